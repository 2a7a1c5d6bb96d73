//! Crossings of one face in a cell: sums of whole numbers, so that no order shows, and bounds on what they leave out.

use crate::bsp::{Clip, ONE, SplatInput};
use crate::lattice::{dot, length, minus, unit};

/// Parts of a lattice unit in which places are counted.
pub(super) const PARTS: i64 = 256;
/// Normals of one face are within 25 degrees of their mean.
pub(super) const SAME_FACE: f64 = 0.906_307_787_036_65;
/// A splat may lose so much of what it stands for to another that cuts it, as a share of the cell.
const LOST_MAX: f64 = 0.1;

/// Crossings of one face in a cell, or what was merged of such. Lengths are in 1/256 of a lattice unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrossingCluster {
    /// Sum of unit normals in 1/16384.
    pub normals: [i64; 3],
    /// Sum of places.
    pub places: [i64; 3],
    pub count: i64,
    /// Signed distances of what it stands for from the plane through the mean lie between these.
    pub low: f64,
    pub high: f64,
    /// What it stands for is no farther than this from the mean.
    pub reach: f64,
}

impl CrossingCluster {
    const NONE: CrossingCluster =
        CrossingCluster { normals: [0; 3], places: [0; 3], count: 0, low: 0.0, high: 0.0, reach: 0.0 };

    fn add(&mut self, normals: [i64; 3], places: [i64; 3], count: i64) {
        for axis in 0..3 {
            self.normals[axis] += normals[axis];
            self.places[axis] += places[axis];
        }
        self.count += count;
    }

    /// The unit normal.
    pub fn normal(&self) -> [f64; 3] {
        unit(self.normals.map(|c| c as f64))
    }

    /// The mean place.
    pub fn mean(&self) -> [f64; 3] {
        self.places.map(|c| c as f64 / self.count as f64)
    }

    /// Half the width of the slab that holds what it stands for.
    pub fn error(&self) -> f64 {
        (self.high - self.low) / 2.0
    }

    /// A point of the plane in the middle of that slab.
    pub fn middle(&self) -> [f64; 3] {
        let (mean, normal) = (self.mean(), self.normal());
        let shift = (self.low + self.high) / 2.0;
        std::array::from_fn(|axis| mean[axis] + normal[axis] * shift)
    }

    /// As it is written, in a cell of this centre and size.
    pub fn wanted(&self, centre: [f64; 3], cell: f64) -> SplatInput {
        let part = 4096.0 / cell;
        let mean = minus(self.middle(), centre).map(|c| (c * part).round().clamp(-8192.0, 8192.0) as i16);
        // What rounding moves is less than a part along each axis.
        let error = (self.error() * part).ceil().clamp(0.0, 16_384.0) as u32 + 2;
        SplatInput { normal: self.normal().map(|c| (c * f64::from(ONE)).round() as i16), mean, error }
    }
}

/// A crossing: a unit normal in 1/16384, and a place.
#[derive(Clone, Copy)]
pub(super) struct ClusterPoint {
    pub normal: [i64; 3],
    pub place: [i64; 3],
}

/// Sorts things into at most three faces by their normals: gives for each its face, and the sums of each.
fn faces(normals: impl Iterator<Item = ([i64; 3], [i64; 3], i64)>) -> (Vec<usize>, Vec<CrossingCluster>) {
    let (mut face_of, mut faces) = (Vec::new(), Vec::<CrossingCluster>::new());
    for (normal, place, count) in normals {
        let direction = unit(normal.map(|c| c as f64));
        let best = (0..faces.len())
            .map(|n| (dot(direction, faces[n].normal()), n))
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let face = match best {
            Some((cosine, face)) if cosine > SAME_FACE || faces.len() == crate::bsp::SPLATS_MAX => face,
            _ => {
                faces.push(CrossingCluster::NONE);
                faces.len() - 1
            }
        };
        faces[face].add(normal, place, count);
        face_of.push(face);
    }
    (face_of, faces)
}

/// The faces of crossings in a cell, the one with most of them first, and how they cut each other.
pub(super) fn of_crossings(crossings: &[ClusterPoint], cell: f64) -> (Vec<CrossingCluster>, u8) {
    let items = crossings.iter().map(|crossing| (crossing.normal, crossing.place, 1));
    let (face_of, mut faces) = faces(items);
    let places: Vec<[f64; 3]> = crossings.iter().map(|crossing| crossing.place.map(|c| c as f64)).collect();
    for (number, face) in faces.iter_mut().enumerate() {
        let (mean, normal) = (face.mean(), face.normal());
        for (place, _) in places.iter().zip(&face_of).filter(|(_, of)| **of == number) {
            let from = minus(*place, mean);
            let distance = dot(normal, from);
            face.low = face.low.min(distance);
            face.high = face.high.max(distance);
            face.reach = face.reach.max(length(from));
        }
    }
    ordered(faces, &face_of, &places, cell)
}

/// The faces of a cell that holds those of smaller cells, the largest first, and how they cut each other.
pub(super) fn of_clusters(parts: &[CrossingCluster], cell: f64) -> (Vec<CrossingCluster>, u8) {
    // The largest part first, so that faces begin with what matters.
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by_key(|&n| std::cmp::Reverse(parts[n].count));
    let parts: Vec<CrossingCluster> = order.into_iter().map(|n| parts[n]).collect();
    let (face_of, mut faces) = faces(parts.iter().map(|part| (part.normals, part.places, part.count)));
    for (number, face) in faces.iter_mut().enumerate() {
        let (mean, normal) = (face.mean(), face.normal());
        for (part, _) in parts.iter().zip(&face_of).filter(|(_, of)| **of == number) {
            let n = part.normal();
            let from = minus(part.mean(), mean);
            let (tilt, cosine) = (length(minus(normal, n)) * part.reach, dot(normal, n));
            let [low, high] = [part.low, part.high].map(|along| along * cosine);
            let along = dot(normal, from);
            face.reach = face.reach.max(length(from) + part.reach);
            face.low = face.low.min(along - tilt + low.min(high));
            face.high = face.high.max(along + tilt + low.max(high));
        }
        (face.low, face.high) = (face.low.max(-face.reach), face.high.min(face.reach));
    }
    let places: Vec<[f64; 3]> = parts.iter().map(CrossingCluster::mean).collect();
    ordered(faces, &face_of, &places, cell)
}

/// Faces by size, with how each pair cuts each other.
fn ordered(
    faces: Vec<CrossingCluster>,
    face_of: &[usize],
    places: &[[f64; 3]],
    cell: f64,
) -> (Vec<CrossingCluster>, u8) {
    let mut order: Vec<usize> = (0..faces.len()).collect();
    order.sort_by_key(|&n| std::cmp::Reverse(faces[n].count));
    // How far places of a face lie before another's plane: the least and the most.
    let before = |face: usize, other: &CrossingCluster| {
        let (normal, middle) = (other.normal(), other.middle());
        let of = places.iter().zip(face_of).filter(|(_, of)| **of == face);
        of.fold([f64::MAX, f64::MIN], |[low, high], (place, _)| {
            let along = dot(normal, minus(*place, middle));
            [low.min(along), high.max(along)]
        })
    };
    let mut clips = 0;
    for (pair, [a, b]) in crate::bsp::PAIRS.into_iter().enumerate().filter(|(_, pair)| pair[1] < order.len())
    {
        let (a, b) = (order[a], order[b]);
        let cosine = dot(faces[a].normal(), faces[b].normal());
        if cosine.abs() > SAME_FACE {
            continue;
        }
        let [[low_a, high_a], [low_b, high_b]] = [before(a, &faces[b]), before(b, &faces[a])];
        let lost = cell * LOST_MAX;
        let clip = if high_a.max(high_b) < lost && low_a.min(low_b) < -lost {
            Clip::Convex
        } else if low_a.min(low_b) > -lost && high_a.max(high_b) > lost {
            Clip::Concave
        } else {
            Clip::None
        };
        clips |= clip.of_pair(pair);
    }
    (order.into_iter().map(|n| faces[n]).collect(), clips)
}
