//! `brickfield csg`: Booleans of stores.

use super::operands::{Common, OpenOperand, OperandContent, ready, source_of};
use super::{open_store, require_whole_samples, start};
use crate::args::IoArg;
use crate::csg_args::CsgArgs;
use crate::failure::Failure;
use crate::kinds::require_store_name;
use crate::output::{in_line, print, print_json, require_distinct, warn};
use crate::units::Size;
use brickfield_engine::analysis::winding_range;
use brickfield_engine::csg::{Chain, CsgSummary, HiddenCrossings, Operand, Operation, Writing, meta_of};
use brickfield_engine::store::{AcceptedStores, Store};
use serde_json::json;
use std::path::Path;
use std::time::{Duration, Instant};

/// Runs the command.
pub fn run(args: &CsgArgs) -> Result<(), Failure> {
    let begun = Instant::now();
    require_store_name(&args.output, false)?;
    if args.chain.0.is_empty() {
        let what = "there is nothing to combine; give --plus, --minus or --and with an operand";
        return Err(Failure::Usage(what.to_owned()));
    }
    let pace = pace(args.keeping.commit_every)?;
    let bars = start(args.work)?;
    let first = open_store(&args.store, 0, args.io, AcceptedStores::Whole)?;
    require_whole_samples(&first, "what is inside cannot be told")?;
    let names = args.chain.0.iter().map(|(_, text)| Path::new(text));
    let inputs: Vec<&Path> = std::iter::once(args.store.as_path()).chain(names).collect();
    require_distinct(&[&args.output], &inputs)?;
    let common = Common {
        first: &first,
        output: &args.output,
        memory: args.keeping.memory,
        io: args.io,
        progress: &bars,
    };
    let mut operands = Vec::new();
    for (number, (operation, text)) in args.chain.0.iter().enumerate() {
        operands.push((*operation, ready(number + 1, *operation, text, &common)?));
    }
    let sources = std::iter::once(source_of(&first, "first"))
        .chain(operands.iter().map(|(_, ready)| Ok(ready.source.clone())))
        .collect::<Result<Vec<_>, Failure>>()?;
    let stores: Vec<(Operation, &Store)> = operands.iter().filter_map(as_store).collect();
    let bounds: Vec<(Operation, [[f64; 3]; 2])> = operands.iter().filter_map(as_body).collect();
    let program = concat!("brickfield ", env!("CARGO_PKG_VERSION"), ", csg");
    let meta = meta_of(&first, &stores, &bounds, sources, program);
    let mut chain = vec![(Operation::Plus, Operand::Store(&first))];
    chain.extend(operands.iter().map(|(operation, ready)| (*operation, ready.operand())));
    let chain = Chain { operands: chain, keep_counts: args.keep_counts, depth: meta.depth, made: None };
    let settings = vec![
        ("made by".to_owned(), "csg".to_owned()),
        ("counts".to_owned(), if args.keep_counts { "kept" } else { "clamped" }.to_owned()),
    ];
    let writing = Writing { memory: args.keeping.memory.0, pace, restart: args.keeping.restart, settings };
    let summary = chain.write(&args.output, meta, writing, &bars)?;
    bars.clear();
    tell_if_empty(&args.output, args.io)?;
    let seconds = begun.elapsed().as_secs_f64();
    if args.json {
        let chain: Vec<_> = args.chain.0.iter().map(|(op, text)| json!([op.name(), text])).collect();
        let CsgSummary { nodes, leaves, file_bytes, hidden, resumed } = summary;
        print_json(&json!({
            "output": args.output.display().to_string(),
            "chain": chain,
            "nodes": nodes,
            "leaves": leaves,
            "file_bytes": file_bytes,
            "hidden_walls": hidden.walls,
            "hidden_gaps": hidden.gaps,
            "resumed_nodes": resumed,
            "seconds": seconds,
        }))
    } else if !args.work.quiet {
        print(&text(&args.output, &summary, seconds))
    } else {
        Ok(())
    }
}

/// Warns of a store without anything solid.
fn tell_if_empty(output: &Path, io: IoArg) -> Result<(), Failure> {
    let made = open_store(output, 0, io, AcceptedStores::Whole)?;
    if winding_range(&made).is_some_and(|(_, most)| most < 1) {
        warn(&format!("{}: nothing is left of the part, so the store is empty", in_line(output)));
    }
    Ok(())
}

/// Time between two commits.
pub(super) fn pace(seconds: f64) -> Result<Duration, Failure> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| Failure::Usage("--commit-every takes a number of seconds of 0 or more".to_owned()))
}

fn as_store((operation, ready): &(Operation, OpenOperand)) -> Option<(Operation, &Store)> {
    match &ready.content {
        OperandContent::Store(store) => Some((*operation, store)),
        OperandContent::Body(..) => None,
    }
}

fn as_body((operation, ready): &(Operation, OpenOperand)) -> Option<(Operation, [[f64; 3]; 2])> {
    match &ready.content {
        OperandContent::Store(..) => None,
        OperandContent::Body(_, bounds) => Some((*operation, *bounds)),
    }
}

/// For people.
pub(super) fn text(output: &Path, summary: &CsgSummary, seconds: f64) -> String {
    let CsgSummary { nodes, leaves, file_bytes, hidden, resumed } = summary;
    let kept = format!("{nodes} nodes, {leaves} leaves, {}", Size(*file_bytes));
    let mut lines = vec![format!("{}: {kept}, {seconds:.2} s", in_line(output))];
    if *resumed > 0 {
        lines.push(format!(
            "  resumed  from {resumed} nodes of an earlier run; what hides is told of the rest"
        ));
    }
    let HiddenCrossings { walls, gaps } = hidden;
    let told = |count: &u64, what: &str| {
        (*count > 0)
            .then(|| format!("  hidden   {count} edges between samples hold {what} that no sample shows"))
    };
    lines.extend(told(walls, "a wall"));
    lines.extend(told(gaps, "a gap"));
    lines.join("\n")
}
