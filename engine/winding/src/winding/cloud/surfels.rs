//! Points with the surface that each stands for.

use super::area::{NeighbourWay, cell_area};
use super::nearest::{KdTree, Located, by_place};
use crate::error::{Error, Result};
use crate::large_array::LargeArray;
use crate::lattice::length;
use crate::progress::Progress;
use crate::soup::PointCloud;
use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;

/// Cosine of the angle between the normals of two points from which on an edge lies between them: 30°.
const EDGE: f64 = 0.866;
/// The same, from which on one is on the other side of a thin wall: 127°, so that edges of 53° and more are none.
const OTHER_SIDE: f64 = -0.6;
/// Neighbours that may bound the area of a point. Of scattered points a cell has six on average, but one in three has
/// one that is not among the twelve nearest: with these alone areas were 5 % too large, and the surface that far outside.
const NEIGHBOURS: usize = 24;
/// The one whose distance bounds the cell of a point at the border of the surface.
const REACH_NEIGHBOUR: usize = 12;
/// Radius of the ball over which a point is spread, in radii of the disc with its area: of a square grid 0.85 spacings.
/// Of 10,000 random points of a torus the surface w = 0.5 is off by 0.9 % of their spacing (rms; 2.5 % at worst) for 1.5, and
/// 1.5 % (3.7 %) for 2, which is mostly that it lies inside; the less, the thinner the walls that stay apart. A density
/// without second moment, 0.6 % for 2, needs finer cells: in cells of half a spacing vertices were farther off.
const SPREAD: f64 = 1.5;
/// Room that the root leaves around the points, in spacings: so far the surface may lie beside them.
const MARGIN: f64 = 2.0;

/// A point, and the surface that it stands for, in the cloud's own unit.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Surfel {
    /// Where it is.
    pub position: [f64; 3],
    /// Outward normal with the length of its area.
    pub area: [f64; 3],
    /// Radius of the ball over which it is spread.
    pub radius: f64,
}

/// A cloud with normals as surface elements.
#[derive(Clone, Debug)]
pub struct Surfels {
    /// One for each point that has an area, by position.
    pub all: LargeArray<Surfel>,
    /// Points that have none: repeated ones, and those with a normal of length 0.
    pub void: u64,
    /// Root of the median area: the distance of neighbouring points, were they a square grid.
    pub spacing: f64,
    /// The box around all points, void ones too.
    pub points: ([f64; 3], [f64; 3]),
}

impl Surfels {
    /// Of a cloud with normals. A point's area is that of its cell among its 24 nearest neighbours, seen along its
    /// normal; those that face the other way, as across a thin wall, do not bound it. Points that coincide count once,
    /// with the first one's normal; those with a normal of length 0 not at all.
    ///
    /// # Errors
    /// [`Error::Setting`] if a point lacks a normal; if the user interrupts.
    pub fn of(cloud: PointCloud, progress: &dyn Progress) -> Result<Surfels> {
        let (count, box_of_all) = (cloud.points.len(), cloud.bounds());
        if cloud.normals.len() != count {
            return Err(Error::setting("the points have no normals", "estimate them"));
        }
        progress.phase("measuring", Some(count as u64), "points");
        let nearest = KdTree::new(distinct(cloud)?);
        let room = nearest.points().room();
        let surfel = |number: usize| {
            progress.advance(1);
            if progress.cancelled() { None } else { surfel_of(number, &nearest) }
        };
        let mut all = LargeArray::of_each(nearest.points().len(), room, surfel)?;
        progress.check()?;
        all.sort_by(|a, b| by_place(a.position, b.position))?;
        let mut areas = LargeArray::of_each(all.len(), room, |number| Some(length(all[number].area)))?;
        let spacing = match areas.len() {
            0 => 0.0,
            n => areas.select_nth_unstable_by(n / 2, f64::total_cmp).1.sqrt(),
        };
        Ok(Surfels { void: (count - all.len()) as u64, all, spacing, points: box_of_all })
    }

    /// The box that a root cube has to hold: two spacings more than the points on every side.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let margin = MARGIN * self.spacing;
        (self.points.0.map(|c| c - margin), self.points.1.map(|c| c + margin))
    }
}

/// A point of a cloud, and the direction that it faces, 0 if it has none.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct FacingPoint {
    position: [f64; 3],
    normal: [f64; 3],
    /// Its number in the cloud.
    number: u64,
}

impl FacingPoint {
    fn normal(&self) -> Option<[f64; 3]> {
        (self.normal != [0.0; 3]).then_some(self.normal)
    }
}

impl Located for FacingPoint {
    fn place(&self) -> [f64; 3] {
        self.position
    }
}

/// The points of a cloud, of those that coincide the first.
fn distinct(cloud: PointCloud) -> Result<LargeArray<FacingPoint>> {
    let PointCloud { points, normals } = cloud;
    let facing = |number: usize| {
        // Without -0, which would sort away from 0.
        let position = points[number].map(|c| c + 0.0);
        Some(FacingPoint {
            position,
            normal: unit(normals[number]).unwrap_or_default(),
            number: number as u64,
        })
    };
    let mut all = LargeArray::of_each(points.len(), points.room(), facing)?;
    drop((points, normals));
    all.sort_by(|a, b| by_place(a.position, b.position).then(a.number.cmp(&b.number)))?;
    all.dedup_by(|a, b| a.position == b.position);
    Ok(all)
}

fn surfel_of(number: usize, nearest: &KdTree<FacingPoint>) -> Option<Surfel> {
    let points = nearest.points();
    let (position, normal) = (points[number].position, points[number].normal()?);
    // The point itself is the first of them.
    let around = &nearest.around(position, NEIGHBOURS + 1)[1..];
    let ways = around.iter().filter_map(|n| {
        let other = points[n.number as usize].normal()?;
        let alike = (0..3).map(|a| normal[a] * other[a]).sum::<f64>();
        let way = std::array::from_fn(|a| n.place[a] - position[a]);
        (alike > OTHER_SIDE).then_some(NeighbourWay { way, face: (alike < EDGE).then_some(other) })
    });
    let reach = around.get(REACH_NEIGHBOUR - 1).or(around.last()).map_or(0.0, |n| n.squared).sqrt();
    let area = cell_area(normal, ways, reach);
    let radius = SPREAD * (area / PI).sqrt();
    let is_sound = area > 0.0 && area.is_finite();
    is_sound.then(|| Surfel { position, area: normal.map(|c| c * area), radius })
}

/// The direction of a vector of any length; `None` of one that has none.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    // Squares of what is left neither overflow nor vanish.
    let largest = v.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    let scaled = v.map(|c| c / largest);
    let length = length(scaled);
    (largest > 0.0).then(|| scaled.map(|c| c / length))
}
