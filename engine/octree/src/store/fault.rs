//! What is wrong with a file that is no sound store.

use super::layout::PreambleError;

/// The remedy for a damaged file.
pub(super) const REBUILD: &str = "restore the file from a copy or build it again";

/// What is wrong with a file, and where.
pub(super) struct StoreFault {
    pub place: String,
    pub what: String,
    pub remedy: String,
}

/// Damage.
pub(super) fn fault(place: impl ToString, what: impl ToString) -> StoreFault {
    StoreFault { place: place.to_string(), what: what.to_string(), remedy: REBUILD.to_owned() }
}

/// Of the first page.
pub(super) fn preamble_fault(error: PreambleError) -> StoreFault {
    match error {
        PreambleError::NotAStore => StoreFault {
            place: "header".into(),
            what: "this is not a brick store".into(),
            remedy: "give a file that `brickfield build` has finished".into(),
        },
        PreambleError::Version(version) => StoreFault {
            place: "header".into(),
            what: format!("format version {version} is unknown to this program"),
            remedy: "use the program that wrote it or build the store again".into(),
        },
        PreambleError::Damaged => fault("header", "the checksum differs"),
    }
}
