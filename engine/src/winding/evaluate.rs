//! Samples of one brick from the triangles that touch it.
//!
//! Walking along a lattice line, w jumps by ±1 where the line crosses a triangle. From the brick's corner
//! the walk goes up the z column, from there along the y lines of the face x = 0, from there along all
//! 33 × 33 rows in x (design: closed part of the field). Cost: triangles that touch the brick plus crossings.

use super::hermite;
use super::scan::{Block, Facet};
use crate::brick::{Brick, POINTS, Samples, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle};

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

impl Hit {
    pub fn jump(self) -> i32 {
        1 - 2 * (self.facet & 1) as i32
    }
}

// A lower sample index fits 16 bits.
const _: () = assert!(POINTS <= u16::MAX as usize + 1);

/// Working memory for evaluating bricks one after the other; one per thread.
pub struct Evaluator {
    /// Jumps along x, [row][edge]; all zero between bricks.
    rows: Vec<i32>,
    /// Which rows of `rows` hold a jump: bit j of word k.
    touched: [u64; P],
    /// Jumps along y in the face x = 0: [k][edge].
    face: Vec<i32>,
    /// Jumps along z in the column x = y = 0.
    column: [i32; C],
    /// Crossings along each axis.
    hits: [Vec<Hit>; 3],
    hermite: hermite::Scratch,
}

impl Default for Evaluator {
    fn default() -> Self {
        Evaluator {
            rows: vec![0; P * P * C],
            touched: [0; P],
            face: vec![0; P * C],
            column: [0; C],
            hits: Default::default(),
            hermite: hermite::Scratch::default(),
        }
    }
}

/// The samples of one brick, and its crossings until the evaluator is used again.
pub struct Evaluation<'a> {
    /// 33³ winding numbers.
    pub samples: Samples,
    /// Where they are inside.
    pub signs: SignChanges,
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
        self.clear();
        if !fits {
            return Err(Error::setting(
                format!("more than {} shells overlap in brick {key}", i16::MAX),
                "remove repeated pieces from the input",
            ));
        }
        Ok(Evaluation { samples, signs, list, evaluator: self })
    }

    /// Finds all crossings of the list with the brick's lattice lines.
    fn collect(&mut self, key: NodeKey, list: Triangles<'_>) {
        let block = Block { shift: key.spacing_bits(), last: C as i32 };
        let origin = key.base().map(|b| b + 1);
        let all = [block.last; 2];
        let [hits_x, hits_y, hits_z] = &mut self.hits;
        hits_x.clear();
        hits_y.clear();
        hits_z.clear();
        for position in 0..list.indices.len() {
            let Some(facet) = Facet::new(list.get(position), origin, block) else { continue };
            let index = |i: i32, j: i32, k: i32| ((k * P as i32 + j) * P as i32 + i) as u16;
            let hit = |lower, offset, jump: i32| Hit {
                lower,
                offset,
                facet: (position as u32) << 1 | u32::from(jump < 0),
            };
            let jump = facet.jump(2);
            facet.scan::<2>(block, all, |c| {
                hits_z.push(hit(index(c.u, c.v, c.lower), c.offset, jump));
                if c.u | c.v == 0 {
                    self.column[c.lower as usize] += jump;
                }
            });
            let jump = facet.jump(1);
            facet.scan::<1>(block, all, |c| {
                hits_y.push(hit(index(c.v, c.lower, c.u), c.offset, jump));
                if c.v == 0 {
                    self.face[c.u as usize * C + c.lower as usize] += jump;
                }
            });
            let jump = facet.jump(0);
            facet.scan::<0>(block, all, |c| {
                hits_x.push(hit(index(c.lower, c.u, c.v), c.offset, jump));
                self.rows[(c.v as usize * P + c.u as usize) * C + c.lower as usize] += jump;
                self.touched[c.v as usize] |= 1 << c.u;
            });
        }
    }

    /// Prefix sums from the corner; false if a value does not fit 16 bits.
    fn walk(&self, corner: i16, samples: &mut Samples, signs: &mut SignChanges) -> bool {
        let mut fits = true;
        let mut at_k = i32::from(corner);
        for k in 0..P {
            let mut at_j = at_k;
            for j in 0..P {
                let row = &mut samples.0[(k * P + j) * P..][..P];
                let mut bits = if at_j >= 1 { (1u64 << P) - 1 } else { 0 };
                fits &= i32::from(at_j as i16) == at_j;
                if self.touched[k] >> j & 1 == 0 {
                    row.fill(at_j as i16);
                } else {
                    let jumps = &self.rows[(k * P + j) * C..][..C];
                    row[0] = at_j as i16;
                    bits &= 1;
                    let mut w = at_j;
                    for (i, jump) in jumps.iter().enumerate() {
                        w += jump;
                        row[i + 1] = w as i16;
                        fits &= i32::from(w as i16) == w;
                        bits |= u64::from(w >= 1) << (i + 1);
                    }
                }
                signs.set_row(j, k, bits);
                if j < C {
                    at_j += self.face[k * C + j];
                }
            }
            if k < C {
                at_k += self.column[k];
            }
        }
        fits
    }

    /// Zeroes the jumps that `collect` made.
    fn clear(&mut self) {
        for (k, touched) in self.touched.iter_mut().enumerate() {
            let mut bits = std::mem::take(touched);
            while bits != 0 {
                let j = bits.trailing_zeros() as usize;
                self.rows[(k * P + j) * C..][..C].fill(0);
                bits &= bits - 1;
            }
        }
        self.face.fill(0);
        self.column.fill(0);
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
        self.evaluator.hits.iter_mut().any(|hits| {
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
        let Evaluation { samples, signs, list, evaluator } = self;
        let hermite = evaluator.hermite.resolve(&samples, &signs, &evaluator.hits, list)?;
        Ok(Brick::Counts { samples, hermite })
    }
}
