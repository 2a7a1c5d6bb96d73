//! Builds whose temporary file fails.

use super::{BuildOptions, BuildSummary, CommitOptions, Resolution, Resources, build_opened};
use crate::disk::Disk;
use crate::disk::sim::{DiskFault, ReadFault, SimDisk};
use crate::error::Result;
use crate::ingest::Input;
use crate::part::temporary::stand_in;
use crate::progress::Silent;
use std::path::{Path, PathBuf};

/// So little that everything goes to the file.
const MEMORY: u64 = 1 << 12;
/// Calls at which the file fails, spread over all.
const FAILURES: usize = 4;

struct Site {
    folder: tempfile::TempDir,
    input: Input,
}

impl Site {
    fn new() -> Site {
        let input =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bench-data/stl/featuretype50_model.stl");
        let input = Input::open(&input, &Silent).expect("it is sound");
        Site { folder: tempfile::tempdir().expect("a folder"), input }
    }

    fn output(&self) -> PathBuf {
        self.folder.path().join("a.brf")
    }

    fn names(&self) -> Vec<String> {
        let files = std::fs::read_dir(self.folder.path()).expect("it can be listed");
        let mut names: Vec<String> =
            files.map(|file| file.expect("a file").file_name().into_string().expect("text")).collect();
        names.sort();
        names
    }

    /// Builds with a temporary file on that disk, and commits all the time.
    fn build(&self, disk: &SimDisk) -> Result<BuildSummary> {
        let file = disk.open_locked(Path::new("temporary")).expect("nothing fails").expect("nobody has it");
        stand_in::put(self.folder.path(), file);
        let options = BuildOptions {
            resolution: Resolution::Depth(2),
            resources: Resources { memory: MEMORY, ..Resources::default() },
            keeping: CommitOptions { pace: std::time::Duration::ZERO, ..CommitOptions::default() },
            ..BuildOptions::default()
        };
        build_opened(std::slice::from_ref(&self.input), &self.output(), &options, &Silent)
    }

    /// Builds while something fails. Then builds again, and gives back whether the first run did well.
    fn build_twice(&self, plan: impl Fn(&SimDisk), expected: &[u8], what: &str) -> bool {
        let disk = SimDisk::default();
        // The file is made before anything fails.
        drop(disk.open_locked(Path::new("temporary")).expect("nothing fails"));
        plan(&disk);
        let built = self.build(&disk);
        if let Err(error) = &built {
            let line = error.to_string();
            assert!(line.contains("temporary file in") && !line.contains('\n'), "{what}: {line}");
            assert!(!self.output().exists(), "{what}: a store of a failed build");
            self.build(&SimDisk::default()).unwrap_or_else(|error| panic!("{what}: {error}"));
        }
        assert!(std::fs::read(self.output()).expect("the store") == expected, "{what}: other bytes");
        assert_eq!(self.names(), ["a.brf"], "{what}");
        std::fs::remove_file(self.output()).expect("it is there");
        built.is_ok()
    }
}

fn some_of(calls: usize) -> impl Iterator<Item = usize> {
    let failures = calls.min(FAILURES);
    (0..failures).map(move |number| number * calls / failures)
}

#[test]
fn a_failing_temporary_file_is_an_error_and_what_was_committed_is_gone_on_with() {
    let site = Site::new();
    let sound = SimDisk::default();
    let summary = site.build(&sound).expect("nothing fails");
    println!("{} calls, {} readings, {} bytes", sound.calls(), sound.reads(), summary.temporary_bytes);
    assert!(summary.temporary_bytes > 0 && sound.reads() > FAILURES && sound.calls() > 1);
    let expected = std::fs::read(site.output()).expect("the store");
    std::fs::remove_file(site.output()).expect("it is there");
    let (mut errors, mut builds) = (0, 0);
    // The first call makes the file.
    for at in some_of(sound.calls() - 1) {
        for fault in [DiskFault::Broken, DiskFault::Full, DiskFault::Short] {
            let what = format!("write {at}, {fault:?}");
            errors += u32::from(!site.build_twice(|disk| disk.plan(at, fault), &expected, &what));
            builds += 1;
        }
    }
    for at in some_of(sound.reads()) {
        for fault in [ReadFault::Broken, ReadFault::Short, ReadFault::Cut, ReadFault::Flipped] {
            let what = format!("reading {at}, {fault:?}");
            let did_well = site.build_twice(|disk| disk.plan_read(at, fault), &expected, &what);
            assert_eq!(did_well, fault == ReadFault::Short, "{what}");
            errors += u32::from(!did_well);
            builds += 1;
        }
    }
    println!("{builds} builds, {errors} errors");
    assert!(errors as usize > 3 * FAILURES);
}
