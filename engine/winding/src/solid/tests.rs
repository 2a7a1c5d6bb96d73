//! Solids against a distance test that shares no code with them.

use super::*;
use crate::brick::{Brick, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};
use proptest::prelude::*;

type V = [f64; 3];

fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn along(a: V, t: f64, b: V) -> V {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(a: V) -> V {
    a.map(|c| c / dot(a, a).sqrt())
}

/// How deep a point lies outside the solid: below 1 inside, in multiples of the section's size. The upward
/// direction is the axis without its part along the segment; what is nearest is found in the plane.
fn oracle(segment: &Segment, profile: &SolidProfile, outline: Outline, p: V) -> f64 {
    let [a, b] = [segment.a, segment.b].map(|v| v.map(f64::from));
    let direction = sub(b, a);
    let up = if direction == [0.0; 3] {
        unit(profile.axis)
    } else {
        let u = unit(direction);
        let rest = along(profile.axis, -dot(profile.axis, u), u);
        if dot(rest, rest) < 1e-12 {
            let least = (0..3).min_by(|&i, &j| u[i].abs().total_cmp(&u[j].abs())).unwrap();
            let mut e = [0.0; 3];
            e[least] = 1.0;
            let side = unit(along([0.0; 3], 1.0, cross(e, u)));
            cross(u, side)
        } else {
            unit(rest)
        }
    };
    let from_a = sub(p, a);
    let height = dot(from_a, up);
    let in_plane = along(from_a, -height, up);
    let t = match dot(direction, direction) {
        0.0 => 0.0,
        squared => (dot(in_plane, direction) / squared).clamp(0.0, 1.0),
    };
    let off = along(in_plane, -t, direction);
    let across = dot(off, off).sqrt();
    let (w, h) = (profile.half_width, profile.half_height);
    match outline {
        Outline::Ellipse => (across / w).powi(2) + (height / h).powi(2),
        Outline::Stadium => {
            let r = w.min(h);
            let x = (across - (w - r)).max(0.0);
            let y = (height.abs() - (h - r)).max(0.0);
            (x * x + y * y) / (r * r)
        }
    }
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A brick of 33³ samples, 512 units apart, in the middle of the root.
fn key() -> NodeKey {
    NodeKey::new(10, [500, 511, 300]).unwrap()
}

fn sample_position(ijk: [usize; 3]) -> V {
    let base = key().base();
    [0, 1, 2].map(|a| f64::from(base[a] + ((ijk[a] as i32) << key().spacing_bits()) + 1))
}

/// Random ends around the brick, with several sorts of direction.
fn ends() -> impl Strategy<Value = ([i32; 3], [i32; 3])> {
    let position = || prop::array::uniform3(-4000i32..12000);
    (position(), position(), 0u8..8).prop_map(|(a, mut b, sort)| {
        match sort {
            0 | 1 => b[2] = a[2],
            2 => b = [a[0], a[1], b[2]],
            3 => b = [b[0], a[1], a[2]],
            4 => b = [a[0], b[1], a[2]],
            5 => b = [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) / 4000),
            6 => b = a,
            _ => {}
        }
        let base = key().base();
        let place = |v: [i32; 3]| [0, 1, 2].map(|i| base[i] + 2 * v[i]);
        (place(a), place(b))
    })
}

fn axes() -> impl Strategy<Value = V> {
    let tilted = prop::array::uniform3(-1.0f64..1.0)
        .prop_filter_map("a direction", |v| (dot(v, v) > 0.01).then(|| unit(v)));
    prop_oneof![4 => Just([0.0, 0.0, 1.0]), 1 => Just([1.0, 0.0, 0.0]), 2 => tilted]
}

/// A segment with a profile of its own.
type Piece = (([i32; 3], [i32; 3]), f64, f64, V, u32);

fn pieces() -> impl Strategy<Value = Vec<Piece>> {
    let piece = (ends(), 100.0f64..6000.0, 0.05f64..3.0, axes(), 0u32..4);
    prop::collection::vec(piece.prop_map(|(e, w, ratio, axis, bead)| (e, w, w * ratio, axis, bead)), 1..12)
}

fn solids(pieces: &[Piece], outline: Outline) -> (Solids, Vec<Segment>) {
    let profile = |&(_, w, h, axis, _): &Piece| SolidProfile::new(outline, w, h, axis);
    let segment =
        |(number, &((a, b), .., bead)): (usize, &Piece)| Segment { a, b, profile: number as u32, pass: bead };
    (
        Solids::of_profiles(pieces.iter().map(profile).collect()),
        pieces.iter().enumerate().map(segment).collect(),
    )
}

fn evaluate(solids: &Solids, segments: &[Segment]) -> Brick {
    let indices: Vec<u32> = (0..segments.len() as u32).collect();
    let list = SegmentList { array: segments, indices: &indices };
    SolidEvaluator::default().evaluate(solids, key(), list).unwrap().into_leaf()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn samples_count_the_beads_that_cover_them(pieces in pieces(), ellipse in any::<bool>()) {
        let outline = if ellipse { Outline::Ellipse } else { Outline::Stadium };
        let (solids, segments) = solids(&pieces, outline);
        let brick = evaluate(&solids, &segments);
        for n in 0..BRICK_POINTS.pow(3) {
            let ijk = [n % 33, n / 33 % 33, n / 1089];
            let p = sample_position(ijk);
            let depth = |s: &Segment| oracle(s, solids.profile(s), outline, p);
            if segments.iter().any(|s| (depth(s) - 1.0).abs() < 1e-9) {
                continue;
            }
            let mut beads: Vec<u32> = segments.iter().filter(|s| depth(s) < 1.0).map(|s| s.pass).collect();
            beads.sort_unstable();
            beads.dedup();
            prop_assert_eq!(brick.sample(ijk), beads.len() as i16, "{:?}", ijk);
        }
    }

    #[test]
    fn hermite_edges_lie_on_the_boundary(pieces in pieces(), ellipse in any::<bool>()) {
        let outline = if ellipse { Outline::Ellipse } else { Outline::Stadium };
        let (solids, segments) = solids(&pieces, outline);
        let Brick::Counts { samples, hermite } = evaluate(&solids, &segments) else { return Ok(()) };
        let signs = SignChanges::of(&samples);
        for axis in Axis::ALL {
            let a = axis.index();
            let mut edges = hermite.edges[a].iter();
            for row in 0..BRICK_POINTS * BRICK_POINTS {
                for i in (0..BRICK_POINTS).filter(|i| signs.edges(axis, row % 33, row / 33) >> i & 1 == 1) {
                    let ijk = [i, row % 33, row / 33];
                    let edge = edges.next().expect("one for each sign change");
                    let sign = if signs.is_inside(ijk) { 1.0 } else { -1.0 };
                    let mut end = sample_position(ijk);
                    let at = |fraction: f64| {
                        let mut p = sample_position(ijk);
                        p[a] += 512.0 * fraction;
                        p
                    };
                    if sign < 0.0 {
                        end = at(1.0);
                    }
                    let depth = |s: &Segment, p| oracle(s, solids.profile(s), outline, p);
                    let bounding: Vec<&Segment> = segments.iter().filter(|s| depth(s, end) < 1.0 + 1e-9).collect();
                    let before = at(edge.fraction() - sign * 2.0 / 65536.0);
                    let behind = at(edge.fraction() + sign * 2.0 / 65536.0);
                    let within = (edge.fraction() - 0.5) * sign > -0.5 + 2.0 / 65536.0;
                    prop_assert!(!within || bounding.iter().any(|s| depth(s, before) < 1.0 + 1e-9));
                    prop_assert!(bounding.iter().all(|s| depth(s, behind) > 1.0 - 1e-9));
                    let normal = edge.normal.to_vector();
                    let grazing = bounding.iter().any(|s| depth(s, end) > 1.0 - 1e-6);
                    prop_assert!(normal[a] * sign > -1e-4 || grazing, "outward: {normal:?}");
                }
            }
            prop_assert!(edges.next().is_none());
        }
    }

    #[test]
    fn cubes_are_covered_missed_or_touched(pieces in pieces(), low in prop::array::uniform3(-3000i32..9000),
                                           bits in 6u32..14) {
        let (solids, segments) = solids(&pieces, Outline::Stadium);
        let base = key().base();
        let (low, size) = ([0, 1, 2].map(|a| base[a] + 2 * low[a] + 1), 1i32 << bits);
        for segment in &segments {
            let (min, max) = solids.bounds(segment);
            let apart = (0..3).any(|a| max[a] < low[a] || min[a] > low[a] + size)
                || !solids.touches_cube(segment, low, size);
            let covered = solids.covers_cube(segment, low, size);
            for n in 0..9usize.pow(3) {
                let at = [n % 9, n / 9 % 9, n / 81];
                let p = [0, 1, 2].map(|a| f64::from(low[a]) + f64::from(size) * at[a] as f64 / 8.0);
                let depth = oracle(segment, solids.profile(segment), Outline::Stadium, p);
                prop_assert!(!apart || depth > 1.0);
                prop_assert!(!covered || depth < 1.0);
            }
            prop_assert!(!(apart && covered));
        }
    }
}
