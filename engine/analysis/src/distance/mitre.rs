//! Convex creases of a surface, and how far planes that meet there reach beyond them.
//!
//! Outward of a crease the nearest point is the crease itself, so that an offset is round there. The offset of the planes that
//! meet in it ends where they do: in a mitre. A crease is known by corners of patches that lie on it, less than a cell apart.

use super::answers::Place;
use super::boxes::{Boxes, Lanes, Normals, Probe, Question, block_of};
use super::patch::Patch;
use super::piece::Piece;
use super::questions::PatchQuestion;
use super::surface::Surface;
use crate::error::{Error, Result};
use crate::lattice::{dot, minus};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::wide::{Simd, f32x8};
use std::collections::BTreeMap;

/// The cosine of the least turn between faces: 20°.
const TURNED: f64 = 0.94;
/// Faces this near to a corner of patches, in cells, meet there.
const MEET: f64 = 2.0;
/// A plane passes through the corner within this, in cells: where three faces meet no cell may resolve them.
const THROUGH: f64 = 0.4;
/// How much lower the faces beside a convex crease lie, in cells.
const LOWER: f64 = 1e-3;
/// A place this far, in cells, from what is outward of the corner may be outward of the crease beside it.
const BESIDE: f64 = 1.25;
/// Parts of a cell by which corners of patches are told apart.
const PARTS: f64 = 512.0;

/// A plane: its outward unit normal, and how far along it from the origin.
type CreasePlane = ([f64; 3], f64);

/// What is known around a corner of patches on a convex crease.
#[derive(Clone)]
struct ConvexCrease {
    planes: Vec<CreasePlane>,
    /// Whether all of them meet convexly, so that no distance from them is less than their height.
    is_convex: bool,
}

/// How far planes reach at a place.
pub(super) struct Mitre {
    /// Over the planes of the crease: less than the distance from it.
    pub height: f64,
    /// The normal of the plane that it is over.
    pub normal: [f64; 3],
    corner: [f64; 3],
    is_convex: bool,
}

impl Mitre {
    /// Whether a foot is of the planes that are known here, so that their height is right where distances of patches are not.
    pub fn knows(&self, foot: [f64; 3]) -> bool {
        let away = minus(foot, self.corner);
        self.is_convex && dot(away, away) <= MEET * MEET
    }
}

/// The convex creases of a surface.
pub(super) struct Mitres {
    corners: Vec<([f64; 3], ConvexCrease)>,
    boxes: Boxes,
    /// How far mitres reach from the crease, as a multiple of the offset.
    pub limit: f64,
}

impl Mitres {
    /// Of a surface, in so many bytes.
    pub fn of(surface: &Surface, limit: f64, memory: u64, progress: &dyn Progress) -> Result<Mitres> {
        progress.phase("edges", Some(surface.leaves().len() as u64), "bricks");
        let mut found: BTreeMap<[i64; 3], ConvexCrease> = BTreeMap::new();
        let mut bytes = 0;
        let make = |_: &mut (), leaf: usize| {
            progress.check()?;
            let corners = turned_corners(&surface.piece(leaf));
            let mut met = Vec::new();
            for corner in corners {
                let at = corner.map(|c| c as f64 / PARTS);
                let crease = surface.ask(FacesAround::new(at)).crease();
                met.extend(crease.map(|crease| (corner, crease)));
            }
            Ok(met)
        };
        let take = |met: Vec<([i64; 3], ConvexCrease)>| {
            progress.advance(1);
            let planes =
                |(_, crease): &([i64; 3], ConvexCrease)| size_of_val(crease.planes.as_slice()) as u64;
            bytes += met.iter().map(|crease| 112 + planes(crease)).sum::<u64>();
            if bytes > memory {
                return Err(Error::setting(
                    "the part has more sharp edges than fit",
                    "allow more `memory`, or offset it without mitres",
                ));
            }
            found.extend(met);
            Ok(())
        };
        run_ordered(surface.leaves().len(), 8 * rayon::current_num_threads(), || (), make, take)?;
        let place = |at: [i64; 3]| at.map(|c| c as f64 / PARTS);
        let mut corners: Vec<_> = found.into_iter().map(|(at, crease)| (place(at), crease)).collect();
        // Neighbours in a box are near.
        corners.sort_by_cached_key(|(at, _)| crate::lattice::morton(at.map(|c| (c.max(0.0) * 8.0) as u32)));
        let block = |(at, _): &([f64; 3], ConvexCrease)| block_of(std::iter::once(*at), 0.0);
        let boxes = Boxes::new(corners.iter().map(block), 1);
        Ok(Mitres { corners, boxes, limit })
    }

    /// How high a place is over the planes of the nearest crease, if it lies outward of one that is within so many cells.
    pub fn at(&self, from: [f64; 3], within: f64) -> Option<Mitre> {
        let (corner, ConvexCrease { planes, is_convex }) = self.nearest(from, within)?;
        let away = minus(from, *corner);
        if beside_cone(away, planes) > BESIDE {
            return None;
        }
        let reach = (dot(away, away).sqrt() / self.limit, away);
        let heights = planes.iter().map(|(normal, along)| (dot(*normal, from) - along, *normal));
        let (height, normal) =
            heights.fold(reach, |most, height| if height.0 > most.0 { height } else { most });
        let size = dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
        let normal = normal.map(|c| c / size);
        Some(Mitre { height, normal, corner: *corner, is_convex: *is_convex })
    }

    fn nearest(&self, from: [f64; 3], within: f64) -> Option<&([f64; 3], ConvexCrease)> {
        let probe = Probe::new(from, self.boxes.size());
        let within = within * within;
        let mut near = NearestCorner { corners: &self.corners, from, probe, within, best: None };
        self.boxes.search(&mut near);
        near.best.map(|best| &self.corners[best])
    }

    /// Whether a crease may be so near.
    pub fn may_be_within(&self, from: [f64; 3], within: f64) -> bool {
        self.nearest(from, within).is_some()
    }
}

/// How far a vector is from the sums of normals with weights of 0 and more (Hildreth 1957).
fn beside_cone(vector: [f64; 3], planes: &[CreasePlane]) -> f64 {
    let mut weights = vec![0.0f64; planes.len()];
    let mut rest = vector;
    for _ in 0..30 {
        for ((normal, _), weight) in planes.iter().zip(&mut weights) {
            let next = (*weight + dot(rest, *normal)).max(0.0);
            let change = next - *weight;
            *weight = next;
            rest = std::array::from_fn(|a| rest[a] - change * normal[a]);
        }
    }
    dot(rest, rest).sqrt()
}

/// Corners of patches, in parts of a cell, around which normals turn more than patches bend, or may do so with those of
/// another piece.
fn turned_corners(piece: &Piece) -> Vec<[i64; 3]> {
    let key = |c: [f64; 3]| -> [i64; 3] {
        std::array::from_fn(|a| ((c[a] + piece.base[a]) * PARTS).round() as i64)
    };
    let mut around: BTreeMap<[i64; 3], Vec<&Patch>> = BTreeMap::new();
    for patch in piece.patches {
        patch.corners(piece.rings).for_each(|corner| around.entry(key(corner)).or_default().push(patch));
    }
    let ends = piece.boxes.whole();
    let is_border = |corner: &[i64; 3]| {
        (0..3).any(|a| {
            let c = corner[a] as f64 / PARTS - piece.base[a];
            (c - f64::from(ends[0][a])).abs() < 1.0 || (f64::from(ends[1][a]) - c).abs() < 1.0
        })
    };
    let turns = |a: &Patch, b: &Patch| {
        let away = minus(b.at.map(f64::from), a.at.map(f64::from));
        dot(a.normal_at(away), b.normal.map(f64::from)) < TURNED
    };
    let is_turned =
        |patches: &[&Patch]| patches.iter().any(|a| patches.iter().any(|b| turns(a, b) && turns(b, a)));
    around.into_iter().filter(|(at, patches)| is_border(at) || is_turned(patches)).map(|(at, _)| at).collect()
}

/// A face around a corner: its nearest crossing with the normal there, and the sum of all of its crossings.
#[derive(Clone, Copy)]
struct MetFace {
    at: [f64; 3],
    normal: [f64; 3],
    sum: [f64; 3],
    crossings: f64,
}

impl MetFace {
    /// Whether the middle of another face lies below this one.
    fn is_above(&self, other: &MetFace) -> bool {
        dot(self.normal, minus(other.sum.map(|c| c / other.crossings), self.at)) < -LOWER
    }
}

/// The patches around a place.
struct FacesAround {
    at: [f64; 3],
    probe: Probe,
    /// The square of the distance, where, the crossing, and the normal.
    found: Vec<(f64, Place, [f64; 3], [f64; 3])>,
}

impl FacesAround {
    fn new(at: [f64; 3]) -> FacesAround {
        FacesAround { at, probe: Probe::default(), found: Vec::new() }
    }

    /// The planes that meet in a convex crease, the nearest of each face.
    fn crease(mut self) -> Option<ConvexCrease> {
        self.found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut faces: Vec<MetFace> = Vec::new();
        for (_, _, at, normal) in self.found {
            match faces.iter_mut().find(|face| dot(face.normal, normal) >= TURNED) {
                Some(face) => {
                    face.sum = std::array::from_fn(|a| face.sum[a] + at[a]);
                    face.crossings += 1.0;
                }
                None => faces.push(MetFace { at, normal, sum: at, crossings: 1.0 }),
            }
        }
        faces.retain(|face| dot(face.normal, minus(self.at, face.at)) <= THROUGH);
        let passes = |face: &MetFace| dot(face.normal, minus(self.at, face.at)).abs() <= THROUGH;
        let through: Vec<MetFace> = faces.iter().copied().filter(passes).collect();
        let pairs = |faces: &[MetFace]| -> Vec<bool> {
            let pairs = (0..faces.len()).flat_map(|n| (0..n).map(move |m| (n, m)));
            pairs.map(|(n, m)| faces[n].is_above(&faces[m]) && faces[m].is_above(&faces[n])).collect()
        };
        if !pairs(&through).contains(&true) {
            return None;
        }
        let is_convex = !pairs(&faces).contains(&false);
        let planes = faces.iter().map(|face| (face.normal, dot(face.normal, face.at))).collect();
        Some(ConvexCrease { planes, is_convex })
    }
}

impl PatchQuestion for FacesAround {
    fn count_from(&mut self, base: [f64; 3], size: f32) {
        self.probe = Probe::new(minus(self.at, base), size);
    }

    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        boxes.squared_from(simd, &self.probe, (MEET * MEET) as f32)
    }

    fn counts(&self, _: f32) -> bool {
        true
    }

    fn visit(&mut self, piece: &Piece, place: Place) -> bool {
        let patch = piece.patch(place);
        let at: [f64; 3] = std::array::from_fn(|a| f64::from(patch.at[a]) + piece.base[a]);
        let away = minus(at, self.at);
        if dot(away, away) <= MEET * MEET {
            self.found.push((dot(away, away), place, at, patch.normal.map(f64::from)));
        }
        false
    }
}

/// The corner that is nearest to a place.
struct NearestCorner<'a> {
    corners: &'a [([f64; 3], ConvexCrease)],
    from: [f64; 3],
    probe: Probe,
    within: f64,
    best: Option<usize>,
}

impl Question for NearestCorner<'_> {
    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        boxes.squared_from(simd, &self.probe, (self.within as f32).next_up())
    }

    fn counts(&self, nearness: f32) -> bool {
        f64::from(nearness) <= self.within
    }

    fn visit(&mut self, thing: usize) -> bool {
        let away = minus(self.from, self.corners[thing].0);
        let squared = dot(away, away);
        if squared < self.within {
            (self.within, self.best) = (squared, Some(thing));
        }
        false
    }
}
