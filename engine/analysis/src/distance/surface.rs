//! The surface of a store as patches, found by place: nearest points, rays, and balls that touch it.

use super::around::{AROUND, Around};
use super::boxes::{Boxes, entered, squared_from};
use super::patch::{Patch, Touch};
use super::piece::Piece;
use crate::contour::{Bend, edge_facets};
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, RootCube, dot, minus, spacing_bits};
use crate::part::temporary::TempFile;
use crate::progress::Progress;
use crate::store::{BrickCache, BrickTree};
use std::path::Path;
use std::sync::Arc;

/// Feet that are as near as this part of their squares are equally near: of a crease, found from its two sides.
const TIE: f64 = 2e-6;
/// The least depth of a point below the tangent plane, in cells, at which it bounds a ball that touches the plane on the same
/// side of the part: nearer ones tell nothing but errors.
const SHALLOW: f64 = 0.3;
/// How far below the surface the solid is asked whose it is, in cells.
const INNER: f64 = 0.3;
/// Rays begin so many cells from their points.
const LEAVE: f64 = 1e-3;

/// Which patch: its leaf among those with surface, and its number there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// Number of the leaf.
    pub leaf: u32,
    /// Number of the patch.
    pub patch: u32,
}

/// A point of the surface. Lengths are in cells of the deepest level, places counted from the root's first sample.
#[derive(Clone, Copy, Debug)]
pub struct Foot {
    /// Where it is.
    pub at: [f64; 3],
    /// The unit normal there, outward.
    pub normal: [f64; 3],
    /// How far it is from what was asked about.
    pub distance: f64,
    /// Whether what was asked about lies on the inner side.
    pub inside: bool,
    /// Its patch.
    pub place: Place,
}

/// A piece in memory, or in a file.
enum Held {
    Here(Box<Piece>),
    There { offset: u64, bytes: usize, base: [f64; 3] },
}

/// The surface w = 0.5 of a tree, made once: about 120 bytes a vertex of its mesh, in a file beside memory where they are more
/// than allowed.
pub struct Surface {
    root: RootCube,
    deepest: u8,
    keys: Vec<NodeKey>,
    held: Vec<Held>,
    boxes: Boxes,
    file: TempFile,
    cache: BrickCache<Piece>,
    patches: u64,
}

impl Surface {
    /// Of a tree, in so many bytes of memory, with a file in `folder` for what does not fit.
    ///
    /// # Errors
    /// What contouring and the file give.
    pub fn new(tree: &dyn BrickTree, memory: u64, folder: &Path, progress: &dyn Progress) -> Result<Surface> {
        let (root, deepest) = (tree.root(), tree.deepest_level());
        let file = TempFile::new(folder);
        let (mut keys, mut held, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
        let (mut here, mut patches) = (0, 0);
        let caches = (memory / 2).clamp(16 << 20, 512 << 20);
        let make = |key: NodeKey, facets: &[_]| {
            let brick = tree.brick(key)?;
            Ok(Piece::new(root, deepest, key, &brick, facets).map(|piece| (key, piece)))
        };
        edge_facets(
            tree,
            caches as usize,
            (Bend::Strong, |_| true),
            progress,
            make,
            |made: Option<(NodeKey, Piece)>| {
                let Some((key, piece)) = made else { return Ok(()) };
                keys.push(key);
                blocks.push(piece.block());
                patches += piece.patches.len() as u64;
                let bytes = piece.heap_bytes() as u64;
                if here + bytes <= memory / 2 {
                    here += bytes;
                    held.push(Held::Here(Box::new(piece)));
                } else {
                    let (base, bytes) = (piece.base, piece.bytes());
                    held.push(Held::There { offset: file.append(&bytes)?, bytes: bytes.len(), base });
                }
                Ok(())
            },
        )?;
        let boxes = Boxes::new(blocks.into_iter(), 1);
        let cache = BrickCache::new(memory / 2);
        Ok(Surface { root, deepest, keys, held, boxes, file, cache, patches })
    }

    /// The cube that the tree divides.
    pub fn root(&self) -> RootCube {
        self.root
    }

    /// World length of a cell of the deepest level.
    pub fn cell(&self) -> f64 {
        self.root.spacing(self.deepest)
    }

    /// How many patches there are: one for each crossing.
    pub fn patches(&self) -> u64 {
        self.patches
    }

    /// Leaves that have patches, in Morton order.
    pub fn leaves(&self) -> &[NodeKey] {
        &self.keys
    }

    /// A world position in cells.
    pub fn to_cells(&self, world: [f64; 3]) -> [f64; 3] {
        let cell = f64::from(1u32 << spacing_bits(self.deepest));
        self.root.to_units(world).map(|u| (u - 1.0) / cell)
    }

    /// The world position of a place in cells.
    pub fn to_world(&self, cells: [f64; 3]) -> [f64; 3] {
        let cell = f64::from(1u32 << spacing_bits(self.deepest));
        self.root.to_world(cells.map(|c| c * cell + 1.0))
    }

    /// The box of all patches, in world units; `None` if there are none.
    pub fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let ends = self.boxes.whole().map(|end| self.to_world(end.map(f64::from)));
        (!self.keys.is_empty()).then_some(ends)
    }

    /// Calls `each` with a piece.
    pub(super) fn with<R>(&self, leaf: usize, each: impl FnOnce(&Piece) -> Result<R>) -> Result<R> {
        let (offset, bytes, base) = match &self.held[leaf] {
            Held::Here(piece) => return each(piece),
            Held::There { offset, bytes, base } => (*offset, *bytes, *base),
        };
        let key = self.keys[leaf];
        if let Some(piece) = self.cache.get(key) {
            return each(&piece);
        }
        let mut read = vec![0; bytes];
        self.file.read(offset, &mut read)?;
        let piece = Arc::new(Piece::of_bytes(base, &read).ok_or_else(|| self.file.damaged())?);
        drop(self.cache.insert(key, &piece, piece.heap_bytes()));
        each(&piece)
    }

    /// The point of the surface that is nearest to a place, if it is within so many cells. Of a crease it is that of the side
    /// that sees the place best, so that its normal tells the sign of the distance.
    ///
    /// # Errors
    /// What reading the file gives.
    pub fn closest(&self, from: [f64; 3], within: f64) -> Result<Option<Foot>> {
        let mut search = Nearest { within: within * within, best: None, aligned: -1.0 };
        let near =
            |search: &Nearest, squared: f64| (squared <= search.within * (1.0 + TIE)).then_some(squared);
        self.boxes.search(
            &mut search,
            |search, block| near(search, squared_from(block, from)),
            |search, leaf| {
                self.with(leaf, |piece| {
                    let local = minus(from, piece.base);
                    piece.boxes.search(
                        search,
                        |search, block| near(search, squared_from(block, local)),
                        |search, n| {
                            let within = search.within * (1.0 + TIE);
                            if let Some(touch) = piece.patches[n].nearest(&piece.rings, local, within) {
                                let place = Place { leaf: leaf as u32, patch: n as u32 };
                                search.take(touch, local, piece.base, place);
                            }
                            Ok(())
                        },
                    )
                })
            },
        )?;
        Ok(search.best)
    }

    /// The normal of the surface around a foot, from all patches that are near: facets of the input turn it by less than the
    /// normal of one crossing. Patches beyond edges do not count.
    ///
    /// # Errors
    /// What reading the file gives.
    pub fn normal_around(&self, at: [f64; 3], normal: [f64; 3]) -> Result<[f64; 3]> {
        let within = AROUND * AROUND;
        let mut around = Around::new(at, normal);
        self.boxes.search(
            &mut around,
            |_, block| Some(squared_from(block, at)).filter(|squared| *squared < within),
            |around, leaf| {
                self.with(leaf, |piece| {
                    let local = minus(at, piece.base);
                    piece.boxes.search(
                        around,
                        |_, block| Some(squared_from(block, local)).filter(|squared| *squared < within),
                        |around, n| {
                            let patch = &piece.patches[n];
                            let crossing = std::array::from_fn(|a| f64::from(patch.at[a]) + piece.base[a]);
                            let turned = patch.normal_at(minus(at, crossing));
                            let [xx, xy, yy] = patch.bend.map(f64::from);
                            let bend = (xx * xx + 2.0 * xy * xy + yy * yy).sqrt();
                            around.add(crossing, turned, bend);
                            Ok(())
                        },
                    )
                })
            },
        )?;
        Ok(around.normal())
    }

    /// Where a ray first passes the surface, going out of the part or into it, if within so many cells. `toward` is a unit
    /// vector. Surfaces that are passed nearly along themselves do not count.
    ///
    /// # Errors
    /// What reading the file gives.
    pub fn ray(&self, from: [f64; 3], toward: [f64; 3], most: f64, outward: bool) -> Result<Option<Foot>> {
        let over = toward.map(|c| 1.0 / c);
        let mut first = (most, None);
        self.boxes.search(
            &mut first,
            |first, block| entered(block, from, over, [0.0, first.0]),
            |first, leaf| {
                self.with(leaf, |piece| {
                    let local = minus(from, piece.base);
                    piece.boxes.search(
                        first,
                        |first: &(f64, Option<Foot>), block| entered(block, local, over, [0.0, first.0]),
                        |first, n| {
                            let span = [LEAVE, first.0];
                            let met = piece.patches[n].met(&piece.rings, (local, toward), span, outward);
                            if let Some((distance, normal)) = met {
                                let at = std::array::from_fn(|a| from[a] + distance * toward[a]);
                                let place = Place { leaf: leaf as u32, patch: n as u32 };
                                let foot = Foot { at, normal, distance, inside: outward, place };
                                *first = (distance, Some(foot));
                            }
                            Ok(())
                        },
                    )
                })
            },
        )?;
        Ok(first.1)
    }

    /// The radius of the largest ball that touches a place with unit normal `toward` on this side of it, holds no point of the
    /// surface, and is no larger than `most`; with the point that bounds it. Surface whose normal is turned by less than
    /// `apart`, a cosine, against the normal at the place does not count.
    ///
    /// A ball shrinks to what lies in it (Ma, Bae & Choi 2012): what lies beyond a box that the ball does not reach never
    /// bounds it, since smaller balls lie within larger ones.
    ///
    /// # Errors
    /// What reading the file gives.
    pub fn ball(&self, touch: BallAt, most: f64, apart: f64) -> Result<(f64, Option<Foot>)> {
        let BallAt { at, toward, outward } = touch;
        let mut ball = Ball { at, toward, radius: most, centre: along(at, toward, most), contact: None };
        let reaches = |ball: &Ball, squared: f64| (squared < ball.radius * ball.radius).then_some(squared);
        self.boxes.search(
            &mut ball,
            |ball, block| reaches(ball, squared_from(block, ball.centre)),
            |ball, leaf| {
                self.with(leaf, |piece| {
                    let base = piece.base;
                    piece.boxes.search(
                        ball,
                        |ball: &Ball, block| reaches(ball, squared_from(block, minus(ball.centre, base))),
                        |ball, n| {
                            let patch = &piece.patches[n];
                            let facing = dot(patch.normal.map(f64::from), outward);
                            if facing <= apart {
                                let place = Place { leaf: leaf as u32, patch: n as u32 };
                                ball.shrink((piece, patch), facing, place);
                            }
                            Ok(())
                        },
                    )
                })
            },
        )?;
        Ok((ball.radius, ball.contact))
    }

    /// Patches of a leaf: where each is, its normal, and its area, in cells.
    ///
    /// # Errors
    /// What reading the file gives.
    pub fn patches_of(&self, leaf: usize) -> Result<Vec<PatchInfo>> {
        self.with(leaf, |piece| {
            let info = |patch: &Patch| PatchInfo {
                at: std::array::from_fn(|a| f64::from(patch.at[a]) + piece.base[a]),
                normal: patch.normal.map(f64::from),
                area: patch.area(&piece.rings),
                corners: patch
                    .corners(&piece.rings)
                    .map(|c| std::array::from_fn(|a| ((c[a] + piece.base[a]) * 512.0).round() as i64))
                    .collect(),
            };
            Ok(piece.patches.iter().map(info).collect())
        })
    }

    /// Fails where there is no surface at all.
    pub(super) fn require_any(&self) -> Result<()> {
        if self.keys.is_empty() {
            return Err(Error::setting("the store has no surface", "build it with finer cells"));
        }
        Ok(())
    }
}

impl PatchInfo {
    /// A place in the solid beside the crossing, in cells.
    pub(super) fn inner(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.at[a] - INNER * self.normal[a])
    }
}

/// A crossing with its patch.
pub struct PatchInfo {
    /// Where it is, in cells.
    pub at: [f64; 3],
    /// The unit normal, outward.
    pub normal: [f64; 3],
    /// The area of its polygon, in square cells.
    pub area: f64,
    /// Corners of its polygon in 512ths of a cell, which tell which patches touch.
    pub corners: Vec<[i64; 3]>,
}

/// Where a ball touches the surface.
#[derive(Clone, Copy, Debug)]
pub struct BallAt {
    /// The place, in cells.
    pub at: [f64; 3],
    /// Unit vector from there to the ball's centre.
    pub toward: [f64; 3],
    /// The outward unit normal of the surface there.
    pub outward: [f64; 3],
}

fn along(at: [f64; 3], toward: [f64; 3], length: f64) -> [f64; 3] {
    std::array::from_fn(|a| at[a] + length * toward[a])
}

struct Nearest {
    within: f64,
    best: Option<Foot>,
    /// How well the best one sees the place: the cosine between its normal and the way to the place.
    aligned: f64,
}

impl Nearest {
    fn take(&mut self, touch: Touch, local: [f64; 3], base: [f64; 3], place: Place) {
        let away = minus(local, touch.at);
        let distance = touch.squared.max(0.0).sqrt();
        let side = dot(away, touch.normal);
        let aligned = side.abs() / distance.max(f64::MIN_POSITIVE);
        let is_nearer = self.best.is_none() || touch.squared < self.within * (1.0 - TIE);
        if is_nearer || aligned > self.aligned {
            let at = std::array::from_fn(|a| touch.at[a] + base[a]);
            self.aligned = aligned;
            let best = Foot { at, normal: touch.normal, distance, inside: side < 0.0, place };
            self.best = Some(best);
        }
        self.within = self.within.min(touch.squared);
    }
}

struct Ball {
    at: [f64; 3],
    toward: [f64; 3],
    radius: f64,
    centre: [f64; 3],
    contact: Option<Foot>,
}

impl Ball {
    /// Shrinks until the patch has no point in it.
    fn shrink(&mut self, (piece, patch): (&Piece, &Patch), facing: f64, place: Place) {
        const STEPS: usize = 8;
        let local = minus(self.at, piece.base);
        for _ in 0..STEPS {
            let centre = minus(self.centre, piece.base);
            let within = self.radius * self.radius;
            let Some(touch) = patch.nearest(&piece.rings, centre, within) else { return };
            let away = minus(touch.at, local);
            let depth = dot(away, self.toward);
            if depth <= 0.0 || (facing > 0.0 && depth < SHALLOW) {
                return;
            }
            let radius = 0.5 * dot(away, away) / depth;
            if radius >= self.radius * (1.0 - 1e-12) {
                return;
            }
            let at = std::array::from_fn(|a| touch.at[a] + piece.base[a]);
            let distance = dot(away, away).sqrt();
            self.contact = Some(Foot { at, normal: touch.normal, distance, inside: true, place });
            let is_done = radius > self.radius * (1.0 - 1e-7);
            self.radius = radius;
            self.centre = along(self.at, self.toward, radius);
            if is_done {
                return;
            }
        }
    }
}
