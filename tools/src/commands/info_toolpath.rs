//! `brickfield info` of a toolpath: what it deposits, by whose rules it was read, and what to beware of.

use super::start;
use crate::args::InfoArgs;
use crate::failure::Failure;
use crate::output::{print, print_json, warn};
use crate::toolpaths::ToolpathReport;
use crate::work::{ProgressArg, WorkArgs};
use brickfield_engine::bead::Sweep;
use brickfield_engine::ingest::read_beads;
use brickfield_engine::toolpath::LayerFills;
use serde::Serialize;
use std::path::Path;

/// Runs the command. Beads pass through one by one: memory does not grow with the file.
pub fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    if args.volume {
        return Err(Failure::Usage("--volume takes a store, not a toolpath".to_owned()));
    }
    let bars = start(WorkArgs { threads: args.threads, quiet: args.json, progress: ProgressArg::Auto })?;
    let options = args.toolpath.options(args.unit)?;
    let sweep = Sweep::new(&options.sweep)?;
    let (mut bead_volume, mut fills) = (0.0, LayerFills::default());
    let details = read_beads(file, &options.gcode, &bars, &mut |bead| {
        bead_volume += sweep.volume(&bead);
        fills.push(&bead);
        Ok(())
    })?;
    bars.clear();
    args.toolpath.require_features([(file, &details)])?;
    let toolpath = ToolpathReport::new(file.display().to_string(), bead_volume, details).with_fill(fills);
    let warnings = toolpath.warnings();
    warnings.iter().for_each(|message| warn(message));
    match args.json {
        true => print_json(&Info { format: "G-code", toolpath: &toolpath, warnings }),
        false => print(&toolpath.description()),
    }
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Info<'a> {
    format: &'static str,
    #[serde(flatten)]
    toolpath: &'a ToolpathReport,
    warnings: Vec<String>,
}
