//! Bricks of open soups: fixed-point samples, and the Hermite edges of a field that is smooth between jumps.

use super::super::evaluate::TriangleList;
use super::super::scan::{SampleCube, ScanFacet};
use super::angle::Cap;
use super::blocks::{SumBlock, SumBlocks};
use super::cells::{BoundedTree, CellCache, CellPoints, PointSpacing};
use super::local::CellExpansion;
use super::region::CellSum;
use super::regions::{CellSums, Range3};
use super::sample_blocks::{BLOCK_BITS, for_blocks};
use super::smooth::{SmoothField, SurfaceJump};
use super::{ClusterTree, OpenPart, SurfaceElement};
use crate::brick::{Brick, Hermite, OctNormal, POINTS, Samples, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle, normal, spacing_bits};
use crate::wide::{dispatch, level};
use std::ops::Range;

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Most binary places of a sample: two shells still fit its 16 bits.
const BITS_MAX: u8 = 13;
/// Fewest: where a large error is asked for, samples are still far more exact than that on average.
const BITS_MIN: u8 = 8;

/// The field of an open soup.
#[derive(Debug)]
pub struct OpenField {
    part: OpenPart,
    /// The caps as [`by_vertex`] gives them, sorted.
    caps: Vec<Triangle>,
    bits: u8,
    error: f64,
    /// log₂ of the edge of the least cells in which sums are given together.
    least: u32,
}

/// log₂ of the least cells among whose parts there are bricks of this depth: 8 of their samples along an edge.
pub(in crate::winding) fn least_bits(depth: u8) -> u32 {
    (spacing_bits(depth) + BLOCK_BITS).max(1)
}

/// Working memory; one per thread.
#[derive(Default)]
pub struct OpenEvaluator {
    shares: Shares,
}

/// Memory for the sum over a tree's elements at the samples of a brick.
pub(in crate::winding) struct Shares {
    cells: CellCache,
    points: CellPoints,
    values: Box<[f64; POINTS]>,
    /// Where a brick's samples are neither in a quiet nor in a smooth cell.
    rough: Box<[bool; POINTS]>,
}

impl Default for Shares {
    fn default() -> Self {
        let values = vec![0.0; POINTS].into_boxed_slice().try_into().expect("the length is POINTS");
        let rough = vec![false; POINTS].into_boxed_slice().try_into().expect("the length is POINTS");
        Shares { cells: CellCache::default(), points: CellPoints::default(), values, rough }
    }
}

/// The sums over the caps at the samples of a brick, as far as the stored samples depend on them.
#[derive(Debug)]
pub struct RoundedShares {
    /// By sample: less the sum, rounded as samples are, in units of their last binary place. Anything where it is given
    /// exactly.
    pub negative: Box<[i32; POINTS]>,
    /// Linear indices of samples, with their sums as the processor computes them.
    pub exact: Vec<(u16, f64)>,
}

/// The samples of one brick, and the facets that touch it.
pub struct OpenBrick {
    /// 33³ samples with binary places.
    pub samples: Samples,
    /// Counts of S ∪ C at the corners of the node's children, by octant.
    pub corner_counts: [i16; 8],
    key: NodeKey,
    facets: Vec<Triangle>,
    error: f64,
}

/// The fewest binary places whose rounding takes no more than a quarter of an error.
///
/// # Errors
/// [`Error::Setting`] if samples of 16 bits cannot be that exact.
pub(in crate::winding) fn binary_places(error: f64) -> Result<u8> {
    let bits = (BITS_MIN..=BITS_MAX).find(|&bits| f64::from(1u32 << bits).recip() <= 0.5 * error);
    bits.ok_or_else(|| {
        Error::setting(
            format!("samples of 16 bits cannot be as exact as {error}, which is what each kind of input may be off by"),
            format!("allow {:.1e} at least, twice that for meshes and clouds together", 2.01 / f64::from(1u32 << BITS_MAX)),
        )
    })
}

/// Winding numbers as the samples of a brick. Those on the root's own faces become outside.
///
/// # Errors
/// [`Error::Setting`] if one does not fit 16 bits.
pub(in crate::winding) fn fixed_point(
    key: NodeKey,
    bits: u8,
    values: impl Iterator<Item = f64>,
) -> Result<Samples> {
    let mut samples = Samples::fractions(bits);
    for (sample, w) in samples.0.iter_mut().zip(values) {
        *sample = i16::try_from(rounded(w, bits)).map_err(|_| too_large(key, w))?;
    }
    keep_root_faces_outside(key, &mut samples);
    Ok(samples)
}

/// Whether all samples are within a quarter of these counts.
pub(in crate::winding) fn are_near(counts: &Samples, samples: &Samples) -> bool {
    let most = 1i32 << samples.1 >> 2;
    let is_near = |(count, w): (&i16, &i16)| ((i32::from(*count) << samples.1) - i32::from(*w)).abs() <= most;
    counts.0.iter().zip(samples.0.iter()).all(is_near)
}

fn too_large(key: NodeKey, w: f64) -> Error {
    Error::setting(
        format!("the winding number reaches {w:.1} in brick {key}, too much for its 16 bits"),
        "use a larger `gwn_error`",
    )
}

/// The same triangle from its first vertex on, which is the least.
fn by_vertex(t: &Triangle) -> Triangle {
    let least = if t[0] <= t[1] && t[0] <= t[2] {
        0
    } else if t[1] <= t[2] {
        1
    } else {
        2
    };
    [0, 1, 2].map(|i| t[(least + i) % 3])
}

/// A winding number in units of its last binary place.
fn rounded(w: f64, bits: u8) -> i32 {
    floor(w * f64::from(1u32 << bits) + 0.5)
}

fn keep_root_faces_outside(key: NodeKey, samples: &mut Samples) {
    let half = 1i16 << (samples.1 - 1);
    for_root_face(key, |index| samples.0[index] = samples.0[index].min(half - 1));
}

impl OpenField {
    /// With samples that are off by at most `error`, for a tree whose deepest bricks are of a level.
    ///
    /// # Errors
    /// [`Error::Setting`] if samples of 16 bits cannot be that exact.
    pub fn new(part: OpenPart, error: f64, depth: u8) -> Result<OpenField> {
        let mut caps: Vec<Triangle> = part.caps.iter().map(by_vertex).collect();
        caps.sort_unstable();
        let (bits, least) = (binary_places(error)?, least_bits(depth));
        Ok(OpenField { part, caps, bits, error, least })
    }

    /// By how much samples may be off.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Binary places of all samples.
    pub fn binary_places(&self) -> u8 {
        self.bits
    }

    /// The caps and what is known of them.
    pub fn part(&self) -> &OpenPart {
        &self.part
    }

    /// The count of S ∪ C at a node's corner: 0 on the root's own faces, whatever is beyond.
    pub fn corner_count(key: NodeKey, corner: i16) -> i16 {
        if key.first_sample().contains(&0) { 0 } else { corner }
    }

    /// Whether the sum over the caps counts for nothing at all samples of a brick, which are then the counts of S ∪ C: it
    /// is at most a quantum, and half of the error.
    pub fn is_quiet(&self, key: NodeKey) -> bool {
        self.part.tree.elements().is_empty() || self.regions().are_quiet(key)
    }

    fn regions(&self) -> CellSums<'_, Cap> {
        regions_of(&self.part.tree, self.error, self.bits, self.least)
    }

    /// Fails unless counts of a quiet brick fit 16 bits beside the binary places that others have.
    ///
    /// # Errors
    /// [`Error::Setting`] if one does not.
    pub fn require_room(&self, key: NodeKey, counts: &Samples) -> Result<()> {
        let (low, high) = counts.range();
        let fits = |w: i16| (w << self.bits) >> self.bits == w;
        if fits(low) && fits(high) {
            Ok(())
        } else {
            Err(too_large(key, f64::from(if fits(low) { high } else { low })))
        }
    }

    /// Whether a triangle is a cap; a facet may lie on one.
    pub fn is_cap(&self, t: &Triangle) -> bool {
        self.caps.binary_search(&by_vertex(t)).is_ok()
    }

    /// The samples of a brick with these counts of S ∪ C. A sample's value depends on its position and on nothing else.
    /// Samples on the root's own faces count as outside the surface, so that a surface that goes on beyond the root ends
    /// there.
    ///
    /// # Errors
    /// [`Error::Setting`] if a winding number does not fit 16 bits.
    pub fn samples(&self, scratch: &mut OpenEvaluator, key: NodeKey, counts: &Samples) -> Result<Samples> {
        let values = counts.0.iter().zip(self.sums(scratch, key));
        fixed_point(key, self.bits, values.map(|(count, share)| f64::from(*count) - share))
    }

    /// The sums over the caps at the samples of a brick: rounded to the binary places, they are off by at most the error.
    pub(in crate::winding) fn sums<'a>(
        &self,
        scratch: &'a mut OpenEvaluator,
        key: NodeKey,
    ) -> &'a [f64; POINTS] {
        scratch.shares.find(&self.part.tree, (self.error, self.bits, self.least), key);
        scratch.shares.values()
    }

    /// As [`OpenField::samples`], where the sums over the caps are known already.
    ///
    /// # Errors
    /// [`Error::Setting`] if a winding number does not fit 16 bits.
    pub fn samples_with(
        &self,
        scratch: &mut OpenEvaluator,
        key: NodeKey,
        counts: &Samples,
        shares: &RoundedShares,
    ) -> Result<Samples> {
        scratch.shares.find_easy(&self.regions(), key);
        match shares.subtracted_from(counts, key, self.bits, &scratch.shares) {
            Some(samples) => Ok(samples),
            // Too much for 16 bits: the error tells how much.
            None => self.samples(scratch, key, counts),
        }
    }

    /// A brick of these counts and samples, which these triangles of S ∪ C touch.
    pub fn brick(
        &self,
        key: NodeKey,
        counts: &Samples,
        samples: Samples,
        list: TriangleList<'_>,
    ) -> OpenBrick {
        OpenBrick::of_facets((samples, counts.child_corners()), key, self.facets(list), self.error)
    }

    /// Whether the sum over the caps, at most a quarter at all samples of a brick that no cap touches, moves no passage of
    /// 0.5: that is where the count passes it.
    pub fn is_tame(&self, counts: &Samples, samples: &Samples, list: TriangleList<'_>) -> bool {
        are_near(counts, samples) && list.indices.iter().all(|&i| !self.is_cap(&list.array[i as usize]))
    }

    /// The sums over the caps at the samples of a brick, to be computed elsewhere, added to `blocks`: all that are in
    /// no quiet or smooth cell.
    pub fn lay_open(&self, scratch: &mut OpenEvaluator, key: NodeKey, blocks: &mut SumBlocks) {
        scratch.shares.find_easy(&self.regions(), key);
        let rough = &scratch.shares.rough;
        blocks.add(self.cells(), key, |index| rough[usize::from(index)]);
    }

    /// The sums over the caps at some samples of a block, by their numbers among all of `blocks`.
    pub fn settle(&self, blocks: &SumBlocks, block: &SumBlock, samples: &[usize]) -> Vec<f64> {
        blocks.settle(&self.cells(), block, samples)
    }

    /// The facets among the pieces of a brick: all but as many as there are caps of the same vertices.
    pub(in crate::winding) fn facets(&self, list: TriangleList<'_>) -> Vec<Triangle> {
        let (mut caps, mut facets) = (Vec::new(), Vec::new());
        for &index in list.indices {
            let t = list.array[index as usize];
            if self.is_cap(&t) { caps.push(by_vertex(&t)) } else { facets.push(t) }
        }
        caps.sort_unstable();
        for same in caps.chunk_by(|a, b| a == b) {
            let first = self.caps.partition_point(|cap| *cap < same[0]);
            let own = self.caps[first..].iter().take_while(|cap| **cap == same[0]).count();
            facets.extend(same.iter().skip(own));
        }
        facets
    }

    fn cells(&self) -> BoundedTree<'_, Cap> {
        cells_of(&self.part.tree, self.error, self.bits)
    }
}

impl RoundedShares {
    /// The samples of a brick with these counts, and with the shares of `easy` where these are known; `None` if one does
    /// not fit 16 bits.
    fn subtracted_from(&self, counts: &Samples, key: NodeKey, bits: u8, easy: &Shares) -> Option<Samples> {
        let mut samples = Samples::fractions(bits);
        for ((sample, count), share) in samples.0.iter_mut().zip(counts.0.iter()).zip(self.negative.iter()) {
            *sample = (i32::from(*count) << bits).checked_add(*share)?.try_into().ok()?;
        }
        for &(index, share) in &self.exact {
            let index = usize::from(index);
            let w = f64::from(counts.0[index]) - share;
            samples.0[index] = rounded(w, bits).try_into().ok()?;
        }
        for index in (0..POINTS).filter(|index| !easy.rough[*index]) {
            let w = f64::from(counts.0[index]) - easy.values[index];
            samples.0[index] = rounded(w, bits).try_into().ok()?;
        }
        keep_root_faces_outside(key, &mut samples);
        Some(samples)
    }
}

/// The sums over a tree, so exact that they are off by at most `error` when rounded to `bits` binary places.
fn cells_of<E: SurfaceElement>(tree: &ClusterTree<E>, error: f64, bits: u8) -> BoundedTree<'_, E> {
    // Rounding takes half a quantum.
    BoundedTree::new(tree, error - 0.5 / f64::from(1u32 << bits))
}

/// Where these sums are easy: next to nothing is a quantum, and half of the error.
fn regions_of<E: SurfaceElement>(tree: &ClusterTree<E>, error: f64, bits: u8, least: u32) -> CellSums<'_, E> {
    CellSums::new(cells_of(tree, error, bits), f64::from(1u32 << bits).recip().min(0.5 * error), least)
}

impl Shares {
    /// The sums found last, by sample.
    pub fn values(&self) -> &[f64; POINTS] {
        &self.values
    }

    /// The sum over a tree's elements at all samples of a brick, by regions whose least cells have an edge of 2^least, so exact that it is off by at most `error` when rounded
    /// to `bits` binary places.
    ///
    /// A sample in a rough cell belongs to the coarsest level whose lattice holds it, and there to a block of 8³ samples
    /// of that level's lattice, which is a cell of the octree over the elements. The cell answers it, whatever brick asks:
    /// a brick's own, a neighbour for its apron, a parent or a child.
    pub fn find<E: SurfaceElement>(
        &mut self,
        tree: &ClusterTree<E>,
        (error, bits, least): (f64, u8, u32),
        key: NodeKey,
    ) {
        if tree.elements().is_empty() {
            self.values.fill(0.0);
            return;
        }
        if !self.find_easy(&regions_of(tree, error, bits, least), key) {
            return;
        }
        let Shares { cells, points, values, rough } = self;
        let tree = cells_of(tree, error, bits);
        for_blocks(key, |spacing, samples| {
            let wanted = || samples.iter().filter(|(_, index)| rough[usize::from(*index)]);
            points.positions.clear();
            points.positions.extend(wanted().map(|(position, _)| *position));
            tree.answer(cells, spacing + BLOCK_BITS, PointSpacing::Lattice(spacing), points);
            for ((_, index), value) in wanted().zip(&points.values) {
                values[usize::from(*index)] = *value;
            }
        });
    }

    /// The same where a brick's samples lie in quiet and in smooth cells; whether there are others.
    fn find_easy<E: SurfaceElement>(&mut self, regions: &CellSums<'_, E>, key: NodeKey) -> bool {
        let mut any_rough = false;
        self.rough.fill(false);
        regions.visit(key, &mut |part, region| {
            match region {
                CellSum::Quiet => for_rows(part, |row| self.values[row].fill(0.0)),
                CellSum::Smooth(center, local) => {
                    let (base, bits) = (key.base(), key.spacing_bits());
                    let ways: [[f64; P]; 3] = std::array::from_fn(|axis| {
                        std::array::from_fn(|i| {
                            f64::from(base[axis] + ((i as i32) << bits) + 1) - center[axis]
                        })
                    });
                    dispatch!(level(), _simd => fill_smooth(&mut self.values, part, local, &ways));
                }
                CellSum::Rough => {
                    any_rough = true;
                    for_rows(part, |row| self.rough[row].fill(true));
                }
            }
            true
        });
        any_rough
    }
}

/// Fills a box of a brick's samples with the values of a polynomial; `ways` tell how far samples are from its centre.
#[inline(always)]
fn fill_smooth(values: &mut [f64; POINTS], [from, to]: Range3, local: &CellExpansion, ways: &[[f64; P]; 3]) {
    let of_box: [&[f64]; 3] = std::array::from_fn(|axis| &ways[axis][from[axis]..=to[axis]]);
    local.at_grid(
        of_box,
        |j, k| (((from[2] + k) * P + from[1] + j) * P + from[0], to[0] + 1 - from[0]),
        values,
    );
}

/// Calls `row` with the rows of a box of a brick's samples.
fn for_rows([from, to]: Range3, mut row: impl FnMut(Range<usize>)) {
    for k in from[2]..=to[2] {
        for j in from[1]..=to[1] {
            let first = (k * P + j) * P;
            row(first + from[0]..first + to[0] + 1);
        }
    }
}

/// The largest whole number not above `x`, within 32 bits.
#[inline]
fn floor(x: f64) -> i32 {
    let toward_zero = x as i32;
    toward_zero - i32::from(f64::from(toward_zero) > x)
}

/// Calls `sample` with the linear index of each sample of a brick that is the root's first or last one along an axis,
/// those on its edges more than once.
fn for_root_face(key: NodeKey, mut sample: impl FnMut(usize)) {
    let last = (BRICK_CELLS as u32) << key.level();
    for (axis, first) in key.first_sample().into_iter().enumerate() {
        for at in [0, P - 1] {
            let on_face = first + at as u32;
            if on_face == 0 || on_face == last {
                for (i, j) in (0..P).flat_map(|i| (0..P).map(move |j| (i, j))) {
                    let [x, y, z] = [[at, i, j], [i, at, j], [i, j, at]][axis];
                    sample((z * P + y) * P + x);
                }
            }
        }
    }
}

impl OpenBrick {
    /// Of a field without facets, or whose Hermite edges are known from elsewhere.
    pub fn smooth(samples: Samples, key: NodeKey, error: f64) -> OpenBrick {
        OpenBrick { samples, corner_counts: [0; 8], key, facets: Vec::new(), error }
    }

    /// Of samples and the counts at the corners of the node's children, with the facets that touch it and are no caps.
    pub(in crate::winding) fn of_facets(
        (samples, corner_counts): (Samples, [i16; 8]),
        key: NodeKey,
        facets: Vec<Triangle>,
        error: f64,
    ) -> OpenBrick {
        OpenBrick { samples, corner_counts, key, facets, error }
    }

    /// Whether a facet touches the brick.
    pub fn is_touched(&self) -> bool {
        !self.facets.is_empty()
    }

    /// Whether trilinear interpolation between the samples is off by no more than the error asked for, to
    /// second order: the error of a cell is an eighth of the second difference along each axis.
    pub fn is_straight(&self) -> bool {
        let bound = (8.0 * self.error * f64::from(1u32 << self.samples.1)) as i32;
        let w = |index: usize| i32::from(self.samples.0[index]);
        [1, P, P * P].into_iter().all(|step| {
            (0..POINTS)
                .filter(|index| (index / step % P) % 2 == 1)
                .all(|index| (w(index - step) + w(index + step) - 2 * w(index)).abs() <= bound)
        })
    }

    /// Whether the boundary w = 0.5 crosses a lattice edge that holds several facets, or crosses none that
    /// holds one: it may pass and come back.
    pub fn may_hide_boundary(&self) -> bool {
        let signs = SignChanges::of(&self.samples);
        Axis::ALL.into_iter().any(|axis| {
            let crossings = self.crossings(axis);
            crossings.chunk_by(|a, b| a.lower == b.lower).any(|edge| {
                let lower = usize::from(edge[0].lower);
                let changes = signs.edges(axis, lower / P % P, lower / (P * P)) >> (lower % P) & 1 == 1;
                edge.len() > 1 || !changes
            })
        })
    }

    /// The leaf's brick with these Hermite edges.
    pub fn into_leaf_with(self, hermite: Hermite) -> Brick {
        Brick::from_samples(self.samples.without_idle_places(), hermite)
    }

    /// The leaf's brick with its Hermite edges.
    pub fn into_leaf(self) -> Brick {
        let signs = SignChanges::of(&self.samples);
        let mut hermite = Hermite::default();
        if signs.counts() != [0; 3] {
            let crossings = Axis::ALL.map(|axis| self.crossings(axis));
            let smooth = SmoothField::new(&self.samples, &crossings);
            for axis in Axis::ALL {
                hermite.edges[axis.index()] = smooth.edges(axis, &signs, &crossings[axis.index()]);
            }
        }
        Brick::from_samples(self.samples.without_idle_places(), hermite)
    }

    /// All crossings of the facets with lattice edges along `axis`, edge by edge, in order.
    fn crossings(&self, axis: Axis) -> Vec<SurfaceJump> {
        let block = SampleCube { shift: self.key.spacing_bits(), last: BRICK_CELLS as i32 };
        let origin = self.key.base().map(|b| b + 1);
        let all = [block.last; 2];
        let mut found = Vec::new();
        for t in &self.facets {
            let facet = dispatch!(level(), simd => ScanFacet::new(simd, t, origin, block));
            let Some(facet) = facet else { continue };
            let normal = OctNormal::from_integer(normal(t));
            let jump = facet.jump(axis.index());
            let mut add = |[i, j, k]: [i32; 3], offset| {
                let lower = ((k as usize * P + j as usize) * P + i as usize) as u16;
                found.push(SurfaceJump { lower, offset, normal, jump });
            };
            dispatch!(level(), simd => match axis {
                Axis::X => facet.scan::<_, 0>(simd, block, all, |c| add([c.lower, c.u, c.v], c.offset)),
                Axis::Y => facet.scan::<_, 1>(simd, block, all, |c| add([c.v, c.lower, c.u], c.offset)),
                Axis::Z => facet.scan::<_, 2>(simd, block, all, |c| add([c.u, c.v, c.lower], c.offset)),
            });
        }
        found.sort_unstable();
        found
    }
}
