use super::*;
use proptest::prelude::*;

fn segments() -> impl Strategy<Value = Vec<PickSegment>> {
    let place = || prop::array::uniform3(0i32..1 << 20);
    let bead = (0u32..90, 0u32..9, 0u32..3, 0u32..2, 1u64..1 << 40, 0u64..99);
    let segment =
        (place(), place(), 1u32..5000, 1u32..5000, any::<bool>(), bead, any::<bool>(), any::<bool>());
    prop::collection::vec(segment, 1..60).prop_map(|list| {
        let mut made: Vec<PickSegment> = Vec::new();
        for (
            a,
            b,
            width,
            height,
            is_turned,
            (number, layer, feature, source, line, more),
            follows,
            is_same,
        ) in list
        {
            let last = made.last().copied().unwrap_or(PickSegment::START);
            let a = if follows { last.b } else { a };
            let axis = if is_turned { [3000, -4000, 15_000] } else { [0, 0, AXIS_ONE] };
            let bead = PickBead { number, layer, feature, source, lines: (line, line + more) };
            let bead = if is_same && !made.is_empty() { last.bead } else { bead };
            made.push(PickSegment { a, b, width, height, axis, bead, line });
        }
        made
    })
}

/// What is kept of segments, by whose lines a table has.
fn kept(segments: &[PickSegment], by_segment: bool) -> Vec<PickSegment> {
    let kept = |s: &PickSegment| {
        let lines = if by_segment { (0, 0) } else { s.bead.lines };
        PickSegment { line: if by_segment { s.line } else { 0 }, bead: PickBead { lines, ..s.bead }, ..*s }
    };
    segments.iter().map(kept).collect()
}

fn header(by_segment: bool, outline: PickOutline) -> PickHeader {
    let steps = Steps { across: 0.01, up: 0.0025 };
    let origin = [5.0, -7.0, 0.5];
    PickHeader { part: 77, ..PickHeader::new(origin, steps, outline, by_segment) }
}

fn table(segments: &[PickSegment], by_segment: bool, outline: PickOutline, at_once: usize) -> Vec<u8> {
    let header = header(by_segment, outline);
    let blocks: Vec<_> = segments.chunks(at_once).map(|some| header.code(some)).collect();
    let features = ["", "Perimètre", "Infill"].map(str::to_owned);
    pick_table_bytes(header, &features, &["a.gcode".to_owned(), "b.gcode".to_owned()], &blocks)
}

fn load(table: &mut PickTable, bytes: &[u8], block: usize) -> Result<(), crate::bsp::Fault> {
    let [from, to] = [block, block + 1].map(|n| table.start(n) as usize);
    table.take(block, &bytes[from..to])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn segments_survive(list in segments(), by_segment in any::<bool>(), at_once in 1usize..40) {
        let list = kept(&list, by_segment);
        let bytes = table(&list, by_segment, PickOutline::Stadium, at_once);
        let mut read = PickTable::open(&bytes).unwrap();
        prop_assert_eq!(read.features().len(), 3);
        prop_assert_eq!(&read.sources()[1], "b.gcode");
        prop_assert_eq!(read.header().part, 77);
        prop_assert_eq!(read.start(read.blocks().len()), bytes.len() as u64);
        for block in 0..read.blocks().len() {
            load(&mut read, &bytes, block).unwrap();
        }
        let all: Vec<PickSegment> = read.loaded().values().flatten().copied().collect();
        prop_assert_eq!(all, list);
    }

    #[test]
    fn damage_is_found(list in segments(), at in any::<prop::sample::Index>(), flip in 1u8..) {
        let mut bytes = table(&list, true, PickOutline::Ellipse, 16);
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        let sound = PickTable::open(&bytes).and_then(|mut read| (0..read.blocks().len()).try_for_each(|n| load(&mut read, &bytes, n)));
        prop_assert!(sound.is_err());
        bytes.truncate(at);
        prop_assert!(PickTable::open(&bytes).map_or(true, |read| read.start(read.blocks().len()) > at as u64));
    }

    #[test]
    fn the_blocks_that_are_wanted_are_enough(
        list in segments(), place in prop::array::uniform3(0.0f64..9000.0), reach in 1.0f64..4000.0,
    ) {
        let bytes = table(&list, true, PickOutline::Stadium, 4);
        let place = [place[0] + 5.0, place[1] - 7.0, place[2] / 4.0 + 0.5];
        let mut all = PickTable::open(&bytes).unwrap();
        (0..all.blocks().len()).for_each(|n| load(&mut all, &bytes, n).unwrap());
        let mut some = PickTable::open(&bytes).unwrap();
        while let Some(n) = some.wanted(place, reach) {
            load(&mut some, &bytes, n).unwrap();
        }
        prop_assert_eq!(all.wanted(place, reach), None);
        prop_assert_eq!(some.nearest(place, reach), all.nearest(place, reach));
        if let Some(found) = all.nearest(place, reach) {
            prop_assert!(found.distance <= reach && found.heights.0 < found.heights.1);
        }
    }
}

fn upright(a: [i32; 3], b: [i32; 3], width: u32, height: u32) -> PickSegment {
    PickSegment { a, b, width, height, ..PickSegment::START }
}

#[test]
fn distances_are_those_of_closed_forms() {
    let steps = Steps { across: 0.01, up: 0.0025 };
    // Half widths of 0.3, half heights of 0.1: flat for 0.2 beside the centre line.
    let bead = upright([0, 0, 0], [500, 0, 0], 60, 80);
    let of = |at, outline| bead.beside(at, outline, steps);
    for (at, expected) in [
        ([2.0, 0.0, 0.1], 0.0),
        ([2.0, 0.0, 0.35], 0.25),
        ([2.0, 0.15, -0.3], 0.2),
        ([2.0, 0.3, 0.0], 0.0),
        ([2.0, -0.5, 0.0], 0.2),
        ([2.0, 0.0, 0.0], -0.1),
        ([5.5, 0.0, 0.0], 0.2),
        ([-0.2, 0.0, 0.1], 0.0),
        ([2.0, 0.5, 0.4], 0.4),
    ] {
        assert!((of(at, PickOutline::Stadium).distance - expected).abs() < 1e-12, "{at:?}");
    }
    assert!((of([2.0, 0.3, 0.0], PickOutline::Stadium).part - 0.4).abs() < 1e-12);
    for at in [[2.0, 0.3, 0.0], [1.0, 0.0, 0.1], [5.3, 0.0, 0.0], [2.0, 0.18, 0.08]] {
        assert!(of(at, PickOutline::Ellipse).distance.abs() < 1e-12, "{at:?}");
    }
    assert!(of([2.0, 0.0, 0.11], PickOutline::Ellipse).distance > 0.0099);
    // One that stands upright, as a wall: half a width of 0.1, half a height of 0.3.
    let wall = upright([0, 0, 0], [500, 0, 0], 20, 240);
    assert!(wall.beside([1.0, 0.1, 0.15], PickOutline::Stadium, steps).distance.abs() < 1e-12);
    assert!(wall.beside([1.0, 0.0, 0.3], PickOutline::Stadium, steps).distance.abs() < 1e-12);
    assert_eq!(bead.heights(0.5, steps), (-0.1, 0.1));
    // One that climbs straight up is as wide one way and as high the other, as seen from above.
    let upward = upright([0, 0, 0], [0, 0, 2000], 60, 80);
    let of = |x: f64, y: f64| upward.beside([x, y, 2.0], PickOutline::Stadium, steps).distance.abs();
    let (x, y) = ((of(0.1, 0.0), of(0.0, 0.3)), (of(0.3, 0.0), of(0.0, 0.1)));
    assert!(x.0.max(x.1) < 1e-12 || y.0.max(y.1) < 1e-12, "{x:?} {y:?}");
}

#[test]
fn a_place_within_two_beads_is_that_of_the_one_that_reaches_farther() {
    let mut first = upright([0, 0, 0], [500, 0, 0], 60, 80);
    let mut second = upright([0, 50, 0], [500, 50, 0], 60, 80);
    first.bead.number = 4;
    second.bead.number = 5;
    let bytes = table(&[first, second], true, PickOutline::Stadium, 8);
    let mut read = PickTable::open(&bytes).unwrap();
    load(&mut read, &bytes, 0).unwrap();
    let of = |y: f64| read.nearest([7.0, y - 7.0, 0.55], 0.1).map(|found| found.segment.bead.number);
    // They meet at 0.25.
    assert_eq!(
        [of(0.1), of(0.24), of(0.25), of(0.26), of(0.4)],
        [Some(4), Some(4), Some(4), Some(5), Some(5)]
    );
    assert_eq!(of(0.95), None);
    assert_eq!(read.nearest([f64::NAN, 0.0, 0.0], 1.0), None);
}

#[test]
fn lines_of_infill_take_few_bytes() {
    let mut list = Vec::new();
    for n in 0..4000i32 {
        let place = |n: i32| [if (n / 2) % 2 == 0 { 100 } else { 9000 }, 40 * ((n + 1) / 2), 80];
        let bead = PickBead { number: 3, layer: 1, ..PickBead::default() };
        list.push(PickSegment { bead, line: 100 + n as u64, ..upright(place(n), place(n + 1), 60, 80) });
    }
    let bytes = table(&list, true, PickOutline::Stadium, SEGMENTS_MAX);
    assert!(bytes.len() < 4500, "{} bytes", bytes.len());
}

/// What version 1 is.
const GOLDEN: &[u8] = include_bytes!("../../golden/v1/beads.picks");

fn golden() -> Vec<u8> {
    let mut list = Vec::new();
    for n in 0..300i32 {
        let place = |n: i32| [5000 + 97 * (n % 23) - n * n % 31, 4000 + 61 * (n % 19), 40 + 80 * (n / 100)];
        let bead = PickBead {
            number: (n / 20) as u32,
            layer: (n / 100) as u32,
            feature: (n / 50 % 3) as u32,
            ..PickBead::default()
        };
        let a = if n % 20 == 0 { [place(n)[0] + 400, place(n)[1], place(n)[2]] } else { place(n) };
        let mut segment = PickSegment {
            bead,
            line: 7 + n as u64 + (n / 20 * 3) as u64,
            ..upright(a, place(n + 1), 58 + (n % 3) as u32, 80)
        };
        if n > 250 {
            (segment.axis, segment.bead.source) = ([100 * (n % 5) as i16, 0, 16_000], 1);
        }
        list.push(segment);
    }
    table(&list, true, PickOutline::Stadium, 128)
}

#[test]
fn the_golden_file_is_read_and_written() {
    let mut read = PickTable::open(GOLDEN).unwrap();
    assert_eq!((read.header().segments, read.blocks().len()), (300, 3));
    (0..3).for_each(|n| load(&mut read, GOLDEN, n).unwrap());
    let last = read.loaded()[&2][43];
    assert_eq!((last.line, last.bead.number, last.bead.source, last.width), (348, 14, 1, 60));
    assert!(golden() == GOLDEN, "a change of the format is a new version");
}

#[test]
#[ignore = "writes the golden file and the seeds of the fuzzer"]
fn makes_golden_files() {
    let top = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let seeds = top.join("../../fuzz/seeds/picks");
    std::fs::create_dir_all(top.join("golden/v1")).unwrap();
    std::fs::create_dir_all(&seeds).unwrap();
    std::fs::write(top.join("golden/v1/beads.picks"), golden()).unwrap();
    std::fs::write(seeds.join("beads.picks"), golden()).unwrap();
    let two = [upright([0, 0, 0], [500, 0, 0], 60, 80), upright([500, 0, 0], [500, 300, 90], 60, 80)];
    std::fs::write(seeds.join("ellipse.picks"), table(&two, false, PickOutline::Ellipse, 1)).unwrap();
}
