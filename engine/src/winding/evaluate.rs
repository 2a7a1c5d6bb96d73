//! Samples of one brick from the triangles that touch it.
//!
//! Walking along a lattice line, w jumps by ±1 where the line crosses a triangle. From the brick's corner
//! the walk goes up the z column, from there along the y lines of the face x = 0, from there along all
//! 33 × 33 rows in x. Cost: triangles that touch the brick plus crossings.

use super::hermite::Resolver;
use super::scan::{Block, Facet};
use crate::brick::{Brick, Hermite, HermiteEdge, POINTS, Samples, SignChanges, inside_from};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle};

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Edges along a row.
const C: usize = BRICK_CELLS;

/// One crossing of a lattice edge of a brick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Linear index of the edge's lower sample.
    pub lower: u16,
    /// Distance from that sample in 1/65536 of the edge.
    pub offset: u16,
    /// Index of the triangle in the brick's list, times two, plus one where the winding number falls.
    pub facet: u32,
}

/// [`Hit::facet`] of a triangle's position in the list and the jump at its crossings.
fn hit_code(position: u32, jump: i32) -> u32 {
    position << 1 | u32::from(jump < 0)
}

impl Hit {
    /// The triangle's position in the brick's list.
    pub fn position(self) -> usize {
        (self.facet >> 1) as usize
    }

    pub fn jump(self) -> i32 {
        1 - 2 * (self.facet & 1) as i32
    }
}

// A lower sample index fits 16 bits.
const _: () = assert!(POINTS <= u16::MAX as usize + 1);

/// Working memory for evaluating bricks one after the other; one per thread.
pub struct Evaluator {
    /// The triangles that meet lattice lines, with their position in the brick's list.
    facets: Vec<(u32, Facet)>,
    /// Jumps along x, [row][edge]; all zero between bricks.
    rows: Vec<i32>,
    /// Per row, which edges hold a jump in `rows`; all zero between bricks.
    touched: Vec<u32>,
    /// Jumps along y in the face x = 0: [k][edge].
    face: Vec<i32>,
    /// Jumps along z in the column x = y = 0.
    column: [i32; C],
    /// Crossings along x.
    hits_x: Vec<Hit>,
    /// Crossings along one axis, those asked for.
    hits: Vec<Hit>,
    resolver: Resolver,
}

impl Default for Evaluator {
    fn default() -> Self {
        Evaluator {
            facets: Vec::new(),
            rows: vec![0; P * P * C],
            touched: vec![0; P * P],
            face: vec![0; P * C],
            column: [0; C],
            hits_x: Vec::new(),
            hits: Vec::new(),
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
        let mut samples = Samples::filled(corner);
        let mut signs = SignChanges::outside();
        let fits = self.walk(corner, &mut samples, &mut signs);
        if !fits {
            return Err(Error::setting(
                format!("more than {} shells overlap in brick {key}", i16::MAX),
                "remove repeated pieces from the input",
            ));
        }
        Ok(Evaluation { samples, signs, key, list, evaluator: self })
    }

    /// Adds up the jumps that the walk needs.
    fn collect(&mut self, key: NodeKey, list: Triangles<'_>) {
        let block = block(key);
        let origin = key.base().map(|b| b + 1);
        self.facets.clear();
        self.hits_x.clear();
        for position in 0..list.indices.len() {
            let Some(facet) = Facet::new(list.get(position), origin, block) else { continue };
            let jump = [0, 1, 2].map(|axis| facet.jump(axis));
            facet.scan::<2>(block, [0, 0], |c| self.column[c.lower as usize] += jump[2]);
            facet.scan::<1>(block, [block.last, 0], |c| {
                self.face[c.u as usize * C + c.lower as usize] += jump[1];
            });
            let code = hit_code(position as u32, jump[0]);
            facet.scan::<0>(block, [block.last; 2], |c| {
                let row = c.v as usize * P + c.u as usize;
                self.rows[row * C + c.lower as usize] += jump[0];
                self.touched[row] |= 1 << c.lower;
                let lower = (row * P + c.lower as usize) as u16;
                self.hits_x.push(Hit { lower, offset: c.offset, facet: code });
            });
            self.facets.push((position as u32, facet));
        }
    }

    /// Fills `hits` with the crossings along `axis`: all of them, or those on the edges that `resolver`
    /// names.
    fn collect_hits(&mut self, key: NodeKey, axis: Axis, resolver: Option<&Resolver>) {
        let block = block(key);
        let hits = &mut self.hits;
        let wants = |row, i| resolver.is_none_or(|r| r.changes(row, i));
        hits.clear();
        if axis == Axis::X {
            let lower = |hit: &&Hit| (usize::from(hit.lower) / P, usize::from(hit.lower) % P);
            hits.extend(self.hits_x.iter().filter(|hit| wants(lower(hit).0, lower(hit).1)));
            return;
        }
        for (position, facet) in &self.facets {
            let code = hit_code(*position, facet.jump(axis.index()));
            let mut add = |[i, j, k]: [i32; 3], offset| {
                let (row, i) = (k as usize * P + j as usize, i as usize);
                if wants(row, i) {
                    hits.push(Hit { lower: (row * P + i) as u16, offset, facet: code });
                }
            };
            let all = [block.last; 2];
            match axis {
                Axis::X => {}
                Axis::Y => facet.scan::<1>(block, all, |c| add([c.v, c.lower, c.u], c.offset)),
                Axis::Z => facet.scan::<2>(block, all, |c| add([c.u, c.v, c.lower], c.offset)),
            }
        }
    }

    /// Prefix sums from the corner; false if a value does not fit 16 bits. Zeroes the jumps for the next
    /// brick.
    fn walk(&mut self, corner: i16, samples: &mut Samples, signs: &mut SignChanges) -> bool {
        let mut fits = true;
        let mut at_k = i32::from(corner);
        for k in 0..P {
            let mut at_j = at_k;
            for j in 0..P {
                let row = k * P + j;
                fits &= self.walk_row(row, at_j, samples, signs);
                if j < C {
                    at_j += std::mem::take(&mut self.face[k * C + j]);
                }
            }
            if k < C {
                at_k += std::mem::take(&mut self.column[k]);
            }
        }
        fits
    }

    /// The samples and signs of one row from its first sample, stepping from jump to jump.
    #[inline]
    fn walk_row(&mut self, row: usize, first: i32, samples: &mut Samples, signs: &mut SignChanges) -> bool {
        let mut w = first;
        let mut fits = i32::from(w as i16) == w;
        let mut inside = inside_from(w, 0);
        samples.fill_row_from(row * P, w as i16);
        let mut touched = std::mem::take(&mut self.touched[row]);
        while touched != 0 {
            let edge = touched.trailing_zeros() as usize;
            touched &= touched - 1;
            inside ^= inside_from(w, edge + 1);
            w += std::mem::take(&mut self.rows[row * C + edge]);
            inside ^= inside_from(w, edge + 1);
            fits &= i32::from(w as i16) == w;
            samples.fill_row_from(row * P + edge + 1, w as i16);
        }
        signs.set_row(row % P, row / P, inside);
        fits
    }
}

impl Evaluation<'_> {
    /// Whether all 33³ samples agree.
    pub fn is_uniform(&self) -> bool {
        let first = self.samples.0[0];
        self.samples.0.iter().all(|&w| w == first)
    }

    /// Whether a lattice edge holds crossings that cancel in part: a wall or a gap thinner than the
    /// spacing that the samples alone do not show.
    pub fn has_hidden_crossings(&mut self) -> bool {
        self.any_edge(|_, jumps| {
            let sum: i32 = jumps.iter().map(|h| h.jump()).sum();
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
                w += group.iter().map(|h| h.jump()).sum::<i32>();
                passes += u32::from((before >= 1) != (w >= 1));
            });
            passes > 1
        })
    }

    /// Whether the predicate holds for an edge with two crossings or more, given its lower sample and the
    /// crossings in order.
    fn any_edge(&mut self, mut predicate: impl FnMut(usize, &[Hit]) -> bool) -> bool {
        Axis::ALL.into_iter().any(|axis| {
            self.evaluator.collect_hits(self.key, axis, None);
            let hits = &mut self.evaluator.hits;
            hits.sort_unstable_by_key(|h| (h.lower, h.offset));
            hits.chunk_by(|a, b| a.lower == b.lower)
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
            // The edges' scratch leaves the evaluator while that scans.
            let mut resolver = std::mem::take(&mut evaluator.resolver);
            resolver.index(axis, &signs);
            evaluator.collect_hits(key, axis, Some(&resolver));
            let resolved = resolver.resolve(&samples, &evaluator.hits, list);
            evaluator.resolver = resolver;
            edges[axis.index()] = resolved?;
        }
        Ok(Brick::Counts { samples, hermite: Hermite { edges } })
    }
}
