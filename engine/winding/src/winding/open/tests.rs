//! Boundaries, caps and expansions of small soups against sums of solid angles.

use super::angle::add_angles;
use super::cells::{BoundedTree, CellCache, CellPoints, PointSpacing};
use super::high_moments::{HIGH_DEGREE, HighMoments};
use super::local::{LocalExpansion, local_bound};
use super::moments::{GROUP, error_bound};
use super::wide::{dispatch, level};
use super::*;
use crate::lattice::ROOT_BITS;
use crate::progress::Silent;
use crate::soup::Facet;
use crate::winding::{EdgeBalance, brute_at};
use brickfield_bench_data::Rng;
use brickfield_bench_data::pile::random_pile;
use fearless_simd::Level;
use proptest::prelude::*;

fn units() -> RootCube {
    RootCube { origin: [0.0; 3], edge: f64::from(1u32 << ROOT_BITS) }
}

fn world(t: &Triangle) -> Facet {
    t.map(|v| v.map(f64::from))
}

fn bounds(soup: &[Facet]) -> ([f64; 3], [f64; 3]) {
    let all = || soup.iter().flatten();
    let min = std::array::from_fn(|a| all().fold(f64::MAX, |m, v| m.min(v[a])));
    let max = std::array::from_fn(|a| all().fold(f64::MIN, |m, v| m.max(v[a])));
    (min, max)
}

fn random_triangles(rng: &mut Rng, count: usize, extent: u32) -> Vec<Triangle> {
    let mut vertex = || -> Units { std::array::from_fn(|_| 2 * (rng.below(extent) as i32 + 8)) };
    (0..count).map(|_| [vertex(), vertex(), vertex()]).collect()
}

fn part_of(soup: &[Triangle]) -> OpenPart {
    let soup: Vec<Facet> = soup.iter().map(world).collect();
    OpenPart::of(&[&soup], units(), &Silent).unwrap()
}

fn assert_closes(soup: &[Triangle]) {
    let sources: Vec<Facet> = soup.iter().map(world).collect();
    let boundary = Boundary::of(&[&sources], units(), &Silent).unwrap();
    let mut balance = EdgeBalance::default();
    let caps = caps::close(&Loops::trace(&boundary.edges));
    soup.iter().chain(&caps).for_each(|t| balance.add(t));
    assert!(balance.is_closed());
}

#[test]
fn an_isolated_facet_is_closed_by_its_reverse() {
    let mut rng = Rng::new(1);
    let soup = random_triangles(&mut rng, 500, 50_000);
    let part = part_of(&soup);
    assert_eq!((part.summary.loops, part.summary.open_edges), (500, 1500));
    assert_closes(&soup);
    let turned = |t: &Triangle| {
        let least = (0..3).min_by_key(|&i| t[i]).unwrap();
        [t[least], t[(least + 1) % 3], t[(least + 2) % 3]]
    };
    let mut reversed: Vec<Triangle> = soup.iter().map(|t| turned(&[t[0], t[2], t[1]])).collect();
    let mut caps: Vec<Triangle> = part.caps.iter().map(turned).collect();
    reversed.sort_unstable();
    caps.sort_unstable();
    assert_eq!(caps, reversed);
}

#[test]
fn junctions_need_no_area_and_repeated_facets_no_care() {
    // A T-junction: one side of the edge has a vertex more.
    let (a, b, c, d, m) = ([2, 2, 2], [42, 2, 2], [22, 40, 2], [22, 2, 60], [22, 2, 2]);
    let soup = [[a, b, c], [m, a, d], [b, m, d], [a, c, d], [c, b, d]];
    let part = part_of(&soup);
    assert_eq!((part.summary.open_edges, part.summary.loops, part.summary.caps), (3, 1, 0));
    let soup = [[a, b, c], [a, b, c], [a, b, c], [b, a, d]];
    let part = part_of(&soup);
    assert_closes(&soup);
    assert_eq!(part.summary.open_edges, 3 + 3 + 2 + 2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    /// Few vertices, so that edges branch, repeat and cancel.
    #[test]
    fn any_soup_is_closed_and_answered(seed in any::<u64>(), count in 1usize..60, extent in 2u32..30) {
        let mut rng = Rng::new(seed);
        let soup = random_triangles(&mut rng, count, extent);
        let part = part_of(&soup);
        assert_closes(&soup);
        let sources: Vec<Facet> = soup.iter().map(world).collect();
        let points: Vec<Units> =
            (0..40).map(|_| std::array::from_fn(|_| rng.below(2 * extent + 32) as i32 | 1)).collect();
        let points: Vec<Units> =
            points.into_iter().filter(|p| !soup.iter().any(|t| in_plane(t, *p))).collect();
        let at: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        let brute = brute_at(&[&sources], units(), &at, &Silent).unwrap();
        for error in [1e-2, 1e-3, 1e-6] {
            let found = open_winding_at(&[&sources], units(), &part, &at, error, &Silent).unwrap();
            for ((w, b), p) in found.iter().zip(&brute).zip(&points) {
                prop_assert!((w - b).abs() <= error, "{} {} at {:?}", w, b, p);
            }
        }
    }

    /// The bound holds for every cluster of triangles and every distance, and is not idle.
    #[test]
    fn an_expansion_keeps_its_bound(seed in any::<u64>(), count in 1usize..20, distance in 1.05f64..8.0) {
        let mut rng = Rng::new(seed);
        let triangles = random_triangles(&mut rng, count, 1 << 20);
        let caps: Vec<Cap> =
            triangles.iter().filter(|t| normal(t) != [0; 3]).map(Cap::new).collect();
        prop_assume!(!caps.is_empty());
        let (center, reach, expansion) = tree::summary_of(&caps);
        let direction: [f64; 3] = std::array::from_fn(|_| rng.range(-1.0, 1.0));
        let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
        prop_assume!(length > 0.1);
        let p: Units = std::array::from_fn(|a| {
            (center[a] + direction[a] / length * distance * reach.farthest) as i32 | 1
        });
        let r: [f64; 3] = std::array::from_fn(|a| center[a] - f64::from(p[a]));
        let away = r.iter().map(|c| c * c).sum::<f64>().sqrt();
        let exact: f64 = caps.iter().map(|c| c.share_at(p)).sum();
        let error = (expansion.at(r) - exact).abs();
        prop_assert!(error <= error_bound(reach, away) + 1e-13, "{} {}", error, error_bound(reach, away));
    }
}

/// A prism over a square on its tip, whose sides run through samples, along the axis `axis`.
fn diamond(axis: usize) -> Vec<Triangle> {
    let corner = |i: usize| {
        let (u, v) = [(40, 0), (0, 40), (-40, 0), (0, -40)][i % 4];
        let mut p = [1000; 3];
        p[(axis + 1) % 3] += u;
        p[(axis + 2) % 3] += v;
        p[axis] += 30 - 60 * (i as i32 / 4 % 2);
        p
    };
    let mut facets = vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]];
    (0..4).for_each(|i| facets.extend([[i, i + 4, (i + 1) % 4], [(i + 1) % 4, i + 4, (i + 1) % 4 + 4]]));
    facets.iter().map(|t| t.map(corner)).collect()
}

fn in_plane(t: &Triangle, p: Units) -> bool {
    let n = normal(t);
    (0..3).map(|a| n[a] * i64::from(p[a] - t[0][a])).sum::<i64>() == 0
}

/// Samples on the planes of missing facets, where caps lie: the soup's own field has no jump there.
#[test]
fn samples_on_caps_agree() {
    let mut rng = Rng::new(5);
    let mut on_caps = 0;
    for round in 0..120 {
        let axis = round % 3;
        let missing = rng.below(1 << 12);
        let all = diamond(axis);
        let soup: Vec<Triangle> = (0..12).filter(|i| missing >> i & 1 == 0).map(|i| all[i]).collect();
        if soup.is_empty() {
            continue;
        }
        assert_closes(&soup);
        let part = part_of(&soup);
        let sources: Vec<Facet> = soup.iter().map(world).collect();
        let mut points: Vec<Units> = Vec::new();
        for w in (963..1038).step_by(6) {
            for u in (961..1040).step_by(2) {
                // On the four sides.
                let rest = 40 - (u - 1000i32).abs();
                for v in [1000 - rest, 1000 + rest] {
                    let mut p = [0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (w, u, v);
                    points.push(p);
                }
            }
        }
        points.retain(|p| !soup.iter().any(|t| in_plane(t, *p)));
        on_caps += points.iter().filter(|p| part.caps.iter().any(|t| in_plane(t, **p))).count();
        let at: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        let brute = brute_at(&[&sources], units(), &at, &Silent).unwrap();
        let found = open_winding_at(&[&sources], units(), &part, &at, 1e-6, &Silent).unwrap();
        for ((w, b), p) in found.iter().zip(&brute).zip(&points) {
            assert!((w - b).abs() < 1e-6, "missing {missing:b} at {p:?}: {w}, the sum is {b}");
        }
    }
    assert!(on_caps > 5_000, "{on_caps}");
}

/// On an edge between two caps, and on one of a cap that bounds the soup, in every orientation.
#[test]
fn the_share_on_an_edge_is_the_limit() {
    let mut rng = Rng::new(7);
    for _ in 0..20_000 {
        // p is the middle of the edge from p − d to p + d.
        let small = |rng: &mut Rng| 2 * (rng.below(9) as i32 - 4) + 1;
        let p = [1001, 1003, 1005];
        let d: Units = std::array::from_fn(|_| small(&mut rng));
        let third: Units = std::array::from_fn(|a| p[a] + small(&mut rng));
        let t = [std::array::from_fn(|a| p[a] - d[a]), std::array::from_fn(|a| p[a] + d[a]), third];
        if normal(&t) == [0; 3] {
            continue;
        }
        // The same a million times as large, seen from a few units beside the edge: ε = 2^-17, 2^-34 is lost in
        // rounding, so take only those that ε alone decides.
        let n = normal(&t);
        let e: [i64; 3] = std::array::from_fn(|a| i64::from(t[1][a] - t[0][a]));
        let inward = n[1] * e[2] - n[2] * e[1];
        if n[0] == 0 || inward == 0 {
            continue;
        }
        let large = t.map(|v| v.map(|c| (c - 1000) << 19));
        let q = p.map(|c| (c - 1000) << 19);
        let beside = [q[0] + 7, q[1], q[2]];
        let limit = crate::winding::solid_angle(
            std::array::from_fn(|a| f64::from(large[0][a] - beside[a])),
            std::array::from_fn(|a| f64::from(large[1][a] - beside[a])),
            std::array::from_fn(|a| f64::from(large[2][a] - beside[a])),
        ) / (4.0 * std::f64::consts::PI);
        let found = Cap::new(&t).share_at(p);
        assert!((found - limit).abs() < 3e-4, "{t:?}: {found} {limit}");
    }
}

/// Slivers and far ends: the quotient stays true where both of its terms nearly vanish.
#[test]
fn shares_next_to_an_edge_are_true() {
    let top = (1 << 24) - 4;
    for (t, p) in [
        ([[0, 0, 0], [top, 2, 0], [top, 0, 2]], [top / 2 + 1, 1, 1]),
        ([[0, 0, 0], [top, top - 2, 0], [0, top, 2]], [8_388_605, 8_388_605, 1]),
        ([[0, 0, 0], [top, 0, 0], [top, 2, 0]], [top / 2 + 1, 1, 1]),
        ([[0, 0, 0], [top, 2, 2], [top, 4, 2]], [top / 2 + 3, 1, 1]),
    ] {
        let found = Cap::new(&t).share_at(p);
        // Cut in halves over and over the triangle's parts near p are well-shaped.
        let expected = divided_share(t.map(|v| v.map(f64::from)), p.map(f64::from), 0);
        assert!((found - expected).abs() < 1e-6, "{t:?}: {found} {expected}");
    }
}

/// The share of a triangle as the sum over its quarters, down to those that are small against their distance.
fn divided_share(t: [[f64; 3]; 3], p: [f64; 3], depth: u32) -> f64 {
    let center: [f64; 3] = std::array::from_fn(|a| (t[0][a] + t[1][a] + t[2][a]) / 3.0);
    let distance = |v: [f64; 3]| (0..3).map(|a| (v[a] - p[a]).powi(2)).sum::<f64>().sqrt();
    let size = (0..3).map(|i| (0..3).map(|a| (t[i][a] - center[a]).powi(2)).sum::<f64>().sqrt());
    let size = size.fold(0.0, f64::max);
    if distance(center) > 4.0 * size || depth > 40 {
        let v = t.map(|v| std::array::from_fn(|a| v[a] - p[a]));
        return crate::winding::solid_angle(v[0], v[1], v[2]) / (4.0 * std::f64::consts::PI);
    }
    let longest = (0..3).fold((0, 0.0), |best, i| {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        let length = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
        if length > best.1 { (i, length) } else { best }
    });
    let (a, b, c) = (t[longest.0], t[(longest.0 + 1) % 3], t[(longest.0 + 2) % 3]);
    let middle = std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
    divided_share([a, middle, c], p, depth + 1) + divided_share([middle, b, c], p, depth + 1)
}

#[test]
fn pieces_with_facets_missing_and_flipped() {
    for seed in 0..3 {
        let all: Vec<Facet> = brickfield_bench_data::Mesh::merged(&random_pile(seed, 8)).facets().collect();
        for (keep, flip) in [(0.999, 0.0), (0.9, 0.1), (0.5, 0.0), (1.0, 0.5), (0.02, 0.0)] {
            let mut rng = Rng::new(seed);
            let mut soup: Vec<Facet> = all.iter().filter(|_| rng.range(0.0, 1.0) < keep).copied().collect();
            soup.iter_mut().for_each(|t| {
                if rng.range(0.0, 1.0) < flip {
                    t.swap(0, 1)
                }
            });
            let (min, max) = bounds(&all);
            let root = RootCube::around(min, max).unwrap();
            let part = OpenPart::of(&[&soup], root, &Silent).unwrap();
            let edge = f64::from(1u32 << ROOT_BITS);
            let points: Vec<[f64; 3]> = (0..400)
                .map(|_| {
                    let p: [f64; 3] = std::array::from_fn(|_| rng.range(-0.2 * edge, 1.2 * edge));
                    root.to_world(p.map(|c| 2.0 * (c / 2.0).floor() + 1.0))
                })
                .collect();
            let brute = brute_at(&[&soup], root, &points, &Silent).unwrap();
            let found = open_winding_at(&[&soup], root, &part, &points, 1e-3, &Silent).unwrap();
            let worst = found.iter().zip(&brute).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst <= 1e-3, "seed {seed}, {keep} kept, {flip} flipped: off by {worst}");
        }
    }
}

#[test]
fn far_away_nothing_is_seen() {
    let soup = random_triangles(&mut Rng::new(3), 20, 1 << 22);
    let part = part_of(&soup);
    let sources: Vec<Facet> = soup.iter().map(world).collect();
    let points = [[1e9, 3e8, -2e9], [1e12; 3], [1e300, 0.0, 0.0], [f64::INFINITY; 3], [f64::NAN; 3]];
    let found = open_winding_at(&[&sources], units(), &part, &points, 1e-3, &Silent).unwrap();
    let brute = brute_at(&[&sources], units(), &points[..2], &Silent).unwrap();
    (0..2).for_each(|i| assert!((found[i] - brute[i]).abs() < 1e-9, "{} {}", found[i], brute[i]));
    assert!(found[2..].iter().all(|w| *w == 0.0), "{found:?}");
}

/// Clusters and the points of a ball away from them: the polynomial is as good as its bound, also when moved. With moments
/// of the third degree and of the sixth, the latter from all elements and from those of two halves.
#[test]
fn a_local_expansion_keeps_its_bound() {
    let mut rng = Rng::new(11);
    let mut nearly = [0.0f64; 2];
    for round in 0..400 {
        let triangles = random_triangles(&mut rng, 2 + round % 12, 1 << 18);
        let caps: Vec<Cap> = triangles.iter().filter(|t| normal(t) != [0; 3]).map(Cap::new).collect();
        let (center, reach, expansion) = tree::summary_of(&caps);
        let radius = reach.farthest * rng.range(0.1, 2.0);
        let away = (reach.farthest + radius) * rng.range(1.1, 4.0);
        let direction = unit_vector(&mut rng);
        let at: [f64; 3] = std::array::from_fn(|a| (center[a] + away * direction[a]).round());
        let way = std::array::from_fn(|a| center[a] - at[a]);
        let points: Vec<Units> = (0..GROUP)
            .map(|_| {
                let direction = unit_vector(&mut rng);
                std::array::from_fn(|a| (at[a] + 0.99 * radius * direction[a]) as i32 | 1)
            })
            .collect();
        let to: [f64; 3] = std::array::from_fn(|_| (0.3 * radius * rng.range(-1.0, 1.0)).round());

        let bound = local_bound::<6, 3>(reach, away - 1.0, radius + 1.0);
        let mut local = LocalExpansion::<6>::default();
        local.add::<7, _>(&[(way, &expansion.moments())]);
        nearly[0] = nearly[0].max(share_of_bound(&caps, &points, at, &local, bound, to));

        let bound = local_bound::<8, 3>(reach, away - 1.0, radius + 1.0);
        let mut local = LocalExpansion::<8>::default();
        local.add::<9, _>(&[(way, &expansion.moments())]);
        share_of_bound(&caps, &points, at, &local, bound, to);

        let bound = local_bound::<8, HIGH_DEGREE>(reach, away - 1.0, radius + 1.0);
        let mut local = LocalExpansion::<8>::default();
        local.add::<9, _>(&[(way, &HighMoments::of(&caps, center).0)]);
        nearly[1] = nearly[1].max(share_of_bound(&caps, &points, at, &local, bound, to));
        let halves = caps.split_at(caps.len() / 2);
        let halves = [halves.0, halves.1].map(|half| (half, tree::summary_of(half).0));
        let moments = halves.map(|(half, center)| HighMoments::of(half, center));
        let way_to = |n: usize| std::array::from_fn(|a| halves[n].1[a] - center[a]);
        let both = HighMoments::of_both([(&moments[0], way_to(0)), (&moments[1], way_to(1))]);
        let mut of_halves = LocalExpansion::<8>::default();
        of_halves.add::<9, _>(&[(way, &both.0)]);
        share_of_bound(&caps, &points, at, &of_halves, bound, to);
    }
    assert!(nearly.iter().all(|nearly| *nearly > 0.02 && *nearly < 1.0), "{nearly:?}");
}

/// The largest error of a polynomial about `at` as a share of its bound, which it keeps, and the same about a point beside.
fn share_of_bound<const C: usize>(
    caps: &[Cap],
    points: &[Units],
    at: [f64; 3],
    local: &LocalExpansion<C>,
    bound: f64,
    to: [f64; 3],
) -> f64 {
    let moved = local.shifted(to);
    let mut nearly = 0.0f64;
    for p in points {
        let seen = |polynomial: &LocalExpansion<C>, from: [f64; 3]| {
            let mut value = [0.0];
            polynomial.at_points(from, &[*p], &mut value);
            value[0]
        };
        let exact: f64 = caps.iter().map(|c| c.share_at(*p)).sum();
        let found = seen(local, at);
        assert!((found - exact).abs() <= bound + 1e-12, "{found} {exact} {bound}");
        let same = seen(&moved, std::array::from_fn(|a| at[a] + to[a]));
        assert!((found - same).abs() < 1e-9 * (1.0 + found.abs()), "{found} {same}");
        nearly = nearly.max((found - exact).abs() / bound);
    }
    nearly
}

fn unit_vector(rng: &mut Rng) -> [f64; 3] {
    let v: [f64; 3] = std::array::from_fn(|_| rng.range(-1.0, 1.0));
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}

/// A group of samples of many caps at once gives the sum of the single ones, samples in planes of caps included.
#[test]
fn groups_of_samples_are_answered_as_single_ones() {
    let mut rng = Rng::new(12);
    for count in [0, 1, 7, 8, 9, 40] {
        let caps: Vec<Cap> = random_triangles(&mut rng, count, 6).iter().map(Cap::new).collect();
        let caps: Vec<Cap> = caps.into_iter().filter(|c| c.area() > 0.0).collect();
        for _ in 0..50 {
            let points: [Units; GROUP] =
                std::array::from_fn(|_| std::array::from_fn(|_| 2 * rng.below(20) as i32 + 1));
            let at = [0, 1, 2].map(|a| points.map(|p| f64::from(p[a])));
            let mut sums = [0.0; GROUP];
            Cap::add_shares(caps.iter(), &at, |l| points[l], &mut sums);
            for (sum, p) in sums.iter().zip(points) {
                let single: f64 = caps.iter().map(|c| c.share_at(p)).sum();
                assert!((sum - single).abs() < 1e-9, "{count} caps at {p:?}: {sum} {single}");
            }
        }
    }
}

/// The narrowest and the widest vectors.
#[test]
fn every_width_of_vectors_gives_the_same_bits() {
    let mut rng = Rng::new(15);
    let caps: Vec<Cap> = random_triangles(&mut rng, 30, 1 << 20).iter().map(Cap::new).collect();
    let (center, _, expansion) = tree::summary_of(&caps[..5]);
    for _ in 0..200 {
        let points: [Units; GROUP] =
            std::array::from_fn(|_| std::array::from_fn(|_| 2 * rng.below(1 << 20) as i32 + 1));
        let at = [0, 1, 2].map(|a| points.map(|p| f64::from(p[a])));
        let found = [Level::baseline(), level()].map(|level| {
            let mut sums = [0.0; GROUP];
            dispatch!(level, simd => add_angles(simd, caps.iter(), &at, |l| points[l], &mut sums));
            let seen: [f64; GROUP] = dispatch!(level, simd => {
                let way = wide::way(simd, &center, &wide::each_of(simd, &at));
                expansion.at_each(simd, way).into()
            });
            (sums.map(f64::to_bits), seen.map(f64::to_bits))
        });
        assert_eq!(found[0], found[1]);
    }
}

/// What a cell answers depends neither on which points are asked for nor on what was asked before.
#[test]
fn a_sample_has_one_value_whoever_asks() {
    let mut rng = Rng::new(13);
    let caps: Vec<Cap> = random_triangles(&mut rng, 3000, 1 << 19).iter().map(Cap::new).collect();
    let tree = ClusterTree::new(caps);
    let (spacing, bits) = (16, 19);
    let base = [0, 1 << 19, 0];
    let all: Vec<Units> = (0..512)
        .map(|i| {
            let at = [i % 8, i / 8 % 8, i / 64];
            std::array::from_fn(|a| base[a] + (at[a] << spacing) + 1)
        })
        .collect();
    let ask = |cells: &BoundedTree<'_, Cap>, cache: &mut CellCache, positions: Vec<Units>| {
        let mut points = CellPoints { positions, values: Vec::new() };
        cells.answer(cache, bits, PointSpacing::Lattice(spacing), &mut points);
        points.values
    };
    for error in [0.3, 1e-2, 1e-4] {
        let cells = BoundedTree::new(&tree, error);
        let mut cache = CellCache::default();
        let values = ask(&cells, &mut cache, all.clone());
        for (p, w) in all.iter().zip(&values) {
            assert!((w - tree.exact_at(*p)).abs() <= error, "{p:?}");
        }
        for i in (0..512).step_by(31) {
            let some: Vec<usize> = (i..512.min(i + 3)).rev().collect();
            let positions: Vec<Units> = some.iter().map(|&i| all[i]).collect();
            let again = ask(&cells, &mut cache, positions.clone());
            assert_eq!(again, ask(&cells, &mut CellCache::default(), positions));
            assert!(some.iter().zip(&again).all(|(&i, w)| values[i].to_bits() == w.to_bits()));
        }
        // What was made for another error is not used, and what was made makes no difference.
        let again = ClusterTree::new(tree.elements().to_vec());
        assert_eq!(values, ask(&BoundedTree::new(&again, error), &mut cache, all.clone()));
    }
}
