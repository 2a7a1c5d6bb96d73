//! Calls that fail, disks that are full, and programs that are killed.

use super::{NAME, build, expected, job, name, nodes_left, settings};
use crate::disk::sim::{Crash, DiskFault, Op, SimDisk, SimRng, image};
use crate::store::writer::StoreWriter;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

const FAULTS: [DiskFault; 4] = [DiskFault::Broken, DiskFault::Full, DiskFault::Short, DiskFault::Kill];

/// Lets each call of a build go wrong in each way, then goes on. Returns how many builds that were.
///
/// # Panics
/// If committed nodes are lost, the older store of that name is touched, or the end is another.
pub fn fail_everywhere() -> usize {
    let counting = SimDisk::default();
    build(&counting).expect("nothing fails");
    let old = BTreeMap::from([(name(""), b"an older store".to_vec())]);
    let mut builds = 0;
    for at in 0..counting.calls() {
        for fault in FAULTS {
            let disk = SimDisk::holding(&old);
            disk.plan(at, fault);
            let built = build(&disk);
            disk.revive();
            builds += 1;
            let log = disk.log();
            let committed = log.iter().filter_map(|op| match op {
                Op::Committed(nodes) => Some(*nodes),
                _ => None,
            });
            let committed = committed.max().unwrap_or(0);
            let files = disk.files();
            let renamed = files[Path::new(NAME)] == expected();
            assert!(renamed || files[Path::new(NAME)] == old[Path::new(NAME)], "call {at}, {fault:?}");
            assert!(renamed || nodes_left(&files) >= committed, "call {at}, {fault:?}: {committed} nodes");
            match built {
                // A short write is gone on with; a journal that cannot be removed means nothing.
                Ok(()) => assert!(renamed, "call {at}, {fault:?}"),
                Err(error) => assert!(error.to_string().contains(NAME), "{error}"),
            }
            build(&disk).unwrap_or_else(|error| panic!("call {at}, {fault:?}: {error}"));
            let after = disk.files();
            assert!(after[Path::new(NAME)] == expected(), "call {at}, {fault:?}: other bytes");
            assert_eq!(after.len(), 1, "call {at}, {fault:?}: something is left behind");
        }
    }
    builds
}

#[test]
fn every_call_may_fail() {
    let builds = fail_everywhere();
    println!("{builds} builds");
    assert!(builds > 190, "{builds} builds");
}

/// A sync that fails says that what was written may never be durable, and a second one says nothing.
///
/// # Panics
/// If a writer goes on after one and what it says is durable is not.
pub fn go_on_after_failed_syncs() {
    let counting = SimDisk::default();
    build(&counting).expect("nothing fails");
    for at in 0..counting.calls() {
        let disk = SimDisk::default();
        disk.plan(at, DiskFault::Broken);
        let mut writer = begin(&disk).ok();
        for (key, leaf, payload) in &job().records {
            let Some(writer) = &mut writer else { break };
            // Who does not look at errors.
            let _ = writer.append(*key, *leaf, payload.head, &payload.bytes);
            if writer.commit().is_ok() {
                disk.note(Op::Committed(writer.nodes().len()));
            }
        }
        let log = disk.log();
        let committed = log.iter().filter_map(|op| match op {
            Op::Committed(nodes) => Some(*nodes),
            _ => None,
        });
        let committed = committed.max().unwrap_or(0);
        std::mem::forget(writer);
        let files = image(&BTreeMap::new(), &log, Crash::Dropped, &mut SimRng(1));
        assert!(
            nodes_left(&files) >= committed,
            "call {at}: nodes are lost of {committed} that were committed"
        );
    }
}

fn begin(disk: &SimDisk) -> crate::error::Result<StoreWriter> {
    StoreWriter::begin(Arc::new(disk.clone()), Path::new(NAME), &job().meta, settings(), false)
}

#[test]
fn a_failed_sync_is_not_tried_again() {
    go_on_after_failed_syncs();
    let disk = SimDisk::default();
    let mut writer = begin(&disk).unwrap();
    let (key, leaf, payload) = &job().records[0];
    writer.append(*key, *leaf, payload.head, &payload.bytes).unwrap();
    disk.plan(0, DiskFault::Broken);
    assert!(writer.commit().unwrap_err().to_string().contains("cannot write"));
    let refused = writer.append(*key, *leaf, payload.head, &payload.bytes).unwrap_err();
    assert!(refused.to_string().contains("an earlier write failed"), "{refused}");
    assert!(writer.commit().is_err() && writer.finish(job().meta.clone()).is_err());
    assert_eq!(disk.files(), BTreeMap::new());
}

/// # Panics
/// If a store is gone on with that is another's.
pub fn go_on_with_another() {
    let disk = SimDisk::default();
    let mut writer = begin(&disk).unwrap();
    for (key, leaf, payload) in &job().records[..5] {
        writer.append(*key, *leaf, payload.head, &payload.bytes).unwrap();
    }
    writer.commit().unwrap();
    drop(writer);
    let files = disk.files();
    let refused = |meta: &crate::store::Meta, value: &str| {
        let settings = vec![("made by".to_owned(), value.to_owned())];
        let begun = StoreWriter::begin(Arc::new(disk.clone()), Path::new(NAME), meta, settings, false);
        let error = begun.err().expect("it is refused").to_string();
        assert!(error.contains("sim.brf.part: unfinished store") && error.contains("`restart`"), "{error}");
        assert_eq!(disk.files(), files, "what is there stays");
        error
    };
    let mut meta = job().meta.clone();
    let by = refused(&meta, "somebody else");
    assert!(by.contains("its made by is a test, that of this build is somebody else"), "{by}");
    meta.sources[0].blake3[0] ^= 1;
    assert!(refused(&meta, "a test").contains("has changed since then"));
    meta = job().meta.clone();
    meta.stddev = 0.5;
    assert!(refused(&meta, "a test").contains("its standard deviation is 0, that of this build is 0.5"));
    // Another depth is another file id already.
    meta.depth += 1;
    assert!(refused(&meta, "a test").contains("its depth is 2, that of this build is 3"));
    let begun = StoreWriter::begin(Arc::new(disk.clone()), Path::new(NAME), &meta, settings(), true).unwrap();
    assert_eq!(begun.nodes(), []);
    drop(begun);
    assert_eq!(disk.files(), BTreeMap::new(), "given up and then dropped");
}

#[test]
fn another_input_or_setting_is_refused_by_name() {
    go_on_with_another();
}

/// Damages what an earlier run has left, as a disk may.
///
/// # Panics
/// If it is in the store in the end.
pub fn damage_kept_records() {
    let disk = SimDisk::default();
    let mut writer = begin(&disk).unwrap();
    for (key, leaf, payload) in &job().records {
        writer.append(*key, *leaf, payload.head, &payload.bytes).unwrap();
        writer.commit().unwrap();
    }
    drop(writer);
    let files = disk.files();
    let part = files[&name(".part")].len();
    for at in (crate::store::layout::HEADER_BYTES..part).step_by(97) {
        let mut damaged = files.clone();
        let bytes = damaged.get_mut(&name(".part")).unwrap();
        bytes[at] ^= 4;
        // And more than there should be.
        bytes.extend([7; 100_000]);
        let left = nodes_left(&damaged);
        assert!(left < job().records.len(), "byte {at}");
        let disk = SimDisk::holding(&damaged);
        build(&disk).unwrap();
        assert!(disk.files()[Path::new(NAME)] == expected(), "byte {at}");
    }
}

#[test]
fn kept_records_are_verified() {
    damage_kept_records();
}

#[test]
fn one_writer_at_a_time_with_and_without_a_journal() {
    let disk = SimDisk::default();
    let mut writer = begin(&disk).unwrap();
    assert!(begin(&disk).err().unwrap().to_string().contains("another process is writing"));
    let (key, leaf, payload) = &job().records[0];
    writer.append(*key, *leaf, payload.head, &payload.bytes).unwrap();
    writer.commit().unwrap();
    assert!(begin(&disk).err().unwrap().to_string().contains("another process is writing"));
    drop(writer);
    let mut names: Vec<_> = disk.files().into_keys().collect();
    names.sort();
    assert_eq!(names, [name(".journal"), name(".part")]);
    assert_eq!(begin(&disk).unwrap().nodes(), [(*key, *leaf)]);
}
