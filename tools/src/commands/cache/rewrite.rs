//! `brickfield cache compact`, `prune` and `repack`: a store written anew.

use crate::cache_args::{CompactArgs, OutputArgs, PruneArgs, RepackArgs};
use crate::commands::{CACHE_BYTES, of_store, open_store, start};
use crate::elsewhere::is_address;
use crate::failure::Failure;
use crate::kinds::require_store_name;
use crate::output::{one_line, print, print_json, require_distinct};
use crate::progress::Bars;
use crate::units::Size;
use brickfield_engine::Error;
use brickfield_engine::cache::{self, PruneOptions, PruneRegion, RewriteSummary};
use brickfield_engine::store::{AcceptedStores, Store};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// What is printed in the end.
#[derive(Serialize)]
struct Report {
    output: String,
    #[serde(flatten)]
    summary: RewriteSummary,
    seconds: f64,
}

/// `cache compact`.
pub fn compact(args: &CompactArgs) -> Result<(), Failure> {
    run(&args.output, AcceptedStores::Shards, |store, output, bars| cache::compact(store, output, bars))
}

/// `cache repack`.
pub fn repack(args: &RepackArgs) -> Result<(), Failure> {
    let compression = match (args.compression, args.order) {
        (None, Some(_)) => None,
        (compression, _) => Some(compression.unwrap_or_default().into()),
    };
    let order = args.order.unwrap_or_default().into();
    run(&args.output, AcceptedStores::Shards, |store, output, bars| {
        cache::reorder(store, output, order, compression, bars)
    })
}

/// `cache prune`.
pub fn prune(args: &PruneArgs) -> Result<(), Failure> {
    let region = args.region.map(|region| {
        let [min, max] = region.corners;
        PruneRegion { min, max, outside_level: args.outside_level }
    });
    let options = PruneOptions { level: args.level, region, error: args.error };
    run(&args.output, AcceptedStores::Whole, |store, output, bars| {
        cache::prune(store, output, &options, bars)
    })
}

fn run(
    args: &OutputArgs,
    accept: AcceptedStores,
    rewrite: impl Fn(&Store, &Path, &Bars) -> Result<RewriteSummary, Error>,
) -> Result<(), Failure> {
    let started = Instant::now();
    let bars = start(args.work)?;
    let output = match &args.output {
        Some(output) => {
            require_store_name(output, false)?;
            require_distinct(&[output], &[&args.store])?;
            output.clone()
        }
        None if is_address(&args.store) => {
            let what = "a store on a server is not changed there; name the file to write with -o";
            return Err(Failure::Usage(format!("{}: {what}", args.store.display())));
        }
        // The file that a link names is replaced, not the link. What is not there is told of when it is opened.
        None => std::fs::canonicalize(&args.store).unwrap_or(args.store.clone()),
    };
    let store = open_store(&args.store, CACHE_BYTES, args.io, accept)?;
    let summary = rewrite(&store, &output, &bars).map_err(|error| of_store(&store, "settings", error))?;
    bars.clear();
    let seconds = started.elapsed().as_secs_f64();
    let output = output.display().to_string();
    if args.json {
        return print_json(&Report { output, summary, seconds });
    }
    if args.work.quiet {
        return Ok(());
    }
    let RewriteSummary { nodes_before, file_bytes_before, nodes, leaves, file_bytes, .. } = summary;
    let (before, now) = (Size(file_bytes_before), Size(file_bytes));
    let output = one_line(&output);
    print(&format!(
        "{output}: {nodes} nodes, {leaves} leaves, {now}, from {nodes_before} nodes and {before} in {seconds:.2} s"
    ))
}
