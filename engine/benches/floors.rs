//! The main job as multiples of the read floor, all measured in one run:
//!
//!     cargo bench -p brickfield-engine --bench floors [-- FACETS|FILE [ROUNDS]]
//!
//! Calls of the library within one process, also meshes into memory, which `brickfield-bench` does not measure: it runs
//! the program. The floor is that of `brickfield-bench`, streaming the input once with all cores and snapping every
//! vertex, number by number in plain code; the engine's own snapping is the second row. Each round measures the floor and
//! then the jobs, so that a slow moment of the machine hits both; the table gives medians and ranges over the rounds.

use brickfield_bench_data::pile::bead_pile;
use brickfield_bench_data::write::StlWriter;
use brickfield_engine::analysis::{Dense, Element};
use brickfield_engine::build::{BuildOptions, BuildSummary, Resolution, build};
use brickfield_engine::contour::{ContourOptions, MeshArrays, MeshSink, contour, create_sink};
use brickfield_engine::store::Store;
use brickfield_engine::{Result, Silent};
use std::fs::File;
use std::io::BufWriter;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::time::Instant;

#[path = "../../tools/bench/src/floor.rs"]
mod floor;

/// Decoded bricks that a store keeps.
const CACHE_BYTES: u64 = 256 << 20;

fn main() -> Result<()> {
    // `cargo bench` adds --bench; `cargo test --benches` does not, and then a small pile only proves that it runs.
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let measuring = arguments.iter().any(|a| a == "--bench");
    let mut numbers = arguments.iter().filter_map(|a| a.replace('_', "").parse::<u64>().ok());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let given = arguments.iter().map(Path::new).find(|path| path.is_file());
    let input = match given {
        Some(file) => file.to_owned(),
        None => {
            let facets = numbers.next().unwrap_or(if measuring { 1_000_000 } else { 10_000 });
            println!("bead pile of {facets} facets");
            let pile = folder.path().join("pile.stl");
            write_pile(&pile, facets).expect("room for the pile");
            pile
        }
    };
    let rounds = numbers.next().unwrap_or(if measuring { 7 } else { 1 });
    println!("{}, {} threads, {rounds} rounds", input.display(), rayon::current_num_threads());
    let mut table = Table::default();
    let mut last = None;
    for _ in 0..rounds {
        last = Some(round(folder.path(), &input, &mut table)?);
    }
    table.print();
    if let Some(summary) = last {
        println!(
            "depth 5 store: {} nodes, {} leaves, {} bytes",
            summary.nodes, summary.leaves, summary.file_bytes
        );
        let phases = summary.phases.iter().map(|(name, s)| format!("{name} {:.1} ms", s * 1e3));
        println!("last depth 5 build: {}", phases.collect::<Vec<_>>().join(", "));
    }
    Ok(())
}

fn write_pile(path: &Path, facets: u64) -> std::io::Result<()> {
    let pile = bead_pile(1, facets, [100.0, 100.0, 12.0]);
    let mut stl = StlWriter::new(BufWriter::new(File::create(path)?), pile.triangles())?;
    for bead in pile {
        stl.mesh(&bead)?;
    }
    stl.finish().map(drop)
}

/// The rows that make a mesh.
const MESHES: [&str; 2] = ["mesh of the depth 4 store, STL", "the same, arrays in memory"];

/// One round: the floor, then every job.
fn round(folder: &Path, input: &Path, table: &mut Table) -> Result<BuildSummary> {
    // To replace the files of the round before would take the time that freeing their pages takes.
    for name in ["dense.brf", "512.brf", "deep.brf", "deeper.brf", "w.raw", "out.stl"] {
        let _ = std::fs::remove_file(folder.join(name));
    }
    let floor = floor::read_floor(input, true)?;
    table.add("read floor", floor, floor);
    let dense = folder.join("dense.brf");
    let mut row = |name, seconds| table.add(name, seconds, floor);
    let own = || floor::read_and_snap(input, floor::ROOT.snapper());
    row("the same with the engine's snapping", timed(|| Ok(std::hint::black_box(own()?)))?.0);
    row("build, depth 2 (dense 128³)", timed(|| build_to(input, &dense, 2))?.0);
    row("build, depth 4 (512³)", timed(|| build_to(input, &folder.join("512.brf"), 4))?.0);
    let deep = folder.join("deep.brf");
    let (seconds, summary) = timed(|| build_to(input, &deep, 5))?;
    row("build, depth 5 (1024³)", seconds);
    row("build, depth 6 (2048³)", timed(|| build_to(input, &folder.join("deeper.brf"), 6))?.0);
    row("export 128³ of the depth 5 store", timed(|| export(&deep, &folder.join("w.raw"), 2))?.0);
    let store = folder.join("512.brf");
    let (seconds, triangles) = timed(|| mesh(&store, &mut *create_sink(&folder.join("out.stl"), None)?))?;
    row(MESHES[0], seconds);
    let (seconds, in_memory) = timed(|| mesh(&store, &mut MeshArrays::default()))?;
    row(MESHES[1], seconds);
    assert_eq!(in_memory, triangles, "the same mesh");
    table.triangles = triangles;
    Ok(summary)
}

fn timed<T>(work: impl FnOnce() -> Result<T>) -> Result<(f64, T)> {
    let start = Instant::now();
    let done = work()?;
    Ok((start.elapsed().as_secs_f64(), done))
}

fn build_to(input: &Path, output: &Path, depth: u8) -> Result<BuildSummary> {
    let options = BuildOptions { resolution: Resolution::Depth(depth), ..BuildOptions::default() };
    build(&[input.to_owned()], output, &options, &Silent)
}

fn export(store: &Path, output: &Path, level: u8) -> Result<()> {
    let store = Store::open(store, CACHE_BYTES)?;
    let file = File::create(output).expect("a writable folder");
    let write_at = |offset, bytes: &[u8]| {
        file.write_all_at(bytes, offset).expect("room for the array");
        Ok(())
    };
    Dense::new(&store, level, Element::I16)?.write(&Silent, &write_at)
}

fn mesh(store: &Path, sink: &mut dyn MeshSink) -> Result<u64> {
    let store = Store::open(store, CACHE_BYTES)?;
    Ok(contour(&store, &ContourOptions::default(), sink, &Silent)?.triangles)
}

/// Seconds and floors of every job in every round.
#[derive(Default)]
struct Table {
    rows: Vec<(&'static str, Vec<(f64, f64)>)>,
    /// Of the mesh.
    triangles: u64,
}

impl Table {
    fn add(&mut self, name: &'static str, seconds: f64, floor: f64) {
        let measured = (seconds, seconds / floor);
        match self.rows.iter_mut().find(|(n, _)| *n == name) {
            Some((_, values)) => values.push(measured),
            None => self.rows.push((name, vec![measured])),
        }
    }

    fn print(&self) {
        println!("{:34} {:>10} {:>19} {:>8} {:>15}", "", "ms, median", "(range)", "floors", "(range)");
        for (name, values) in &self.rows {
            let spread = |mut v: Vec<f64>| {
                v.sort_by(f64::total_cmp);
                (v[v.len() / 2], v[0], v[v.len() - 1])
            };
            let (ms, ms_low, ms_high) = spread(values.iter().map(|v| v.0 * 1e3).collect());
            let (floors, low, high) = spread(values.iter().map(|v| v.1).collect());
            println!(
                "{name:34} {ms:10.1} {:>19} {floors:8.1} {:>15}",
                format!("({ms_low:.1} to {ms_high:.1})"),
                format!("({low:.1} to {high:.1})")
            );
            if MESHES.contains(name) {
                let rate = |ms: f64| self.triangles as f64 / ms / 1e3;
                println!("  {:.1} M triangles/s, {:.1} in the best round", rate(ms), rate(ms_low));
            }
        }
        println!("mesh: {} triangles", self.triangles);
    }
}
