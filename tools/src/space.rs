//! Large files are foreseen against the free space before they are written.

use crate::failure::Failure;
use crate::output::note;
use crate::units::Size;
use brickfield_engine::part::{free_beside, left_behind, part_path};
use std::path::Path;

/// Smaller files are not foreseen: writing tells soon enough.
pub const LARGE_BYTES: u64 = 1_000_000_000;

/// Fails unless the disk of `path` has room for a file of about `bytes`; files of less than [`LARGE_BYTES`] are left to
/// their writing.
///
/// # Errors
/// Both numbers, and what to do: `remedy` beside making room.
pub fn require_space(path: &Path, bytes: u64, remedy: &str) -> Result<(), Failure> {
    let Some(free) = free_beside(path) else { return Ok(()) };
    if bytes < LARGE_BYTES || bytes <= free {
        return Ok(());
    }
    let name = path.display();
    let (bytes, free) = (Size(bytes), Size(free));
    let what = format!("{name}: about {bytes} would be written, and {free} are free there");
    Err(anyhow::anyhow!("{what}; make room, choose another disk, or {remedy}").into())
}

/// Tells of an unfinished file that a killed writer of `path` has left, and that is about to be replaced.
pub fn tell_left_behind(path: &Path, quiet: bool) {
    if let (Some(bytes), false) = (left_behind(path), quiet) {
        let part = part_path(path);
        note(&format!("{}: {} that a killed run has left are removed", part.display(), Size(bytes)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_large_files_are_refused_and_with_both_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npy");
        assert!(require_space(&path, LARGE_BYTES - 1, "").is_ok());
        let Err(Failure::Run(refused)) = require_space(&path, 1 << 62, "choose a lower --level") else {
            panic!("no disk has so much")
        };
        let line = refused.to_string();
        assert!(line.contains("x.npy: about") && line.contains("are free there"), "{line}");
        assert!(line.contains("choose a lower --level"), "{line}");
    }
}
