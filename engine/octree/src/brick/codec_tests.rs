use super::*;
use crate::brick::{HermiteEdge, OctNormal, POINTS, point_index};
use proptest::prelude::*;

/// A convex solid: the planes n·p = d around it, n not normalized.
struct Solid(Vec<([f64; 3], f64)>);

impl Solid {
    /// A bead of twelve sides and radius `r` from `a` along the unit vector `d`, both ends far away.
    fn bead(a: [f64; 3], d: [f64; 3], r: f64) -> Solid {
        let side = if d[2].abs() < 0.9 { [-d[1], d[0], 0.0] } else { [0.0, -d[2], d[1]] };
        let up = [
            d[1] * side[2] - d[2] * side[1],
            d[2] * side[0] - d[0] * side[2],
            d[0] * side[1] - d[1] * side[0],
        ];
        let planes = (0..12).map(|i| {
            let (s, c) = (f64::from(i) * std::f64::consts::TAU / 12.0).sin_cos();
            let n = [0, 1, 2].map(|x| c * side[x] + s * up[x]);
            (n, dot(n, a) + r * dot(n, n).sqrt())
        });
        Solid(planes.collect())
    }

    /// A ball of some 200 facets.
    fn ball(a: [f64; 3], r: f64) -> Solid {
        let planes = (0..200).map(|i| {
            let z = 1.0 - (f64::from(i) + 0.5) / 100.0;
            let (s, c) = (f64::from(i) * 2.399963).sin_cos();
            let n = [c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z];
            (n, dot(n, a) + r)
        });
        Solid(planes.collect())
    }

    fn depth(&self, p: [f64; 3]) -> (f64, [f64; 3]) {
        let all = self.0.iter().map(|&(n, d)| (dot(n, p) - d, n));
        all.max_by(|a, b| a.0.total_cmp(&b.0)).expect("a solid has planes")
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The brick that counts the solids around each sample; unit spacing.
fn brick_of(solids: &[Solid]) -> Brick {
    let mut samples = Samples::filled(0);
    for index in 0..POINTS {
        let p = point_of(index);
        samples.0[index] = solids.iter().filter(|s| s.depth(p).0 <= 0.0).count() as i16;
    }
    let signs = SignChanges::of(&samples);
    let mut hermite = Hermite::default();
    for axis in Axis::ALL {
        for index in 0..POINTS {
            let [i, j, k] = ijk_of(index);
            if signs.edges(axis, j, k) >> i & 1 == 1 {
                hermite.edges[axis.index()].push(edge_of(solids, point_of(index), axis.index()));
            }
        }
    }
    Brick::Counts { samples, hermite }
}

fn edge_of(solids: &[Solid], from: [f64; 3], axis: usize) -> HermiteEdge {
    let depth = |t: f64| {
        let mut p = from;
        p[axis] += t;
        solids.iter().map(|s| s.depth(p)).min_by(|a, b| a.0.total_cmp(&b.0)).expect("solids")
    };
    let (mut lo, mut hi) = (0.0, 1.0);
    let lower_inside = depth(0.0).0 <= 0.0;
    for _ in 0..20 {
        let mid = (lo + hi) / 2.0;
        if (depth(mid).0 <= 0.0) == lower_inside { lo = mid } else { hi = mid }
    }
    let normal = OctNormal::from_integer(depth(lo).1.map(|c| (c * 1e9) as i64));
    HermiteEdge { offset: (lo * 65536.0) as u16, normal }
}

fn ijk_of(index: usize) -> [usize; 3] {
    [index % BRICK_POINTS, index / BRICK_POINTS % BRICK_POINTS, index / ROWS]
}

fn point_of(index: usize) -> [f64; 3] {
    ijk_of(index).map(|v| v as f64)
}

/// Twelve bricks as surfaces make them: balls, planes along and across the axes, crossing beads.
fn typical_bricks() -> Vec<Brick> {
    let wall = |n: [f64; 3], d: f64| Solid(vec![(n, d)]);
    let beads = |step: f64, r: f64, tilt: f64, count: i32| -> Vec<Solid> {
        let d = [tilt.cos(), tilt.sin(), 0.0];
        (0..count)
            .map(|i| Solid::bead([16.0, f64::from(i % 4) * step, f64::from(i / 4) * step * 0.7], d, r))
            .collect()
    };
    vec![
        brick_of(&[Solid::ball([16.0; 3], 12.3)]),
        brick_of(&[Solid::ball([40.0, 35.0, -3.0], 45.7)]),
        brick_of(&[wall([1.0, 0.0, 0.0], 13.4)]),
        brick_of(&[wall([0.1, 0.2, 1.0], 21.0)]),
        brick_of(&[wall([1.0, 0.9, 1.1], 50.0)]),
        brick_of(&beads(9.0, 5.1, 0.1, 12)),
        brick_of(&beads(9.0, 5.1, 0.8, 12)),
        brick_of(&beads(12.0, 6.5, 1.5, 12)),
        brick_of(&beads(20.0, 11.0, 0.4, 8)),
        brick_of(&beads(5.0, 2.8, 0.785, 24)),
        brick_of(&[Solid::ball([5.0, 9.0, 9.0], 9.3), Solid::ball([14.0, 9.0, 19.0], 11.3)]),
        brick_of(&[wall([0.0, 0.0, 1.0], 9.4), Solid::bead([16.0, 16.0, 9.0], [0.6, 0.8, 0.0], 6.2)]),
    ]
}

/// The payload that a compression gives.
fn encoded(brick: &Brick, compression: Compression) -> Payload {
    let mut bytes = Vec::new();
    let head = encode_with(brick, compression, &mut Scratch::new(), &mut bytes);
    Payload { head, bytes }
}

const COMPRESSIONS: [Compression; 3] = [Compression::Lz4, Compression::None, Compression::Range];

/// The payload that a build writes, after every compression has given the brick back.
fn round_trip(brick: &Brick) -> Payload {
    for compression in COMPRESSIONS {
        let payload = encoded(brick, compression);
        let back = decode(payload.head.kind, payload.head.min, &payload.bytes, &mut Scratch::new());
        assert!(back.as_ref() == Ok(brick), "{:?} {:?}", back, payload.head);
        assert_eq!((payload.head.min, payload.head.max), brick.range());
        let is_coded = compression == Compression::Range && !payload.bytes.is_empty();
        assert_eq!(payload.head.kind.is_range_coded(), is_coded);
    }
    encode(brick)
}

#[test]
fn typical_bricks_round_trip_and_shrink() {
    let mut scratch = Scratch::new();
    let mut lengths = [0; 2];
    for brick in typical_bricks() {
        let payload = round_trip(&brick);
        assert!(payload.bytes.len() < 2500 + brick_edges(&brick).len() * 6);
        // A used scratch gives the same bytes as a new one, and the same brick.
        for compression in COMPRESSIONS {
            let payload = encoded(&brick, compression);
            let mut again = vec![0xff];
            assert_eq!(encode_with(&brick, compression, &mut scratch, &mut again), payload.head);
            assert_eq!((again[0], &again[1..]), (0xff, &payload.bytes[..]));
            assert!(decode(payload.head.kind, 0, &payload.bytes, &mut scratch) == Ok(brick.clone()));
        }
        lengths[0] += payload.bytes.len();
        lengths[1] += encoded(&brick, Compression::Range).bytes.len();
    }
    assert!(lengths[1] * 3 < lengths[0], "{lengths:?}");
    assert!(round_trip(&Brick::Uniform(-7)).bytes.is_empty());
}

#[test]
fn equal_counts_become_uniform() {
    let brick = Brick::Counts { samples: Samples::filled(3), hermite: Hermite::default() };
    assert_eq!(encode(&brick).head.kind, PayloadKind::UNIFORM);
}

#[test]
#[should_panic(expected = "one Hermite edge")]
fn hermite_edges_that_do_not_match_are_a_bug() {
    let mut samples = Samples::filled(0);
    samples.0[point_index([4, 4, 4])] = 1;
    let edge = HermiteEdge { offset: 1, normal: OctNormal(0) };
    let _ = encode(&Brick::Counts { samples, hermite: Hermite { edges: [vec![edge], vec![], vec![]] } });
}

#[test]
fn kinds_are_a_closed_set() {
    let known = (0..=255).filter(|&bits| PayloadKind::from_bits(bits).is_some()).collect::<Vec<u8>>();
    let flags = [0x00, 0x10, 0x20, 0x30, 0x50, 0x70, 0x90, 0xb0, 0xd0, 0xf0];
    let expected = [0].into_iter().chain(flags.iter().flat_map(|f| [f | 1, f | 2, f | 3]));
    let mut expected: Vec<u8> = expected.chain([0x04, 0x05, 0x14, 0x15]).collect();
    expected.sort_unstable();
    assert_eq!(known, expected);
}

/// Samples from a small choice of values, in runs, with edges for the sign changes on leaves.
fn any_brick() -> impl Strategy<Value = Brick> {
    let values = prop_oneof![
        Just(vec![0i16, 1]),
        Just(vec![i16::MIN, i16::MAX, 0, 1]),
        prop::collection::vec(any::<i16>(), 1..6),
        prop::collection::vec(-60i16..60, 1..6),
    ];
    // Few normals or many: both sides of what a palette holds.
    let normals = prop_oneof![Just(1usize), 2usize..300, Just(usize::MAX)];
    (values, normals, 1usize..2000, any::<u64>(), any::<bool>()).prop_map(
        |(values, normals, run, seed, leaf)| {
            let mut state = seed | 1;
            let mut next = move || {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (state >> 33) as usize
            };
            let mut samples = Samples::filled(0);
            let mut at = 0;
            while at < POINTS {
                let end = (at + 1 + next() % run).min(POINTS);
                samples.0[at..end].fill(values[next() % values.len()]);
                at = end;
            }
            let mut hermite = Hermite::default();
            if leaf {
                for (edges, count) in hermite.edges.iter_mut().zip(SignChanges::of(&samples).counts()) {
                    let mut edge = || HermiteEdge {
                        offset: next() as u16,
                        normal: OctNormal((next() % normals) as u32),
                    };
                    edges.extend((0..count).map(|_| edge()));
                }
            }
            Brick::Counts { samples, hermite }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_brick_round_trips(brick in any_brick()) {
        let (min, max) = brick.range();
        if min != max {
            round_trip(&brick);
        }
    }

    #[test]
    fn damaged_payloads_never_panic(brick in any_brick(), at in any::<prop::sample::Index>(),
                                    bits in any::<u8>(), cut in any::<prop::sample::Index>(),
                                    compression in prop::sample::select(COMPRESSIONS.to_vec())) {
        let Payload { head, mut bytes } = encoded(&brick, compression);
        prop_assume!(!bytes.is_empty());
        let mut scratch = Scratch::new();
        let short = &bytes[..cut.index(bytes.len())];
        prop_assert!(decode(head.kind, 0, short, &mut scratch).is_err());
        let at = at.index(bytes.len());
        bytes[at] ^= bits;
        for kind in (0..=255).filter_map(PayloadKind::from_bits) {
            let _ = decode(kind, 0, &bytes, &mut scratch);
        }
    }

    #[test]
    fn noise_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..4000), kind in any::<u8>()) {
        if let Some(kind) = PayloadKind::from_bits(kind) {
            let _ = decode(kind, 0, &bytes, &mut Scratch::new());
        }
    }
}

/// Without the checksum that catches it in a store: a changed byte of the range coder is found, or makes another brick.
#[test]
#[ignore = "a sweep of half a minute and more: .ci/run has it"]
fn every_byte_of_a_coded_brick_counts() {
    let mut scratch = Scratch::new();
    let mut found = [0; 2];
    for brick in typical_bricks().into_iter().step_by(4) {
        let Payload { head, mut bytes } = encoded(&brick, Compression::Range);
        for at in 0..bytes.len() {
            assert!(decode(head.kind, 0, &bytes[..at], &mut scratch).is_err(), "cut at {at}");
            for flip in [1 << (at % 8), 0xff] {
                bytes[at] ^= flip;
                let back = decode(head.kind, 0, &bytes, &mut scratch);
                assert!(back.as_ref() != Ok(&brick), "byte {at}");
                found[usize::from(back.is_ok())] += 1;
                bytes[at] ^= flip;
            }
        }
        bytes.push(0);
        assert!(decode(head.kind, 0, &bytes, &mut scratch).is_err());
        assert!(decode(PayloadKind(PayloadKind::RANGE_COUNTS), 0, &bytes, &mut scratch).is_err());
    }
    println!("{} changes refused, {} other bricks", found[0], found[1]);
    assert!(found[0] > 1000 && found[1] * 100 < found[0]);
}

/// The sizes in the table of the module's documentation: what was chosen is the smallest.
#[test]
fn rows_and_masks_are_smaller_than_plain_samples() {
    use lz4_flex::block::compress_into;
    let bricks = typical_bricks();
    let mut out = vec![0; 1 << 20];
    let mut lz4 = |plain: &[u8]| compress_into(plain, &mut out).unwrap();
    let (mut plain, mut differences, mut chosen, mut coded, mut words, mut planes) = (0, 0, 0, 0, 0, 0);
    for brick in &bricks {
        let Brick::Counts { samples, hermite } = brick else { panic!("a surface brick") };
        let bytes: Vec<u8> = samples.0.iter().map(|&w| w as u8).collect();
        plain += lz4(&bytes);
        let along_x = bytes.windows(2).map(|w| w[1].wrapping_sub(w[0]));
        differences += lz4(&std::iter::once(bytes[0]).chain(along_x).collect::<Vec<u8>>());
        let bare = Brick::Counts { samples: samples.clone(), hermite: Hermite::default() };
        chosen += encoded(&bare, Compression::Lz4).bytes.len();
        coded += encoded(&bare, Compression::Range).bytes.len();
        let edges = || hermite.edges.iter().flatten();
        words += lz4(&edges().flat_map(|edge| edge.normal.0.to_le_bytes()).collect::<Vec<u8>>());
        let plane = |shift: u32| edges().map(move |edge| (edge.normal.0 >> shift) as u8);
        planes += lz4(&[0, 8, 16, 24].into_iter().flat_map(plane).collect::<Vec<u8>>());
    }
    let means = [plain, differences, chosen, coded, words, planes].map(|bytes| bytes / bricks.len());
    println!("plain, differences, chosen, range coder, normals as words, as planes: {means:?}");
    assert!(2 * chosen < differences && differences < plain && 2 * coded < chosen, "{means:?}");
    assert!(words < planes, "{means:?}");
}

fn brick_edges(brick: &Brick) -> &Hermite {
    match brick {
        Brick::Counts { hermite, .. } => hermite,
        Brick::Uniform(_) => panic!("a surface brick"),
    }
}

#[test]
fn the_memory_of_another_brick_changes_nothing() {
    let whole = brick_of(&[Solid::ball([16.0; 3], 9.0)]);
    let mut fractions = Samples::fractions(7);
    fractions.0.iter_mut().enumerate().for_each(|(n, w)| *w = (n % 311) as i16);
    let fractions = Brick::Counts { samples: fractions, hermite: Hermite::default() };
    for compression in [Compression::Lz4, Compression::None, Compression::Range] {
        for brick in [&whole, &fractions] {
            let (mut scratch, mut bytes) = (Scratch::new(), Vec::new());
            let head = encode_with(brick, compression, &mut scratch, &mut bytes);
            for other in [Samples::filled(-7), Samples(vec![300; POINTS].try_into().unwrap(), 3)] {
                let memory = other.0.as_ptr();
                scratch.reuse(Brick::Counts { samples: other, hermite: Hermite::default() });
                let decoded = decode(head.kind, head.min, &bytes, &mut scratch).unwrap();
                assert!(decoded == *brick, "{compression}");
                let Brick::Counts { samples, .. } = decoded else { panic!("it is not uniform") };
                assert_eq!(samples.0.as_ptr(), memory, "{compression}");
            }
        }
    }
}
