//! Samples of one brick from the triangles that touch it.
//!
//! Walking along a lattice line, w jumps by ±1 where the line crosses a triangle. From the brick's corner
//! the walk goes up the z column, from there along the x lines of the face y = 0, from there along all
//! 33 × 33 lines in y, a row of 33 at once. Cost: triangles that touch the brick plus crossings.

use super::crossings::{Crossings, Hit};
use super::edges::EdgeMasks;
use super::hermite::FacetNormals;
use super::passages::{CrossingSide, EdgeHits, HermiteOutcome};
use super::scan::{EdgeCrossing, SampleCube, ScanFacet};
use crate::brick::{Brick, Hermite, HermiteEdge, POINTS, Samples, SignChanges, ThinLines, point_index};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle};
use crate::wide::{Simd, dispatch, level};
use std::ops::AddAssign;

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Edges along a row.
const C: usize = BRICK_CELLS;

/// Working memory for evaluating bricks one after the other; one per thread.
pub struct Evaluator {
    /// The triangles that meet lattice lines.
    facets: Vec<ScanFacet>,
    /// Jumps along y by the lower sample of the edge; all zero between bricks, as the next two. Those at the last
    /// sample of a line lie beyond it and count for nothing. In bricks of so many facets that a sum might not fit, they
    /// are right modulo 2^16.
    jumps: Box<[i16; POINTS]>,
    /// Jumps along x in the face y = 0: [k][edge].
    face: Box<[[i32; C]; P]>,
    /// Jumps along z in the column x = y = 0.
    column: [i32; C],
    /// The crossings along y.
    crossings: Crossings,
    /// The sign-changing edges along one axis.
    changes: EdgeMasks,
    /// Their crossings.
    passages: EdgeHits,
    /// Per axis, whether the last brick needed the list of its passages.
    listing: [bool; 3],
    normals: FacetNormals,
}

impl Default for Evaluator {
    fn default() -> Self {
        Evaluator {
            facets: Vec::new(),
            jumps: vec![0; POINTS].into_boxed_slice().try_into().expect("the length is POINTS"),
            face: Box::new([[0; C]; P]),
            column: [0; C],
            crossings: Crossings::default(),
            changes: EdgeMasks::default(),
            passages: EdgeHits::default(),
            listing: [false; 3],
            normals: FacetNormals::default(),
        }
    }
}

/// The samples of one brick, and its crossings until the evaluator is used again.
pub struct Evaluation<'a> {
    /// 33³ winding numbers.
    pub samples: Samples,
    /// Where they are inside.
    pub signs: SignChanges,
    pub(super) key: NodeKey,
    pub(super) list: TriangleList<'a>,
    pub(super) evaluator: &'a mut Evaluator,
}

/// The triangles of a brick: some of an array, by index.
#[derive(Clone, Copy)]
pub struct TriangleList<'a> {
    /// All of them.
    pub array: &'a [Triangle],
    /// Those that touch the brick.
    pub indices: &'a [u32],
}

impl<'a> TriangleList<'a> {
    pub(super) fn get(&self, position: usize) -> &'a Triangle {
        &self.array[self.indices[position] as usize]
    }
}

fn block(key: NodeKey) -> SampleCube {
    SampleCube { shift: key.spacing_bits(), last: C as i32 }
}

impl Evaluator {
    /// Evaluates the 33³ samples of `key` from the triangles that touch it and the winding number at its
    /// corner sample (0, 0, 0). The triangles must be all of a closed soup that touch the closed cube from
    /// sample 0 to sample 32; others are ignored.
    ///
    /// # Errors
    /// [`Error::Setting`] if a winding number does not fit 16 bits.
    pub fn evaluate<'a>(
        &'a mut self,
        key: NodeKey,
        corner: i16,
        list: TriangleList<'a>,
    ) -> Result<Evaluation<'a>> {
        dispatch!(level(), simd => self.collect(simd, key, list));
        // From the corner to a sample the walk goes along three lines, each of which crosses a facet once at most.
        let most = 3 * self.facets.len() + usize::from(corner.unsigned_abs());
        let few = most <= i16::MAX as usize;
        let samples = if few { self.walk_few(corner) } else { self.walk_many(corner) };
        let Some(samples) = samples else {
            return Err(Error::setting(
                format!("more than {} shells overlap in brick {key}", i16::MAX),
                "remove repeated pieces from the input",
            ));
        };
        let signs = SignChanges::of(&samples);
        Ok(Evaluation { samples, signs, key, list, evaluator: self })
    }

    /// Finds the crossings that the walk needs.
    #[inline(always)]
    fn collect<S: Simd>(&mut self, simd: S, key: NodeKey, list: TriangleList<'_>) {
        let block = block(key);
        let origin = key.base().map(|b| b + 1);
        let Evaluator { facets, jumps, face, column, crossings, .. } = self;
        facets.clear();
        crossings.clear();
        for position in 0..list.indices.len() {
            let Some(facet) = ScanFacet::new(simd, list.get(position), origin, block) else { continue };
            let jump = [0, 1, 2].map(|axis| facet.jump(axis));
            facet.scan::<S, 2>(simd, block, [0, 0], |c| column[c.lower as usize] += jump[2]);
            facet.scan::<S, 0>(simd, block, [0, block.last], |c| {
                face[c.v as usize][c.lower as usize] += jump[0]
            });
            // The last sample takes crossings that lie between no two, without a branch.
            facet.scan_lines::<S, 1>(simd, block, [block.last; 2], |c| {
                let lower = lower_of::<1>(c);
                jumps[lower] = jumps[lower].wrapping_add(jump[1] as i16);
                crossings.add(lower, c.offset);
            });
            crossings.end_facet();
            facets.push(facet);
        }
    }

    /// The samples where no winding number can leave 16 bits.
    fn walk_few(&mut self, corner: i16) -> Option<Samples> {
        let Evaluator { jumps, face, column, .. } = self;
        dispatch!(level(), simd => walk(simd, corner, column, face, jumps))
    }

    /// The samples, with sums in 32 bits; `None` if one does not fit 16 bits.
    #[cold]
    fn walk_many(&mut self, corner: i16) -> Option<Samples> {
        let Evaluator { facets, jumps, face, column, crossings, .. } = self;
        jumps.fill(0);
        let mut jumps: Box<[i32; POINTS]> = vec![0; POINTS].try_into().expect("the length is POINTS");
        for (number, own) in crossings.by_facet() {
            let jump = facets[number].jump(1);
            own.iter().for_each(|place| jumps[usize::from(place.lower)] += jump);
        }
        dispatch!(level(), simd => walk(simd, corner, column, face, &mut jumps))
    }
}

/// A number in which jumps are added.
trait Sum: Copy + Default + AddAssign + Into<i32> {
    /// Of a number that fits.
    fn of(w: i32) -> Self;
}

impl Sum for i16 {
    fn of(w: i32) -> i16 {
        w as i16
    }
}

impl Sum for i32 {
    fn of(w: i32) -> i32 {
        w
    }
}

/// Prefix sums from the corner; `None` if a value does not fit 16 bits. Leaves no jumps for the next brick.
#[inline(always)]
fn walk<S: Simd, T: Sum>(
    _: S,
    corner: i16,
    column: &mut [i32; C],
    face: &mut [[i32; C]; P],
    jumps: &mut [T; POINTS],
) -> Option<Samples> {
    let mut samples = Vec::with_capacity(POINTS);
    let mut excess = 0;
    let mut at_k = i32::from(corner);
    let layers = jumps.as_chunks_mut::<P>().0.chunks_exact_mut(P);
    for (k, (layer, face)) in layers.zip(face.iter_mut()).enumerate() {
        let mut row = [T::of(at_k); P];
        for i in 0..C {
            row[i + 1] = row[i];
            row[i + 1] += T::of(std::mem::take(&mut face[i]));
        }
        for jumps in layer {
            samples.extend_from_slice(&row.map(|w| w.into() as i16));
            for (w, jump) in row.iter_mut().zip(std::mem::replace(jumps, [T::default(); P])) {
                let whole: i32 = (*w).into();
                excess |= whole ^ i32::from(whole as i16);
                *w += jump;
            }
        }
        if k < C {
            at_k += std::mem::take(&mut column[k]);
        }
    }
    let samples = samples.into_boxed_slice().try_into().expect("P rows of P layers are POINTS");
    (excess == 0).then_some(Samples(samples, 0))
}

impl Evaluator {
    /// The Hermite edges along an axis.
    fn hermite(
        &mut self,
        axis: Axis,
        key: NodeKey,
        samples: &Samples,
        signs: &SignChanges,
    ) -> Result<Vec<HermiteEdge>> {
        let Evaluator { changes, passages, .. } = self;
        passages.clear();
        let ask = |lower| passages.ask(point_index(lower));
        match axis {
            Axis::X => changes.set::<0>(signs, ask),
            Axis::Y => signs.for_edges(Axis::Y, ask),
            Axis::Z => changes.set::<2>(signs, ask),
        }
        let step = point_index(Axis::ALL.map(|other| usize::from(other == axis)));
        loop {
            let listing = self.listing[axis.index()];
            self.passages.begin(listing);
            match axis {
                Axis::X => dispatch!(level(), simd => self.collect_changes::<_, 0>(simd, key)),
                Axis::Y => self.recall_changes(),
                Axis::Z => dispatch!(level(), simd => self.collect_changes::<_, 2>(simd, key)),
            }
            let decided;
            (decided, self.listing[axis.index()]) = self.passages.hermite(samples, step);
            match decided {
                HermiteOutcome::All(edges) => return Ok(edges),
                HermiteOutcome::ListNeeded => {}
                HermiteOutcome::Torn => {
                    let what = "internal error: a sign change without a crossing";
                    return Err(Error::setting(what, "report this with the input"));
                }
            }
        }
    }

    /// Finds the crossings of the sign-changing edges along axis `A`.
    #[inline(always)]
    fn collect_changes<S: Simd, const A: usize>(&mut self, simd: S, key: NodeKey) {
        let block = block(key);
        let Evaluator { facets, changes, passages, normals, .. } = self;
        for (number, facet) in facets.iter().enumerate() {
            let mut passing = None;
            facet.scan_edges::<S, A>(simd, block, changes, |c| {
                let passing = passing
                    .get_or_insert_with(|| CrossingSide::new(facet.jump(A), normals.of(number, facet)));
                passages.add(lower_of::<A>(c), c.offset, *passing);
            });
        }
    }

    /// Picks the crossings of the sign-changing edges along y, which the samples needed already.
    fn recall_changes(&mut self) {
        let Evaluator { facets, crossings, passages, normals, .. } = self;
        for (number, own) in crossings.by_facet() {
            let mut passing = None;
            // Most facets have all their crossings on such edges, or none.
            for c in own {
                if !passages.asks(c.lower.into()) {
                    continue;
                }
                let facet = &facets[number];
                let passing = passing
                    .get_or_insert_with(|| CrossingSide::new(facet.jump(1), normals.of(number, facet)));
                passages.add(c.lower.into(), c.offset, *passing);
            }
        }
    }

    /// All crossings with edges along an axis, by edge and offset.
    pub(super) fn all_hits(&self, axis: Axis, key: NodeKey) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.add_hits(axis, key, ThinLines::All, |_, _| true, &mut hits);
        hits.sort_unstable_by_key(|hit| (hit.lower, hit.offset));
        hits
    }

    /// Adds the crossings of some facets with edges along an axis, on some of its lines.
    pub(super) fn add_hits(
        &self,
        axis: Axis,
        key: NodeKey,
        lines: ThinLines,
        wanted: fn(&ScanFacet, Axis) -> bool,
        hits: &mut Vec<Hit>,
    ) {
        let choice = (key, lines, wanted);
        match axis {
            Axis::X => dispatch!(level(), simd => self.hits_along::<_, 0>(simd, choice, hits)),
            Axis::Y => dispatch!(level(), simd => self.hits_along::<_, 1>(simd, choice, hits)),
            Axis::Z => dispatch!(level(), simd => self.hits_along::<_, 2>(simd, choice, hits)),
        }
    }

    #[inline(always)]
    fn hits_along<S: Simd, const A: usize>(
        &self,
        simd: S,
        (key, lines, wanted): (NodeKey, ThinLines, fn(&ScanFacet, Axis) -> bool),
        hits: &mut Vec<Hit>,
    ) {
        let block = block(key);
        for (number, facet) in self.facets.iter().enumerate() {
            if !facet.may_meet(A, lines) || !wanted(facet, Axis::ALL[A]) {
                continue;
            }
            let jump = facet.jump(A);
            facet.scan_some::<S, A>(simd, block, lines, |c| {
                if c.lower < block.last {
                    let lower = lower_of::<A>(c) as u16;
                    hits.push(Hit { lower, offset: c.offset, jump, facet: number as u32 });
                }
            });
        }
    }

    /// A facet of the brick by its number.
    pub(super) fn facet(&self, number: u32) -> &ScanFacet {
        &self.facets[number as usize]
    }
}

/// The index of the lower sample of a crossed edge along axis `A`.
#[inline(always)]
fn lower_of<const A: usize>(c: EdgeCrossing) -> usize {
    let mut ijk = [0; 3];
    (ijk[A], ijk[(A + 1) % 3], ijk[(A + 2) % 3]) = (c.lower as usize, c.u as usize, c.v as usize);
    point_index(ijk)
}

impl Evaluation<'_> {
    /// Whether all 33³ samples agree.
    pub fn is_uniform(&self) -> bool {
        let first = self.samples.0[0];
        // Row by row: a loop that ends at the first difference is not vectorized.
        let differs = |row: &[i16; P]| row.iter().fold(0, |differs, &w| differs | (w ^ first)) != 0;
        !self.samples.0.as_chunks().0.iter().any(differs)
    }

    /// Whether a lattice edge holds crossings that cancel in part: a wall or a gap thinner than the
    /// spacing that the samples alone do not show.
    pub fn has_hidden_crossings(&self) -> bool {
        self.any_edge(|edge| {
            let sum: i32 = edge.iter().map(|hit| hit.jump).sum();
            (sum.unsigned_abs() as usize) < edge.len()
        })
    }

    /// Whether the running count along a lattice edge passes 0.5 and back.
    pub fn has_hidden_boundary(&self) -> bool {
        self.any_edge(|edge| {
            let mut w = i32::from(self.samples.0[usize::from(edge[0].lower)]);
            let mut passes = 0;
            edge.chunk_by(|a, b| a.offset == b.offset).for_each(|group| {
                let before = w;
                w += group.iter().map(|hit| hit.jump).sum::<i32>();
                passes += u32::from((before >= 1) != (w >= 1));
            });
            passes > 1
        })
    }

    /// Whether the predicate holds for an edge with two crossings or more, which it gets in order.
    fn any_edge(&self, predicate: impl Fn(&[Hit]) -> bool) -> bool {
        Axis::ALL.into_iter().any(|axis| {
            let hits = self.evaluator.all_hits(axis, self.key);
            hits.chunk_by(|a, b| a.lower == b.lower).any(|edge| edge.len() > 1 && predicate(edge))
        })
    }

    /// Turns the samples into a leaf's brick with its Hermite edges.
    ///
    /// # Errors
    /// [`Error::Setting`] if a sign change has no crossing, which closed input cannot cause.
    pub fn into_leaf(self) -> Result<Brick> {
        if self.is_uniform() {
            return Ok(Brick::Uniform(self.samples.0[0]));
        }
        let Evaluation { samples, signs, key, evaluator, .. } = self;
        let mut edges: [Vec<HermiteEdge>; 3] = Default::default();
        evaluator.normals.begin(evaluator.facets.len());
        for axis in Axis::ALL {
            edges[axis.index()] = evaluator.hermite(axis, key, &samples, &signs)?;
        }
        Ok(Brick::Counts { samples, hermite: Hermite { edges } })
    }
}
