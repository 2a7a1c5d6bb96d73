//! `brickfield cache diff`: are two stores the same?

use crate::cache_args::DiffArgs;
use crate::commands::{open_store, start};
use crate::failure::Failure;
use crate::output::{one_line, print, print_json};
use brickfield_engine::cache::{BrickDifferences, Comparison, Difference, MetaDifference, compare};
use brickfield_engine::store::AcceptedStores;
use serde::Serialize;

/// What is printed as JSON.
#[derive(Serialize)]
struct Report {
    stores: [String; 2],
    equal: bool,
    #[serde(flatten)]
    comparison: Comparison,
}

/// Runs the command.
pub fn run(args: &DiffArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    // No brick is read twice, so none is kept.
    let first = open_store(&args.first, 0, args.io, AcceptedStores::Unfinished)?;
    let second = open_store(&args.second, 0, args.io, AcceptedStores::Unfinished)?;
    let comparison = compare(&first, &second, &bars)?;
    bars.clear();
    let equal = comparison.is_equal(!args.ignore_metadata);
    let stores = [&args.first, &args.second].map(|path| path.display().to_string());
    let [a, b] = stores.each_ref().map(|path| one_line(path));
    let verdict = format!("{a} and {b} {}", if equal { "are equal" } else { "differ" });
    let told = as_text(&verdict, &comparison, args.ignore_metadata);
    if args.json {
        print_json(&Report { stores, equal, comparison })?;
    } else if !args.work.quiet {
        print(&told)?;
    }
    if equal { Ok(()) } else { Err(anyhow::Error::msg(verdict).into()) }
}

fn as_text(verdict: &str, comparison: &Comparison, ignore_metadata: bool) -> String {
    let Comparison {
        metadata,
        same_lattice,
        common,
        only_first,
        only_second,
        leaf_in_one,
        bricks,
        lists,
        first,
    } = comparison;
    let mut text = format!("{verdict}\n");
    let mut line = |line: String| text += &format!("  {line}\n");
    for MetaDifference { name, first, second } in metadata {
        let ignored = if ignore_metadata { " (ignored)" } else { "" };
        let told = |value: &Option<String>| value.clone().unwrap_or("not told".to_owned());
        line(format!("{name}{ignored}: {} and {}", told(first), told(second)));
    }
    if !same_lattice {
        line("their lattices lie elsewhere, so their nodes are not compared".to_owned());
        return text;
    }
    line(format!("{common} nodes in both, {only_first} in the first only, {only_second} in the second only"));
    if *leaf_in_one > 0 {
        line(format!("{leaf_in_one} nodes are a leaf in one of them and divided in the other"));
    }
    let BrickDifferences {
        bricks,
        samples,
        max_difference,
        signs,
        hermite_bricks,
        hermite_edges,
        moved_edges,
        max_move,
        turned_edges,
    } = bricks;
    if *bricks > 0 {
        let most = format!("by up to {max_difference}");
        line(format!("{samples} samples of {bricks} bricks differ {most}; {signs} are inside in one only"));
    }
    if *hermite_bricks > 0 {
        let moved = format!("{moved_edges} in place by up to {max_move:.6}, {turned_edges} in their normal");
        line(format!("{hermite_edges} Hermite edges of {hermite_bricks} leaves differ, {moved}"));
    }
    if *lists > 0 {
        line(format!("{lists} lists or tables of beads differ"));
    }
    for Difference { node, what, .. } in first {
        line(format!("{node}: {what}"));
    }
    text
}
