//! What `brickfield voids` writes beside its table: meshes of voids, and their numbers as an array.

use super::void_mesh::VoidMeshFile;
use crate::failure::Failure;
use crate::output::{in_line, require_distinct};
use crate::progress::Bars;
use crate::space::require_space;
use crate::void_args::VoidsArgs;
use anyhow::Context;
use brickfield_engine::export::npy_header;
use brickfield_engine::lattice::BRICK_CELLS;
use brickfield_engine::part::{PartPair, directory_of};
use brickfield_engine::store::{BrickTree, Store};
use brickfield_engine::voids::{Voids, write_labels};
use serde_json::json;
use std::path::PathBuf;

/// Files that have been created.
pub struct VoidOutputs {
    mesh: Option<VoidMeshFile>,
    labels: Option<(PartPair, PathBuf)>,
}

impl VoidOutputs {
    /// Creates the files, so that one that cannot be written is told before the work.
    ///
    /// # Errors
    /// Names with wrong endings, of other files of the command, or that cannot be written.
    pub fn create(args: &VoidsArgs, store: &Store) -> Result<VoidOutputs, Failure> {
        let ending = |path: &PathBuf| path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let mut mesh = None;
        if let Some(path) = &args.mesh {
            require_distinct(&[path, &args.output], &[&args.store])?;
            let folder = args.temp_dir.as_deref().unwrap_or(directory_of(path));
            mesh = Some(VoidMeshFile::create(path, store, (args.memory.0, folder))?);
        }
        let mut labels = None;
        if let Some(path) = &args.labels {
            if ending(path).as_deref() != Some("npy") {
                return Err(Failure::Usage(format!("{}: the name must end in .npy", in_line(path))));
            }
            let description = path.with_extension("json");
            let others = [&args.output, &args.store];
            require_distinct(&[path, &description], &others.map(PathBuf::as_path))?;
            let axis = axis(store) as u64;
            require_space(path, axis.pow(3) * 4, "cut the store down with `brickfield cache prune`")?;
            labels = Some((PartPair::create(path, &description)?, path.clone()));
        }
        Ok(VoidOutputs { mesh, labels })
    }

    /// Writes them.
    ///
    /// # Errors
    /// What writing gives.
    pub fn write(self, store: &Store, found: &Voids, bars: &Bars) -> Result<(), Failure> {
        if let Some(mesh) = self.mesh {
            mesh.write(store, found, bars)?;
        }
        let Some((mut pair, path)) = self.labels else { return Ok(()) };
        let axis = axis(store);
        let header = npy_header("<u4", axis);
        pair.file.write_at(&header, 0)?;
        // All that nothing is written to is zero.
        pair.file.write_at(&[0; 4], header.len() as u64 + (axis as u64).pow(3) * 4 - 4)?;
        let write = |offset: u64, bytes: &[u8]| pair.file.write_at(bytes, header.len() as u64 + offset);
        write_labels(store, found, bars, &write)?;
        let root = store.root();
        let description = json!({
            "array": path.file_name().map(|name| name.to_string_lossy().into_owned()),
            "store": store.path().display().to_string(),
            "order": "zyx",
            "shape": [axis, axis, axis],
            "dtype": "<u4",
            "origin": root.to_world([1.0; 3]),
            "spacing": root.edge / axis as f64,
            "unit": store.meta().unit,
        });
        let text = serde_json::to_string_pretty(&description).context("cannot write JSON")?;
        pair.description.append(format!("{text}\n").as_bytes())?;
        Ok(pair.finish()?)
    }
}

/// Samples an axis of the deepest level.
fn axis(store: &Store) -> usize {
    BRICK_CELLS << store.deepest_level()
}
