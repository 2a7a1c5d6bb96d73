//! `brickfield cache ls`: the nodes of a store.

use super::Row;
use crate::cache_args::LsArgs;
use crate::commands::{open_store, unit_of};
use crate::failure::Failure;
use crate::output::Lines;
use anyhow::Context;
use brickfield_engine::cache::meets_box;
use brickfield_engine::store::{AcceptedStores, IndexEntry};

/// Runs the command.
pub fn run(args: &LsArgs) -> Result<(), Failure> {
    // Nothing but the index is read.
    let store = open_store(&args.store, 0, args.io, AcceptedStores::Unfinished)?;
    let meta = store.meta();
    let is_asked = |entry: &&IndexEntry| {
        args.level.is_none_or(|level| entry.key.level() == level)
            && (!args.leaves || entry.leaf)
            && args.region.is_none_or(|region| meets_box(entry.key, &meta.root, region.corners))
    };
    let mut lines = Lines::to_stdout();
    for level in store.entries().chunk_by(|a, b| a.key.level() == b.key.level()) {
        let mut entries = level.iter().filter(is_asked).peekable();
        if entries.peek().is_none() {
            continue;
        }
        if !args.json {
            let leaves = level.iter().filter(|entry| entry.leaf).count();
            let (level, count) = (level[0].key.level(), level.len());
            let (cell, unit) = (meta.root.spacing(level), unit_of(meta));
            lines.line(format_args!(
                "level {level}: {count} nodes, {leaves} leaves, cells of {cell:.6} {unit}"
            ))?;
        }
        for entry in entries {
            let row = Row::of(entry, meta);
            if args.json {
                let json = serde_json::to_string(&row).context("cannot write JSON")?;
                lines.line(format_args!("{json}"))?;
                continue;
            }
            let Row { node, leaf, kind, min, max, offset, bytes, .. } = row;
            let leaf = if leaf { "leaf" } else { "interior" };
            lines.line(format_args!(
                "  {node:<22} {leaf:<8} {kind:<21} {min:>6} to {max:<6} {offset:>12} {bytes:>7}"
            ))?;
        }
    }
    lines.flush()
}
