//! Beads of picks, from the table that travels with a page, held against the solids of all segments.

use brickfield_bench_data::Rng;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::analysis::FaceBeads;
use brickfield_engine::brick::Count;
use brickfield_engine::build::{BuildOptions, Resolution, bead_sources, build_beads, listed_beads};
use brickfield_engine::contour::Coordinates;
use brickfield_engine::ingest::{Input, OpenOptions};
use brickfield_engine::lattice::{RootCube, Units};
use brickfield_engine::picks::{PickTable, PickedBead};
use brickfield_engine::solid::{Body, Outline, Segment, Solids};
use brickfield_engine::splats::{LevelsOptions, PickBeads, SplatLevels, bsp_bytes};
use brickfield_engine::store::{BrickTree, Store};
use std::path::{Path, PathBuf};

type V = [f64; 3];
/// A segment, its solid, and the box around that.
type PlacedSegment = (Segment, Body, (Units, Units));

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data").join(name)
}

/// A toolpath; of the one that says nothing of them with sizes of its beads.
fn input(name: &str) -> Input {
    let mut options = OpenOptions::default();
    if name.contains("five_axis") {
        (options.gcode.width, options.gcode.height) = (Some(2.0), Some(0.8));
    }
    Input::open_with(&file(name), &options, &Silent).unwrap()
}

/// A store that tells beads apart.
fn store(name: &str, folder: &Path) -> Store {
    let path = folder.join("part.brf");
    let input = input(name);
    let sources = bead_sources(std::slice::from_ref(&input)).unwrap();
    let options =
        BuildOptions { identity: true, resolution: Resolution::Depth(2), ..BuildOptions::default() };
    build_beads(&sources, (Outline::Stadium, Count::Passes), &path, &options, &Silent).unwrap();
    Store::open(&path, 1 << 26).unwrap()
}

/// Its table, as a page has it.
fn table(store: &Store) -> Vec<u8> {
    let levels = SplatLevels::new(store, LevelsOptions::default(), &Silent).unwrap();
    let splats = bsp_bytes(&levels, "mm", [[0.0; 3], [1.0; 3]], &Silent).unwrap().0;
    PickBeads::new(store, &Silent).unwrap().unwrap().bytes(&splats)
}

/// The same without the store's lists, from the toolpath.
fn table_of_toolpath(name: &str, store: &Store) -> Vec<u8> {
    let input = input(name);
    let sources = bead_sources(std::slice::from_ref(&input)).unwrap();
    let (tables, segments) = listed_beads(&sources, (Outline::Stadium, Count::Passes), store.root()).unwrap();
    let levels = SplatLevels::new(store, LevelsOptions::default(), &Silent).unwrap();
    let splats = bsp_bytes(&levels, "mm", [[0.0; 3], [1.0; 3]], &Silent).unwrap().0;
    PickBeads::of(store, tables, segments, &Silent).unwrap().bytes(&splats)
}

/// What a pick tells, of the blocks that it needs.
fn picked(table: &mut PickTable, bytes: &[u8], place: V, reach: f64) -> Option<PickedBead> {
    while let Some(block) = table.wanted(place, reach) {
        let [from, to] = [block, block + 1].map(|n| table.start(n) as usize);
        table.take(block, &bytes[from..to]).unwrap();
    }
    table.nearest(place, reach)
}

/// All segments of a toolpath with their solids.
struct Truth {
    root: RootCube,
    segments: Vec<PlacedSegment>,
    /// By segment: its bead, and its line.
    names: Vec<(u32, u64)>,
    layers: Vec<u32>,
}

impl Truth {
    fn of(name: &str, root: RootCube) -> Truth {
        let input = input(name);
        let sources = bead_sources(std::slice::from_ref(&input)).unwrap();
        let path = sources[0].toolpath;
        let (solids, segments) = Solids::new(&[path], root, Outline::Stadium, Count::Passes).unwrap();
        let names = (0..path.len()).flat_map(|bead| {
            (0..path.points(bead).len() - 1).map(move |n| (bead as u32, path.line(bead, n)))
        });
        let names = names.collect();
        let layers = (0..path.len()).map(|bead| path.attributes(bead).layer).collect();
        let segments = segments.iter().map(|s| (*s, solids.body(s), solids.bounds(s))).collect();
        Truth { root, segments, names, layers }
    }

    /// A place on the surface of a segment, in units, at random; none where a line misses it or another bead holds the place.
    fn place(&self, rng: &mut Rng) -> Option<(usize, V)> {
        let n = rng.range(0.0, self.segments.len() as f64) as usize;
        let (segment, body, (low, high)) = &self.segments[n];
        let axis = rng.range(0.0, 3.0) as usize;
        let mut at: V = std::array::from_fn(|a| {
            rng.range(f64::from(low[a]), f64::from(high[a])) - f64::from(segment.a[a])
        });
        let (from, to) = body.line(axis, at)?;
        at[axis] = if rng.range(0.0, 1.0) < 0.5 { from } else { to };
        let at: V = std::array::from_fn(|a| at[a] + f64::from(segment.a[a]));
        let holds = |(segment, body, (low, high)): &PlacedSegment| {
            let is_near = (0..3).all(|a| (f64::from(low[a])..=f64::from(high[a])).contains(&at[a]));
            is_near && body.value(std::array::from_fn(|a| at[a] - f64::from(segment.a[a]))) <= 0.0
        };
        let others = self.segments.iter().enumerate().filter(|(other, _)| *other != n);
        let is_surface = !others.into_iter().any(|(_, other)| holds(other));
        is_surface.then_some((n, at))
    }
}

#[test]
fn picks_tell_the_bead_that_the_solids_tell() {
    for name in [
        "clover.gcode",
        "gcode/nonplanar.gcode",
        "gcode/five_axis_ded.gcode",
        "gcode/thinwall_ladder_prusaslicer.gcode.gz",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let store = store(name, folder.path());
        let bytes = table(&store);
        assert!(table_of_toolpath(name, &store) == bytes, "{name}");
        let mut table = PickTable::open(&bytes).unwrap();
        let truth = Truth::of(name, store.root());
        assert_eq!(table.header().segments, truth.segments.len() as u64, "{name}");
        let faces = FaceBeads::new(&store, Coordinates::Single, Vec::new()).unwrap().unwrap();
        let steps = table.header().steps;
        let mut rng = Rng::new(5);
        let (mut asked, mut same_bead, mut same_line, mut same_face, mut worst) = (0, 0, 0, 0, 0.0f64);
        let all = part_or_all(300, 6000);
        for _ in 0..100 * all {
            let Some((n, at)) = truth.place(&mut rng) else { continue };
            let place = truth.root.to_world(at);
            let found = picked(&mut table, &bytes, place, 20.0 * steps.across)
                .unwrap_or_else(|| panic!("{name}: no bead at {place:?}"));
            let (bead, line) = truth.names[n];
            worst = worst.max(found.distance.abs());
            asked += 1;
            same_bead += usize::from(found.segment.bead.number == bead);
            same_line += usize::from((found.segment.bead.number, found.segment.line) == (bead, line));
            same_face += usize::from(faces.at(&[place]).unwrap()[0] == Some(found.segment.bead.number));
            assert_eq!(found.segment.bead.layer, truth.layers[found.segment.bead.number as usize]);
            if asked == all {
                break;
            }
        }
        let per_segment = bytes.len() as f64 / truth.segments.len() as f64;
        eprintln!(
            "{name}: of {asked} places {same_bead} the same bead, {same_line} the same line, {same_face} as `mesh --attributes`; {worst:.5} \
             off, step {:.5}; {} segments, {} bytes, {per_segment:.2} each",
            steps.across,
            truth.segments.len(),
            bytes.len()
        );
        assert_eq!(asked, all, "{name}");
        // Another bead's surface passes there as well.
        assert!(worst <= 1.5 * (steps.across + steps.up), "{name}: {worst}");
        assert!(same_bead as f64 >= 0.98 * asked as f64, "{name}: {same_bead} of {asked}");
    }
}

#[test]
fn tables_have_the_same_bytes_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let store = store("clover.gcode", folder.path());
    let made = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| table(&store))
    };
    assert!(made(1) == made(3));
}
