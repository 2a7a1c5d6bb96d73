use super::layout::*;
use super::testing::{
    brick_at, fractions, lists, lists_of_passes, meta, meta_of_shard, nodes, nodes_of_shard, tables,
    tables_of_passes, tree, write, write_beads, write_fractions, write_passes, write_range,
    write_range_fractions, write_shard,
};
use super::*;
use crate::brick::Brick;
use crate::lattice::NodeKey;
use crate::progress::Silent;
use proptest::prelude::*;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

const CACHE_BYTES: u64 = 8 << 20;

/// The small tree's file, a copy of one that was written once: most of the time goes into making it durable.
fn store_in(directory: &tempfile::TempDir) -> PathBuf {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    let path = directory.path().join("small.brf");
    let bytes = BYTES.get_or_init(|| {
        write(&path);
        std::fs::read(&path).unwrap()
    });
    std::fs::write(&path, bytes).unwrap();
    path
}

/// True if the file opens and answers as the small tree; false if it is refused anywhere.
///
/// # Panics
/// If it gives another answer.
fn answers_right(path: &Path) -> bool {
    let Ok(store) = Store::open(path, CACHE_BYTES) else { return false };
    let tree = tree_once();
    assert_eq!(store.keys(), tree.keys());
    assert_eq!(Meta { beads: None, ..store.meta().clone() }, meta(2));
    let mut sound = true;
    for key in store.keys() {
        assert_eq!(store.node(key), tree.node(key));
        match store.brick(key) {
            Ok(brick) => assert!(*brick == *tree.brick(key).unwrap(), "another brick at {key}"),
            Err(_) => sound = false,
        }
    }
    sound
}

fn tree_once() -> &'static MemoryTree {
    static TREE: OnceLock<MemoryTree> = OnceLock::new();
    TREE.get_or_init(tree)
}

#[test]
fn a_store_answers_as_the_tree_it_was_made_from() {
    let directory = tempfile::tempdir().unwrap();
    let path = store_in(&directory);
    assert!(answers_right(&path));
    let store = Store::open(&path, CACHE_BYTES).unwrap();
    assert_eq!(store.root(), meta(2).root);
    assert_eq!(store.node(NodeKey::new(2, [0, 0, 0]).unwrap()), None);
    assert!(store.brick(NodeKey::new(2, [0, 0, 0]).unwrap()).is_err());
    let report = store.verify(&Silent).unwrap().into_result(&store).unwrap();
    assert_eq!((report.records, report.damaged), (17, 0));
    for (key, leaf) in nodes() {
        let mut payload = Vec::new();
        store.read_payload(store.entry(key).unwrap(), &mut payload).unwrap();
        assert_eq!(payload, encode(&brick_at(key, leaf)).bytes);
    }
    let first = store.cache_stats();
    store.brick(NodeKey::ROOT).unwrap();
    assert_eq!(store.cache_stats().hits, first.hits + 1);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
}

#[test]
fn the_summary_adds_up() {
    let directory = tempfile::tempdir().unwrap();
    let path = store_in(&directory);
    let summary = Store::open(&path, 0).unwrap().summary();
    assert_eq!(summary.levels.iter().map(|l| l.numbers.nodes).collect::<Vec<_>>(), [1, 8, 8]);
    assert_eq!(summary.levels[2].spacing, 0.5);
    let total = summary.total;
    assert_eq!((total.nodes, total.leaves, total.interior), (17, 15, 2));
    assert_eq!(total.uniform + total.counts + total.hermite, 17);
    assert_eq!(summary.dense_bytes, 128 * 128 * 128 * 2);
    assert_eq!(summary.file_bytes, std::fs::metadata(&path).unwrap().len());
}

#[test]
fn the_same_appends_give_the_same_bytes() {
    let directory = tempfile::tempdir().unwrap();
    let (a, b) = (directory.path().join("a.brf"), directory.path().join("b.brf"));
    write(&a);
    write(&b);
    write(&b);
    assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
}

#[test]
fn truncation_at_every_length_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = store_in(&directory);
    let length = std::fs::metadata(&path).unwrap().len();
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    for length in (0..length).rev() {
        file.set_len(length).unwrap();
        assert!(Store::open(&path, 0).is_err(), "{length} bytes");
    }
}

#[test]
fn no_single_damaged_byte_changes_an_answer() {
    let directory = tempfile::tempdir().unwrap();
    let path = store_in(&directory);
    let bytes = std::fs::read(&path).unwrap();
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    let mut harmless = Vec::new();
    for (at, &byte) in bytes.iter().enumerate() {
        // The header pages are nearly empty: every byte in use, and a sample of the others.
        if at < HEADER_BYTES && at % PAGE_BYTES > SLOT_BYTES && at % 61 != 0 {
            continue;
        }
        file.write_all_at(&[byte ^ (1 << (at % 8))], at as u64).unwrap();
        if answers_right(&path) {
            harmless.push(at);
        }
        file.write_all_at(&[byte], at as u64).unwrap();
    }
    // Only bytes of the slot pages that no commit uses.
    let slot_end = SLOT_OFFSETS[1] + SLOT_BYTES;
    assert!(harmless.iter().all(|at| (PAGE_BYTES..HEADER_BYTES).contains(at)));
    assert!(harmless.iter().all(|at| !(SLOT_OFFSETS[1]..slot_end).contains(at)));
    assert!(answers_right(&path));
}

#[test]
fn verify_names_the_damaged_record() {
    let directory = tempfile::tempdir().unwrap();
    let path = store_in(&directory);
    let entries: Vec<IndexEntry> = Store::open(&path, 0).unwrap().entries().to_vec();
    let damaged: Vec<IndexEntry> = entries.into_iter().filter(|e| e.length > 0).skip(1).collect();
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    for entry in &damaged {
        file.write_all_at(&[0xa5], entry.offset + u64::from(entry.length) / 2).unwrap();
    }
    let store = Store::open(&path, CACHE_BYTES).unwrap();
    let report = store.verify(&Silent).unwrap();
    assert_eq!(report.damaged, damaged.len() as u64);
    let first = report.first_damage.clone().unwrap();
    assert_eq!((first.key, first.offset), (Some(damaged[0].key), damaged[0].offset));
    let message = report.into_result(&store).unwrap_err().to_string();
    assert!(message.contains(&format!("record {} at byte {}", damaged[0].key, first.offset)), "{message}");
}

/// Rewrites the index through `change` and makes all checksums fit again.
fn forge(path: &Path, change: impl FnOnce(&mut Slot, &mut Vec<[u8; ENTRY_BYTES]>)) {
    let file = std::fs::File::options().write(true).open(path).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let mut slot = Slot::decode(&bytes[SLOT_OFFSETS[1]..][..PAGE_BYTES], 1).unwrap();
    let index = &bytes[slot.index_offset as usize..slot.meta_offset as usize];
    let mut entries = index.as_chunks::<ENTRY_BYTES>().0.to_vec();
    change(&mut slot, &mut entries);
    let index = entries.concat();
    slot.index_crc = crc32fast::hash(&index);
    file.write_all_at(&index, slot.index_offset.min(bytes.len() as u64)).unwrap();
    file.write_all_at(&slot.encode(), SLOT_OFFSETS[slot.which()] as u64).unwrap();
}

fn forged_error(change: impl FnOnce(&mut Slot, &mut Vec<[u8; ENTRY_BYTES]>)) -> String {
    let directory = tempfile::tempdir().unwrap();
    let path = store_in(&directory);
    forge(&path, change);
    match Store::open(&path, 0) {
        Ok(_) => panic!("a forged store was opened"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn hostile_commits_are_refused_before_anything_is_allocated() {
    for count in [u64::MAX, u64::MAX / 32, 1 << 58, 1 << 40, 10_000] {
        let message = forged_error(|slot, _| slot.index_entries = count);
        assert!(message.contains("commit slot"), "{message}");
    }
    for offset in [u64::MAX, u64::MAX - 31, 1 << 40] {
        assert!(forged_error(|slot, _| slot.index_offset = offset).contains("commit"));
        assert!(forged_error(|slot, _| slot.meta_offset = offset).contains("commit"));
        assert!(forged_error(|slot, _| slot.records_end = offset).contains("overlap"));
    }
    assert!(forged_error(|slot, _| slot.records_end = 0).contains("overlap"));
    assert!(forged_error(|slot, _| slot.meta_bytes = u32::MAX).contains("larger"));
    let nothing = forged_error(|slot, entries| {
        entries.clear();
        slot.index_entries = 0;
    });
    assert!(nothing.contains("missing"), "{nothing}");
    assert!(forged_error(|slot, _| slot.file_id[3] ^= 1).contains("another store"));
    assert!(forged_error(|slot, _| slot.meta_crc ^= 1).contains("metadata"));
}

#[test]
fn hostile_index_entries_are_refused() {
    let edit = |at: usize, change: fn(&mut IndexEntry)| {
        forged_error(|_, entries| {
            let mut entry = IndexEntry::decode(&entries[at]).unwrap();
            change(&mut entry);
            entries[at] = entry.encode();
        })
    };
    assert!(edit(0, |e| e.offset = u64::MAX).contains("outside"));
    assert!(edit(0, |e| e.length = u32::MAX).contains("outside"));
    assert!(edit(0, |e| e.offset = 0).contains("overlaps"));
    assert!(edit(0, |e| e.offset -= 1).contains("overlaps"));
    assert!(edit(0, |e| e.leaf = true).contains("out of order"));
    assert!(edit(3, |e| e.key = NodeKey::ROOT).contains("out of order"));
    assert!(edit(3, |e| e.key = NodeKey::new(16, [9; 3]).unwrap()).contains("missing"));
    assert!(edit(16, |e| e.leaf = false).contains("deeper"));
    assert!(forged_error(|_, entries| entries[0][24] = 0xff).contains("kind"));
    assert!(forged_error(|_, entries| entries[0][31] = 1).contains("reserved"));
    assert!(forged_error(|_, entries| entries[5][..8].fill(0xff)).contains("key"));
    assert!(forged_error(|_, entries| entries.swap(4, 5)).contains("missing"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_index_with_a_sound_checksum_is_read_or_refused(
        at in 0usize..17 * ENTRY_BYTES, value in any::<u64>(), bytes in 1usize..9,
    ) {
        let directory = tempfile::tempdir().unwrap();
        let path = store_in(&directory);
        forge(&path, |_, entries| {
            let index = entries.as_flattened_mut();
            let end = (at + bytes).min(index.len());
            index[at..end].copy_from_slice(&value.to_le_bytes()[..end - at]);
        });
        if let Ok(store) = Store::open(&path, CACHE_BYTES) {
            for key in store.keys() {
                let _ = store.brick(key);
            }
            store.verify(&Silent).unwrap();
        }
    }

    /// Payload damage that the checksum hides.
    #[test]
    fn any_payload_with_a_sound_checksum_is_read_or_refused(
        which in any::<prop::sample::Index>(), at in any::<prop::sample::Index>(), value in any::<u8>(),
        compression in prop::sample::select(vec![Compression::Lz4, Compression::Range]),
    ) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x.brf");
        let mut writer = StoreWriter::create(&path, &meta(2)).unwrap();
        let which = which.index(17);
        for (i, (key, leaf)) in nodes().into_iter().enumerate() {
            let mut bytes = Vec::new();
            let head = encode_with(&brick_at(key, leaf), compression, &mut Scratch::new(), &mut bytes);
            if i == which && !bytes.is_empty() {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            writer.append(key, leaf, head, &bytes).unwrap();
        }
        writer.finish(meta(2)).unwrap();
        let report = Store::open(&path, CACHE_BYTES).unwrap().verify(&Silent).unwrap();
        prop_assert!(report.damaged <= 17);
    }
}

#[test]
fn swapped_records_are_found() {
    let directory = tempfile::tempdir().unwrap();
    let path = store_in(&directory);
    let stored: Vec<usize> = {
        let store = Store::open(&path, 0).unwrap();
        (1..17).filter(|&at| store.entries()[at].head.kind.has_hermite()).take(2).collect()
    };
    // Swaps everything but the keys: each entry alone is sound, bound to the other key.
    forge(&path, |_, entries| {
        let (a, b) = (entries[stored[0]], entries[stored[1]]);
        entries[stored[0]][8..].copy_from_slice(&b[8..]);
        entries[stored[1]][8..].copy_from_slice(&a[8..]);
    });
    let store = Store::open(&path, CACHE_BYTES).unwrap();
    assert!(store.brick(store.entries()[stored[0]].key).unwrap_err().to_string().contains("checksum"));
    assert_eq!(store.verify(&Silent).unwrap().damaged, 2);
}

#[test]
fn contradictions_between_sound_records_are_found() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.brf");
    let found = |change: &dyn Fn(NodeKey, bool) -> (Brick, PayloadHead)| {
        let mut writer = StoreWriter::create(&path, &meta(2)).unwrap();
        for (key, leaf) in nodes() {
            let (brick, head) = change(key, leaf);
            writer.append(key, leaf, head, &encode(&brick).bytes).unwrap();
        }
        writer.finish(meta(2)).unwrap();
        let store = Store::open(&path, CACHE_BYTES).unwrap();
        store.verify(&Silent).unwrap().first_damage.map(|d| (d.key.unwrap(), d.what)).unwrap()
    };
    let as_encoded = |brick: Brick| {
        let head = encode(&brick).head;
        (brick, head)
    };
    // One uniform child that contradicts the root.
    let child = NodeKey::new(1, [0, 0, 1]).unwrap();
    let (key, what) =
        found(&|key, leaf| as_encoded(if key == child { Brick::Uniform(9) } else { brick_at(key, leaf) }));
    assert_eq!(key, NodeKey::new(1, [0, 0, 0]).unwrap());
    assert!(what.contains("does not repeat") && what.contains("L1(0,0,1)"), "{what}");
    let last = NodeKey::new(2, [3, 1, 1]).unwrap();
    let (key, what) =
        found(&|key, leaf| as_encoded(if key == last { Brick::Uniform(9) } else { brick_at(key, leaf) }));
    assert!(what.contains("does not repeat"), "{key} {what}");
    // A range that is not the samples'.
    let (key, what) = found(&|key, leaf| {
        let (brick, mut head) = as_encoded(brick_at(key, leaf));
        head.max += i16::from(key == NodeKey::ROOT);
        (brick, head)
    });
    assert!(key == NodeKey::ROOT && what.contains("range"), "{key} {what}");
    // A leaf without its edges.
    let (_, what) = found(&|key, leaf| as_encoded(brick_at(key, leaf && key.level() < 2)));
    assert!(what.contains("no Hermite edges"), "{what}");
}

#[test]
fn other_files_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("other");
    for content in [&b""[..], b"solid cube", &MAGIC, &[0; 20_000]] {
        std::fs::write(&path, content).unwrap();
        assert!(Store::open(&path, 0).err().unwrap().to_string().contains("not a brick store"));
    }
    let newer = store_in(&directory);
    std::fs::File::options().write(true).open(&newer).unwrap().write_all_at(&[9], 8).unwrap();
    assert!(Store::open(&newer, 0).err().unwrap().to_string().contains("version 9"));
    assert!(Store::open(directory.path(), 0).is_err());
    assert!(Store::open(&directory.path().join("missing"), 0).is_err());
}

#[test]
fn an_abandoned_writer_leaves_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.brf");
    let empty = || std::fs::read_dir(directory.path()).unwrap().count() == 0;
    let mut writer = StoreWriter::create(&path, &meta(2)).unwrap();
    assert!(!empty() && !path.exists());
    writer.append_brick(NodeKey::ROOT, true, &Brick::Uniform(0)).unwrap();
    drop(writer);
    assert!(empty());
    // A tree that is not complete is not given the final name either.
    let mut writer = StoreWriter::create(&path, &meta(2)).unwrap();
    writer.append_brick(NodeKey::ROOT, false, &Brick::Uniform(0)).unwrap();
    assert!(writer.finish(meta(2)).unwrap_err().to_string().contains("missing"));
    assert!(empty());
    let mut writer = StoreWriter::create(&path, &meta(2)).unwrap();
    writer.append_brick(NodeKey::ROOT, true, &Brick::Uniform(0)).unwrap();
    assert!(writer.finish(meta(3)).unwrap_err().to_string().contains("begun with"));
    assert!(empty());
}

#[test]
fn one_writer_at_a_time() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.brf");
    let writer = StoreWriter::create(&path, &meta(2)).unwrap();
    let refused = StoreWriter::create(&path, &meta(2)).err().unwrap().to_string();
    assert!(refused.contains("another process"), "{refused}");
    drop(writer);
    StoreWriter::create(&path, &meta(2)).unwrap();
}

#[test]
fn hopeless_outputs_are_refused_at_once() {
    let directory = tempfile::tempdir().unwrap();
    let message = |path: &Path| StoreWriter::create(path, &meta(2)).err().unwrap().to_string();
    assert!(message(directory.path()).contains("is a directory"));
    assert!(message(&directory.path().join("no/x.brf")).contains("does not exist"));
    assert!(message(Path::new("/dev/null")).contains("not a regular file"));
    assert!(message(Path::new("/proc/x.brf")).contains("cannot create"));
    assert!(message(Path::new("/")).contains("name of a file"));
}

#[test]
fn a_bad_record_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let mut writer = StoreWriter::create(&directory.path().join("x.brf"), &meta(2)).unwrap();
    let head = PayloadHead { kind: PayloadKind::UNIFORM, min: 0, max: 1 };
    assert!(writer.append(NodeKey::ROOT, true, head, &[]).is_err());
    let Payload { head, bytes } = encode(&brick_at(NodeKey::ROOT, true));
    assert!(writer.append(NodeKey::ROOT, false, head, &bytes).is_err());
}

/// A golden file of the version that holds such content: as the first program of that version wrote it, with palettes of
/// normals, as it is written now, or of the range coder.
fn golden_path(version: &str, name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(version).join(name)
}

/// Version, name, and the function that writes the content.
type Golden = (&'static str, &'static str, fn(&Path));

/// The golden files of today.
const WRITTEN_NOW: [Golden; 7] = [
    ("v1", "boxes-palette.brf", write),
    ("v1", "fractions-palette.brf", write_fractions),
    ("v1", "boxes-range.brf", write_range),
    ("v1", "fractions-range.brf", write_range_fractions),
    ("v2", "beads-palette.brf", write_beads),
    ("v2", "passes-palette.brf", write_passes),
    ("v3", "shard-palette.brf", write_shard),
];

#[test]
fn stores_are_written_as_the_golden_files_are() {
    let directory = tempfile::tempdir().unwrap();
    for (version, name, write) in WRITTEN_NOW {
        let again = directory.path().join(name);
        write(&again);
        let golden = std::fs::read(golden_path(version, name)).unwrap();
        assert!(
            std::fs::read(again).unwrap() == golden,
            "the bytes of {version}/{name} have changed: what readers know already must not, and what they cannot \
             know yet needs a new golden file"
        );
    }
}

#[test]
fn golden_files_of_soups_are_read() {
    for name in ["boxes.brf", "boxes-palette.brf", "boxes-range.brf"] {
        assert!(answers_right(&golden_path("v1", name)));
    }
}

#[test]
fn golden_files_of_fractions_are_read() {
    for name in ["fractions.brf", "fractions-palette.brf", "fractions-range.brf"] {
        let store = Store::open(&golden_path("v1", name), 0).unwrap();
        assert_eq!(*store.brick(NodeKey::ROOT).unwrap(), fractions());
        assert!(store.node(NodeKey::ROOT).is_some_and(|node| node.fractions && node.leaf));
    }
}

#[test]
fn golden_files_of_beads_are_read() {
    for name in ["beads.brf", "beads-palette.brf"] {
        let path = golden_path("v2", name);
        assert!(answers_right(&path));
        let store = Store::open(&path, 0).unwrap();
        let read = store.bead_tables().unwrap().expect("the store tells beads apart");
        assert_eq!(read, tables());
        for (key, list) in lists() {
            assert_eq!(store.segments(key, &read).unwrap(), list);
        }
        assert_eq!(store.segments(NodeKey::ROOT, &read).unwrap(), []);
    }
}

#[test]
fn golden_files_of_passes_are_read() {
    let path = golden_path("v2", "passes-palette.brf");
    assert!(answers_right(&path));
    let store = Store::open(&path, 0).unwrap();
    assert_eq!(store.meta().beads.as_ref().unwrap().passes, Some(3));
    let read = store.bead_tables().unwrap().expect("the store tells beads apart");
    assert_eq!(read, tables_of_passes());
    for (key, list) in lists_of_passes() {
        assert_eq!(store.segments(key, &read).unwrap(), list);
        assert!(list.iter().all(|segment| segment.line >= 10));
    }
}

#[test]
fn golden_shards_are_read_and_are_no_stores() {
    for name in ["shard.brf", "shard-palette.brf"] {
        let path = golden_path("v3", name);
        let refused = Store::open(&path, 0).err().unwrap().to_string();
        assert!(refused.contains("shard 1 of 2") && refused.contains("cache merge"), "{refused}");
        let store = Store::open_any(&path, CACHE_BYTES).unwrap();
        assert_eq!(store.meta().shard, meta_of_shard().shard);
        assert_eq!(store.keys(), nodes_of_shard().iter().map(|(key, _)| *key).collect::<Vec<_>>());
        for (key, leaf) in nodes_of_shard() {
            assert!(
                *store.brick(key).unwrap() == brick_at(key, leaf) && store.node(key).unwrap().leaf == leaf
            );
        }
        assert_eq!(store.identity_entries().len(), lists().len());
        assert_eq!(store.summary().total.nodes, 12);
        assert_eq!(store.verify(&Silent).unwrap().damaged, 0);
    }
}

/// Makes the newest golden files. The older ones are never made again.
#[test]
#[ignore = "writes into the source tree"]
fn make_golden_files() {
    for (version, name, write) in WRITTEN_NOW {
        let path = golden_path(version, name);
        // A golden file is never changed.
        if !path.exists() {
            write(&path);
        }
    }
}
