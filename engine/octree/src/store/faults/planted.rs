//! Mistakes planted on purpose: each must be found by a test.

use super::{crash, failing, reading};
use crate::disk::planted::{Bug, with_planted};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A mistake, the test that finds it, and what that test does.
type Case = (Bug, &'static str, fn());

const CASES: [Case; 17] = [
    (Bug::RecordsNotSyncedBeforeFrame, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::FrameNotSynced, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::DirectoryNotSyncedAtCommit, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::RecordsNotSyncedBeforeSlot, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::SlotNotSynced, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::DirectoryNotSyncedAfterRename, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::JournalRemovedBeforeRename, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::FrameChecksumIgnored, "checksums_are_compared", reading::read_a_damaged_journal),
    (Bug::KeptRecordsNotVerified, "kept_records_are_verified", failing::damage_kept_records),
    (Bug::LeftoverKept, "kept_records_are_verified", failing::damage_kept_records),
    (Bug::KeptNodesRepeated, "no_power_cut_loses_or_changes_what_was_committed", cut),
    (Bug::PoisonIgnored, "a_failed_sync_is_not_tried_again", failing::go_on_after_failed_syncs),
    (Bug::SettingsNotCompared, "another_input_or_setting_is_refused_by_name", failing::go_on_with_another),
    (Bug::RecordChecksumIgnored, "checksums_are_compared", reading::read_a_damaged_record),
    (Bug::IndexChecksumIgnored, "checksums_are_compared", reading::read_a_damaged_index),
    (Bug::StaleSlotChosen, "the_newer_commit_counts", reading::choose_the_newer_slot),
    (Bug::OverlapsIgnored, "overlapping_records_are_refused", reading::overlap_records),
];

fn cut() {
    crash::cut_everywhere(4, 3);
}

#[test]
fn every_planted_mistake_is_found() {
    // The messages of the panics that are to come would be taken for failures.
    let missed: Vec<String> = CASES
        .iter()
        .filter(|(bug, _, test)| with_planted(*bug, || catch_unwind(AssertUnwindSafe(test)).is_ok()))
        .map(|(bug, name, _)| format!("{bug:?} is not found by {name}"))
        .collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}
