//! What the parts of a build cost: `cargo bench -p brickfield-engine --bench kernel`.
//!
//! Run as a test, each runs once on a hundredth of the input. Nothing here asserts a time.

use brickfield_bench_data::pile::bead_pile;
use brickfield_bench_data::write::StlWriter;
use brickfield_engine::Silent;
use brickfield_engine::brick::{Brick, codec};
use brickfield_engine::build::{TreeOptions, build_in_memory};
use brickfield_engine::ingest::{Facet, Input, runs};
use brickfield_engine::lattice::{CubeTest, NodeKey, Octant, RootCube, Triangle, bounds};
use brickfield_engine::winding::{CornerGrid, Evaluator, TriangleList, winding_at};
use divan::Bencher;
use divan::counter::{BytesCount, ItemsCount};
use rayon::prelude::*;
use std::sync::LazyLock;

fn main() {
    divan::main();
}

/// The pile of one million facets as binary STL, opened as any input.
struct Pile {
    input: Input,
    root: RootCube,
}

static PILE: LazyLock<Pile> = LazyLock::new(|| {
    // `cargo bench` passes --bench; `cargo test --benches` does not.
    let facets = if std::env::args().any(|a| a == "--bench") { 1_000_000 } else { 10_000 };
    let pile = bead_pile(1, facets, [100.0, 100.0, 12.0]);
    let mut stl = StlWriter::new(Vec::new(), pile.triangles()).expect("into memory");
    pile.for_each(|bead| stl.mesh(&bead).expect("into memory"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("pile.stl");
    std::fs::write(&path, stl.finish().expect("all facets")).expect("room for 50 MB");
    let input = Input::open(&path, &Silent).expect("a binary STL");
    let (min, max) = input.bounds(&Silent).expect("finite");
    let root = RootCube::around(min, max).expect("an extent");
    // The folder goes; the map stays, since a static is never dropped and would leave the folder behind.
    drop(folder);
    Pile { input, root }
});

/// The floor under everything: every facet decoded and snapped on all cores, and forgotten.
#[divan::bench]
fn read_and_snap(bencher: Bencher) {
    let pile = &*PILE;
    let snap = pile.root.snapper();
    let work = || -> i64 {
        let of_run = |world: &mut Vec<Facet>, (_, range): (usize, std::ops::Range<u64>)| -> i64 {
            pile.input.read(range, world);
            // A sum of everything, so that nothing is optimised away.
            world.iter().map(|t| t.map(snap).as_flattened().iter().map(|&c| i64::from(c)).sum::<i64>()).sum()
        };
        runs(&[&pile.input]).into_par_iter().map_init(Vec::new, of_run).sum()
    };
    bencher
        .counter(ItemsCount::new(pile.input.facets()))
        .counter(BytesCount::new(pile.input.bytes()))
        .bench(work);
}

/// 128³ samples of the whole pile, in memory.
#[divan::bench(max_time = 20)]
fn dense_128(bencher: Bencher) {
    let pile = &*PILE;
    let options = TreeOptions { depth: 2, ..Default::default() };
    bencher
        .counter(ItemsCount::new(pile.input.facets()))
        .bench(|| build_in_memory(&[&pile.input], pile.root, options).expect("closed"));
}

/// Bricks of level 5 below one of level 3, their corners and triangles.
struct Region {
    triangles: Vec<Triangle>,
    bricks: Vec<(NodeKey, i16, Vec<u32>)>,
}

static REGION: LazyLock<Region> = LazyLock::new(|| {
    let pile = &*PILE;
    let top = NodeKey::new(3, [4, 4, 4]).expect("in the middle");
    let snap = pile.root.snapper();
    let mut world = Vec::new();
    pile.input.read(0..pile.input.facets(), &mut world);
    let triangles: Vec<Triangle> = world.iter().map(|t| t.map(snap)).filter(|t| touches(top, t)).collect();
    let corner = pile.root.to_world(top.base().map(|c| f64::from(c + 1)));
    let corner = winding_at(&[&pile.input], pile.root, &[corner], &Silent).expect("not interrupted")[0];
    let mut grid = CornerGrid::new(top, 2);
    triangles.iter().for_each(|t| grid.add(t));
    let corners = grid.finish(corner);
    let mut bricks = Vec::new();
    for key in Octant::all().flat_map(|a| Octant::all().map(move |b| top.child(a).child(b))) {
        let [x, y, z] = key.position().map(|p| p as usize % 4);
        let touching = |&i: &u32| touches(key, &triangles[i as usize]);
        let list: Vec<u32> = (0..triangles.len() as u32).filter(touching).collect();
        bricks.push((key, corners[(z * 4 + y) * 4 + x] as i16, list));
    }
    Region { triangles, bricks }
});

fn touches(key: NodeKey, t: &Triangle) -> bool {
    let low = key.base().map(|b| b + 1);
    let size = 32 << key.spacing_bits();
    let (min, max) = bounds(t);
    (0..3).all(|a| min[a] <= low[a] + size && max[a] >= low[a]) && CubeTest::new(t, size).touches(low)
}

fn evaluate(region: &Region, evaluator: &mut Evaluator, mut each: impl FnMut(Brick)) {
    for (key, corner, indices) in &region.bricks {
        let list = TriangleList { array: &region.triangles, indices };
        let evaluation = evaluator.evaluate(*key, *corner, list).expect("few overlaps");
        each(evaluation.into_leaf().expect("closed"));
    }
}

/// 64 bricks of level 5 with their Hermite edges, on one thread.
#[divan::bench]
fn leaf_bricks(bencher: Bencher) {
    let region = &*REGION;
    let mut evaluator = Evaluator::default();
    bencher.counter(ItemsCount::new(region.bricks.len())).bench_local(|| {
        evaluate(region, &mut evaluator, |brick| drop(divan::black_box(brick)));
    });
}

/// The same bricks without their Hermite edges.
#[divan::bench]
fn samples_of_bricks(bencher: Bencher) {
    let region = &*REGION;
    let mut evaluator = Evaluator::default();
    bencher.counter(ItemsCount::new(region.bricks.len())).bench_local(|| {
        for (key, corner, indices) in &region.bricks {
            let list = TriangleList { array: &region.triangles, indices };
            divan::black_box(evaluator.evaluate(*key, *corner, list).expect("few overlaps").samples);
        }
    });
}

fn evaluated() -> Vec<Brick> {
    let mut bricks = Vec::new();
    evaluate(&REGION, &mut Evaluator::default(), |brick| bricks.push(brick));
    bricks
}

/// The same bricks into their stored form.
#[divan::bench]
fn encode(bencher: Bencher) {
    let bricks = evaluated();
    let mut scratch = codec::Scratch::new();
    let mut out = Vec::new();
    bencher.counter(ItemsCount::new(bricks.len())).bench_local(|| {
        out.clear();
        for brick in &bricks {
            divan::black_box(codec::encode_into(brick, &mut scratch, &mut out));
        }
    });
}

/// And back.
#[divan::bench]
fn decode(bencher: Bencher) {
    let payloads: Vec<codec::Payload> = evaluated().iter().map(codec::encode).collect();
    let mut scratch = codec::Scratch::new();
    bencher.counter(ItemsCount::new(payloads.len())).bench_local(|| {
        for payload in &payloads {
            let head = payload.head;
            divan::black_box(
                codec::decode(head.kind, head.min, &payload.bytes, &mut scratch).expect("sound"),
            );
        }
    });
}
