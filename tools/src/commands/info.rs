//! `brickfield info`: what is in a store; for each kind of input see the files `info_*.rs`.

use super::balance::Balance;
use super::{
    info_cloud, info_devices, info_mesh, info_three_mf, info_toolpath, info_volume, info_x3d, open_store,
    start, unit_of, volumes_text,
};
use crate::args::InfoArgs;
use crate::failure::Failure;
use crate::kinds::{FileKind, not_read};
use crate::output::{in_line, one_line, print, print_json, warn};
use crate::pieces::{negative, negative_text};
use crate::units::Size;
use crate::work::{ProgressArg, WorkArgs};
use brickfield_engine::analysis::{Volumes, volume, winding_range};
use brickfield_engine::import::is_volume;
use brickfield_engine::ingest::InputKind;
use brickfield_engine::store::{
    AcceptedStores, BeadsMeta, LayerVolumes, LevelSummary, Meta, NodeNumbers, Source, SourceVolumes, Store,
    StoreSummary,
};
use serde_json::{Value, json};
use std::path::Path;

/// Runs the command.
pub fn run(args: &InfoArgs) -> Result<(), Failure> {
    let Some(file) = args.file.as_deref().filter(|_| !args.devices) else {
        return info_devices::run(args.json);
    };
    if is_volume(file) {
        return info_volume::run(file, args);
    }
    if let Some(kind) = FileKind::of(file).filter(|kind| *kind != FileKind::Store) {
        return of_input(file, kind, args);
    }
    // No brick is read twice, so none is kept.
    let store = open_store(file, 0, args.io, AcceptedStores::Unfinished)?;
    if let (Some(shard), true) = (&store.meta().shard, args.volume) {
        let what = format!("--volume: this is shard {} of a store; join all with `cache merge`", shard.id);
        return Err(anyhow::anyhow!("{}: {what}", file.display()).into());
    }
    if store.is_unfinished() && args.volume {
        let what = "--volume: this store is unfinished; give the command that builds it again, which goes on";
        return Err(anyhow::anyhow!("{}: {what}", file.display()).into());
    }
    let bars = start(WorkArgs { threads: args.threads, quiet: false, progress: ProgressArg::Auto })?;
    let volumes = args.volume.then(|| volume(&store, &bars)).transpose()?;
    // Samples cannot know what lies between them; the source does.
    let source = store.meta().volumes.as_ref().map(Volumes::from);
    let volumes = volumes.map(|volumes| source.map_or(volumes, |source| volumes.not_nearer_than(&source)));
    let negative = negative(&store, &bars)?;
    bars.clear();
    let warning = negative.map(|volume| negative_text(volume, unit_of(store.meta())));
    warning.iter().for_each(|warning| warn(&format!("{}: {warning}", file.display())));
    if args.json {
        let mut json = as_json(&store, volumes);
        json["negative_volume"] = negative.map(|(volume, _)| volume).into();
        json["negative_volume_error"] = negative.map(|(_, error)| error).into();
        return print_json(&json);
    }
    let warning = warning.map_or(String::new(), |warning| format!("  warning  {warning}\n"));
    print(&(as_text(&store, volumes) + &warning))
}

/// Says what is in a file that is no store.
fn of_input(file: &Path, kind: FileKind, args: &InfoArgs) -> Result<(), Failure> {
    if args.volume {
        let name = kind.name().unwrap_or_else(|| "no store".to_owned());
        let what = format!("--volume takes a store; {} is {name}", file.display());
        return Err(Failure::Usage(what));
    }
    match kind {
        FileKind::Input(InputKind::Mesh(_)) => info_mesh::run(file, args),
        FileKind::Input(InputKind::Cloud(_)) => info_cloud::run(file, args),
        FileKind::Input(InputKind::Toolpath) => info_toolpath::run(file, args),
        FileKind::Input(InputKind::X3d) => info_x3d::run(file, args),
        FileKind::Input(InputKind::ThreeMf) => info_three_mf::run(file, args),
        _ => Err(not_read(file, kind).into()),
    }
}

fn hex(hash: &[u8]) -> String {
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What telling beads apart takes of the file.
fn identity_bytes(store: &Store) -> u64 {
    let lists: u64 = store.identity_entries().iter().map(|entry| u64::from(entry.length)).sum();
    let place = store.meta().beads.as_ref().and_then(|beads| beads.identity).unwrap_or_default();
    lists + place.tables_bytes + place.index_bytes()
}

fn as_json(store: &Store, volumes: Option<Volumes>) -> Value {
    let Meta {
        program,
        sources,
        unit,
        root,
        bounds_min,
        bounds_max,
        depth,
        refine,
        stddev,
        tolerance,
        numbers,
        beads,
        shard,
        ..
    } = store.meta();
    let source = |Source { path, bytes, facets, format, blake3 }: &Source| json!({ "path": path, "bytes": bytes, "facets": facets, "format": format, "blake3": hex(blake3) });
    let winding = winding_range(store);
    json!({
        "path": store.path().display().to_string(),
        "program": program,
        "sources": sources.iter().map(source).collect::<Vec<_>>(),
        "unfinished": store.is_unfinished(),
        "unit": unit,
        // As it was called before.
        "units": unit,
        "bounds": [bounds_min, bounds_max],
        "root": { "origin": root.origin, "edge": root.edge },
        "shard": shard.as_ref().map(|shard| json!({
            "number": shard.id.number,
            "of": shard.id.of,
            "level": shard.level,
            "cubes": [shard.found.cells.0, shard.found.cells.1],
        })),
        "depth": depth,
        "refine": refine,
        "stddev": stddev,
        "tolerance": tolerance,
        "facets": numbers.facets,
        "degenerate_facets": numbers.degenerate_facets,
        "beads": beads.as_ref().map(|beads| json!({
            "section": beads.section,
            "beads": beads.beads,
            "segments": beads.segments,
            "counts": beads.count(),
            "passes": beads.passes,
            "identity_bytes": beads.identity.map(|_| identity_bytes(store)),
        })),
        "winding_min": winding.map(|(min, _)| min),
        "winding_max": winding.map(|(_, max)| max),
        "volumes": volumes,
        "source_volumes": store.meta().volumes.as_ref().map(source_json),
        "store": store.summary(),
    })
}

/// Volumes of the source, and by layer, numbered from 1.
fn source_json(volumes: &SourceVolumes) -> Value {
    let layer = |(number, layer): (usize, &LayerVolumes)| {
        json!({
            "layer": number + 1,
            "z_top": layer.top,
            "union": layer.union.value,
            "union_error": layer.union.bound(),
            "overlap": layer.overlap.value,
            "overlap_error": layer.overlap.bound(),
        })
    };
    let mut json = json!(Volumes::from(volumes));
    json["balance"] = json!(Balance::of(volumes));
    json["layers"] = volumes.layers.iter().enumerate().map(layer).collect();
    json
}

fn as_text(store: &Store, volumes: Option<Volumes>) -> String {
    let meta = store.meta();
    let unit = unit_of(meta);
    let StoreSummary { levels, total, file_bytes, dense_bytes, dense_ratio } = store.summary();
    let mut text = String::new();
    let mut line = |line: String| text += &format!("{line}\n");
    line(format!("{}: brick store, written by {}", in_line(store.path()), meta.program));
    if store.is_unfinished() {
        line("  state    unfinished: the command that builds it goes on from what is here".to_owned());
    }
    if let Some(shard) = &meta.shard {
        let (cubes, all) = (shard.cells(), 1u64 << (3 * u32::from(shard.level)));
        let cubes = format!("cubes {} to {} of {all} of level {}", cubes.start, cubes.end, shard.level);
        line(format!("  shard    {} of a store, to be joined by `cache merge`: {cubes}", shard.id));
    }
    pieces_lines(store).into_iter().for_each(&mut line);
    line(format!("  units    {unit}"));
    line(format!("  bounds   {} to {}", point(meta.bounds_min), point(meta.bounds_max)));
    line(format!("  root     {} with an edge of {}", point(meta.root.origin), meta.root.edge));
    let tolerance =
        meta.tolerance.map_or(String::new(), |tolerance| format!("tolerance {tolerance} {unit}, "));
    line(format!(
        "  refined  {}, standard deviation {}, {tolerance}depth {}",
        meta.refine, meta.stddev, meta.depth
    ));
    if let Some((min, max)) = winding_range(store) {
        line(format!("  winding  {min} to {max}"));
    }
    if let Some(source) = &meta.volumes {
        line(format!("  volume   {}, by the source", volumes_text(&source.into(), unit)));
        if let Some(balance) = Balance::of(source) {
            line(format!("  balance  {}", balance.text(unit)));
        }
    }
    if let Some(volumes) = volumes {
        line(format!("  volume   {}, by the samples and crossings", volumes_text(&volumes, unit)));
    }
    line(format!(
        "  size     {}, {dense_ratio:.1} times smaller than a dense grid of 16-bit samples ({:.1} MiB)",
        Size(file_bytes),
        dense_bytes as f64 / f64::from(1u32 << 20)
    ));
    text + &levels_table(&levels, &total)
}

/// The sources, and how many pieces they have.
fn pieces_lines(store: &Store) -> Vec<String> {
    let meta = store.meta();
    let counted = meta.counted();
    let mut lines = Vec::new();
    let mut line = |line: String| lines.push(line);
    for source in &meta.sources {
        let Source { path, bytes, facets, format, blake3 } = source;
        let kind = if source.is_cloud() { "points" } else { "facets" };
        let hash = &hex(blake3)[..16];
        let pieces = if meta.beads.is_some() { String::new() } else { format!("{facets} {kind}, ") };
        let path = one_line(path);
        line(format!("  source   {path}: {format}, {pieces}{}, blake3 {hash}…", Size(*bytes)));
    }
    let degenerate = meta.numbers.degenerate_facets;
    match &meta.beads {
        // Counted in the end.
        _ if store.is_unfinished() => {}
        None => line(format!("  {counted}   {} ({degenerate} without area)", meta.numbers.facets)),
        Some(BeadsMeta { section, beads, segments, identity, passes }) => {
            let identity = match identity {
                Some(_) => format!("told apart, {}", Size(identity_bytes(store))),
                None => "not told apart".to_owned(),
            };
            let passes = passes.map_or(String::new(), |passes| format!(" in {passes} passes"));
            let counted = meta.beads.as_ref().map_or(String::new(), |beads| beads.count().to_string());
            line(format!(
                "  beads    {beads}{passes} as solids, {section} section, {segments} segments, {identity}; w counts {counted}"
            ));
        }
    }
    lines
}

/// The nodes of each level, and of all.
fn levels_table(levels: &[LevelSummary], total: &NodeNumbers) -> String {
    let mut text = String::new();
    let mut line = |line: String| text += &format!("{line}\n");
    line(format!(
        "  {:>5} {:>12} {:>9} {:>9} {:>9} {:>9} {:>9} {:>10}",
        "level", "cell", "bricks", "leaves", "uniform", "counts", "hermite", "payload"
    ));
    let row = |name: String, cell: String, n: &NodeNumbers| {
        let payload = Size(n.counts_bytes + n.hermite_bytes).to_string();
        format!(
            "  {name:>5} {cell:>12} {:>9} {:>9} {:>9} {:>9} {:>9} {payload:>10}",
            n.nodes, n.leaves, n.uniform, n.counts, n.hermite
        )
    };
    for level in levels {
        line(row(level.level.to_string(), format!("{:.6}", level.spacing), &level.numbers));
    }
    line(row("all".to_owned(), String::new(), total));
    text
}

pub(super) fn point(p: [f64; 3]) -> String {
    format!("({:.6}, {:.6}, {:.6})", p[0], p[1], p[2])
}
