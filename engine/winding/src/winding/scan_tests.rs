//! Tests of the scan against exact references.

use super::*;
use crate::brick::SignChanges;
use crate::lattice::{Axis, BRICK_POINTS};
use crate::wide::{dispatch, level};
use fearless_simd::Level;
use proptest::prelude::*;

/// Everything in i128 with the perturbation as explicit small numbers: coordinates times 2^60,
/// ε = 2^40, ε² = 2^20, ε³ = 1 are far apart for the small triangles used here.
fn reference<const A: usize>(t: &Triangle, block: SampleCube) -> Vec<(i32, i32, i32)> {
    const EPS: [i128; 3] = [1 << 40, 1 << 20, 1];
    let (au, av) = ((A + 1) % 3, (A + 2) % 3);
    let n = normal(t).map(i128::from);
    let mut out = Vec::new();
    let at = |i: i32, a: usize| ((i128::from(i) << block.shift) << 60) + EPS[a];
    for v in 0..=block.last {
        for u in 0..=block.last {
            let inside = (0..3).all(|i| {
                let (a, b) = (t[i].map(i128::from), t[(i + 1) % 3].map(i128::from));
                let e = (b[au] - a[au]) * (at(v, av) - (a[av] << 60))
                    - (b[av] - a[av]) * (at(u, au) - (a[au] << 60));
                e * n[A].signum() > 0
            });
            if n[A] == 0 || !inside {
                continue;
            }
            let side = |i: i32| {
                let mut p = [0i128; 3];
                (p[A], p[au], p[av]) = (at(i, A), at(u, au), at(v, av));
                (0..3).map(|a| n[a] * (p[a] - (i128::from(t[0][a]) << 60))).sum::<i128>() * n[A].signum()
            };
            if let Some(lower) = (0..block.last).find(|&i| side(i) < 0 && side(i + 1) > 0) {
                out.push((u, v, lower));
            }
        }
    }
    out
}

fn facet_of(t: &Triangle, block: SampleCube) -> Option<ScanFacet> {
    dispatch!(level(), simd => ScanFacet::new(simd, t, [0; 3], block))
}

fn scanned<const A: usize>(t: &Triangle, block: SampleCube) -> Vec<(i32, i32, i32)> {
    let mut out = Vec::new();
    if let Some(facet) = facet_of(t, block) {
        let add = |c: EdgeCrossing| out.push((c.u, c.v, c.lower));
        dispatch!(level(), simd => facet.scan::<_, A>(simd, block, [block.last; 2], add));
    }
    out.sort_unstable_by_key(|&(u, v, _)| (v, u));
    out
}

/// Odd vertices, many on 45° faces through samples, some far outside.
fn triangle() -> impl Strategy<Value = Triangle> {
    let vertex = prop::array::uniform3(-6i32..22).prop_map(|v| v.map(|c| 2 * c + 1));
    (prop::array::uniform3(vertex.clone()), vertex, 0..4usize).prop_map(|(mut t, d, flatten)| {
        if flatten < 3 {
            // Force a 45° plane: one coordinate a copy of another up to an even shift.
            for p in &mut t {
                p[flatten] = p[(flatten + 1) % 3] + 2 * (d[0] / 8);
            }
        }
        t
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]
    #[test]
    fn crossings_match_the_perturbed_reference(t in triangle(), shift in 1u32..4) {
        let block = SampleCube { shift, last: 6 };
        prop_assert_eq!(scanned::<0>(&t, block), reference::<0>(&t, block));
        prop_assert_eq!(scanned::<1>(&t, block), reference::<1>(&t, block));
        prop_assert_eq!(scanned::<2>(&t, block), reference::<2>(&t, block));
    }

    /// One cell twice as large as the root, as for single points, whose lines pass through many edges.
    #[test]
    fn a_huge_cell_matches_the_perturbed_reference(t in prop::array::uniform3(prop::array::uniform3(-3i32..3))) {
        let t = t.map(|v| v.map(|c| 2 * c + 1));
        let block = SampleCube { shift: 25, last: 1 };
        prop_assert_eq!(scanned::<0>(&t, block), reference::<0>(&t, block));
        prop_assert_eq!(scanned::<1>(&t, block), reference::<1>(&t, block));
        prop_assert_eq!(scanned::<2>(&t, block), reference::<2>(&t, block));
    }

    #[test]
    fn fast_and_exact_location_agree(t in prop::array::uniform3(prop::array::uniform3(-(1i32 << 22)..1 << 22)),
                                     shift in 3u32..26) {
        let t = t.map(|v| v.map(|c| 2 * c + 1));
        let last = if shift < 20 { 32 } else { 1 };
        let block = SampleCube { shift, last };
        if let Some(facet) = facet_of(&t, block) {
            let mut checked = Vec::new();
            dispatch!(level(), simd => {
                facet.scan::<_, 0>(simd, block, [last; 2], |c| checked.push((0, c)));
                facet.scan::<_, 1>(simd, block, [last; 2], |c| checked.push((1, c)));
                facet.scan::<_, 2>(simd, block, [last; 2], |c| checked.push((2, c)));
            });
            for (axis, c) in checked {
                let exact = locate_exactly(&facet, block, axis, (c.u, c.v));
                prop_assert_eq!((c.lower as u64) << 16 | u64::from(c.offset), exact);
            }
        }
    }
}

/// Every row's span against the exact one, with the widest vectors and with those that every processor has.
fn spans_are_exact<const A: usize, const SWAP: bool>(facet: &ScanFacet, block: SampleCube) -> bool {
    [level(), Level::baseline()].into_iter().all(|level| spans_are_exact_at::<A, SWAP>(level, facet, block))
}

fn spans_are_exact_at<const A: usize, const SWAP: bool>(
    level: Level,
    facet: &ScanFacet,
    block: SampleCube,
) -> bool {
    dispatch!(level, simd => {
        let (s, r) = sweep_axes::<A, SWAP>();
        let edges = Edges::new::<_, A, SWAP>(simd, facet, block);
        let range = |axis| facet.lines(axis).0..=facet.lines(axis).1;
        let within = range(s).fold(0, |bits, line| bits | 1 << line);
        facet.normal[A] == 0
            || range(r).all(|row| {
                let exact = edges.span_exactly((s, r), (facet.normal[A] > 0) != SWAP, row);
                // As the first of those that are looked at together, and as the last.
                let all = u64x4::splat(simd, within);
                let spans = |first: i32| edges.spans::<_, A, SWAP>(simd, first, all);
                let [first, last] = [spans(row)[0], spans(row + 1 - ROWS as i32)[ROWS - 1]];
                first == exact && last == exact
            })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn fast_and_exact_spans_agree(t in prop::array::uniform3(prop::array::uniform3(-(1i32 << 22)..1 << 22)),
                                  small in 0u32..18, shift in 3u32..26) {
        let t = t.map(|v| v.map(|c| 2 * (c >> small) + 1));
        // Blocks of a brick, and of one cell larger than the root, as for single points.
        let block = SampleCube { shift, last: if shift < 20 { 32 } else { 1 } };
        if let Some(facet) = facet_of(&t, block) {
            prop_assert!(spans_are_exact::<0, false>(&facet, block) && spans_are_exact::<0, true>(&facet, block));
            prop_assert!(spans_are_exact::<1, false>(&facet, block) && spans_are_exact::<1, true>(&facet, block));
            prop_assert!(spans_are_exact::<2, false>(&facet, block) && spans_are_exact::<2, true>(&facet, block));
        }
    }
}

proptest! {
    #[test]
    fn asking_for_edges_finds_them_all(t in triangle(), shift in 1u32..3, rows in any::<[u64; 8]>()) {
        let block = SampleCube { shift, last: 32 };
        let inside = |i: usize| rows[i / BRICK_POINTS % 8].rotate_left(i as u32 / 64) >> (i % BRICK_POINTS) & 1 != 0;
        let signs = SignChanges::from_fn(inside);
        let Some(facet) = facet_of(&t, block) else { return Ok(()) };
        let mut masks = EdgeMasks::default();
        let changes = |axis, [i, j, k]: [i32; 3]| signs.edges(axis, j as usize, k as usize) >> i & 1 != 0;
        let (mut all, mut asked) = (Vec::new(), Vec::new());
        for axis in Axis::ALL {
            let (all, asked) = (|c| all.push((axis, c)), |c| asked.push((axis, c)));
            dispatch!(level(), simd => match axis {
                Axis::X => {
                    masks.set::<0>(&signs, |_| ());
                    facet.scan::<_, 0>(simd, block, [32; 2], all);
                    facet.scan_edges::<_, 0>(simd, block, &masks, asked);
                }
                Axis::Y => {
                    masks.set::<1>(&signs, |_| ());
                    facet.scan::<_, 1>(simd, block, [32; 2], all);
                    facet.scan_edges::<_, 1>(simd, block, &masks, asked);
                }
                Axis::Z => {
                    masks.set::<2>(&signs, |_| ());
                    facet.scan::<_, 2>(simd, block, [32; 2], all);
                    facet.scan_edges::<_, 2>(simd, block, &masks, asked);
                }
            });
        }
        let wanted = |(axis, c): &(Axis, EdgeCrossing)| match axis {
            Axis::X => changes(Axis::X, [c.lower, c.u, c.v]),
            Axis::Y => changes(Axis::Y, [c.v, c.lower, c.u]),
            Axis::Z => changes(Axis::Z, [c.u, c.v, c.lower]),
        };
        all.retain(wanted);
        asked.retain(wanted);
        prop_assert_eq!(all, asked);
    }
}

#[test]
fn an_edge_shared_by_two_triangles_belongs_to_one() {
    // A square through samples, split along both diagonals: each line crosses exactly once.
    let block = SampleCube { shift: 1, last: 8 };
    for flip in [false, true] {
        let p = [[1, 1, 3], [13, 1, 3], [13, 13, 3], [1, 13, 3]];
        let (a, b) = if flip {
            ([p[0], p[1], p[3]], [p[1], p[2], p[3]])
        } else {
            ([p[0], p[1], p[2]], [p[0], p[2], p[3]])
        };
        let mut all = scanned::<2>(&a, block);
        all.extend(scanned::<2>(&b, block));
        all.sort_unstable();
        let expected: Vec<_> = (1..=6).flat_map(|u| (1..=6).map(move |v| (u, v, 1))).collect();
        assert_eq!(all, expected);
    }
}
