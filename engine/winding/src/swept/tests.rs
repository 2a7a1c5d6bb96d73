//! Intervals against a search for the place of the tool, which shares no formula with them.

use super::*;
use crate::lattice::{cross, dot};
use proptest::prelude::*;

/// How far a point is outside of a solid that moves, by the steps of the move that suit it best: below 0 inside.
fn outside(shape: &ConvexSolid, at: [f64; 3]) -> f64 {
    let still = |s: f64| match shape {
        ConvexSolid::Box { low, high } => {
            (0..3).map(|a| (low[a] - at[a]).max(at[a] - high[a])).fold(f64::NEG_INFINITY, f64::max)
        }
        ConvexSolid::Ball { at: centre, way, radius } => {
            let off = [0, 1, 2].map(|a| at[a] - centre[a] - s * way[a]);
            dot(off, off).sqrt() - radius
        }
        ConvexSolid::Frustum { at: place, way, frame, height, radius } => {
            let off = [0, 1, 2].map(|a| at[a] - place[a] - s * way[a]);
            let [x, y, z] = frame.map(|row| dot(row, off));
            let slope = (radius[1] - radius[0]) / (height[1] - height[0]);
            let side = x.hypot(y) - (radius[0] + slope * (z - height[0]));
            side.max(height[0] - z).max(z - height[1])
        }
    };
    // Convex in s.
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for _ in 0..200 {
        let third = (to - from) / 3.0;
        if still(from + third) < still(to - third) { to -= third } else { from += third }
    }
    still(0.5 * (from + to)).min(still(0.0)).min(still(1.0))
}

/// A frame whose third row is near this direction.
fn frame(axis: [f64; 3]) -> [[f64; 3]; 3] {
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        v.map(|c| c / length)
    };
    let up = unit(axis);
    let side = unit(cross(up, if up[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] }));
    [side, cross(up, side), up]
}

fn check(shape: ConvexSolid, axis: usize, at: [f64; 3]) -> Result<(), TestCaseError> {
    let solid = SweptSolid::new(shape);
    let outside_at = |t: f64| {
        let mut at = at;
        at[axis] = t;
        outside(&shape, at)
    };
    let [low, high] = solid.bounds();
    match solid.line(axis, at) {
        Some(Interval { low, high }) => {
            for end in [low, high] {
                prop_assert!(
                    outside_at(end.at).abs() < 1e-5,
                    "{shape:?} {axis} {at:?}: {end:?} {}",
                    outside_at(end.at)
                );
            }
            prop_assert!(outside_at(0.5 * (low.at + high.at)) < 1e-6);
            let reach = high.at - low.at;
            for beyond in [0.01, 0.3, 2.0] {
                prop_assert!(outside_at(low.at - beyond * reach) > -1e-6, "{shape:?} {axis} {at:?}");
                prop_assert!(outside_at(high.at + beyond * reach) > -1e-6, "{shape:?} {axis} {at:?}");
            }
            for end in [low, high] {
                // Outward of the surface, and never across it.
                let mut place = at;
                place[axis] = end.at;
                let normal = solid.outward(axis, at, &end);
                let size = dot(normal, normal).sqrt();
                prop_assert!(size > 0.0);
                let off = [0, 1, 2].map(|a| place[a] + 1e-3 * normal[a] / size);
                prop_assert!(outside(&shape, off) > 0.0, "{shape:?} {axis} {at:?} {end:?} {normal:?}");
            }
        }
        None => {
            for n in 0..=100 {
                let t = low[axis] + (high[axis] - low[axis]) * f64::from(n) / 100.0;
                prop_assert!(outside_at(t) > -1e-5, "{shape:?} {axis} {at:?} {t}");
            }
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn lines_meet_what_moves_where_a_search_says(
        seed in prop::array::uniform3(-50.0f64..50.0),
        way in prop::array::uniform3(-60.0f64..60.0),
        still in 0usize..8,
        tilt in prop::array::uniform3(-1.0f64..1.0),
        radius in prop::array::uniform2(0.0f64..20.0),
        height in 1.0f64..40.0,
        axis in 0usize..3,
        kind in 0usize..4,
    ) {
        // Moves across, along, and not at all are special cases.
        let way = [0, 1, 2].map(|a| if still >> a & 1 == 1 { 0.0 } else { way[a] });
        let upright = ConvexSolid::UPRIGHT;
        let shape = match kind {
            0 => ConvexSolid::Ball { at: [0.0; 3], way, radius: radius[0] + 1.0 },
            1 => ConvexSolid::Frustum { at: [0.0; 3], way, frame: upright, height: [0.0, height], radius: [radius[0] + 0.5; 2] },
            2 => ConvexSolid::Frustum { at: [0.0; 3], way, frame: upright, height: [0.0, height], radius: [radius[0], radius[1] + 0.1] },
            _ => ConvexSolid::Frustum { at: [0.0; 3], way, frame: frame([tilt[0], tilt[1], tilt[2] + 1.5]), height: [0.0, height], radius: [radius[0], radius[1] + 0.1] },
        };
        check(shape, axis, seed)?;
        // Nearer, so that most lines meet it.
        check(shape, axis, seed.map(|c| c * 0.2))?;
    }

    /// What is told of cubes is never wrong.
    #[test]
    fn cubes_that_are_missed_or_covered_are_so(
        way in prop::array::uniform3(-60.0f64..60.0),
        low in prop::array::uniform3(-60.0f64..60.0),
        size in 1.0f64..30.0,
        radius in prop::array::uniform2(1.0f64..40.0),
        tilt in -1.0f64..1.0,
        kind in 0usize..2,
        at in prop::array::uniform3(0.0f64..1.0),
    ) {
        let shape = match kind {
            0 => ConvexSolid::Ball { at: [0.0; 3], way, radius: radius[0] },
            _ => ConvexSolid::Frustum { at: [0.0; 3], way, frame: frame([tilt, 0.2, 1.0]), height: [-10.0, 30.0], radius },
        };
        let solid = SweptSolid::new(shape);
        let point = [0, 1, 2].map(|a| low[a] + size * at[a]);
        let (missed, covered) = (solid.misses_cube(low, size), solid.covers_cube(low, size));
        prop_assert!(!(missed && covered));
        if missed { prop_assert!(outside(&shape, point) > 0.0) }
        if covered { prop_assert!(outside(&shape, point) < 0.0) }
    }
}

proptest! {
    /// Points are as far as the nearest of many points of the surface.
    #[test]
    fn distances_are_those_of_the_nearest_point(
        way in prop::array::uniform3(-30.0f64..30.0),
        flat in 0usize..3,
        radius in prop::array::uniform2(1.0f64..20.0),
        at in prop::array::uniform3(-70.0f64..70.0),
        turn in prop::array::uniform3(-1.0f64..1.0),
    ) {
        let way = [way[0], way[1], if flat == 0 { 0.0 } else { way[2] }];
        let radius = if flat == 1 { [radius[0]; 2] } else { radius };
        let shape = ConvexSolid::Frustum { at: [0.0; 3], way, frame: ConvexSolid::UPRIGHT, height: [-4.0, 12.0], radius };
        let solid = SweptSolid::new(shape);
        let distance = solid.distance(at);
        prop_assert_eq!(distance < 0.0, outside(&shape, at) < 0.0);
        // Nothing of the solid is nearer.
        let size = dot(turn, turn).sqrt().max(1e-3);
        let near = [0, 1, 2].map(|a| at[a] + turn[a] / size * distance.max(0.0) * 0.999);
        prop_assert!(distance <= 0.0 || outside(&shape, near) > -1e-6);
        // And something of it is as near: the distance falls by the step towards it.
        if distance > 0.0 {
            let slope = [0, 1, 2].map(|a| {
                let mut moved = at;
                moved[a] += 1e-3;
                (solid.distance(moved) - distance) / 1e-3
            });
            prop_assert!((dot(slope, slope).sqrt() - 1.0).abs() < 0.02, "{slope:?}");
        }
    }
}
