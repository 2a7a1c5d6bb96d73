//! Bricks of unions against the intervals of all their solids, one by one.

use super::*;
use crate::brick::{Brick, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};
use proptest::prelude::*;

/// A mill of so many moves: balls with shafts, half upright and half tilted, each move where the last one ended.
fn moves(ends: &[[f64; 3]], radius: f64) -> Vec<SweptSolid> {
    let (sine, cosine) = 0.3f64.sin_cos();
    let tilted = [[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]];
    let mut solids = Vec::new();
    for (n, pair) in ends.windows(2).enumerate() {
        let way = [0, 1, 2].map(|a| pair[1][a] - pair[0][a]);
        let frame = if n % 2 == 0 { ConvexSolid::UPRIGHT } else { tilted };
        let at = pair[0];
        solids.push(SweptSolid::new(ConvexSolid::Ball { at, way, radius }));
        let (height, radius) = ([0.0, 9.0 * radius], [radius; 2]);
        solids.push(SweptSolid::new(ConvexSolid::Frustum { at, way, frame, height, radius }));
    }
    solids
}

/// Where samples of a node stand.
fn place(key: NodeKey, ijk: [usize; 3]) -> [f64; 3] {
    let (low, size) = cube_of(key);
    [0, 1, 2].map(|a| low[a] + ijk[a] as f64 * size / 32.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn bricks_are_those_of_the_union(
        ends in prop::collection::vec(prop::array::uniform3(-0.1f64..1.1), 2..24),
        radius in 0.02f64..0.3,
        part in prop::array::uniform3(0.0f64..1.0),
    ) {
        let key = NodeKey::ROOT;
        let (low, size) = cube_of(key);
        let step = size / 32.0;
        // Many short moves and some long ones.
        let mut at = ends[0];
        let ends: Vec<[f64; 3]> = ends.iter().enumerate().map(|(n, end)| {
            let share = if n % 5 == 0 { 1.0 } else { 0.03 };
            at = [0, 1, 2].map(|a| at[a] + share * (end[a] - at[a]));
            [0, 1, 2].map(|a| low[a] + at[a] * size)
        }).collect();
        let solids = moves(&ends, radius * size);
        let list: Vec<u32> = (0..solids.len() as u32).collect();
        let mut evaluator = SweptEvaluator::default();
        let brick = evaluator.brick(key, &solids, &list, &WantedSamples::all());
        let all = (0..BRICK_POINTS).flat_map(|k| (0..BRICK_POINTS).flat_map(move |j| (0..BRICK_POINTS).map(move |i| [i, j, k])));
        for ijk in all.clone() {
            let inside = solids.iter().any(|solid| solid.contains(place(key, ijk)));
            prop_assert_eq!(brick.sample(ijk) == 1, inside, "{:?}", ijk);
        }
        let Brick::Counts { samples, hermite } = &brick else { return Ok(()) };
        let signs = SignChanges::of(samples);
        // A part of the space, whose boundary is elsewhere.
        let mut of_part = SignChanges::outside();
        for row in 0..BRICK_POINTS * BRICK_POINTS {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            let is_in = (j as f64) < part[1] * 33.0 && (k as f64) < part[2] * 33.0;
            of_part.set_row(j, k, if is_in { (1 << (part[0] * 33.0) as u64) - 1 } else { 0 });
        }
        let wanted = WantedSamples::around(&of_part);
        let few = evaluator.brick(key, &solids, &list, &wanted);
        for ijk in all.filter(|ijk| of_part.is_inside(*ijk)) {
            prop_assert_eq!(few.sample(ijk), brick.sample(ijk));
        }
        for axis in Axis::ALL {
            let a = axis.index();
            let mut kept = Vec::new();
            signs.for_crossings(axis, hermite, |ijk, edge| {
                let mut upper = ijk;
                upper[a] += 1;
                if of_part.is_inside(ijk) || of_part.is_inside(upper) {
                    kept.push((ijk, edge));
                }
                let lower = place(key, ijk);
                let at = lower[a] + edge.fraction() * step;
                let inward = if signs.is_inside(ijk) { -1.0 } else { 1.0 };
                let intervals: Vec<Interval> = solids.iter().filter_map(|solid| solid.line(a, lower)).collect();
                let in_union = |t: f64| intervals.iter().any(|i| i.low.at - 1e-5 * step <= t && t <= i.high.at + 1e-5 * step);
                let deeper = at + inward * 1e-3 * step;
                let is_clamped = (deeper - lower[a]) * (deeper - lower[a] - step) > 0.0;
                assert!(is_clamped || in_union(deeper), "{axis:?} {ijk:?}");
                let beyond = at - inward * 1e-3 * step;
                let is_clamped = (beyond - lower[a]) * (beyond - lower[a] - step) > 0.0;
                // A gap that is thinner than this may follow.
                let is_out = !in_union(beyond) || intervals.iter().any(|i| (i.low.at - at).abs().min((i.high.at - at).abs()) < 1e-3 * step);
                assert!(is_clamped || is_out, "{axis:?} {ijk:?}");
            });
            if let Brick::Counts { samples, hermite } = &few {
                let signs = SignChanges::of(samples);
                let mut same = Vec::new();
                signs.for_crossings(axis, hermite, |ijk, edge| {
                    let mut upper = ijk;
                    upper[a] += 1;
                    if of_part.is_inside(ijk) || of_part.is_inside(upper) {
                        same.push((ijk, edge));
                    }
                });
                prop_assert_eq!(same, kept);
            } else {
                prop_assert!(kept.is_empty());
            }
        }
    }
}
