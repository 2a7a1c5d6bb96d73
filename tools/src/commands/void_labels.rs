//! The numbers of voids at all samples, as an array or in a format of volumes.

use crate::failure::Failure;
use crate::output::{in_line, require_distinct};
use crate::progress::Bars;
use crate::space::require_space;
use anyhow::Context;
use brickfield_engine::analysis::Element;
use brickfield_engine::export::{Format, Quantity, Volume, format_of, listed_endings, npy_header};
use brickfield_engine::lattice::BRICK_CELLS;
use brickfield_engine::part::PartPair;
use brickfield_engine::store::{BrickTree, Store};
use brickfield_engine::voids::{VoidNumbers, Voids, write_labels};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The file, before the numbers are known.
pub struct VoidLabelFile {
    path: PathBuf,
    kind: LabelKind,
}

enum LabelKind {
    /// An array of 32 bits.
    Array(Box<PartPair>),
    /// Samples of 16 bits.
    Volume(&'static dyn Format),
}

impl VoidLabelFile {
    /// Of a name, beside files of these names.
    ///
    /// # Errors
    /// Names with wrong endings, of other files of the command, or that cannot be written; too little room on the disk.
    pub fn create(path: &Path, others: &[&Path], store: &Store) -> Result<VoidLabelFile, Failure> {
        let Some(format) = format_of(path) else {
            let what = format!("the name must end in one of {}", listed_endings());
            return Err(Failure::Usage(format!("{}: {what}", in_line(path))));
        };
        let beside = format.beside().map(|ending| path.with_extension(ending));
        let outputs: Vec<&Path> = std::iter::once(path).chain(beside.as_deref()).collect();
        require_distinct(&outputs, others)?;
        let kind = match beside {
            Some(description) if format.ending() == "npy" => {
                let bytes = (axis(store) as u64).pow(3) * 4;
                require_space(path, bytes, "cut the store down with `brickfield cache prune`")?;
                LabelKind::Array(Box::new(PartPair::create(path, &description)?))
            }
            _ => {
                format.require_writable(path)?;
                LabelKind::Volume(format)
            }
        };
        Ok(VoidLabelFile { path: path.to_owned(), kind })
    }

    /// Writes the numbers.
    ///
    /// # Errors
    /// What finding and writing them gives; more voids than the format tells apart.
    pub fn write(self, store: &Store, found: &Voids, bars: &Bars) -> Result<(), Failure> {
        let VoidLabelFile { path, kind } = self;
        match kind {
            LabelKind::Array(pair) => write_array((*pair, &path), store, found, bars),
            LabelKind::Volume(format) => write_volume((format, &path), store, found, bars),
        }
    }
}

fn write_array(
    (mut pair, path): (PartPair, &Path),
    store: &Store,
    found: &Voids,
    bars: &Bars,
) -> Result<(), Failure> {
    let axis = axis(store);
    let header = npy_header("<u4", axis);
    pair.file.write_at(&header, 0)?;
    // All that nothing is written to is zero.
    pair.file.write_at(&[0; 4], header.len() as u64 + (axis as u64).pow(3) * 4 - 4)?;
    let write = |offset: u64, bytes: &[u8]| pair.file.write_at(bytes, header.len() as u64 + offset);
    write_labels(store, found, bars, &write)?;
    let text = text_of(&description(path, store, "<u4"))?;
    pair.description.append(text.as_bytes())?;
    Ok(pair.finish()?)
}

fn write_volume(
    (format, path): (&dyn Format, &Path),
    store: &Store,
    found: &Voids,
    bars: &Bars,
) -> Result<(), Failure> {
    let tree = VoidNumbers::new(store, found)?;
    let text = text_of(&description(path, store, Element::I16.numpy()))?;
    let volume = Volume {
        tree: &tree,
        levels: vec![store.deepest_level()],
        quantity: Quantity::Labels,
        element: Element::I16,
        name: "void",
        unit: Some(store.meta().unit.as_str()).filter(|unit| *unit != "unit"),
        description: &text,
    };
    let bytes = format.bytes_about(&volume).try_into().unwrap_or(u64::MAX);
    require_space(path, bytes, "cut the store down with `brickfield cache prune`")?;
    Ok(format.write(&volume, path, bars)?)
}

fn text_of(description: &Value) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(description).context("cannot write JSON")? + "\n")
}

fn description(path: &Path, store: &Store, dtype: &str) -> Value {
    let (axis, root) = (axis(store), store.root());
    json!({
        "array": path.file_name().map(|name| name.to_string_lossy().into_owned()),
        "store": store.path().display().to_string(),
        "order": "zyx",
        "shape": [axis, axis, axis],
        "dtype": dtype,
        "origin": root.to_world([1.0; 3]),
        "spacing": root.edge / axis as f64,
        "unit": store.meta().unit,
    })
}

/// Samples an axis of the deepest level.
fn axis(store: &Store) -> usize {
    BRICK_CELLS << store.deepest_level()
}
