//! `brickfield build --plan`, and what may be said of a plan that is built from.

use super::build::{BuildRequest, choose_solids, settle_unit};
use super::{features_of, open_inputs, start};
use crate::args::{BuildArgs, RefineArg};
use crate::clouds::TypedInputs;
use crate::failure::Failure;
use crate::kinds::require_inputs;
use crate::memory;
use crate::output::{in_line, print, print_json};
use crate::units::{Size, Unit};
use anyhow::anyhow;
use brickfield_engine::build::{PlanSummary, is_plan, plan};
use brickfield_engine::ingest::Input;
use serde_json::json;
use std::path::Path;

/// The ending of plans.
const ENDING: &str = "plan";

/// The plan among the inputs, if there is one.
///
/// # Errors
/// If there are other inputs beside it, no shard is asked for, or a setting is given that the plan holds.
pub(super) fn plan_of(args: &BuildArgs) -> Result<Option<&Path>, Failure> {
    let Some(plan) = args.inputs.iter().find(|path| is_plan(path)) else { return Ok(None) };
    if args.inputs.len() > 1 {
        let what = "a plan is built alone; it has all inputs that it was made of";
        return Err(Failure::Usage(format!("{}: {what}", in_line(plan))));
    }
    if args.shard.is_none() {
        let what = "it is a plan, which is built in shards; say which, as by --shard 1/8";
        return Err(Failure::Usage(format!("{}: {what}", in_line(plan))));
    }
    let given = [
        (args.plan, "--plan"),
        (args.depth.is_some(), "--depth"),
        (args.cell.is_some(), "--cell"),
        (args.like.is_some(), "--like"),
        (args.max_depth.is_some(), "--max-depth"),
        (args.thin.is_some(), "--thin"),
        (args.stddev != 0.0, "--stddev"),
        (!matches!(args.refine, RefineArg::Hidden), "--refine"),
        (args.boundary_error.in_unit(Unit::Mm) != 0.0, "--boundary-error"),
        (args.beads_as.is_some(), "--beads-as"),
        (args.count.is_some(), "--count"),
        (args.identity, "--identity"),
        (args.gwn_error.is_some(), "--gwn-error"),
        (args.estimate_normals, "--estimate-normals"),
        (args.orient.is_some(), "--orient"),
        (args.unit.is_some(), "--unit"),
    ];
    match given.iter().find(|(is_given, _)| *is_given) {
        Some((_, option)) => Err(Failure::Usage(format!("{option}: the plan has settled it; leave it out"))),
        None => Ok(Some(plan)),
    }
}

/// Makes a plan.
pub(super) fn run(mut request: BuildRequest) -> Result<(), Failure> {
    if request.output.extension().is_none_or(|ending| ending != ENDING) {
        let what = format!("--output {}: plans have names like PART.{ENDING}", in_line(&request.output));
        return Err(Failure::Usage(what));
    }
    require_inputs(&request.inputs, "info PART.brf")?;
    if let Some(cloud) = TypedInputs::of(&request.inputs, false)?.clouds.first() {
        let what =
            "it is a point cloud, and plans are for closed meshes; build it with --shard and without a plan";
        return Err(anyhow!("{}: {what}", in_line(cloud)).into());
    }
    let bars = start(request.work)?;
    let inputs = open_inputs(&request.inputs, &[&request.output], &request.open, &bars)?;
    request.toolpath.require_features(features_of(&inputs))?;
    settle_unit(&mut request, &inputs, &[])?;
    choose_solids(&mut request, &inputs, false)?;
    if request.options.solids.is_some() {
        let what =
            "beads as solids are few, and every shard reads them; leave it out, or use --beads-as mesh";
        return Err(Failure::Usage(format!("--plan: {what}")));
    }
    let budget = memory::budget(request.memory);
    request.take_memory(memory::require_room(&inputs, &request.options, budget)?);
    let summary = plan(&inputs, &request.output, &request.options, &bars)?;
    drop::<Vec<Input>>(inputs);
    bars.clear();
    tell(&request, &summary)
}

fn tell(request: &BuildRequest, summary: &PlanSummary) -> Result<(), Failure> {
    let PlanSummary { facets, degenerate_facets, depth, cell, cubes, file_bytes, .. } = summary;
    let phases = summary.phases.iter().copied();
    let output = request.output.display().to_string();
    if request.json {
        return print_json(&json!({
            "output": output,
            "facets": facets,
            "degenerate_facets": degenerate_facets,
            "depth": depth,
            "cell": cell,
            "cubes": cubes,
            "file_bytes": file_bytes,
            "temporary_bytes": summary.temporary_bytes,
            "phases": phases.map(|(name, seconds)| (name.to_owned(), json!(seconds))).collect::<serde_json::Map<_, _>>(),
        }));
    }
    if request.work.quiet {
        return Ok(());
    }
    let unit = request.units.symbol();
    let times: Vec<String> = phases.map(|(name, seconds)| format!("{name} {seconds:.2} s")).collect();
    print(&format!(
        "{}: a plan, {}\n  facets   {facets} ({degenerate_facets} without area)\n  depth    {depth}, cells of {cell:.6} {unit}\n  \
         cubes    {cubes} with work, to be shared out\n  time     {}",
        in_line(&request.output),
        Size(*file_bytes),
        times.join(", ")
    ))
}
