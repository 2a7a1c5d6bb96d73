//! A hostile file takes no more memory than it has bytes to show for: a test program of its own, since it counts what the
//! whole program allocates.

use brickfield_engine::Silent;
use brickfield_engine::build::{BuildOptions, Resolution, build};
use brickfield_engine::store::{AcceptedStores, Io, Store, StoreOptions};
use peak_alloc::PeakAlloc;
use std::path::Path;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

const SLOT: usize = 8192;
const SLOT_BYTES: usize = 72;
const INDEX_OFFSET: usize = SLOT + 32;
const INDEX_ENTRIES: usize = SLOT + 40;
const META_OFFSET: usize = SLOT + 48;
const META_BYTES: usize = SLOT + 56;
const INDEX_CRC: usize = SLOT + 60;
const META_CRC: usize = SLOT + 64;
const SLOT_CRC: usize = SLOT + 68;

/// CRC-32 as FORMAT.md says.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 })
    })
}

fn number(bytes: &[u8], at: usize) -> usize {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes[at..at + value.len()].copy_from_slice(value);
}

/// Makes the slot's own checksum fit.
fn seal(bytes: &mut [u8]) {
    let crc = crc(&bytes[SLOT..SLOT_CRC]);
    put(bytes, SLOT_CRC, &crc.to_le_bytes());
}

/// Opens a file and tries to read all of it; returns whether it opened, and the most memory that took.
fn open(path: &Path, bytes: &[u8]) -> (bool, usize) {
    std::fs::write(path, bytes).unwrap();
    ALLOCATED.reset_peak_usage();
    let before = ALLOCATED.current_usage();
    let options = StoreOptions { cache_bytes: 0, io: Io::Pread, accept: AcceptedStores::Unfinished };
    let opened = Store::open_with(path, options).map(drop).is_ok();
    (opened, ALLOCATED.peak_usage() - before)
}

fn store(folder: &Path) -> Vec<u8> {
    let input = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/stl/overlap_boxes.stl");
    let options = BuildOptions { resolution: Resolution::Depth(2), ..BuildOptions::default() };
    let path = folder.join("sound.brf");
    build(&[input], &path, &options, &Silent).unwrap();
    std::fs::read(&path).unwrap()
}

/// A store whose index has as many entries as there is room for in `size` bytes, each like the one given.
fn flooded(sound: &[u8], size: usize, entry: impl Fn(u64) -> [u8; 32]) -> Vec<u8> {
    let meta = sound[number(sound, META_OFFSET)..].to_vec();
    let mut bytes = sound[..3 * 4096].to_vec();
    let count = (size - bytes.len() - meta.len()) / 32;
    let from = bytes.len();
    (0..count as u64).for_each(|n| bytes.extend(entry(n)));
    let index = crc(&bytes[from..]);
    put(&mut bytes, SLOT + 24, &(from as u64).to_le_bytes());
    put(&mut bytes, INDEX_OFFSET, &(from as u64).to_le_bytes());
    put(&mut bytes, INDEX_ENTRIES, &(count as u64).to_le_bytes());
    put(&mut bytes, INDEX_CRC, &index.to_le_bytes());
    let end = bytes.len() as u64;
    put(&mut bytes, META_OFFSET, &end.to_le_bytes());
    seal(&mut bytes);
    bytes.extend(meta);
    bytes
}

#[test]
fn memory_is_bounded_by_the_bytes_present() {
    let folder = tempfile::tempdir().unwrap();
    let (sound, path) = (store(folder.path()), folder.path().join("hostile.brf"));
    let (opened, least) = open(&path, &sound);
    assert!(opened && least > 0, "{least} bytes: nothing is counted");
    let (mut files, mut worst) = (0, 0.0f64);
    let mut check = |bytes: &[u8], what: String| {
        let (_, peak) = open(&path, bytes);
        let bound = 4 * bytes.len() + (1 << 20);
        assert!(peak <= bound, "{what}: {peak} bytes of memory for {} of a file", bytes.len());
        files += 1;
        worst = worst.max(peak as f64 / bound as f64);
    };
    let values = [u64::MAX, u64::MAX / 32, 1 << 58, 1 << 40, 1 << 31, 1 << 20, sound.len() as u64];
    // Every number of the slot, the slot's checksum made to fit; and of the metadata, likewise.
    for at in (SLOT..SLOT + SLOT_BYTES - 8).step_by(4) {
        for value in values {
            let mut bytes = sound.clone();
            put(&mut bytes, at, &value.to_le_bytes());
            seal(&mut bytes);
            check(&bytes, format!("slot {at}, {value}"));
        }
    }
    let meta = number(&sound, META_OFFSET)..sound.len();
    assert_eq!(meta.len(), number(&sound, META_BYTES) & 0xffff_ffff);
    for at in meta.start..meta.end - 8 {
        for value in values {
            let mut bytes = sound.clone();
            put(&mut bytes, at, &value.to_le_bytes());
            let crc = crc(&bytes[meta.clone()]);
            put(&mut bytes, META_CRC, &crc.to_le_bytes());
            seal(&mut bytes);
            check(&bytes, format!("metadata {at}, {value}"));
        }
    }
    // Large indices of legal entries: uniform leaves, and payloads side by side.
    let uniform = |_| {
        let mut entry = [0; 32];
        put(&mut entry, 0, &1u64.to_le_bytes());
        entry[25] = 1;
        entry
    };
    let stored = |n: u64| {
        let mut entry = uniform(n);
        put(&mut entry, 8, &(12_288 + n).to_le_bytes());
        put(&mut entry, 16, &1u32.to_le_bytes());
        entry[24] = 1;
        entry
    };
    for size in [100_000, 8 << 20] {
        check(&flooded(&sound, size, uniform), format!("{size} bytes of uniform leaves"));
        check(&flooded(&sound, size, stored), format!("{size} bytes of payloads"));
        check(&flooded(&sound, size, |_| [0; 32]), format!("{size} bytes of nothing"));
    }
    // An index is in memory once, not as bytes and as entries.
    let (_, peak) = open(&path, &flooded(&sound, 32 << 20, uniform));
    assert!(peak > 31 << 20 && peak < 36 << 20, "{peak} bytes of memory for an index of 32 MiB");
    println!("{files} files, at most {:.0} % of the bound", 100.0 * worst);
}
