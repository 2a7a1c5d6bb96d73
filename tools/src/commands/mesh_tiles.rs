//! `brickfield mesh -o FOLDER/tileset.json`: meshes of all levels as 3D Tiles.

use super::mesh::BOUNDARY;
use super::{of_store, open_store, require_level, start};
use crate::args::{MeshArgs, MethodArg};
use crate::failure::Failure;
use crate::memory;
use crate::output::{in_line, print, print_json, require_distinct};
use crate::units::{Size, Unit};
use brickfield_engine::contour::{ContourOptions, TilesSummary, foresee_triangles, write_tiles};
use brickfield_engine::store::{AcceptedStores, Store};
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// Bytes of a triangle while its level is made into tiles.
const BYTES_A_TRIANGLE: u64 = 60;

/// Whether a name is that of a tileset.
pub(super) fn is_tileset(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == "tileset.json")
}

/// Runs the command.
pub(super) fn run(args: &MeshArgs, output: &Path) -> Result<(), Failure> {
    if let Some(option) = not_of_tiles(args) {
        let what = "tiles take --iso, --level, --follow-creases, --memory and --temp-dir";
        return Err(Failure::Usage(format!("{}: {what}; leave {option} out", in_line(output))));
    }
    let folder = output.parent().filter(|folder| folder.file_name().is_some()).ok_or_else(|| {
        let what = "tiles need a folder of their own, as in tiles/tileset.json";
        Failure::Usage(format!("{}: {what}", in_line(output)))
    })?;
    let iso = args.iso.unwrap_or(BOUNDARY);
    let bars = start(args.work)?;
    let store = open_store(&args.file, 0, args.io, AcceptedStores::Whole)?;
    let cache_bytes = memory::mesh_caches(args.memory, &store);
    let store = store.with_cache(cache_bytes / 8);
    if let Some(level) = args.level {
        require_level(&store, level)?;
    }
    require_distinct(&[folder], &[&args.file])?;
    require_memory(args, iso, &store, output)?;
    let metres = Unit::of_symbol(&store.meta().unit).map_or(1.0, Unit::metres);
    let options = ContourOptions {
        iso,
        level: args.level,
        cache_bytes: (cache_bytes - cache_bytes / 8) as usize,
        follow_creases: args.follow_creases,
        temp_dir: args.temp_dir.clone(),
        ..ContourOptions::default()
    };
    let started = Instant::now();
    let summary = write_tiles(&store, &options, metres, folder, &bars)
        .map_err(|error| of_store(&store, "settings", error))?;
    let seconds = started.elapsed().as_secs_f64();
    bars.clear();
    let TilesSummary { tiles, finest, triangles, levels, bytes } = summary;
    if args.json {
        let output = output.display().to_string();
        return print_json(&json!({
            "output": output, "iso": iso, "tiles": tiles, "levels": levels, "finest": finest,
            "triangles": triangles, "bytes": bytes, "metres": metres, "seconds": seconds,
        }));
    }
    if args.work.quiet {
        return Ok(());
    }
    let (name, size) = (in_line(output), Size(bytes));
    print(&format!(
        "{name}: {tiles} tiles of {levels} levels, {finest} triangles in the finest, {size}, {seconds:.2} s"
    ))
}

/// The first option that says nothing of tiles.
fn not_of_tiles(args: &MeshArgs) -> Option<&'static str> {
    let asked = [
        (args.check, "--check"),
        (args.detail.is_some(), "--detail"),
        (args.triangles.is_some(), "--triangles"),
        (args.max_size.is_some(), "--max-size"),
        (args.tolerance.in_unit(Unit::Mm) != 0.0, "--tolerance"),
        (args.close.is_some(), "--close"),
        (args.outer, "--outer"),
        (args.keep_largest, "--keep-largest"),
        (args.min_shell_volume.is_some(), "--min-shell-volume"),
        (args.quality, "--quality"),
        (!matches!(args.method, MethodArg::Dual), "--method"),
        (args.normals, "--normals"),
        (args.origin.is_some(), "--origin"),
        (args.double, "--double"),
        (!args.attributes.is_empty(), "--attributes"),
    ];
    asked.into_iter().find(|(is_asked, _)| *is_asked).map(|(_, name)| name)
}

/// Refuses a level whose mesh does not fit.
fn require_memory(args: &MeshArgs, iso: f64, store: &Store, output: &Path) -> Result<(), Failure> {
    let triangles = foresee_triangles(store, iso, args.level)?;
    let needed = triangles.saturating_mul(BYTES_A_TRIANGLE);
    if needed <= args.memory.0 {
        return Ok(());
    }
    let (name, needed) = (in_line(output), Size(needed));
    let what =
        format!("{name}: the finest level has about {triangles} triangles, which take {needed} of memory");
    Err(anyhow::anyhow!("{what}; allow it with --memory, or choose a coarser --level").into())
}
