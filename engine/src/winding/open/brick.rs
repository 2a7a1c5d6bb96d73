//! Bricks of open soups: fixed-point samples, and the Hermite edges of a field that is smooth between jumps.

use super::super::evaluate::{Evaluator, Triangles};
use super::super::scan::{Block, Facet};
use super::{OpenPart, Selection};
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle, Units, normal};

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// log₂ of the samples along a block that share a choice of clusters: a choice costs about as much as ten
/// answers, and a larger block asks for more clusters.
const BLOCK_BITS: u32 = 3;
/// Most binary places of a sample: two shells still fit its 16 bits.
const BITS_MAX: u8 = 13;
/// Share of the error that the clusters may take. Rounding to a quantum of at most half the error takes a
/// quarter of it.
const CLUSTER_SHARE: f64 = 0.74;

/// The field of an open soup.
#[derive(Debug)]
pub struct OpenField {
    part: OpenPart,
    bits: u8,
    error: f64,
}

/// A triangle of S ∪ C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenPiece {
    /// Where it is.
    pub triangle: Triangle,
    /// Whether it is a cap.
    pub cap: bool,
}

/// Working memory; one per thread.
#[derive(Default)]
pub struct OpenEvaluator {
    evaluator: Evaluator,
    triangles: Vec<Triangle>,
    indices: Vec<u32>,
    /// Samples with the block in which they are answered: coarseness of the block's level, place, sample.
    order: Vec<(u32, [u32; 3], u16)>,
}

/// The samples of one brick, and the facets that touch it.
pub struct OpenBrick {
    /// 33³ samples with binary places.
    pub samples: Samples,
    key: NodeKey,
    facets: Vec<Triangle>,
    error: f64,
}

/// A crossing of a lattice edge with a facet, in the order in which they are passed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Crossing {
    lower: u16,
    offset: u16,
    normal: OctNormal,
    jump: i32,
}

impl OpenField {
    /// With samples that are off by at most `error`.
    ///
    /// # Errors
    /// [`Error::Setting`] if samples of 16 bits cannot be that exact.
    pub fn new(part: OpenPart, error: f64) -> Result<OpenField> {
        let bits = (1..=BITS_MAX).find(|&bits| f64::from(1u32 << bits).recip() <= 0.5 * error);
        let bits = bits.ok_or_else(|| {
            Error::setting(
                format!("an error of {error} does not fit samples of 16 bits"),
                format!("use one of at least {:.1e}", 2.01 / f64::from(1u32 << BITS_MAX)),
            )
        })?;
        Ok(OpenField { part, bits, error })
    }

    /// The caps and what is known of them.
    pub fn part(&self) -> &OpenPart {
        &self.part
    }

    /// Evaluates the 33³ samples of `key` from all triangles of S ∪ C that touch it and its corner sample,
    /// which is ignored for the root: there the count is 0. A sample's value depends on its position and on
    /// nothing else. Samples on the root's own faces count as outside the surface, so that a surface that
    /// goes on beyond the root ends there.
    ///
    /// # Errors
    /// [`Error::Setting`] if a winding number does not fit 16 bits.
    pub fn evaluate(
        &self,
        scratch: &mut OpenEvaluator,
        key: NodeKey,
        corner: i16,
        pieces: impl Iterator<Item = OpenPiece>,
    ) -> Result<OpenBrick> {
        let OpenEvaluator { evaluator, triangles, indices, order } = scratch;
        triangles.clear();
        let mut facets = Vec::new();
        for piece in pieces {
            triangles.push(piece.triangle);
            if !piece.cap {
                facets.push(piece.triangle);
            }
        }
        indices.clear();
        indices.extend(0..triangles.len() as u32);
        let shares = self.shares(key, order);
        let scale = f64::from(1u32 << self.bits);
        // Samples are off by far less than a half, so this is the count exactly.
        let count = (f64::from(corner) / scale + shares[0]).round();
        let count = if key == NodeKey::ROOT || on_root_face(key, 0) { 0.0 } else { count };
        let list = Triangles { array: triangles, indices };
        let counts = evaluator.evaluate(key, count as i16, list)?.samples;
        let mut samples = Samples::fractions(self.bits);
        let half = 1i16 << (self.bits - 1);
        for (index, (sample, (count, share))) in
            samples.0.iter_mut().zip(counts.0.iter().zip(shares)).enumerate()
        {
            let w = (f64::from(*count) - share) * scale;
            let rounded = (w + 0.5).floor();
            if rounded.abs() > f64::from(i16::MAX) {
                return Err(Error::setting(
                    format!(
                        "the winding number reaches {:.1} in brick {key}, too much for its 16 bits",
                        w / scale
                    ),
                    "use a larger --gwn-error",
                ));
            }
            *sample = rounded as i16;
            if on_root_face(key, index) {
                *sample = (*sample).min(half - 1);
            }
        }
        Ok(OpenBrick { samples, key, facets, error: self.error })
    }

    /// w_C at all samples of a brick.
    ///
    /// A sample belongs to the coarsest level whose lattice holds it, and there to a block of 8³ samples of
    /// that level's lattice. The clusters chosen for the block answer it, whatever brick asks: a brick's own,
    /// a neighbour for its apron, a parent or a child.
    fn shares(&self, key: NodeKey, order: &mut Vec<(u32, [u32; 3], u16)>) -> Vec<f64> {
        let mut shares = vec![0.0; POINTS];
        if self.part.caps.is_empty() {
            return shares;
        }
        let first = key.first_sample();
        let level = u32::from(key.level());
        order.clear();
        for index in 0..POINTS {
            let ijk = [index % P, index / P % P, index / (P * P)];
            let at: [u32; 3] = std::array::from_fn(|a| first[a] + ijk[a] as u32);
            let up = (at[0] | at[1] | at[2]).trailing_zeros().min(level);
            order.push((up, at.map(|c| c >> (up + BLOCK_BITS)), index as u16));
        }
        order.sort_unstable();
        for block in order.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (up, place, _) = block[0];
            let selection = self.select(key.spacing_bits() + up, place);
            for &(_, _, index) in block {
                shares[usize::from(index)] = self.part.tree.at(&selection, position(key, usize::from(index)));
            }
        }
        shares
    }

    /// The clusters that answer a block of samples 2^spacing units apart.
    fn select(&self, spacing: u32, place: [u32; 3]) -> Selection {
        let low = place.map(|c| f64::from((c << (BLOCK_BITS + spacing)) + 1));
        let extent = f64::from(((1u32 << BLOCK_BITS) - 1) << spacing);
        self.part.tree.select(low, low.map(|c| c + extent), CLUSTER_SHARE * self.error)
    }
}

/// Lattice position of a sample by its linear index.
fn position(key: NodeKey, index: usize) -> Units {
    let ijk = [index % P, index / P % P, index / (P * P)];
    let base = key.base();
    std::array::from_fn(|a| base[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1)
}

/// Whether the sample is the root's first or last one along an axis.
fn on_root_face(key: NodeKey, index: usize) -> bool {
    let last = (BRICK_CELLS as u32) << key.level();
    let first = key.first_sample();
    let ijk = [index % P, index / P % P, index / (P * P)];
    (0..3).any(|a| {
        let at = first[a] + ijk[a] as u32;
        at == 0 || at == last
    })
}

impl OpenBrick {
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

    /// The leaf's brick with its Hermite edges.
    pub fn into_leaf(self) -> Brick {
        let signs = SignChanges::of(&self.samples);
        let mut hermite = Hermite::default();
        if signs.counts() != [0; 3] {
            let crossings = Axis::ALL.map(|axis| self.crossings(axis));
            let smooth = Smooth::new(&self.samples, &crossings);
            for axis in Axis::ALL {
                hermite.edges[axis.index()] = smooth.edges(axis, &signs, &crossings[axis.index()]);
            }
        }
        Brick::from_samples(self.samples, hermite)
    }

    /// All crossings of the facets with lattice edges along `axis`, edge by edge, in order.
    fn crossings(&self, axis: Axis) -> Vec<Crossing> {
        let block = Block { shift: self.key.spacing_bits(), last: BRICK_CELLS as i32 };
        let origin = self.key.base().map(|b| b + 1);
        let all = [block.last; 2];
        let mut found = Vec::new();
        for t in &self.facets {
            let Some(facet) = Facet::new(t, origin, block) else { continue };
            let normal = OctNormal::from_integer(normal(t));
            let jump = facet.jump(axis.index());
            let mut add = |[i, j, k]: [i32; 3], offset| {
                let lower = ((k as usize * P + j as usize) * P + i as usize) as u16;
                found.push(Crossing { lower, offset, normal, jump });
            };
            match axis {
                Axis::X => facet.scan::<0>(block, all, |c| add([c.lower, c.u, c.v], c.offset)),
                Axis::Y => facet.scan::<1>(block, all, |c| add([c.v, c.lower, c.u], c.offset)),
                Axis::Z => facet.scan::<2>(block, all, |c| add([c.u, c.v, c.lower], c.offset)),
            }
        }
        found.sort_unstable();
        found
    }
}

/// The field without its jumps: what is left of the difference of two neighbouring samples when the facets
/// between them are taken off.
struct Smooth<'a> {
    samples: &'a Samples,
    /// Sum of the jumps on each lattice edge, by axis and lower sample.
    jumps: [Vec<i32>; 3],
}

impl<'a> Smooth<'a> {
    fn new(samples: &'a Samples, crossings: &[Vec<Crossing>; 3]) -> Smooth<'a> {
        let jumps = [0, 1, 2].map(|axis| {
            let mut jumps = vec![0; POINTS];
            crossings[axis].iter().for_each(|c: &Crossing| jumps[usize::from(c.lower)] += c.jump);
            jumps
        });
        Smooth { samples, jumps }
    }

    /// Change along the lattice edge from sample `lower`, in quanta, without the jumps.
    fn step(&self, axis: Axis, lower: usize) -> i32 {
        let upper = lower + stride(axis);
        let change = i32::from(self.samples.0[upper]) - i32::from(self.samples.0[lower]);
        change - (self.jumps[axis.index()][lower] << self.samples.1)
    }

    /// Twice the slope at a sample, one-sided at the border of the brick.
    fn slope(&self, axis: Axis, index: usize) -> i64 {
        let at = index / stride(axis) % P;
        let before = (at > 0).then(|| self.step(axis, index - stride(axis)));
        let behind = (at + 1 < P).then(|| self.step(axis, index));
        match (before, behind) {
            (Some(a), Some(b)) => i64::from(a) + i64::from(b),
            (a, b) => 2 * i64::from(a.or(b).unwrap_or(0)),
        }
    }

    /// One Hermite edge for each sign-changing edge along `axis`.
    fn edges(&self, axis: Axis, signs: &SignChanges, crossings: &[Crossing]) -> Vec<HermiteEdge> {
        let mut edges = Vec::new();
        let mut next = 0;
        for row in 0..P * P {
            let mut bits = signs.edges(axis, row % P, row / P);
            while bits != 0 {
                let lower = row * P + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                while crossings.get(next).is_some_and(|c| usize::from(c.lower) < lower) {
                    next += 1;
                }
                let count = crossings[next..].iter().take_while(|c| usize::from(c.lower) == lower).count();
                edges.push(self.settle(axis, lower, &crossings[next..next + count]));
                next += count;
            }
        }
        edges
    }

    /// The first point of a lattice edge where the field passes 0.5: a facet where it jumps across, or the root
    /// of the part between, which is taken to be linear.
    fn settle(&self, axis: Axis, lower: usize, crossings: &[Crossing]) -> HermiteEdge {
        let bits = self.samples.1;
        let half = f64::from(1u32 << bits) * 0.5;
        let start = f64::from(self.samples.0[lower]);
        let inside = start >= half;
        let step = f64::from(self.step(axis, lower));
        let mut jumped = 0.0;
        for group in crossings.chunk_by(|a, b| a.offset == b.offset) {
            let at = f64::from(group[0].offset) / 65536.0;
            let before = start + step * at + jumped;
            if (before >= half) != inside {
                return self.root(axis, lower, (half - start - jumped) / step);
            }
            jumped += f64::from(group.iter().map(|c| c.jump).sum::<i32>()) * 2.0 * half;
            let after = start + step * at + jumped;
            if (after >= half) != inside {
                let direction = if inside { -1 } else { 1 };
                let facet = group.iter().find(|c| c.jump == direction).unwrap_or(&group[0]);
                return HermiteEdge { offset: group[0].offset, normal: facet.normal };
            }
        }
        self.root(axis, lower, (half - start - jumped) / step)
    }

    /// A passage between facets, with the normal −∇w.
    fn root(&self, axis: Axis, lower: usize, fraction: f64) -> HermiteEdge {
        let upper = lower + stride(axis);
        let offset = (fraction.clamp(0.0, 1.0) * 65536.0).min(65535.0) as u16;
        let mut normal = Axis::ALL.map(|a| -(self.slope(a, lower) + self.slope(a, upper)));
        if normal == [0; 3] {
            let falls = self.samples.0[lower] > self.samples.0[upper];
            normal[axis.index()] = if falls { 1 } else { -1 };
        }
        HermiteEdge { offset, normal: OctNormal::from_integer(normal) }
    }
}

fn stride(axis: Axis) -> usize {
    match axis {
        Axis::X => 1,
        Axis::Y => P,
        Axis::Z => P * P,
    }
}
