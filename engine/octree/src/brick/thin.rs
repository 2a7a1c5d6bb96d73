//! Walls and gaps that are thinner than a cell, counted where they hide between two samples.
//!
//! A lattice edge that meets both faces of a wall, or of a gap, has samples that do not show it. Only sheets that face
//! each other count: at the edge of a solid, or where a line grazes a round one, both crossings lie on one lattice edge,
//! too, but their normals differ.

use crate::lattice::Axis;

/// Levels below a leaf by which the area of thin sheets is counted.
pub const THIN_LEVELS: usize = 16;

/// The cosine of 30°: two sheets face each other if the angle between one normal and the reverse of the other is no
/// larger. A wedge of that angle is thin near its edge.
const FACING_COSINE: f64 = 0.866_025_403_784_438_6;

/// Fractions of a lattice edge, as crossings are stored.
const EDGE: f64 = 65536.0;

/// Which lattice lines along an axis are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ThinLines {
    /// All of them: what is divided must not depend on chance.
    All,
    /// One in each block of 4 × 4, which stands for sixteen: enough to tell how much there is, at a fraction of the work.
    Sixteenth,
}

impl ThinLines {
    /// Whether the line with these indices along the two other axes is one of them.
    #[inline]
    pub fn holds(self, u: usize, v: usize) -> bool {
        match self {
            ThinLines::All => true,
            ThinLines::Sixteenth => (u + 4 * v).is_multiple_of(16),
        }
    }

    /// How many lines one of them stands for.
    fn each(self) -> u64 {
        match self {
            ThinLines::All => 1,
            ThinLines::Sixteenth => 16,
        }
    }
}

/// Two crossings of the boundary with one lattice edge, which enclose a wall or a gap.
#[derive(Clone, Copy, Debug)]
pub struct ThinPair {
    /// The axis of the edge.
    pub axis: Axis,
    /// The outward normals at both crossings, of any length.
    pub normals: [[f64; 3]; 2],
    /// The distance between them along the edge, in 1/65536 of it.
    pub chord: u32,
    /// log₂ of the length of the edge in lattice units.
    pub spacing_bits: u32,
    /// Whether what lies between them is inside.
    pub is_wall: bool,
}

/// All walls, or all gaps, of some leaves that hide between samples. Sums of integers, which are the same in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThinSheets {
    /// Lattice edges that hold both faces of one, along the axis nearest to their normals.
    pub edges: u64,
    /// The area of their mid-surfaces, in sixteenths of a squared lattice unit.
    area: u128,
    /// Their volume, in 1/65536 of a cubed lattice unit.
    volume: u128,
    /// The thinnest, in 1/65536 of a lattice unit; 0 where there is none.
    thinnest: u64,
    /// The area by the levels below the leaf on which the lattice would show them without holes.
    area_by_levels: [u128; THIN_LEVELS],
}

/// The walls and gaps of some leaves that hide between samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThinFeatures {
    /// Inside between two faces.
    pub walls: ThinSheets,
    /// Outside between two faces.
    pub gaps: ThinSheets,
    /// Bricks without a sample inside that hold a piece of solid which is no such wall: a rod, or a small body.
    pub unseen: u64,
    /// Bricks with samples side by side, on one side of the boundary, that a wall or a gap of any shape keeps apart. Known
    /// of all lines only.
    pub bridged: u64,
}

impl ThinFeatures {
    /// Whether nothing hides.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.walls.edges == 0 && self.gaps.edges == 0 && self.unseen == 0 && self.bridged == 0
    }

    /// Adds those of other leaves.
    #[inline]
    pub fn add(&mut self, other: &ThinFeatures) {
        self.walls.add(&other.walls);
        self.gaps.add(&other.gaps);
        self.unseen += other.unseen;
        self.bridged += other.bridged;
    }

    /// What was found on some lines, for all of them.
    #[inline]
    pub fn of_all(mut self, lines: ThinLines) -> ThinFeatures {
        self.walls.scale(lines.each());
        self.gaps.scale(lines.each());
        self
    }

    /// Adds a pair of crossings, if the sheets face each other and their common normal is nearest to the edge's axis: so
    /// each sheet is counted along one axis.
    pub fn add_pair(&mut self, pair: &ThinPair) {
        let Some((cosine, sum)) = pair.cosine() else { return };
        let sheets = if pair.is_wall { &mut self.walls } else { &mut self.gaps };
        let spacing = f64::from(1u32 << pair.spacing_bits);
        let thickness = f64::from(pair.chord) * cosine;
        let area = (16.0 * spacing * spacing / cosine).round() as u128;
        // As thick as that, samples between the faces are neighbours along lattice edges, with no holes between them
        // (standard digital planes; Reveillès 1991).
        let levels = (0..THIN_LEVELS - 1).find(|&k| sum * EDGE <= thickness * (1u64 << k) as f64);
        sheets.edges += 1;
        sheets.area += area;
        sheets.volume += u128::from(pair.chord) << (3 * pair.spacing_bits);
        sheets.area_by_levels[levels.unwrap_or(THIN_LEVELS - 1)] += area;
        let thickness = ((thickness * spacing) as u64).max(1);
        sheets.thinnest = if sheets.thinnest == 0 { thickness } else { sheets.thinnest.min(thickness) };
    }
}

impl ThinPair {
    /// The cosine between the edge and the sheets' common normal, and the sum of its cosines with all axes, if the sheets
    /// face each other and no axis is nearer to it; of several that are equally near the first counts.
    fn cosine(&self) -> Option<(f64, f64)> {
        let [p, q] = self.normals.map(unit);
        let (p, q) = (p?, q?);
        let facing = -(p[0] * q[0] + p[1] * q[1] + p[2] * q[2]);
        let common = unit([p[0] - q[0], p[1] - q[1], p[2] - q[2]]).filter(|_| facing >= FACING_COSINE)?;
        let cosines = common.map(f64::abs);
        let mut nearest = 0;
        for axis in 1..3 {
            nearest = if cosines[axis] > cosines[nearest] { axis } else { nearest };
        }
        (nearest == self.axis.index()).then_some((cosines[nearest], cosines.iter().sum()))
    }
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|c| c / length))
}

impl ThinSheets {
    fn add(&mut self, other: &ThinSheets) {
        self.edges += other.edges;
        self.area += other.area;
        self.volume += other.volume;
        self.thinnest = match (self.thinnest, other.thinnest) {
            (0, thickness) | (thickness, 0) => thickness,
            (mine, theirs) => mine.min(theirs),
        };
        self.area_by_levels.iter_mut().zip(&other.area_by_levels).for_each(|(mine, theirs)| *mine += theirs);
    }

    fn scale(&mut self, by: u64) {
        self.edges *= by;
        self.area *= u128::from(by);
        self.volume *= u128::from(by);
        self.area_by_levels.iter_mut().for_each(|area| *area *= u128::from(by));
    }

    /// The area of their mid-surfaces, given the length of a lattice unit.
    #[inline]
    pub fn area(&self, unit: f64) -> f64 {
        self.area as f64 / 16.0 * unit * unit
    }

    /// What they enclose, given the length of a lattice unit.
    #[inline]
    pub fn volume(&self, unit: f64) -> f64 {
        self.volume as f64 / EDGE * unit * unit * unit
    }

    /// The least distance of two faces, given the length of a lattice unit.
    #[inline]
    pub fn thinnest(&self, unit: f64) -> f64 {
        self.thinnest as f64 / EDGE * unit
    }

    /// Levels below the leaves on which the lattice would show 99% of their area without holes.
    #[inline]
    pub fn levels_needed(&self) -> u8 {
        let mut left = self.area;
        for (levels, area) in self.area_by_levels.iter().enumerate() {
            left -= area;
            if left * 100 <= self.area {
                return levels as u8;
            }
        }
        THIN_LEVELS as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(normals: [[f64; 3]; 2], chord: u32) -> ThinPair {
        ThinPair { axis: Axis::Z, normals, chord, spacing_bits: 10, is_wall: true }
    }

    #[test]
    fn a_plate_has_its_area_and_thickness() {
        // 60° from z would be nearer to another axis; at 30° a lattice line meets the plate every cos 30° cells.
        let (s, c) = (0.5, FACING_COSINE);
        let mut thin = ThinFeatures::default();
        for _ in 0..1000 {
            thin.add_pair(&pair([[s, 0.0, -c], [-s, 0.0, c]], 16384));
        }
        let ThinFeatures { walls, gaps, .. } = thin;
        assert_eq!((walls.edges, gaps), (1000, ThinSheets::default()));
        let spacing = 1024.0;
        assert!((walls.area(1.0) / (1000.0 * spacing * spacing / c) - 1.0).abs() < 1e-6);
        assert!((walls.thinnest(1.0) / (0.25 * spacing * c) - 1.0).abs() < 1e-3);
        assert!((walls.volume(1.0) / (walls.area(1.0) * walls.thinnest(1.0)) - 1.0).abs() < 1e-3);
        // A fifth of a cell, and 1.37 of one are needed.
        assert_eq!(walls.levels_needed(), 3);
    }

    #[test]
    fn other_pairs_do_not_count() {
        let mut thin = ThinFeatures::default();
        // The edge of a box, a grazed sphere, another axis, a normal that nobody knows.
        thin.add_pair(&pair([[0.0, 0.0, -1.0], [0.7, 0.0, 0.7]], 100));
        thin.add_pair(&pair([[1.0, 0.0, -0.1], [1.0, 0.0, 0.1]], 100));
        thin.add_pair(&pair([[-1.0, 0.0, -0.5], [1.0, 0.0, 0.5]], 100));
        thin.add_pair(&pair([[0.0; 3], [0.0, 0.0, 1.0]], 100));
        assert!(thin.is_empty());
        assert_eq!(thin.walls.levels_needed(), 0);
    }

    #[test]
    fn sums_do_not_depend_on_the_order() {
        let pairs: Vec<ThinPair> =
            (1..40).map(|n| pair([[0.0, 0.01, -1.0], [0.0, 0.1, 1.0]], n * 1601)).collect();
        let sum = |pairs: &mut dyn Iterator<Item = &ThinPair>| {
            let mut all = ThinFeatures::default();
            for own in pairs {
                let mut thin = ThinFeatures::default();
                thin.add_pair(own);
                all.add(&thin);
            }
            all
        };
        assert_eq!(sum(&mut pairs.iter()), sum(&mut pairs.iter().rev()));
        assert_eq!(sum(&mut pairs.iter()).walls.edges, 39);
    }
}
