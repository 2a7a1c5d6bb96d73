//! What `brickfield voids` writes beside its table: meshes of voids, and their numbers at all samples.

use super::void_labels::VoidLabelFile;
use super::void_mesh::VoidMeshFile;
use crate::failure::Failure;
use crate::output::require_distinct;
use crate::progress::Bars;
use crate::void_args::VoidsArgs;
use brickfield_engine::part::directory_of;
use brickfield_engine::store::Store;
use brickfield_engine::voids::Voids;

/// Files that have been created.
pub struct VoidOutputs {
    mesh: Option<VoidMeshFile>,
    labels: Option<VoidLabelFile>,
}

impl VoidOutputs {
    /// Creates the files, so that one that cannot be written is told before the work.
    ///
    /// # Errors
    /// Names with wrong endings, of other files of the command, or that cannot be written.
    pub fn create(args: &VoidsArgs, store: &Store) -> Result<VoidOutputs, Failure> {
        let mesh = args.mesh.as_deref().map(|path| {
            require_distinct(&[path, &args.output], &[&args.store])?;
            let folder = args.temp_dir.as_deref().unwrap_or(directory_of(path));
            VoidMeshFile::create(path, store, (args.memory.0, folder))
        });
        let labels = args.labels.as_deref().map(|path| {
            let mut others = vec![args.output.as_path(), &args.store];
            others.extend(args.mesh.as_deref());
            VoidLabelFile::create(path, &others, store)
        });
        Ok(VoidOutputs { mesh: mesh.transpose()?, labels: labels.transpose()? })
    }

    /// Writes them.
    ///
    /// # Errors
    /// What writing gives.
    pub fn write(self, store: &Store, found: &Voids, bars: &Bars) -> Result<(), Failure> {
        if let Some(mesh) = self.mesh {
            mesh.write(store, found, bars)?;
        }
        self.labels.map_or(Ok(()), |labels| labels.write(store, found, bars))
    }
}
