//! `brickfield cache merge`: one store from the shards of several runs.

use crate::cache_args::MergeArgs;
use crate::commands::start;
use crate::failure::Failure;
use crate::kinds::not_a_store;
use crate::kinds::require_store_name;
use crate::output::{one_line, print, print_json, require_distinct};
use crate::units::Size;
use crate::work::WorkArgs;
use brickfield_engine::build::{MergeSummary, merge};
use brickfield_engine::store::{Store, is_store};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What is printed in the end.
#[derive(Serialize)]
struct Report {
    output: String,
    #[serde(flatten)]
    summary: MergeSummary,
    seconds: f64,
}

/// Joins shards. One thread keeps up with any disk.
pub fn run(args: &MergeArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let bars = start(WorkArgs { threads: Some(1), quiet: args.quiet, progress: args.progress })?;
    let shards: Vec<&Path> = args.shards.iter().map(PathBuf::as_path).collect();
    require_store_name(&args.output, false)?;
    require_distinct(&[&args.output], &shards)?;
    for shard in shards.iter().filter(|shard| !is_store(shard)) {
        Store::open_any(shard, 0).map_err(|error| not_a_store(shard, error, None))?;
    }
    let summary = merge(&args.shards, &args.output, &bars)?;
    bars.clear();
    let seconds = started.elapsed().as_secs_f64();
    let output = args.output.display().to_string();
    if args.json {
        return print_json(&Report { output, summary, seconds });
    }
    if args.quiet {
        return Ok(());
    }
    let MergeSummary { shards, nodes, leaves, file_bytes } = summary;
    let kept = format!("{nodes} nodes, {leaves} leaves, {}", Size(file_bytes));
    let output = one_line(&output);
    print(&format!("{output}: {kept}, joined from {shards} shards in {seconds:.2} s"))
}
