//! Files of other programs (`tests/data/volumes/make.py`) against the formulas of their values; files that were damaged.

mod damaged;
mod other_programs;
mod vdb;

use super::grid::Grid;
use crate::progress::Silent;
use std::path::{Path, PathBuf};

/// A file of the test data.
fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/volumes").join(name)
}

/// Opens a file of the test data and makes it readable.
fn opened(path: &Path, field: Option<&str>) -> Grid {
    let mut grid = Grid::open(path, field).unwrap_or_else(|error| panic!("{error}"));
    grid.prepare(&std::env::temp_dir(), &Silent)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    grid
}

/// All values of a box, with their indices.
fn values_of(grid: &Grid, [low, high]: [[usize; 3]; 2]) -> Vec<([usize; 3], f64)> {
    let mut values = Vec::new();
    grid.read([low, high], &mut values).unwrap_or_else(|error| panic!("{error}"));
    let [x, y, z]: [usize; 3] = std::array::from_fn(|a| high[a] - low[a]);
    assert_eq!(values.len(), x * y * z);
    let index = |n: usize| [low[0] + n % x, low[1] + n / x % y, low[2] + n / x / y];
    values.into_iter().enumerate().map(|(n, value)| (index(n), value)).collect()
}
