//! `brickfield cache get`: what one node holds.

use super::Row;
use crate::cache_args::GetArgs;
use crate::commands::open_store;
use crate::failure::Failure;
use crate::output::{one_line, print, print_json, require_distinct};
use brickfield_engine::Error;
use brickfield_engine::brick::{Brick, Hermite, SignChanges};
use brickfield_engine::cache::node_at;
use brickfield_engine::export::npy_header;
use brickfield_engine::lattice::{Axis, BRICK_POINTS, NodeKey};
use brickfield_engine::part::PartFile;
use brickfield_engine::store::{AcceptedStores, BrickTree, IndexEntry, Store};
use serde::Serialize;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Samples along an axis.
const P: usize = BRICK_POINTS;

/// How samples are written.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Npy,
    Raw,
    Csv,
}

/// What is told of the node.
#[derive(Serialize)]
struct Report {
    store: String,
    #[serde(flatten)]
    row: Row,
    unit: String,
    spacing: f64,
    /// 0 where samples are whole numbers.
    binary_places: u8,
    inside_samples: usize,
    /// Along x, y and z.
    hermite_edges: [usize; 3],
}

/// Runs the command.
pub fn run(args: &GetArgs) -> Result<(), Failure> {
    let format = args.samples.as_deref().map(format_of).transpose()?;
    let outputs: Vec<&Path> =
        [&args.samples, &args.hermite].into_iter().flatten().map(|path| path.as_path()).collect();
    let files: Vec<&Path> = outputs.iter().copied().filter(|path| !is_stdout(path)).collect();
    if outputs.len() - files.len() > 1 {
        return Err(Failure::Usage(
            "only one of --samples and --hermite can go to standard output".to_owned(),
        ));
    }
    require_distinct(&files, &[&args.store])?;
    let store = open_store(&args.store, 0, args.io, AcceptedStores::Unfinished)?;
    let entry = entry_of(args, &store)?;
    let brick = store.brick(entry.key)?;
    if let (Some(path), Some(format)) = (&args.samples, format) {
        deliver(path, &samples_as(&brick, format))?;
    }
    if let Some(path) = &args.hermite {
        deliver(path, hermite_as_csv(&store, entry.key, &brick).as_bytes())?;
    }
    if outputs.len() > files.len() {
        return Ok(());
    }
    let report = report(args, &store, &entry, &brick);
    if args.json { print_json(&report) } else { print(&as_text(&report)) }
}

fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

fn format_of(path: &Path) -> Result<Format, Failure> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        _ if is_stdout(path) => Ok(Format::Csv),
        Some("npy") => Ok(Format::Npy),
        Some("raw") => Ok(Format::Raw),
        Some("csv") => Ok(Format::Csv),
        _ => Err(Failure::Usage(format!("{}: samples are written as .npy, .raw or .csv", path.display()))),
    }
}

/// The node asked for.
fn entry_of(args: &GetArgs, store: &Store) -> Result<IndexEntry, Failure> {
    let place = |point| node_at(store, point, args.level);
    let key = match (args.node, args.point) {
        (Some(node), _) => Some(node.0),
        (None, point) => point.and_then(|point| place(point.0)),
    };
    let entry = key.and_then(|key| store.entry(key)).copied();
    entry.ok_or_else(|| {
        let place = key.map_or("the point".to_owned(), |key| format!("record {key}"));
        let what = "the store has no node there";
        Error::store(store.path(), place, what, "`brickfield cache ls` lists the nodes").into()
    })
}

fn report(args: &GetArgs, store: &Store, entry: &IndexEntry, brick: &Brick) -> Report {
    let (binary_places, hermite_edges) = match brick {
        Brick::Uniform(_) => (0, [0; 3]),
        Brick::Counts { samples, hermite } => (samples.1, hermite.edges.each_ref().map(Vec::len)),
    };
    Report {
        store: args.store.display().to_string(),
        row: Row::of(entry, store.meta()),
        unit: store.meta().unit.clone(),
        spacing: store.meta().root.spacing(entry.key.level()),
        binary_places,
        inside_samples: points().filter(|&ijk| brick.sample(ijk) >= 1).count(),
        hermite_edges,
    }
}

fn as_text(report: &Report) -> String {
    let Report { store, row, unit, spacing, binary_places, inside_samples, hermite_edges } = report;
    let Row { node, key, leaf, kind, min, max, offset, bytes, crc, corners, .. } = row;
    let [low, high] = corners.map(|[x, y, z]| format!("({x:.6}, {y:.6}, {z:.6})"));
    let leaf = if *leaf { "a leaf" } else { "an interior node" };
    let [x, y, z] = hermite_edges;
    let store = one_line(store);
    let mut text = format!("{store}: {node}, {leaf}, key {key}\n");
    let _ = write!(
        text,
        "  payload  {kind}, {bytes} bytes at {offset}, CRC-32 {crc}\n  samples  {min} to {max}, {inside_samples} of {} \
         inside, {binary_places} binary places\n  edges    {x} along x, {y} along y, {z} along z\n  cells    of \
         {spacing:.6} {unit}, from {low} to {high}\n",
        P * P * P
    );
    text
}

/// All samples, x fastest.
fn points() -> impl Iterator<Item = [usize; 3]> {
    (0..P * P * P).map(|n| [n % P, n / P % P, n / (P * P)])
}

/// A sample as it is stored.
fn stored(brick: &Brick, ijk: [usize; 3]) -> i16 {
    match brick {
        Brick::Uniform(w) => *w,
        Brick::Counts { samples, .. } => samples.at(ijk),
    }
}

fn samples_as(brick: &Brick, format: Format) -> Vec<u8> {
    let whole =
        |brick: &Brick| points().flat_map(|ijk| stored(brick, ijk).to_le_bytes()).collect::<Vec<u8>>();
    match format {
        Format::Raw => whole(brick),
        Format::Npy if !brick.has_fractions() => [npy_header("<i2", P), whole(brick)].concat(),
        Format::Npy => {
            let values = points().flat_map(|ijk| brick.value(ijk).to_le_bytes());
            npy_header("<f8", P).into_iter().chain(values).collect()
        }
        Format::Csv => {
            let mut text = String::from("i,j,k,w\n");
            for [i, j, k] in points() {
                let _ = writeln!(text, "{i},{j},{k},{}", brick.value([i, j, k]));
            }
            text.into_bytes()
        }
    }
}

fn hermite_as_csv(store: &Store, key: NodeKey, brick: &Brick) -> String {
    let mut text = String::from("axis,i,j,k,offset,x,y,z,nx,ny,nz\n");
    let Brick::Counts { samples, hermite } = brick else { return text };
    let signs = SignChanges::of(samples);
    let root = store.meta().root;
    let spacing = f64::from(1u32 << key.spacing_bits());
    for (axis, [i, j, k], edge) in edges(&signs, hermite) {
        let mut at = [i, j, k].map(|c| c as f64);
        at[axis] += edge.fraction();
        let base = key.base();
        let [x, y, z] = root.to_world([0, 1, 2].map(|a| f64::from(base[a]) + 1.0 + at[a] * spacing));
        let [nx, ny, nz] = edge.normal.to_vector();
        let name = ["x", "y", "z"][axis];
        let _ = writeln!(text, "{name},{i},{j},{k},{},{x},{y},{z},{nx},{ny},{nz}", edge.fraction());
    }
    text
}

/// Hermite edges with their axis and lower sample; none of nodes that keep none.
fn edges<'a>(
    signs: &'a SignChanges,
    hermite: &'a Hermite,
) -> impl Iterator<Item = (usize, [usize; 3], brickfield_engine::brick::HermiteEdge)> + 'a {
    Axis::ALL.into_iter().flat_map(move |axis| {
        let changes = move |ijk: &[usize; 3]| signs.edges(axis, ijk[1], ijk[2]) >> ijk[0] & 1 == 1;
        let lowers = points().filter(changes);
        lowers.zip(&hermite.edges[axis.index()]).map(move |(ijk, edge)| (axis.index(), ijk, *edge))
    })
}

/// To a file, which gets its name when it is complete, or to standard output.
fn deliver(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if is_stdout(path) {
        let mut out = std::io::stdout().lock();
        return out.write_all(bytes).and_then(|()| out.flush()).map_err(Failure::stdout);
    }
    let mut part = PartFile::create(path)?;
    part.append(bytes)?;
    Ok(part.finish()?)
}
