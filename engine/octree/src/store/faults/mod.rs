//! What happens to a store when calls fail, the program is killed, or the power goes.

mod crash;
mod failing;
mod planted;
mod reading;

use super::identity::encode_segments;
use super::meta::Meta;
use super::testing::{brick_at, lists, meta_of_beads, nodes, tables};
use super::writer::StoreWriter;
use crate::brick::Count;
use crate::brick::codec::{Payload, encode};
use crate::disk::sim::{Op, SimDisk};
use crate::error::Result;
use crate::lattice::NodeKey;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

const NAME: &str = "sim.brf";

fn settings() -> super::SettingPairs {
    vec![("made by".to_owned(), "a test".to_owned())]
}

fn name(ending: &str) -> PathBuf {
    PathBuf::from(format!("{NAME}{ending}"))
}

/// A small build: records in the order of a store, and lists of beads.
struct Job {
    meta: Meta,
    records: Vec<(NodeKey, bool, Payload)>,
    lists: Vec<(NodeKey, Vec<u8>)>,
}

fn job() -> &'static Job {
    static JOB: OnceLock<Job> = OnceLock::new();
    JOB.get_or_init(|| {
        let mut nodes = nodes();
        nodes.sort_by_key(|(key, _)| key.post_order());
        let record = |(key, leaf)| (key, leaf, encode(&brick_at(key, leaf)));
        let list = |(key, list): (NodeKey, Vec<_>)| {
            let mut bytes = Vec::new();
            encode_segments(&list, Count::Beads, &mut bytes);
            (key, bytes)
        };
        Job {
            meta: meta_of_beads(),
            records: nodes.into_iter().map(record).collect(),
            lists: lists().into_iter().map(list).collect(),
        }
    })
}

/// Writes the store as a build does, on whatever an earlier run has left: subtrees that are there are not built again.
/// Commits after every second node.
fn build(disk: &SimDisk) -> Result<()> {
    let Job { meta, records, lists } = job();
    let mut writer = StoreWriter::begin(Arc::new(disk.clone()), Path::new(NAME), meta, settings(), false)?;
    let kept = writer.kept();
    let built = |key: NodeKey| {
        let mut up = Some(key);
        let kept = kept.as_deref()?;
        while let Some(key) = up {
            if kept.brick(key).expect("it can be read").is_some() {
                return Some(());
            }
            up = key.parent();
        }
        None
    };
    let built: Vec<bool> = records.iter().map(|(key, ..)| built(*key).is_some()).collect();
    for (number, ((key, leaf, payload), built)) in records.iter().zip(built).enumerate() {
        if !built {
            writer.append(*key, *leaf, payload.head, &payload.bytes)?;
        }
        if number % 2 == 1 {
            writer.commit()?;
            disk.note(Op::Committed(writer.nodes().len()));
        }
    }
    writer.begin_identity(tables());
    for (key, list) in lists {
        writer.append_identity(*key, list)?;
        writer.commit()?;
    }
    writer.finish(meta.clone())?;
    disk.note(Op::Finished);
    Ok(())
}

/// The bytes of the store that nothing has interrupted.
fn expected() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| {
        let disk = SimDisk::default();
        build(&disk).expect("nothing fails");
        let mut files = disk.files();
        let bytes = files.remove(Path::new(NAME)).expect("the store");
        assert_eq!(files, BTreeMap::new(), "nothing else is left");
        bytes
    })
}

/// Nodes that a run can go on with.
fn nodes_left(files: &BTreeMap<PathBuf, Vec<u8>>) -> usize {
    let disk = SimDisk::holding(files);
    let begun = StoreWriter::begin(Arc::new(disk), Path::new(NAME), &job().meta, settings(), false);
    let writer = begun.expect("what is there is the same store");
    let nodes = writer.nodes();
    for (key, leaf) in &nodes {
        assert!(job().records.iter().any(|(k, l, _)| (k, l) == (key, leaf)), "{key} is no node of the store");
    }
    nodes.len()
}
