//! Mistakes that tests plant on purpose, to show that they would be found.
//!
//! Each stands where a programmer might make it. Outside of the tests `planted` is a constant, and the mistakes are
//! gone from the program.

/// A mistake in writing, going on with, or reading a store, or in writing a file that gets its name in the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bug {
    /// A commit names records that are not durable.
    RecordsNotSyncedBeforeFrame,
    /// A commit is done before its frame is durable.
    FrameNotSynced,
    /// The first commit leaves the names of its files to chance.
    DirectoryNotSyncedAtCommit,
    /// The last commit names records and an index that are not durable.
    RecordsNotSyncedBeforeSlot,
    /// The file gets its name before its commit is durable.
    SlotNotSynced,
    /// The file is said to be finished before its name is durable.
    DirectoryNotSyncedAfterRename,
    /// The journal goes before the file has its name.
    JournalRemovedBeforeRename,
    /// Who goes on after a failed sync takes the file for durable.
    PoisonIgnored,
    /// Frames count whatever their checksums say.
    FrameChecksumIgnored,
    /// Records of an earlier run count unread.
    KeptRecordsNotVerified,
    /// What an earlier run wrote behind its last commit stays.
    LeftoverKept,
    /// Nodes of an earlier run are appended again.
    KeptNodesRepeated,
    /// Other settings go on with an unfinished store.
    SettingsNotCompared,
    /// Records count whatever their checksums say.
    RecordChecksumIgnored,
    /// The index counts whatever its checksum says.
    IndexChecksumIgnored,
    /// The older of two commits counts.
    StaleSlotChosen,
    /// Records may overlap.
    OverlapsIgnored,
    /// A mesh or an array gets its name before it is durable.
    PartNotSynced,
    /// A mesh or an array is said to be finished before its name is durable.
    PartDirectoryNotSynced,
    /// A mesh or an array gets its name although writing a part of it has failed.
    PartFailureIgnored,
    /// What was written of a mesh or an array that failed stays under its unfinished name.
    PartLeftBehind,
}

#[cfg(any(test, feature = "testing"))]
thread_local! {
    static PLANTED: std::cell::Cell<Option<Bug>> = const { std::cell::Cell::new(None) };
}

/// Whether the mistake is to be made, on this thread.
#[cfg(any(test, feature = "testing"))]
pub fn planted(bug: Bug) -> bool {
    PLANTED.get() == Some(bug)
}

/// Whether the mistake is to be made: never.
#[cfg(not(any(test, feature = "testing")))]
pub const fn planted(_: Bug) -> bool {
    false
}

/// Runs something with a mistake planted.
#[cfg(any(test, feature = "testing"))]
pub fn with_planted<T>(bug: Bug, run: impl FnOnce() -> T) -> T {
    /// Takes the mistake out again even if `run` panics, as it should.
    struct TakeOut;
    impl Drop for TakeOut {
        fn drop(&mut self) {
            PLANTED.set(None);
        }
    }
    PLANTED.set(Some(bug));
    let _take_out = TakeOut;
    run()
}
