//! The surface that the points of a cloud were measured on, as far as they tell: around each place the quadratic form through the
//! nearest of them (Levin 1998), by least squares.

use super::answers::ReferencePoint;
use super::motion::Motion;
use super::sides::Sides;
use super::surface::Surface;
use crate::error::{Error, Result};
use crate::lattice::{dot, frame, minus, solved_positive};
use crate::soup::PointCloud;
use crate::winding::{KdTree, by_place, plane_normal};

/// Points that a form goes through: three times what it has unknowns.
const NEIGHBOURS: usize = 18;
const UNKNOWNS: usize = 6;
/// A place lies beside the points where it is farther from their middle, along their plane, than this part of how far they reach,
/// since they end there; and in a hole where the nearest is farther. Of scattered points one place in 100,000 seems to be in one.
const BESIDE: f64 = 0.8;
const BARE: f64 = 0.7;
/// Points that spread less across than along their plane, by the ratio of variances, are the border that is nearest to a place far
/// from all.
const ROUND: f64 = 0.1;
/// The least cosine between the normal of the part and that of the points: what is turned more is another face.
const ALIKE: f64 = 0.5;

/// The points of a cloud, found by place.
pub struct CloudSurface {
    tree: KdTree<[f64; 3]>,
    bounds: [[f64; 3]; 2],
}

/// A cloud beside a part, whose normals tell the sides of its points.
#[derive(Clone, Copy)]
pub struct MeasuredPart<'a> {
    /// The cloud.
    pub cloud: &'a CloudSurface,
    /// The part, and its samples.
    pub part: &'a Surface,
    /// See `part`.
    pub sides: &'a Sides<'a>,
    /// What takes the part to the cloud.
    pub motion: Motion,
}

/// The surface around a place.
struct LocalForm {
    /// The nearest point.
    nearest: [f64; 3],
    /// The unit normal below the place, to either side.
    normal: [f64; 3],
    /// How far the place is along it, above 0 on its side.
    height: f64,
    /// Whether the points lie around the place, not beside it.
    is_covered: bool,
}

impl CloudSurface {
    /// Of points, in any order and with any repeated.
    ///
    /// # Errors
    /// If there are too few; if a file for sorting them cannot be made.
    pub fn new(cloud: PointCloud) -> Result<CloudSurface> {
        let (low, high) = cloud.bounds();
        let mut points = cloud.points;
        // Repeated ones would leave a form less than it needs.
        points.sort_by(|p, q| by_place(*p, *q))?;
        points.dedup_by(|p, q| p == q);
        if points.len() < NEIGHBOURS {
            let what = format!("a cloud of {} different points tells no surface", points.len());
            return Err(Error::setting(what, format!("give at least {NEIGHBOURS}")));
        }
        Ok(CloudSurface { tree: KdTree::new(points), bounds: [low, high] })
    }

    /// The box around all points.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        self.bounds
    }

    /// All of its different points; those that are near each other are mostly together.
    pub fn points(&self) -> &[[f64; 3]] {
        self.tree.points()
    }

    /// Every so manieth point, so that these are at most so many.
    pub fn samples(&self, most: usize) -> Vec<[f64; 3]> {
        let points = self.points();
        points.iter().step_by(points.len().div_ceil(most).max(1)).copied().collect()
    }

    /// The form through the nearest points of a place. Of those on a line it is their plane.
    fn around(&self, from: [f64; 3]) -> LocalForm {
        let near = self.tree.around(from, NEIGHBOURS);
        let places = || near.iter().map(|neighbour| neighbour.place);
        let count = near.len() as f64;
        let middle: [f64; 3] = std::array::from_fn(|a| places().map(|p| p[a]).sum::<f64>() / count);
        let normal = plane_normal(places());
        let [u, v] = frame(normal);
        let local = |p: [f64; 3]| {
            let away = minus(p, middle);
            [dot(away, u), dot(away, v), dot(away, normal)]
        };
        let square = |[x, y, _]: [f64; 3]| x * x + y * y;
        let reach = places().map(|p| square(local(p))).fold(f64::MIN_POSITIVE, f64::max).sqrt();
        let [x, y, z] = local(from);
        let beside = |p: [f64; 3]| square(minus(local(p), [x, y, z]));
        let bare = places().map(beside).fold(f64::INFINITY, f64::min).sqrt();
        let moment = |of: fn([f64; 3]) -> f64| places().map(|p| of(local(p))).sum::<f64>();
        let (xx, xy, yy) = (moment(|p| p[0] * p[0]), moment(|p| p[0] * p[1]), moment(|p| p[1] * p[1]));
        let turn = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let is_round = 0.5 * (xx + yy) - turn >= ROUND * (0.5 * (xx + yy) + turn);
        let (mut matrix, mut rhs) = ([[0.0; UNKNOWNS]; UNKNOWNS], [0.0; UNKNOWNS]);
        for p in places() {
            let [x, y, z] = local(p).map(|c| c / reach);
            let row = [1.0, x, y, x * x, x * y, y * y];
            for n in 0..UNKNOWNS {
                (0..UNKNOWNS).for_each(|m| matrix[n][m] += row[n] * row[m]);
                rhs[n] += row[n] * z;
            }
        }
        let [c, cx, cy, cxx, cxy, cyy] = solved_positive(matrix, rhs, UNKNOWNS).unwrap_or_default();
        let (s, t) = (x / reach, y / reach);
        let slope = [cx + 2.0 * cxx * s + cxy * t, cy + cxy * s + 2.0 * cyy * t];
        let steep = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        let below = reach * (c + cx * s + cy * t + cxx * s * s + cxy * s * t + cyy * t * t);
        LocalForm {
            nearest: near[0].place,
            normal: std::array::from_fn(|a| (normal[a] - slope[0] * u[a] - slope[1] * v[a]) / steep),
            height: (z - below) / steep,
            is_covered: square([x, y, z]).sqrt() <= BESIDE * reach && bare <= BARE * reach && is_round,
        }
    }
}

impl MeasuredPart<'_> {
    /// What was measured of the part's surface at a place of it, which lies in the cloud's space: how far the part lies outside of
    /// the points, below 0 within. Not a number where no points were measured.
    pub fn opposite(&self, from: [f64; 3]) -> ReferencePoint {
        let form = self.cloud.around(from);
        let outward = self.outward(from);
        // The nearest points may be those of the other side of a wall.
        let is_own =
            outward.zip(self.outward(form.nearest)).is_some_and(|(own, other)| dot(own, other) > 0.0);
        let facing = outward.map_or(0.0, |outward| dot(outward, form.normal));
        if !form.is_covered || !is_own || facing.abs() < ALIKE {
            return ReferencePoint { at: from, normal: [0.0; 3], signed: f64::NAN };
        }
        let at = std::array::from_fn(|a| from[a] - form.height * form.normal[a]);
        let side = facing.signum();
        ReferencePoint { at, normal: form.normal.map(|c| side * c), signed: side * form.height }
    }

    /// The outward normal of the part nearest to a place of the cloud's space.
    fn outward(&self, from: [f64; 3]) -> Option<[f64; 3]> {
        let foot = self.part.closest(self.part.to_cells(self.motion.undo(from)), f64::INFINITY)?;
        Some(self.motion.turn(foot.normal))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{MIDDLE, ball, surface, tree};
    use super::*;
    use crate::large_array::LargeArray;
    use crate::lattice::mix;

    /// Points spread over a ball, but for a cap, each off by up to so much.
    fn points_of_ball(count: u64, (centre, radius): ([f64; 3], f64), off: f64) -> PointCloud {
        let random = |n: u64| (mix(n) >> 11) as f64 / (1u64 << 53) as f64;
        let point = |n: u64| {
            let z = 2.0 * random(3 * n) - 1.0;
            let (sin, cos) = (std::f64::consts::TAU * random(3 * n + 1)).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            let r = radius + off * (2.0 * random(3 * n + 2) - 1.0);
            let way = [flat * cos, flat * sin, z];
            (z > -0.5).then(|| std::array::from_fn(|a| centre[a] + r * way[a]))
        };
        let points: Vec<[f64; 3]> = (0..count).filter_map(point).collect();
        PointCloud { points: LargeArray::from(points), normals: LargeArray::default() }
    }

    #[test]
    fn a_ball_is_found_from_its_points_and_what_was_not_measured_has_no_number() {
        let (centre, radius) = (MIDDLE, 20.0);
        let tree = tree(&ball(radius));
        let (part, sides) = (surface(&tree), Sides::new(&tree).unwrap());
        for (grown, off, most, rms) in
            [(0.0, 0.0, 2e-3, 2e-4), (0.2, 0.0, 2e-3, 2e-4), (-0.3, 0.05, 0.1, 0.02)]
        {
            let cloud = CloudSurface::new(points_of_ball(40_000, (centre, radius + grown), off)).unwrap();
            let measured = MeasuredPart { cloud: &cloud, part: &part, sides: &sides, motion: Motion::NONE };
            let (mut found, mut none, mut squares) = (0, 0, 0.0);
            for n in 0..2000u64 {
                let way = [0, 1, 2].map(|a| mix(3 * n + a) as f64 / u64::MAX as f64 - 0.5);
                let way = way.map(|c| c / dot(way, way).sqrt());
                let told = measured.opposite(std::array::from_fn(|a| centre[a] + radius * way[a]));
                if way[2] > -0.45 {
                    let miss = told.signed + grown;
                    assert!(miss.abs() < most, "{way:?}: {miss}");
                    squares += miss * miss;
                    assert!(dot(told.normal, way) > 0.999 - 3.0 * off);
                    found += 1;
                } else if way[2] < -0.55 {
                    assert!(told.signed.is_nan(), "{way:?}: {}", told.signed);
                    none += 1;
                }
            }
            let mean = (squares / f64::from(found)).sqrt();
            assert!(found > 1000 && none > 300 && mean < rms, "{found} {none} {mean}");
        }
    }

    #[test]
    fn too_few_points_are_refused() {
        let few = LargeArray::from(vec![[1.0, 2.0, 3.0]; 100]);
        let few = PointCloud { points: few, normals: LargeArray::default() };
        let text = CloudSurface::new(few).err().unwrap().to_string();
        assert!(text.contains("1 different points"), "{text}");
    }
}
