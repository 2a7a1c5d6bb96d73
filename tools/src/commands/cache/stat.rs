//! `brickfield cache stat`: where the bytes of a store are.

use crate::cache_args::StatArgs;
use crate::commands::{open_store, start};
use crate::failure::Failure;
use crate::output::{one_line, print, print_json};
use crate::units::Size;
use brickfield_engine::cache::{FileBytes, KindNumbers, PartBytes, RecordNumbers, Statistics, statistics};
use brickfield_engine::store::AcceptedStores;
use serde::Serialize;

/// What is printed as JSON.
#[derive(Serialize)]
struct Report {
    path: String,
    unfinished: bool,
    #[serde(flatten)]
    statistics: Statistics,
}

/// Runs the command.
pub fn run(args: &StatArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    // No brick is read twice, so none is kept.
    let store = open_store(&args.store, 0, args.io, AcceptedStores::Unfinished)?;
    let statistics = statistics(&store, &bars)?;
    bars.clear();
    let path = args.store.display().to_string();
    if args.json {
        return print_json(&Report { path, unfinished: store.is_unfinished(), statistics });
    }
    print(&as_text(&path, &statistics))
}

fn as_text(path: &str, statistics: &Statistics) -> String {
    let Statistics { levels, total, lists, file } = statistics;
    let FileBytes { bytes, payloads, lists: list_bytes, tables, index, rest, .. } = *file;
    let mut text = format!("{}: {}\n", one_line(path), Size(bytes));
    let mut line = |line: String| text += &format!("{line}\n");
    line(format!("  {:<28} {:>12} bytes", "payloads", payloads));
    if list_bytes + tables > 0 {
        line(format!("  {:<28} {list_bytes:>12} bytes", "lists of beads"));
        line(format!("  {:<28} {tables:>12} bytes", "tables and index of beads"));
    }
    line(format!("  {:<28} {index:>12} bytes", "index"));
    line(format!("  {:<28} {rest:>12} bytes", "header, metadata, gaps"));
    for (name, KindNumbers { records, bytes }) in &total.kinds {
        line(format!("  {name:<28} {bytes:>12} bytes in {records} records"));
    }
    for (name, part) in
        [("samples parts", total.samples), ("Hermite parts", total.hermite), ("beads", *lists)]
    {
        if part.records > 0 {
            line(format!("  {name:<28} {}", part_text(part)));
        }
    }
    line(format!(
        "  {:>5} {:>12} {:>9} {:>9} {:>11} {:>11} {:>12} {:>12} {:>8} {:>8}",
        "level", "cell", "bricks", "leaves", "samples", "Hermite", "crossing", "active", "B/cell", "B/voxel"
    ));
    let row = |name: String, cell: String, n: &RecordNumbers| {
        let ratio = |ratio: Option<f64>| ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.3}"));
        format!(
            "  {name:>5} {cell:>12} {:>9} {:>9} {:>11} {:>11} {:>12} {:>12} {:>8} {:>8}",
            n.records,
            n.leaves,
            n.samples.stored,
            n.hermite.stored,
            n.crossing_cells,
            n.active_voxels,
            ratio(n.bytes_per_crossing_cell),
            ratio(n.bytes_per_active_voxel)
        )
    };
    for level in levels {
        line(row(level.level.to_string(), format!("{:.6}", level.spacing), &level.numbers));
    }
    line(row("all".to_owned(), String::new(), total));
    if let (Some(cell), Some(voxel)) = (file.per_crossing_cell, file.per_active_voxel) {
        line(format!("  the file takes {cell:.3} bytes a crossing cell, {voxel:.3} bytes an active voxel"));
    }
    text
}

fn part_text(PartBytes { records, stored, plain }: PartBytes) -> String {
    let share = if plain > 0 { stored as f64 / plain as f64 * 100.0 } else { 100.0 };
    format!("{stored:>12} bytes in {records} records, {share:.1} % of {plain} plain bytes")
}
