//! `brickfield cache`: stores as files.

mod diff;
mod get;
mod ls;
mod merge;
mod rewrite;
mod stat;

use crate::cache_args::{CacheArgs, CacheCommand};
use crate::failure::Failure;
use brickfield_engine::store::{IndexEntry, Meta};
use serde::Serialize;

/// Runs the command.
pub fn run(args: CacheArgs) -> Result<(), Failure> {
    match args.command {
        CacheCommand::Ls(args) => ls::run(&args),
        CacheCommand::Stat(args) => stat::run(&args),
        CacheCommand::Get(args) => get::run(&args),
        CacheCommand::Verify(args) => super::verify::run(&args),
        CacheCommand::Compact(args) => rewrite::compact(&args),
        CacheCommand::Prune(args) => rewrite::prune(&args),
        CacheCommand::Repack(args) => rewrite::repack(&args),
        CacheCommand::Merge(args) => merge::run(&args),
        CacheCommand::Diff(args) => diff::run(&args),
    }
}

/// What the index says of a node.
#[derive(Serialize)]
struct Row {
    node: String,
    key: u64,
    level: u8,
    position: [u32; 3],
    leaf: bool,
    kind: String,
    min: i16,
    max: i16,
    offset: u64,
    bytes: u32,
    crc: String,
    /// First and last sample in the world.
    corners: [[f64; 3]; 2],
}

impl Row {
    fn of(entry: &IndexEntry, meta: &Meta) -> Row {
        let IndexEntry { key, offset, length, crc, leaf, head } = *entry;
        Row {
            node: key.to_string(),
            key: key.code(),
            level: key.level(),
            position: key.position(),
            leaf,
            kind: head.kind.to_string(),
            min: head.min,
            max: head.max,
            offset,
            bytes: length,
            crc: format!("{crc:08x}"),
            corners: brickfield_engine::cache::corners(key, &meta.root),
        }
    }
}
