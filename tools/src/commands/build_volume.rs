//! `brickfield build` of a volume that another tool wrote, on the volume's own lattice.

use super::start;
use crate::args::{BuildArgs, RefineArg, VolumeArg};
use crate::cache_args::CompressionArg;
use crate::failure::Failure;
use crate::kinds::require_store_name;
use crate::output::{in_line, print, print_json, require_distinct, warn};
use crate::units::Unit;
use crate::work::WorkArgs;
use brickfield_engine::import::{Grid, Reading, VolumeSummary, build_volume, is_volume};
use brickfield_engine::store::check_target;
use serde_json::json;
use std::path::Path;

/// The volume among the inputs, if there is one.
///
/// # Errors
/// If there are other inputs beside it.
pub(super) fn volume_of(args: &BuildArgs) -> Result<Option<&Path>, Failure> {
    let Some(volume) = args.inputs.iter().find(|path| is_volume(path)) else {
        let given = if args.threshold.is_some() { Some("--threshold") } else { None };
        let given = given.or(args.volume_as.map(|_| "--volume-as"));
        let given = given.or(args.field.as_ref().map(|_| "--field"));
        return match given {
            Some(option) => Err(Failure::Usage(format!("{option}: it is for volumes; leave it out"))),
            None => Ok(None),
        };
    };
    if args.inputs.len() > 1 {
        let what = "a volume is built alone; join stores with `brickfield csg`";
        return Err(Failure::Usage(format!("{}: {what}", in_line(volume))));
    }
    Ok(Some(volume))
}

/// Refuses options that a volume leaves nothing to decide for.
fn require_no_others(args: &BuildArgs) -> Result<(), Failure> {
    let lattice = "the lattice is that of the volume; leave it out";
    let samples = "it is for meshes, toolpaths and points; leave it out";
    let given = [
        (args.depth.is_some(), "--depth", lattice),
        (args.cell.is_some(), "--cell", lattice),
        (args.like.is_some(), "--like", lattice),
        (args.max_depth.is_some(), "--max-depth", lattice),
        (args.thin.is_some(), "--thin", lattice),
        (args.stddev != 0.0, "--stddev", lattice),
        (!matches!(args.refine, RefineArg::Hidden), "--refine", lattice),
        (args.boundary_error.in_unit(Unit::Mm) != 0.0, "--boundary-error", lattice),
        (args.beads_as.is_some(), "--beads-as", samples),
        (args.count.is_some(), "--count", samples),
        (args.identity, "--identity", samples),
        (args.gwn_error.is_some(), "--gwn-error", samples),
        (args.estimate_normals, "--estimate-normals", samples),
        (args.orient.is_some(), "--orient", samples),
        (args.shard.is_some(), "--shard", "volumes are built in one go; leave it out"),
        (args.mesh.is_some(), "--mesh", "give `brickfield mesh` the store when it is made"),
        (args.compression != CompressionArg::Lz4, "--compression", "give it to `cache repack`"),
    ];
    match given.iter().find(|(is_given, ..)| *is_given) {
        Some((_, option, why)) => Err(Failure::Usage(format!("{option}: {why}"))),
        None => Ok(()),
    }
}

/// Runs the command.
pub(super) fn run(args: &BuildArgs, input: &Path) -> Result<(), Failure> {
    require_no_others(args)?;
    require_store_name(&args.output, true)?;
    require_distinct(&[&args.output], &[input])?;
    let work = WorkArgs { threads: args.threads, quiet: args.quiet, progress: args.progress };
    let bars = start(work)?;
    let mut grid = Grid::open(input, args.field.as_deref())?;
    check_target(&args.output)?;
    let reading = match (args.threshold, args.volume_as) {
        (Some(least), _) => Some(Reading::Threshold(least)),
        (None, Some(VolumeArg::Sdf)) => Some(Reading::Distance),
        (None, Some(VolumeArg::W)) => Some(Reading::Winding),
        (None, None) if grid.holds_distances() => Some(Reading::Distance),
        (None, None) => None,
    };
    let unit = match args.unit {
        Some(unit) => unit.symbol().to_owned(),
        None => grid.unit().unwrap_or(Unit::Mm.symbol()).to_owned(),
    };
    let program = concat!("brickfield ", env!("CARGO_PKG_VERSION"));
    let temp_dir = args.temp_dir.as_deref();
    let built = build_volume(&mut grid, (input, &args.output), reading, (&unit, program), temp_dir, &bars)?;
    bars.clear();
    if built.is_cut {
        let what = "what is solid ends at the border of the volume, and was closed there";
        warn(&format!("{}: {what}", in_line(input)));
    }
    tell(args, &grid, &unit, &built)
}

fn tell(args: &BuildArgs, grid: &Grid, unit: &str, built: &VolumeSummary) -> Result<(), Failure> {
    let [x, y, z] = grid.shape();
    let VolumeSummary { stats, range: [least, greatest], depth, is_cut } = built;
    if args.json {
        return print_json(&json!({
            "output": args.output.display().to_string(),
            "format": grid.format(),
            "field": grid.fields().first(),
            "note": grid.note(),
            "shape": [z, y, x],
            "unit": unit,
            "cell": grid.spacing(),
            "depth": depth,
            "values": [least, greatest],
            "cut_at_border": is_cut,
            "nodes": stats.nodes,
            "leaves": stats.leaves,
            "file_bytes": stats.file_bytes,
        }));
    }
    if args.quiet {
        return Ok(());
    }
    let (name, cell) = (in_line(&args.output), grid.spacing());
    let field = grid.fields().first().map_or(String::new(), |field| format!("\n  of       {field}"));
    let note = grid.note().map_or(String::new(), |note| format!("\n  note     {note}"));
    print(&format!(
        "{name}: {x} × {y} × {z} samples of {least} to {greatest}, cells of {cell} {unit}, {} nodes, {} leaves{field}{note}",
        stats.nodes, stats.leaves
    ))
}
