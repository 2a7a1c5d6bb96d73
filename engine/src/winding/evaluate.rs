//! Samples of one brick from the triangles that touch it.
//!
//! Walking along a lattice line, w jumps by ±1 where the line crosses a triangle. From the brick's corner
//! the walk goes up the z column, from there along the y lines of the face x = 0, from there along all
//! 33 × 33 rows in x. Cost: triangles that touch the brick plus crossings.

use super::crossings::{Cause, Crossings, Hit};
use super::edges::EdgeMasks;
use super::hermite::Resolver;
use super::passages::{Decided, Passages, Passing};
use super::scan::{Block, Crossing, Facet};
use crate::brick::{
    Brick, Hermite, HermiteEdge, Samples, SamplesInOrder, SignChanges, inside_from, point_index,
};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle};

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Edges along a row.
const C: usize = BRICK_CELLS;

/// Working memory for evaluating bricks one after the other; one per thread.
pub struct Evaluator {
    /// The triangles that meet lattice lines.
    facets: Vec<Facet>,
    /// Their positions in the brick's list.
    positions: Vec<u32>,
    /// Per row, which edges along x hold crossings; all zero between bricks.
    touched: Box<[u32; P * P]>,
    /// Jumps along y in the face x = 0: [k][edge].
    face: Vec<i32>,
    /// Jumps along z in the column x = y = 0.
    column: [i32; C],
    /// Crossings along x, and along one other axis behind them.
    crossings: Crossings,
    /// How many lie along x.
    count_x: usize,
    /// The number of the last crossing on each sign-changing edge along x, in the edges' order.
    passages_x: Vec<u32>,
    /// The sign-changing edges along the other axis.
    changes: EdgeMasks,
    /// Their crossings.
    passages: Passages,
    /// Per axis, whether the last brick needed the list of its passages.
    listing: [bool; 3],
    resolver: Resolver,
}

impl Default for Evaluator {
    fn default() -> Self {
        Evaluator {
            facets: Vec::new(),
            positions: Vec::new(),
            touched: Box::new([0; P * P]),
            face: vec![0; P * C],
            column: [0; C],
            crossings: Crossings::default(),
            count_x: 0,
            passages_x: Vec::new(),
            changes: EdgeMasks::default(),
            passages: Passages::default(),
            listing: [false; 3],
            resolver: Resolver::default(),
        }
    }
}

/// The samples of one brick, and its crossings until the evaluator is used again.
pub struct Evaluation<'a> {
    /// 33³ winding numbers.
    pub samples: Samples,
    /// Where they are inside.
    pub signs: SignChanges,
    key: NodeKey,
    list: Triangles<'a>,
    evaluator: &'a mut Evaluator,
}

/// The triangles of a brick: some of an array, by index.
#[derive(Clone, Copy)]
pub struct Triangles<'a> {
    /// All of them.
    pub array: &'a [Triangle],
    /// Those that touch the brick.
    pub indices: &'a [u32],
}

impl<'a> Triangles<'a> {
    pub(super) fn get(&self, position: usize) -> &'a Triangle {
        &self.array[self.indices[position] as usize]
    }
}

fn block(key: NodeKey) -> Block {
    Block { shift: key.spacing_bits(), last: C as i32 }
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
        list: Triangles<'a>,
    ) -> Result<Evaluation<'a>> {
        self.collect(key, list);
        let mut samples = SamplesInOrder::default();
        let mut signs = SignChanges::outside();
        let fits = self.walk(corner, &mut samples, &mut signs);
        let samples = samples.finish();
        if !fits {
            return Err(Error::setting(
                format!("more than {} shells overlap in brick {key}", i16::MAX),
                "remove repeated pieces from the input",
            ));
        }
        Ok(Evaluation { samples, signs, key, list, evaluator: self })
    }

    /// Finds the crossings that the walk needs.
    fn collect(&mut self, key: NodeKey, list: Triangles<'_>) {
        let block = block(key);
        let origin = key.base().map(|b| b + 1);
        self.facets.clear();
        self.positions.clear();
        self.crossings.truncate(0);
        for position in 0..list.indices.len() {
            let Some(facet) = Facet::new(list.get(position), origin, block) else { continue };
            let jump = [0, 1, 2].map(|axis| facet.jump(axis));
            facet.scan::<2>(block, [0, 0], |c| self.column[c.lower as usize] += jump[2]);
            facet.scan::<1>(block, [block.last, 0], |c| {
                self.face[c.u as usize * C + c.lower as usize] += jump[1];
            });
            let cause = Cause::new(position, jump[0]);
            facet.scan::<0>(block, [block.last; 2], |c| {
                let row = c.v as usize * P + c.u as usize;
                self.touched[row] |= 1 << c.lower;
                self.crossings.add(row * P + c.lower as usize, c.offset, cause);
            });
            self.facets.push(facet);
            self.positions.push(position as u32);
        }
        self.count_x = self.crossings.len();
    }

    /// Finds all crossings along y or z, in place of others but those along x.
    fn collect_other(&mut self, key: NodeKey, axis: Axis) {
        let (block, limit) = (block(key), [C as i32; 2]);
        let Evaluator { facets, positions, crossings, .. } = self;
        crossings.truncate(self.count_x);
        for (facet, position) in facets.iter().zip(positions) {
            let cause = Cause::new(*position as usize, facet.jump(axis.index()));
            let mut add = |c: Crossing, ijk: [i32; 3]| {
                crossings.add(point_index(ijk.map(|i| i as usize)), c.offset, cause);
            };
            match axis {
                Axis::Y => facet.scan::<1>(block, limit, |c| add(c, [c.v, c.lower, c.u])),
                _ => facet.scan::<2>(block, limit, |c| add(c, [c.u, c.v, c.lower])),
            }
        }
    }

    /// Finds the crossings of the sign-changing edges along axis `A`, y or z.
    // A function for each axis: their inner loops leave no registers for each other.
    #[inline(never)]
    fn collect_changes<const A: usize>(&mut self, key: NodeKey) {
        let block = block(key);
        let Evaluator { facets, positions, changes, passages, resolver, .. } = self;
        for (facet, position) in facets.iter().zip(positions) {
            let position = *position as usize;
            let mut passing = None;
            facet.scan_edges::<A>(block, changes, |c| {
                let passing = passing.get_or_insert_with(|| {
                    Passing::new(facet.jump(A), resolver.normal(position, || facet.normal))
                });
                passages.add(lower_of::<A>(c), c.offset, *passing);
            });
        }
    }

    /// Prefix sums from the corner; false if a value does not fit 16 bits. Leaves no jumps for the next
    /// brick.
    fn walk(&mut self, corner: i16, samples: &mut SamplesInOrder, signs: &mut SignChanges) -> bool {
        let mut excess = 0;
        self.passages_x.clear();
        let mut at_k = i32::from(corner);
        for k in 0..P {
            let mut at_j = at_k;
            for j in 0..P {
                let row = k * P + j;
                excess |= self.walk_row(row, at_j, samples, signs);
                if j < C {
                    at_j += std::mem::take(&mut self.face[k * C + j]);
                }
            }
            if k < C {
                at_k += std::mem::take(&mut self.column[k]);
            }
        }
        excess == 0
    }

    /// The samples and signs of one row from its first sample, stepping from crossed edge to crossed edge. Not
    /// zero if a value does not fit 16 bits.
    #[inline]
    fn walk_row(
        &mut self,
        row: usize,
        first: i32,
        samples: &mut SamplesInOrder,
        signs: &mut SignChanges,
    ) -> i32 {
        let mut w = first;
        let mut excess = w ^ i32::from(w as i16);
        let mut inside = inside_from(w, 0);
        samples.fill_from(row * P, w as i16);
        let mut touched = std::mem::take(&mut self.touched[row]);
        while touched != 0 {
            let lower = row * P + touched.trailing_zeros() as usize;
            touched &= touched - 1;
            let last = self.crossings.take(lower);
            let before = w;
            w += self.crossings.jump(last);
            if (before >= 1) != (w >= 1) {
                inside ^= inside_from(1, lower + 1 - row * P);
                self.passages_x.push(last);
            }
            excess |= w ^ i32::from(w as i16);
            samples.fill_from(lower + 1, w as i16);
        }
        signs.set_row(row % P, row / P, inside);
        excess
    }
}

impl Evaluator {
    /// The Hermite edges along x; the walk has found their crossings.
    fn hermite_x(&mut self, samples: &Samples, list: Triangles<'_>) -> Vec<HermiteEdge> {
        let Evaluator { crossings, passages_x, resolver, .. } = self;
        passages_x.iter().map(|&last| resolver.resolve(last, crossings, samples, list)).collect()
    }

    /// The Hermite edges along y or z.
    fn hermite_other(
        &mut self,
        axis: Axis,
        key: NodeKey,
        samples: &Samples,
        signs: &SignChanges,
    ) -> Result<Vec<HermiteEdge>> {
        self.passages.clear();
        let edges = |j, k| signs.edges(axis, j, k);
        self.changes.set(axis, edges, |lower| self.passages.ask(point_index(lower)));
        let along_y = axis == Axis::Y;
        let step = point_index(if along_y { [0, 1, 0] } else { [0, 0, 1] });
        loop {
            let listing = self.listing[axis.index()];
            self.passages.begin(listing);
            if along_y {
                self.collect_changes::<1>(key)
            } else {
                self.collect_changes::<2>(key)
            }
            let decided;
            (decided, self.listing[axis.index()]) = self.passages.hermite(samples, step);
            match decided {
                Decided::All(edges) => return Ok(edges),
                Decided::ListNeeded => {}
                Decided::Torn => {
                    let what = "internal error: a sign change without a crossing";
                    return Err(Error::setting(what, "report this with the input"));
                }
            }
        }
    }
}

/// The index of the lower sample of a crossed edge along axis `A`, y or z.
#[inline(always)]
fn lower_of<const A: usize>(c: Crossing) -> usize {
    let ijk = if A == 1 { [c.v, c.lower, c.u] } else { [c.u, c.v, c.lower] };
    point_index(ijk.map(|i| i as usize))
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
    pub fn has_hidden_crossings(&mut self) -> bool {
        self.any_edge(|_, jumps| {
            let sum: i32 = jumps.iter().map(|h| h.cause.jump()).sum();
            (sum.unsigned_abs() as usize) < jumps.len()
        })
    }

    /// Whether the running count along a lattice edge passes 0.5 and back.
    pub fn has_hidden_boundary(&mut self) -> bool {
        let samples = self.samples.clone();
        self.any_edge(|lower, hits| {
            let mut w = i32::from(samples.0[lower]);
            let mut passes = 0;
            hits.chunk_by(|a, b| a.offset == b.offset).for_each(|group| {
                let before = w;
                w += group.iter().map(|h| h.cause.jump()).sum::<i32>();
                passes += u32::from((before >= 1) != (w >= 1));
            });
            passes > 1
        })
    }

    /// Whether the predicate holds for an edge with two crossings or more, given its lower sample and the
    /// crossings in order.
    fn any_edge(&mut self, mut predicate: impl FnMut(usize, &[Hit]) -> bool) -> bool {
        Axis::ALL.into_iter().any(|axis| {
            let mut from = 0;
            if axis != Axis::X {
                self.evaluator.collect_other(self.key, axis);
                from = self.evaluator.count_x;
            }
            let sorted = self.evaluator.crossings.sorted(from);
            self.evaluator.crossings.truncate(self.evaluator.count_x);
            sorted
                .chunk_by(|a, b| a.lower == b.lower)
                .any(|edge| edge.len() > 1 && predicate(usize::from(edge[0].lower), edge))
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
        let Evaluation { samples, signs, key, list, evaluator } = self;
        let mut edges: [Vec<HermiteEdge>; 3] = Default::default();
        evaluator.resolver.begin(list.indices.len());
        for axis in Axis::ALL {
            edges[axis.index()] = match axis {
                Axis::X => evaluator.hermite_x(&samples, list),
                _ => evaluator.hermite_other(axis, key, &samples, &signs)?,
            };
        }
        Ok(Brick::Counts { samples, hermite: Hermite { edges } })
    }
}
