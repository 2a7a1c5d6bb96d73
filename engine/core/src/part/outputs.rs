//! What must hold for every file that gets its name in the end, wherever its writing fails.

use super::part_path;
use crate::disk::Disk;
use crate::disk::sim::{Crash, DiskFault, Op, SimDisk, SimRng, image};
use crate::error::Result;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The name that is to be written.
pub const NAME: &str = "output.x";
const OLD: &[u8] = b"an older file";
const FAULTS: [DiskFault; 4] = [DiskFault::Broken, DiskFault::Full, DiskFault::Short, DiskFault::Kill];
const CRASHES: [Crash; 4] = [Crash::Dropped, Crash::Kept, Crash::Reordered, Crash::Torn];

type Files = BTreeMap<PathBuf, Vec<u8>>;

/// Writes [`NAME`] on a disk.
pub type Write<'a> = &'a dyn Fn(Arc<dyn Disk>) -> Result<()>;

fn old() -> Files {
    Files::from([(NAME.into(), OLD.to_vec())])
}

/// The disk after an undisturbed run, the file, and the calls that changed something.
fn undisturbed(write: Write<'_>) -> (SimDisk, Vec<u8>) {
    let disk = SimDisk::holding(&old());
    write(Arc::new(disk.clone())).expect("nothing fails");
    let mut files = disk.files();
    let expected = files.remove(Path::new(NAME)).expect("the file");
    assert!(files.is_empty() && expected != OLD);
    (disk, expected)
}

/// Lets each call go wrong in each way. Returns how many runs that were.
///
/// # Panics
/// If the name then stands for anything but the older file or the whole new one, or an error does not name
/// the file in one line. Also if a program that was not killed leaves something else behind, or the next run does not
/// do what it should.
pub fn fail_everywhere(write: Write<'_>) -> usize {
    let (sound, expected) = undisturbed(write);
    for at in 0..sound.calls() {
        for fault in FAULTS {
            let disk = SimDisk::holding(&old());
            disk.plan(at, fault);
            let written = write(Arc::new(disk.clone()));
            disk.revive();
            let files = disk.files();
            let new = files[Path::new(NAME)] == expected;
            assert!(new || files[Path::new(NAME)] == OLD, "call {at}, {fault:?}: neither old nor new");
            match written {
                Ok(()) => assert!(new, "call {at}, {fault:?}: the old file"),
                Err(error) => {
                    let line = error.to_string();
                    assert!(line.contains(NAME) && !line.contains('\n'), "{line}");
                }
            }
            let left: Vec<_> = files.keys().filter(|name| *name != Path::new(NAME)).collect();
            let killed = fault == DiskFault::Kill;
            assert!(left.iter().all(|name| killed && **name == part_path(Path::new(NAME))), "{left:?}");
            write(Arc::new(disk.clone())).unwrap_or_else(|error| panic!("call {at}, {fault:?}: {error}"));
            assert!(disk.files() == Files::from([(NAME.into(), expected.clone())]), "call {at}, {fault:?}");
        }
    }
    let runs = sound.calls() * FAULTS.len();
    println!("{runs} runs");
    runs
}

/// Cuts the power at every call, `repeats` times where chance decides what is left. Returns how many images were looked
/// at.
///
/// # Panics
/// If the name then stands for anything but the older file or the whole new one. Also if it stands for the
/// older one after the writer said that the new one was finished, or if the next run does not do what it should.
pub fn cut_everywhere(write: Write<'_>, repeats: usize) -> usize {
    let (disk, expected) = undisturbed(write);
    disk.note(Op::Finished);
    let log = disk.log();
    let (mut rng, mut images) = (SimRng(11), 0);
    for cut in 0..=log.len() {
        for crash in CRASHES {
            let repeats = if matches!(crash, Crash::Dropped | Crash::Kept) { 1 } else { repeats };
            for _ in 0..repeats {
                let files = image(&old(), &log[..cut], crash, &mut rng);
                let new = files[Path::new(NAME)] == expected;
                assert!(new || files[Path::new(NAME)] == OLD, "cut {cut}, {crash:?}: neither old nor new");
                assert!(new || cut < log.len(), "{crash:?}: a finished file is gone");
                images += 1;
            }
            let files = image(&old(), &log[..cut], crash, &mut rng);
            let disk = SimDisk::holding(&files);
            write(Arc::new(disk.clone())).expect("nothing fails");
            assert!(disk.files() == Files::from([(NAME.into(), expected.clone())]), "cut {cut}, {crash:?}");
        }
    }
    println!("{images} images");
    images
}
