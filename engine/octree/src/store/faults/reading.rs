//! Files that are damaged, forged, cut short, or no longer what they were.

use super::{NAME, expected, job, name, settings};
use crate::brick::{Brick, Hermite, Samples};
use crate::disk::sim::{SimDisk, SimRng};
use crate::lattice::NodeKey;
use crate::progress::Silent;
use crate::store::layout::{
    ENTRY_BYTES, HEADER_BYTES, IndexEntry, PAGE_BYTES, SLOT_BYTES, SLOT_OFFSETS, Slot,
};
use crate::store::reader::Store;
use crate::store::source::ByteSource;
use crate::store::testing::{brick_at, meta};
use crate::store::writer::StoreWriter;
use crate::store::{BrickTree, Meta, VerifyReport};
use std::path::Path;
use std::sync::Arc;

fn open(bytes: Vec<u8>) -> crate::error::Result<Store> {
    Store::of_source(Path::new(NAME), ByteSource::Memory(bytes), 0, &|_| None)
}

fn verify(bytes: Vec<u8>) -> VerifyReport {
    open(bytes).expect("it opens").verify(&Silent).expect("nobody interrupts")
}

/// Eight changes of a byte: each bit, and combinations that turn it into all of 0, 255 and its neighbours now and then.
fn changes(byte: u8, at: usize) -> [u8; 8] {
    let flip = |bit: usize| byte ^ 1 << (bit % 8);
    [
        flip(at),
        flip(at + 3),
        !byte,
        byte.wrapping_add(1),
        byte.wrapping_sub(1),
        byte ^ 0x0f,
        byte ^ 0xaa,
        byte ^ 0x55,
    ]
}

/// Changes every byte of a store in eight ways. Returns how many changes that were, and which bytes no answer depends on.
///
/// # Panics
/// If an answer is another than that of the sound store.
fn change_every_byte(sound: &[u8]) -> (usize, Vec<usize>) {
    let slot = slot_of(sound);
    let mut store = open(sound.to_vec()).expect("a sound store");
    let entries = store.entries().to_vec();
    let lists = store.identity_entries().to_vec();
    let tables = store.bead_tables().expect("sound tables");
    let (mut count, mut harmless) = (0, Vec::new());
    // A record's bytes are nobody else's, and nothing of them is read before somebody asks for it.
    for at in HEADER_BYTES..slot.index_offset as usize {
        let holds = |offset: u64, length: u32| (offset..offset + u64::from(length)).contains(&(at as u64));
        let brick = entries.iter().find(|entry| holds(entry.offset, entry.length)).copied();
        let list = lists.iter().find(|entry| holds(entry.offset, entry.length)).copied();
        for byte in changes(sound[at], at) {
            count += 1;
            store.poke(at, byte);
            match (&brick, &list, &tables) {
                (Some(entry), ..) => assert!(store.brick(entry.key).is_err(), "byte {at} as {byte}"),
                (_, Some(entry), Some(tables)) => {
                    assert!(store.segments(entry.key, tables).is_err(), "byte {at} as {byte}");
                }
                _ => {
                    // Tables and index of the beads.
                    let mut bytes = sound.to_vec();
                    bytes[at] = byte;
                    let answer = open(bytes).and_then(|store| store.bead_tables());
                    assert!(answer.is_err(), "byte {at} as {byte}");
                }
            }
        }
        store.poke(at, sound[at]);
    }
    let mut bytes = sound.to_vec();
    for at in (0..HEADER_BYTES).chain(slot.index_offset as usize..sound.len()) {
        for byte in changes(sound[at], at) {
            count += 1;
            bytes[at] = byte;
            if let Ok(other) = open(bytes.clone()) {
                assert!(other.entries() == entries && other.meta() == store.meta(), "byte {at} as {byte}");
                assert!(other.identity_entries() == lists, "byte {at} as {byte}");
                harmless.push(at);
            }
        }
        bytes[at] = sound[at];
    }
    (count, harmless)
}

/// Noise in the first samples of the root, so that its record is long: the index need not grow with the store.
const NOISE_SAMPLES: usize = 30_000;

fn noise() -> Brick {
    let mut samples = Samples::filled(0);
    let mut rng = SimRng(5);
    samples.0[..NOISE_SAMPLES].fill_with(|| rng.below(256) as i16);
    Brick::Counts { samples, hermite: Hermite::default() }
}

/// A store of all nodes down to level 3.
fn large() -> Vec<u8> {
    let disk = SimDisk::default();
    let meta = Meta { depth: 3, ..meta(3) };
    let begun = StoreWriter::begin(Arc::new(disk.clone()), Path::new(NAME), &meta, settings(), false);
    let mut writer = begun.expect("nothing fails");
    for level in 0..=3 {
        let side = 1u32 << level;
        for n in 0..side.pow(3) {
            let key = NodeKey::new(level, [n % side, n / side % side, n / side / side]).expect("a node");
            let brick = if level == 0 { noise() } else { brick_at(key, level == 3) };
            writer.append_brick(key, level == 3, &brick).expect("nothing fails");
        }
    }
    writer.finish(meta).expect("a complete tree");
    disk.files().remove(Path::new(NAME)).expect("the store")
}

#[test]
#[ignore = "half a minute: cargo test -p brickfield-octree --lib every_byte_of_a_large_store -- --ignored --nocapture"]
fn every_byte_of_a_large_store() {
    let large = large();
    let (count, harmless) = change_every_byte(&large);
    println!("{count} changes of {} bytes, {} of them harmless", large.len(), harmless.len());
    assert!(large.len() >= 64 << 10 && count == 8 * large.len());
}

fn slot_of(bytes: &[u8]) -> Slot {
    Slot::decode(&bytes[SLOT_OFFSETS[1]..][..PAGE_BYTES], 1).expect("the first commit")
}

#[test]
fn no_changed_byte_changes_an_answer_and_verify_finds_each() {
    let (count, harmless) = change_every_byte(expected());
    println!("{count} changes of {} bytes, {} of them harmless", expected().len(), harmless.len());
    assert_eq!(count, 8 * expected().len());
    let used = SLOT_OFFSETS[1]..SLOT_OFFSETS[1] + SLOT_BYTES;
    assert!(harmless.iter().all(|at| (PAGE_BYTES..HEADER_BYTES).contains(at) && !used.contains(at)));
    // What no answer depends on is found all the same.
    for at in harmless.iter().step_by(331) {
        let mut bytes = expected().to_vec();
        bytes[*at] ^= 0x10;
        let report = verify(bytes);
        assert_eq!((report.damaged, report.strays), (0, 1), "byte {at}");
        let damage = report.first_damage.unwrap();
        assert_eq!((damage.key, damage.offset), (None, *at as u64));
    }
    let appended = [expected(), b"x"].concat();
    let report = verify(appended);
    assert!(report.strays == 1 && report.first_damage.unwrap().what.contains("1 bytes stand behind"));
    // And records are named.
    let store = open(expected().to_vec()).unwrap();
    for entry in store.entries().iter().filter(|entry| entry.length > 0) {
        let mut bytes = expected().to_vec();
        bytes[entry.offset as usize] ^= 1;
        let report = verify(bytes);
        assert_eq!((report.damaged, report.first_damage.unwrap().key), (1, Some(entry.key)));
    }
    for entry in store.identity_entries() {
        let mut bytes = expected().to_vec();
        bytes[entry.offset as usize] ^= 1;
        let report = verify(bytes);
        assert_eq!((report.damaged, report.first_damage.unwrap().key), (1, Some(entry.key)));
    }
}

#[test]
fn truncation_at_every_length_is_an_error() {
    for length in 0..expected().len() {
        assert!(open(expected()[..length].to_vec()).is_err(), "{length} bytes");
    }
}

/// Makes the checksums of index and slot fit an index that was changed.
fn forge(bytes: &mut [u8], change: impl FnOnce(&mut [[u8; ENTRY_BYTES]])) {
    let mut slot = slot_of(bytes);
    let range = slot.index_offset as usize..slot.index_offset as usize + job().records.len() * ENTRY_BYTES;
    change(bytes[range.clone()].as_chunks_mut().0);
    slot.index_crc = crc32fast::hash(&bytes[range]);
    bytes[SLOT_OFFSETS[1]..][..SLOT_BYTES].copy_from_slice(&slot.encode());
}

/// Records in each other's places, and such as were sound in another store.
///
/// # Panics
/// If one of them is taken for what stood there.
pub fn swap_records() -> usize {
    let sound = open(expected().to_vec()).unwrap();
    let entries: Vec<(usize, IndexEntry)> =
        sound.entries().iter().copied().enumerate().filter(|(_, entry)| entry.length > 0).collect();
    let mut swaps = 0;
    for (a, one) in &entries {
        for (b, other) in &entries {
            if a == b || !one.leaf || !other.leaf {
                continue;
            }
            // Everything but the keys.
            let mut bytes = expected().to_vec();
            forge(&mut bytes, |index| {
                let (first, second) = (index[*a], index[*b]);
                index[*a][8..].copy_from_slice(&second[8..]);
                index[*b][8..].copy_from_slice(&first[8..]);
            });
            let store = open(bytes).expect("each entry is legal");
            assert!(store.brick(one.key).is_err() && store.brick(other.key).is_err());
            swaps += 1;
        }
        // A stale record: sound bytes of the same length from elsewhere.
        let mut bytes = expected().to_vec();
        let range = one.offset as usize..(one.offset + u64::from(one.length)) as usize;
        bytes[range.clone()].rotate_left(1);
        let store = open(bytes).unwrap();
        if expected()[range.clone()].iter().any(|byte| *byte != expected()[range.start]) {
            assert!(store.brick(one.key).is_err(), "{}", one.key);
            swaps += 1;
        }
    }
    swaps
}

#[test]
fn swapped_and_stale_records_are_errors() {
    let swaps = swap_records();
    println!("{swaps} swaps");
    assert!(swaps > 20, "{swaps} swaps");
}

/// A store with two commits: the newer one is in the other slot.
///
/// # Panics
/// If the older one answers.
pub fn choose_the_newer_slot() {
    let mut bytes = expected().to_vec();
    let first = slot_of(&bytes);
    // The second names the same parts, and the first is of an index that is no longer there.
    let second = Slot { generation: 2, ..first };
    let stale = Slot { index_crc: first.index_crc ^ 1, ..first };
    bytes[SLOT_OFFSETS[0]..][..SLOT_BYTES].copy_from_slice(&second.encode());
    bytes[SLOT_OFFSETS[1]..][..SLOT_BYTES].copy_from_slice(&stale.encode());
    let store = open(bytes.clone()).expect("the newer commit is sound");
    assert_eq!(store.entries().len(), job().records.len());
    // If the newer one is torn, the older one counts; if it is whole and what it names is not, nothing does.
    bytes[SLOT_OFFSETS[0] + 5] ^= 1;
    bytes[SLOT_OFFSETS[1]..][..SLOT_BYTES].copy_from_slice(&first.encode());
    assert!(open(bytes.clone()).is_ok());
    bytes[SLOT_OFFSETS[0]..][..SLOT_BYTES].copy_from_slice(&Slot { meta_crc: 0, ..second }.encode());
    assert!(open(bytes).is_err());
}

#[test]
fn the_newer_commit_counts() {
    choose_the_newer_slot();
}

/// # Panics
/// If records are opened that overlap.
pub fn overlap_records() {
    let mut bytes = expected().to_vec();
    let stored = open(bytes.clone()).unwrap().entries().iter().rposition(|entry| entry.length > 9).unwrap();
    forge(&mut bytes, |index| {
        let mut entry = IndexEntry::decode(&index[stored]).expect("a sound entry");
        entry.offset -= 1;
        index[stored] = entry.encode();
    });
    let error = open(bytes).err().expect("it is refused").to_string();
    assert!(error.contains("overlaps"), "{error}");
}

#[test]
fn overlapping_records_are_refused() {
    overlap_records();
}

/// # Panics
/// If another record's bytes are taken for a brick.
pub fn read_a_damaged_record() {
    let store = open(expected().to_vec()).unwrap();
    let entry = *store.entries().iter().find(|entry| entry.length > 0).unwrap();
    let mut bytes = expected().to_vec();
    // Somewhere in the middle, so that the decoder may well accept it.
    bytes[(entry.offset + u64::from(entry.length) * 3 / 4) as usize] ^= 1;
    let answer = open(bytes).unwrap().brick(entry.key);
    assert!(answer.is_err_and(|error| error.to_string().contains("checksum")));
}

/// # Panics
/// If an index is believed whose checksum differs.
pub fn read_a_damaged_index() {
    let mut bytes = expected().to_vec();
    // The checksum of a record: any value is legal.
    let at = slot_of(&bytes).index_offset as usize + 20;
    bytes[at] ^= 1;
    let error = open(bytes).err().expect("it is refused").to_string();
    assert!(error.contains("index"), "{error}");
}

/// # Panics
/// If a frame of the journal is believed whose checksum differs.
pub fn read_a_damaged_journal() {
    let disk = SimDisk::default();
    let begun = StoreWriter::begin(Arc::new(disk.clone()), Path::new(NAME), &job().meta, settings(), false);
    let mut writer = begun.expect("nothing fails");
    for (key, leaf, payload) in &job().records {
        writer.append(*key, *leaf, payload.head, &payload.bytes).expect("nothing fails");
        writer.commit().expect("nothing fails");
    }
    drop(writer);
    let mut files = disk.files();
    let journal = files.get_mut(&name(".journal")).expect("it is there");
    // The checksum of the last record: any value is legal.
    let at = journal.len() - 10;
    journal[at] ^= 1;
    let part = ByteSource::Memory(files[&name(".part")].clone());
    let store = Store::of_source(&name(".part"), part, 0, &|path| files.get(path).cloned());
    assert_eq!(store.expect("the frames before are sound").entries().len(), job().records.len() - 1);
}

#[test]
fn checksums_are_compared() {
    read_a_damaged_record();
    read_a_damaged_index();
    read_a_damaged_journal();
}

#[test]
fn a_file_that_is_cut_short_under_the_reader_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.brf");
    std::fs::write(&path, expected()).unwrap();
    let store = Store::open(&path, 0).unwrap();
    std::fs::File::options().write(true).open(&path).unwrap().set_len(HEADER_BYTES as u64 + 1).unwrap();
    let mut lost = 0;
    for entry in store.entries().iter().filter(|entry| entry.length > 1) {
        let error = store.brick(entry.key).unwrap_err().to_string();
        assert!(error.contains("cut short"), "{error}");
        lost += 1;
    }
    assert!(lost > 3);
    assert!(store.bead_tables().is_err());
    // Another store in its place is another file; the one that was opened still answers.
    std::fs::write(&path, expected()).unwrap();
    let store = Store::open(&path, 0).unwrap();
    std::fs::write(directory.path().join("y"), b"another").unwrap();
    std::fs::rename(directory.path().join("y"), &path).unwrap();
    assert!(*store.brick(NodeKey::ROOT).unwrap() == brick_at(NodeKey::ROOT, false));
}
