//! The readers of volumes, fed with any bytes.

use super::{Grid, Reading, build_volume, endings};
use crate::error::Error;
use crate::progress::Silent;
use std::path::Path;

/// Larger volumes are opened and not built: a short file may stand for many samples of one value.
const MOST_SAMPLES: usize = 1 << 18;

/// Any bytes as a volume of the kind that the first one chooses: a store or an error of one line.
///
/// # Panics
/// If there is no temporary folder; if a reader has a mistake.
pub fn volume(bytes: &[u8]) {
    let Some((kind, bytes)) = bytes.split_first() else { return };
    let endings: Vec<_> = endings().collect();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(format!("a.{}", endings[usize::from(*kind) % endings.len()]));
    let description = "{\"origin\": [0, 0, 0], \"spacing\": 1, \"dtype\": \"<i2\", \"shape\": [3, 4, 5]}";
    std::fs::write(path.with_extension("json"), description).expect("room");
    std::fs::write(&path, bytes).expect("room");
    if let Err(error) = read(&path) {
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

fn read(path: &Path) -> Result<(), Error> {
    let mut grid = Grid::open(path, None)?;
    let samples = grid.shape().iter().try_fold(1usize, |all, &n| all.checked_mul(n));
    if samples.is_none_or(|samples| samples > MOST_SAMPLES) {
        return Ok(());
    }
    let output = path.with_extension("brf");
    let reading = grid.holds_distances().then_some(Reading::Distance);
    build_volume(&mut grid, (path, &output), reading, ("mm", "fuzz"), None, &Silent).map(|_| ())
}
