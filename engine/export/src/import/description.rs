//! The JSON beside a `.npy` or `.raw` file that tells where its samples lie, as `export` writes it.

use super::grid::{GridLayout, GridPlacement, SampleType, plain};
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

    /// Refuses a description of another file, by its name's ending, or of other values than that file has.
    pub fn require_of(&self, volume: &Path, number: SampleType, shape: [usize; 3]) -> Result<()> {
        let described = self.value["array"].as_str().map(Path::new);
        if let Some(array) = described.filter(|array| ending(array) != ending(volume)) {
            let what = format!("it is of {}, not of {}", plain(&array.to_string_lossy()), name_of(volume));
            return Err(self.error("array", &what));
        }
        let (dtype, described) = (&self.value["dtype"], self.numbers("shape"));
        if dtype.as_str().and_then(SampleType::of_numpy).is_some_and(|other| other != number) {
            let what = format!("is {dtype}, and {} has {}", name_of(volume), number.numpy());
            return Err(self.error("dtype", &what));
        }
        let [x, y, z] = shape;
        if described.is_some_and(|described| described != [z, y, x].map(|n| n as f64)) {
            let what = format!("is {}, and {} has [{z}, {y}, {x}]", self.value["shape"], name_of(volume));
            return Err(self.error("shape", &what));
        }
        Ok(())
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

/// The ending of a name, in lower case.
fn ending(path: &Path) -> Option<String> {
    path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase())
}

/// The name of a file, as a part of a line.
fn name_of(path: &Path) -> String {
    plain(&path.file_name().unwrap_or_default().to_string_lossy())
}

/// Refuses samples of which a description and a MetaImage, both beside them, tell different things: one is of samples that were
/// there before.
pub(super) fn require_same(samples: &Path, told: &GridLayout, other: Option<GridLayout>) -> Result<()> {
    if other.is_none_or(|other| other.is_as(told)) {
        return Ok(());
    }
    let [json, mhd] = ["json", "mhd"].map(|ending| name_of(&samples.with_extension(ending)));
    let what = format!("{json} and {mhd} tell different things of its samples");
    Err(Error::input(samples, "description", what, "remove the one that is of another export"))
}

/// One spacing, if all are equal.
pub(super) fn equal(volume: &Path, [x, y, z]: [f64; 3]) -> Result<f64> {
    if [y, z].iter().all(|other| (other - x).abs() <= 1e-6 * x.abs()) {
        return Ok(x);
    }
    let what = format!("its samples are {x}, {y} and {z} apart along the axes");
    Err(Error::input(volume, "spacing", what, "sample it anew with equal steps"))
}

/// What the description beside samples without a header tells.
pub(super) fn raw_layout(path: &Path) -> Result<GridLayout> {
    let description = Description::beside(path)?;
    let (number, shape) = description.layout()?;
    description.require_of(path, number, shape)?;
    let place = description.place(path)?;
    Ok(GridLayout { number, shape, place, format: "raw volume" })
}
