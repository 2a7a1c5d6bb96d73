//! The sums over the caps of an open soup at the samples of bricks, on a device in single precision.
//!
//! What a device computes has a bound on its error, made of the bounds of this file for the far field and of the
//! kernel's own for single caps (`angle.wgsl`). A sample that the processor might round to another number within that
//! bound is settled by the processor: so bytes are the processor's.
//!
//! Bounds hold for every device that keeps to Vulkan's table of precisions: units below are its ULP, twice the error
//! of rounding to the nearest.

use super::check::CheckCandidate;
use super::trust::KernelSet;
use super::vulkan::Vulkan;
use crate::brick::{POINTS, Samples};
use crate::error::Result;
use crate::gpu::{DeviceFailure, SumCapacity, SumInput, SumLane, SumTree};
use crate::lattice::NodeKey;
use crate::winding::{
    BlockSample, ClusterParts, OpenEvaluator, OpenField, RoundedShares, SumBlock, SumBlocks,
};
use brickfield_shaders as shaders;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, OnceLock};

/// The distance of floats above 1.
const ULP: f64 = f32::EPSILON as f64;
/// Terms, and the polynomials' parts, are below this: the kernel holds them in 32 bits.
const TERM_LIMIT: f64 = 1.9;
/// A bound that settles nothing.
const UNBOUNDED: f32 = 1.0;

/// The field of an open soup with its clusters on a device, for the threads of a build.
pub struct DeviceShares {
    vulkan: Vulkan,
    /// Made when the first thread asks; `None` if the device has no room or fails.
    tree: OnceLock<Option<Tree>>,
}

/// Clusters on the device, and what bounds their errors.
struct Tree {
    there: Arc<SumTree>,
    clusters: Vec<Sizes>,
}

/// Where a cluster is, and how large its expansion.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    center: [f64; 3],
    /// A power of two, not below its reach.
    scale: f64,
    /// Lengths of the vectors of factors, by degree, divided by the scale's powers.
    factors: [f64; 3],
}

/// Evaluates bricks a few at a time; one per thread.
#[derive(Default)]
pub struct ShareQueue {
    /// `None` before the first brick; `Some(None)` if the device has no room.
    lane: Option<Option<SumLane>>,
    /// Bricks in a batch, at most.
    limit: usize,
    input: SumInput,
    /// Batches that are under way, the oldest first.
    pending: VecDeque<Batch>,
    /// What the blocks of one need no more.
    spare: Vec<SumBlocks>,
    ready: HashMap<NodeKey, RoundedShares>,
}

/// Bricks on their way.
struct Batch {
    keys: Vec<NodeKey>,
    blocks: SumBlocks,
    /// By sample of the blocks: where its answer will be, if it was sent.
    sent: Vec<Option<usize>>,
}

impl DeviceShares {
    /// For one build.
    pub fn new(vulkan: &Vulkan) -> DeviceShares {
        DeviceShares { vulkan: vulkan.clone(), tree: OnceLock::new() }
    }

    /// Compares the samples of a brick that was made with the device's sums with the processor's, if it is to be
    /// checked.
    ///
    /// # Errors
    /// [`Error::Distrusted`](crate::error::Error::Distrusted) if it has not; what `here` gives.
    pub fn check(&self, key: NodeKey, found: &Samples, here: impl FnOnce() -> Result<Samples>) -> Result<()> {
        let vulkan = &self.vulkan;
        if vulkan.is_distrusted() {
            return Err(vulkan.distrust(key));
        }
        let claim = CheckCandidate { key, kernels: KernelSet::Sums, is_seconds: false, has_hidden: false };
        if !vulkan.is_to_check(claim) {
            return Ok(());
        }
        let (lowest, highest) = found.range();
        vulkan.note_check(claim, here()? == *found, lowest < highest)
    }

    fn tree(&self, field: &OpenField) -> Option<&Tree> {
        self.tree.get_or_init(|| self.upload(field)).as_ref()
    }

    fn upload(&self, field: &OpenField) -> Option<Tree> {
        let tree = &field.part().tree;
        if tree.elements().is_empty() {
            return None;
        }
        let mut clusters = Vec::new();
        let mut words = Vec::new();
        for parts in tree.cluster_parts() {
            clusters.push(write_cluster(&parts, &mut words));
        }
        let elements: Vec<u32> = tree
            .elements()
            .iter()
            .flat_map(|cap| {
                let vertices = cap.vertices().into_iter().flatten().map(|c| c as u32);
                vertices.chain(cap.normal().map(|c| (c as f32).to_bits()))
            })
            .collect();
        // The rest is for what comes and goes.
        let is_small = 4 * (words.len() + elements.len()) as u64 <= self.vulkan.gpu().memory() / 2;
        let there = match is_small {
            true => SumTree::new(self.vulkan.gpu(), &words, &elements),
            false => Err(DeviceFailure::OutOfMemory),
        };
        match there {
            Ok(there) => Some(Tree { there: Arc::new(there), clusters }),
            Err(failure) => {
                self.vulkan.note_failure(failure);
                None
            }
        }
    }

    fn lane(&self, tree: &Tree) -> Option<SumLane> {
        let gpu = self.vulkan.gpu();
        let bytes = gpu.memory() / 2 / rayon::current_num_threads() as u64;
        SumLane::new(&tree.there, bytes).map_err(|failure| self.vulkan.note_failure(failure)).ok()
    }
}

impl ShareQueue {
    /// Begins to find the sums at the samples of some bricks, which [`ShareQueue::take`] then gives. Where the device does
    /// not answer, there are none.
    pub fn find(
        &mut self,
        device: &DeviceShares,
        field: &OpenField,
        scratch: &mut OpenEvaluator,
        keys: &[NodeKey],
    ) {
        let Some(tree) = device.tree(field) else { return };
        if self.lane.is_none() {
            let lane = device.lane(tree);
            self.limit = lane.as_ref().map_or(0, |lane| lane.room().bricks);
            self.lane = Some(lane);
        }
        let mut left = keys;
        while !left.is_empty() {
            let Some(Some(lane)) = &self.lane else { return };
            let (some, rest) = left.split_at(self.limit.min(left.len()));
            let mut blocks = self.spare.pop().unwrap_or_default();
            blocks.clear();
            some.iter().for_each(|key| field.lay_open(scratch, *key, &mut blocks));
            let sent = pack(&blocks, &tree.clusters, lane.room(), &mut self.input);
            let batch = Batch { keys: some.to_vec(), blocks, sent };
            if self.input.rows.is_empty() {
                self.ready.extend(some.iter().copied().zip(unpack(field, &batch, &[])));
            } else if !self.send(device, field, batch) {
                continue;
            }
            left = rest;
        }
    }

    /// Sends the batch whose input is written down, once there is a place for it; whether it is under way.
    fn send(&mut self, device: &DeviceShares, field: &OpenField, batch: Batch) -> bool {
        let is_full = |lane: &Option<Option<SumLane>>| matches!(lane, Some(Some(lane)) if lane.is_full());
        if is_full(&self.lane) {
            self.receive(device, field);
        }
        let Some(Some(lane)) = &mut self.lane else { return false };
        let sent = lane.submit(&self.input, field.binary_places());
        match sent {
            Ok(()) => self.pending.push_back(batch),
            Err(failure) => self.give_way(device, failure, batch.keys.len()),
        }
        sent.is_ok()
    }

    /// Receives the oldest batch.
    fn receive(&mut self, device: &DeviceShares, field: &OpenField) {
        let Some(batch) = self.pending.pop_front() else { return };
        let Some(Some(lane)) = &mut self.lane else { return };
        match lane.receive() {
            Ok((quanta, seconds)) => {
                let found = unpack(field, &batch, quanta);
                let mut report = device.vulkan.report();
                report.batches += 1;
                report.bricks += batch.keys.len() as u64;
                report.samples += batch.blocks.samples().len() as u64;
                report.settled += found.iter().map(|shares| shares.exact.len() as u64).sum::<u64>();
                report.sum_seconds += seconds.unwrap_or(0.0);
                self.ready.extend(batch.keys.into_iter().zip(found));
                self.spare.push(batch.blocks);
            }
            Err(failure) => self.give_way(device, failure, batch.keys.len()),
        }
    }

    /// After a failed batch: the next has half as many bricks, or the processor takes over.
    fn give_way(&mut self, device: &DeviceShares, failure: DeviceFailure, bricks: usize) {
        device.vulkan.note_failure(failure);
        if failure.may_pass_with_less() && bricks > 1 {
            self.limit = bricks / 2;
            device.vulkan.report().retries += 1;
        } else {
            self.lane = Some(None);
        }
    }

    /// What was found for a brick.
    pub fn take(&mut self, device: &DeviceShares, field: &OpenField, key: NodeKey) -> Option<RoundedShares> {
        while self.pending.iter().any(|batch| batch.keys.contains(&key)) {
            self.receive(device, field);
        }
        let found = self.ready.remove(&key);
        if found.is_none() {
            device.vulkan.report().cpu_bricks += 1;
        }
        found
    }
}

/// Writes all blocks down for which there is room, and says where each sample's answer will be; `None` for those that are
/// not sent.
fn pack(
    blocks: &SumBlocks,
    clusters: &[Sizes],
    room: SumCapacity,
    input: &mut SumInput,
) -> Vec<Option<usize>> {
    input.clear();
    // Neighbours share blocks.
    let mut known: HashMap<usize, Option<u32>> = HashMap::new();
    let write = |block: &SumBlock, input: &mut SumInput| {
        let terms = block.clusters().len() + block.elements().len();
        let has_room = input.blocks.len() < room.blocks && input.terms.len() + terms <= room.terms;
        (has_room && terms <= shaders::TERMS_MAX as usize).then(|| {
            write_block(block, clusters, input);
            input.blocks.len() as u32 - 1
        })
    };
    let mut sent = vec![None; blocks.samples().len()];
    for block in blocks.blocks() {
        let samples = &blocks.samples()[block.samples.clone()];
        let Some(number) = *known.entry(block.number()).or_insert_with(|| write(block, input)) else {
            continue;
        };
        let mut sent = sent[block.samples.clone()].iter_mut();
        for row in rows(samples) {
            if input.rows.len() == room.rows {
                break;
            }
            let answers = 4 * input.rows.len();
            input.rows.push(number << 10 | row.first);
            let lane =
                |sample: &BlockSample| (u32::from(sample.place) - (row.first & 0x1ff)) >> (row.first >> 9);
            row.samples
                .iter()
                .zip(&mut sent)
                .for_each(|(sample, at)| *at = Some(answers + lane(sample) as usize));
        }
    }
    sent
}

/// Some samples of a block, at most four.
struct Row<'a> {
    samples: &'a [BlockSample],
    /// The place of the first of four, and in the ninth bit whether the others are every second sample from there on.
    first: u32,
}

/// The samples of a block, four in a row: half a line, or the odd ones of a line whose others belong to a coarser lattice.
fn rows(samples: &[BlockSample]) -> impl Iterator<Item = Row<'_>> {
    samples.chunk_by(|a, b| a.place >> 3 == b.place >> 3).flat_map(|line| {
        let is_odd = line.iter().all(|sample| sample.place & 1 == 1);
        line.chunk_by(move |a, b| is_odd || a.place >> 2 == b.place >> 2).map(move |samples| {
            let place = u32::from(samples[0].place);
            let first = if is_odd { 1 << 9 | place & !7 | 1 } else { place & !3 };
            Row { samples, first }
        })
    })
}

/// The sums of each brick, of which the processor settles what the device leaves open.
fn unpack(field: &OpenField, batch: &Batch, quanta: &[[i32; 4]]) -> Vec<RoundedShares> {
    let Batch { blocks, sent, .. } = batch;
    let fresh = || RoundedShares {
        negative: vec![0; POINTS].into_boxed_slice().try_into().expect("the length is POINTS"),
        exact: Vec::new(),
    };
    let mut found: Vec<RoundedShares> = (0..blocks.bricks()).map(|_| fresh()).collect();
    let mut open = Vec::new();
    let quanta = quanta.as_flattened();
    for block in blocks.blocks() {
        let shares = &mut found[block.brick];
        open.clear();
        for number in block.samples.clone() {
            match sent[number].map(|at| quanta[at]) {
                Some(value) if value as u32 != shaders::UNSURE => {
                    shares.negative[usize::from(blocks.samples()[number].index)] = value;
                }
                _ => open.push(number),
            }
        }
        if !open.is_empty() {
            let values = field.settle(blocks, block, &open);
            shares.exact.extend(open.iter().map(|&number| blocks.samples()[number].index).zip(values));
        }
    }
    found
}

/// Writes a block down.
fn write_block(block: &SumBlock, clusters: &[Sizes], input: &mut SumInput) {
    let radius = f64::from(1u32 << 2) * (1u64 << block.spacing) as f64;
    let farthest = f64::from(block.steps - 1) / 8.0;
    let mut sizes = 0.0;
    let mut constant = 0.0;
    let mut coefficients = [0.0f32; shaders::COEFFICIENTS as usize];
    for (slot, (powers, value)) in coefficients.iter_mut().zip(block.polynomial()) {
        let degree = powers.iter().sum::<usize>() as i32;
        if degree == 0 {
            constant = value;
            continue;
        }
        let scaled = value * radius.powi(degree);
        *slot = scaled as f32;
        sizes += scaled.abs() * farthest.powi(degree);
    }
    // A coefficient is rounded, and passes at most 17 operations on its way to the value.
    let mut bound = 20.0 * ULP * sizes;
    let mut largest = sizes;
    let low = block.low.map(f64::from);
    let edge = f64::from(block.steps - 1) * (1u64 << block.spacing) as f64;
    for &number in block.clusters() {
        let (error, size) = clusters[number as usize].bound(low, edge);
        bound += error;
        largest = largest.max(size);
    }
    // Those of sums and products in double precision are far smaller.
    let bound = if largest < TERM_LIMIT { (bound * 1.001) as f32 } else { UNBOUNDED };
    let base = (constant * f64::from(1u32 << shaders::TERM_BITS)).round() as i64;
    input.blocks.push(shaders::Block {
        low_x: block.low[0],
        low_y: block.low[1],
        low_z: block.low[2],
        spacing: block.spacing,
        steps: block.steps,
        terms_from: input.terms.len() as u32,
        clusters: block.clusters().len() as u32,
        elements: block.elements().len() as u32,
        base_low: base as u32,
        base_high: (base >> 32) as u32,
        bound,
    });
    input.coefficients.push(coefficients);
    input.terms.extend_from_slice(block.clusters());
    input.terms.extend_from_slice(block.elements());
}

/// Writes a cluster down.
fn write_cluster(parts: &ClusterParts, words: &mut Vec<u32>) -> Sizes {
    let ClusterParts { center, reach, dipole, quadrupole, octupole } = parts;
    let mut scale = 1.0;
    while scale < *reach {
        scale *= 2.0;
    }
    let start = words.len();
    let whole = center.map(f64::round);
    words.extend(whole.map(|c| c as i32 as u32));
    words.extend([0, 1, 2].map(|a| ((center[a] - whole[a]) as f32).to_bits()));
    words.push((scale as f32).to_bits());
    let mut length = |factors: &[f64], power: i32| {
        let scaled = factors.iter().map(|f| f / scale.powi(power));
        words.extend(scaled.clone().map(|f| (f as f32).to_bits()));
        scaled.map(|f| f * f).sum::<f64>().sqrt()
    };
    let factors = [length(dipole, 2), length(quadrupole, 3), length(octupole, 4)];
    debug_assert_eq!(words.len() - start, shaders::CLUSTER_WORDS as usize);
    Sizes { center: *center, scale, factors }
}

impl Sizes {
    /// Bounds, anywhere in a cube, on the error of what the cluster adds in single precision, and on that itself.
    ///
    /// With the direction n and s = scale/r it is s²(D·n + s (Q(n,n) + s T(n,n,n))). The products of n's coordinates that
    /// a form of degree m consists of have squares that add up to at most |n|^2m = 1, so the sum of its terms'
    /// magnitudes is at most the length of the vector of its factors.
    ///
    /// The length of r is at least 1, so r itself is off by 3.3 ULP of it; the part of degree m is homogeneous of
    /// degree −(m + 1), with a gradient of at most (3m + 1) times its largest value over r, which makes 13, 23 and 33
    /// ULP of the three parts.
    ///
    /// Lengths (3.5 ULP), directions (4.5 ULP), factors, products and sums as the kernel has them make 18, 33 and 42.
    fn bound(&self, low: [f64; 3], edge: f64) -> (f64, f64) {
        let away = |a: usize| (low[a] - self.center[a]).max(self.center[a] - low[a] - edge).max(0.0);
        let squared = (0..3).map(|a| away(a) * away(a)).sum::<f64>();
        if squared < 1.0 {
            return (f64::INFINITY, f64::INFINITY);
        }
        let near = self.scale * self.scale / squared;
        let s = near.sqrt();
        let [d, q, t] = self.factors;
        (near * ULP * (40.0 * d + s * (64.0 * q + s * 96.0 * t)), near * (d + s * (q + s * t)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every sample of a line is found where its row says: the rows of whole lines, of odd samples, of single ones.
    #[test]
    fn rows_hold_all_samples_of_a_block() {
        for (xs, rows_of_line) in [
            (vec![0, 1, 2, 3, 4, 5, 6, 7], 2),
            (vec![1, 3, 5, 7], 1),
            (vec![0], 1),
            (vec![5], 1),
            (vec![0, 2, 4], 2),
        ] {
            let sample = |(line, x): (u16, &u16)| BlockSample { index: 8 * line + x, place: line << 3 | x };
            let samples: Vec<BlockSample> = [0, 3, 17, 63]
                .into_iter()
                .flat_map(|line| xs.iter().map(move |x| sample((line, x))))
                .collect();
            let rows: Vec<Row<'_>> = rows(&samples).collect();
            assert_eq!(rows.len(), 4 * rows_of_line, "{xs:?}");
            for row in &rows {
                for sample in row.samples {
                    let (first, stride) = (row.first & 0x1ff, 1 + (row.first >> 9));
                    let steps = u32::from(sample.place) - first;
                    assert!(steps % stride == 0 && steps / stride < 4, "{xs:?}");
                }
            }
            let listed: Vec<u16> = rows.iter().flat_map(|row| row.samples.iter().map(|s| s.index)).collect();
            assert_eq!(listed, samples.iter().map(|s| s.index).collect::<Vec<u16>>());
        }
    }

    /// The bound of a cluster is that of its nearest point, and none where it may lie in the cube.
    #[test]
    fn bounds_of_clusters_fall_with_the_distance() {
        let sizes = Sizes { center: [0.0; 3], scale: 4.0, factors: [1.0, 0.5, 0.25] };
        let at = |x: f64| sizes.bound([x, -3.0, -3.0], 6.0);
        assert_eq!(at(-3.0).0, f64::INFINITY);
        let [(near, size), (far, _)] = [at(8.0), at(16.0)];
        assert_eq!(size, 0.25 * (1.0 + 0.5 * (0.5 + 0.5 * 0.25)));
        assert!(near > 40.0 * ULP * 0.25 && near < 96.0 * ULP * size && far < near / 4.0);
        // From the other side alike.
        assert_eq!(at(-14.0), at(8.0));
    }
}
