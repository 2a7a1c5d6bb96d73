//! Tables of `brickfield deviation` by layer and by feature.

use super::sample::tables_of;
use crate::distance_args::DeviationArgs;
use crate::failure::Failure;
use crate::table::{Table, TableKind, to_place};
use brickfield_engine::distance::{DeviationByBead, SurfaceDeviation};
use brickfield_engine::part::PartFile;
use brickfield_engine::store::{BeadTables, Store};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names of the columns, in order.
const LAYER_COLUMNS: [&str; 7] = ["layer", "crossings", "area", "mean", "rms", "min", "max"];
const FEATURE_COLUMNS: [&str; 7] = ["feature", "crossings", "area", "mean", "rms", "min", "max"];

/// A table that was asked for: its name in JSON, what it holds, where it goes, and how it is written.
pub(super) type FilledTable = (&'static str, Table<'static>, PartFile, TableKind);

/// The tables that were asked for, before anything is written.
pub(super) struct BeadTableFiles<'a> {
    layers: Option<(&'a Path, TableKind)>,
    features: Option<(&'a Path, TableKind)>,
}

/// Their files.
pub(super) struct CreatedTables {
    layers: Option<(PartFile, TableKind)>,
    features: Option<(PartFile, TableKind)>,
}

impl<'a> BeadTableFiles<'a> {
    /// Those of the command line.
    pub fn new(args: &'a DeviationArgs) -> Result<BeadTableFiles<'a>, Failure> {
        let kind = |path: &'a Option<PathBuf>| -> Result<_, Failure> {
            path.as_deref().map(|path| Ok((path, TableKind::of(path)?))).transpose()
        };
        Ok(BeadTableFiles { layers: kind(&args.layers)?, features: kind(&args.features)? })
    }

    /// What tells layers and features, if any table was asked for.
    pub fn tables_of(&self, store: &Store) -> Result<Option<BeadTables>, Failure> {
        if self.layers.is_none() && self.features.is_none() {
            return Ok(None);
        }
        tables_of(store).map(Some)
    }

    /// Makes the files.
    pub fn create(self) -> Result<CreatedTables, Failure> {
        let file = |wanted: Option<(&Path, TableKind)>| -> Result<_, Failure> {
            wanted.map(|(path, kind)| Ok((PartFile::create(path)?, kind))).transpose()
        };
        Ok(CreatedTables { layers: file(self.layers)?, features: file(self.features)? })
    }
}

impl CreatedTables {
    /// The tables of what was found.
    pub fn filled(self, (found, tables): (&DeviationByBead, &BeadTables), cell: f64) -> Vec<FilledTable> {
        let layers = self.layers.map(|(file, kind)| {
            let name = |layer: &u32| json!(layer + 1);
            ("layers", Table::of_rows(&LAYER_COLUMNS, rows(&found.layers, name, cell)), file, kind)
        });
        let features = self.features.map(|(file, kind)| {
            let name = |feature: &u16| json!(tables.features[usize::from(*feature)]);
            ("features", Table::of_rows(&FEATURE_COLUMNS, rows(&found.features, name, cell)), file, kind)
        });
        layers.into_iter().chain(features).collect()
    }
}

/// Rows in the order of their names, the one without a name last.
fn rows<K: Ord>(
    found: &BTreeMap<Option<K>, SurfaceDeviation>,
    name: impl Fn(&K) -> Value,
    cell: f64,
) -> Vec<Vec<Value>> {
    let length = |value: f64| to_place(value, cell / 1e4);
    let row = |(key, some): (&Option<K>, &SurfaceDeviation)| {
        let name = key.as_ref().map_or(Value::Null, &name);
        let area = to_place(some.area, some.area / 1e4);
        let mut row = vec![name, json!(some.crossings), area];
        row.extend([some.mean(), some.rms(), some.min, some.max].map(length));
        row
    };
    let (named, unnamed): (Vec<_>, Vec<_>) = found.iter().partition(|(key, _)| key.is_some());
    named.into_iter().chain(unnamed).map(row).collect()
}
