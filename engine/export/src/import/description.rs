//! The JSON beside a `.npy` or `.raw` file that tells where its samples lie, as `export` writes it.

use super::grid::{Grid, GridLayout, GridPlacement, SampleType};
use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Larger files are no descriptions.
const MOST_BYTES: u64 = 1 << 20;
/// What a description holds at least.
const REMEDY: &str = "write one with \"origin\": [x, y, z], \"spacing\": step and \"unit\": \"mm\"";

/// A description.
pub(super) struct Description {
    path: PathBuf,
    value: Value,
}

impl Description {
    /// The one beside a volume.
    pub fn beside(volume: &Path) -> Result<Description> {
        let path = volume.with_extension("json");
        if !path.exists() {
            let what = format!("{} is not there to tell where its samples lie", path.display());
            return Err(Error::input(volume, "description", what, REMEDY));
        }
        let file = MappedFile::open(&path)?;
        let text = (file.len() <= MOST_BYTES).then(|| file.bytes());
        let value = text.and_then(|text| serde_json::from_slice(text).ok());
        let value = value.ok_or_else(|| Error::input(&path, "byte 0", "is no JSON", REMEDY))?;
        Ok(Description { path, value })
    }

    fn error(&self, name: &str, what: &str) -> Error {
        Error::input(&self.path, format!("\"{name}\""), what, REMEDY)
    }

    /// Three numbers, or one for all.
    fn numbers(&self, name: &str) -> Option<[f64; 3]> {
        match &self.value[name] {
            Value::Array(all) if all.len() == 3 => {
                let [a, b, c] = [0, 1, 2].map(|n| all[n].as_f64());
                Some([a?, b?, c?])
            }
            one => one.as_f64().map(|one| [one; 3]),
        }
    }

    /// Where samples lie.
    pub fn place(&self, volume: &Path) -> Result<GridPlacement> {
        let origin = self.numbers("origin").ok_or_else(|| self.error("origin", "is not three numbers"))?;
        let steps = self.numbers("spacing").ok_or_else(|| self.error("spacing", "is no number"))?;
        Ok(GridPlacement {
            origin,
            spacing: equal(volume, steps)?,
            unit: self.value["unit"].as_str().map(str::to_owned).filter(|unit| !unit.is_empty()),
            holds_distances: self.value["quantity"] == "distance",
        })
    }

    /// The type of the values and how many there are along x, y and z.
    fn layout(&self) -> Result<(SampleType, [usize; 3])> {
        let number = self.value["dtype"].as_str().and_then(SampleType::of_numpy);
        let number = number.ok_or_else(|| self.error("dtype", "is no type that is read, as \"<i2\""))?;
        let shape = self.numbers("shape").filter(|_| self.value["shape"].is_array());
        let [z, y, x] = shape.ok_or_else(|| self.error("shape", "is not three numbers"))?;
        Ok((number, [x, y, z].map(|n| n as usize)))
    }
}

/// One spacing, if all are equal.
pub(super) fn equal(volume: &Path, [x, y, z]: [f64; 3]) -> Result<f64> {
    if [y, z].iter().all(|other| (other - x).abs() <= 1e-6 * x.abs()) {
        return Ok(x);
    }
    let what = format!("its samples are {x}, {y} and {z} apart along the axes");
    Err(Error::input(volume, "spacing", what, "sample it anew with equal steps"))
}

/// Opens samples without a header.
pub(super) fn open_raw(path: &Path, file: MappedFile, _: Option<&str>) -> Result<Grid> {
    let description = Description::beside(path)?;
    let (number, shape) = description.layout()?;
    let place = description.place(path)?;
    Grid::in_place(path, file, 0, GridLayout { number, shape, place, format: "raw volume" })
}
