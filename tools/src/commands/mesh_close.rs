//! A part without its narrow voids, for meshes of it.

use super::mesh_shells::ShellRegions;
use super::{no_unit, of_store, require_whole_samples};
use crate::failure::Failure;
use crate::measured::measured;
use crate::units::Length;
use brickfield_engine::Progress;
use brickfield_engine::analysis::volume_added;
use brickfield_engine::distance::closing::close;
use brickfield_engine::part::temporary::BesideFile;
use brickfield_engine::store::{BrickTree, Store};
use brickfield_engine::voids::{Connectivity, Total, label};
use serde::Serialize;
use std::path::Path;

/// A store with its narrow voids filled, which vanishes with this.
pub struct ClosedStore {
    pub store: Store,
    pub told: MeshClosing,
    _file: BesideFile,
}

/// What was filled.
#[derive(Clone, Copy, Serialize)]
pub struct MeshClosing {
    /// Diameter of the ball.
    pub diameter: f64,
    /// Volume that became solid.
    pub volume: f64,
    /// Bound on its error.
    pub volume_error: f64,
    /// Enclosed voids before and after.
    pub voids: [ShellRegions; 2],
}

impl ClosedStore {
    /// Closes a store, beside `output`.
    ///
    /// # Errors
    /// Open input, a length below two cells, coarse cells at the surface; what reading and writing give.
    pub fn of(
        store: &Store,
        length: Length,
        output: &Path,
        memory: u64,
        bars: &dyn Progress,
    ) -> Result<ClosedStore, Failure> {
        require_whole_samples(store, "what narrows in it cannot be told")?;
        let diameter = length.in_unit_of(&store.meta().unit).ok_or_else(no_unit)?;
        let file = BesideFile::new(output, ".closed");
        close(store, diameter, file.path(), memory, bars)
            .map_err(|error| of_store(store, "closing", error))?;
        let closed = Store::open(file.path(), memory / 8)?.named(store.path());
        let (volume, volume_error) = volume_added(store, &closed, bars)?;
        let voids = [voids_of(store, bars)?, voids_of(&closed, bars)?];
        let told = MeshClosing { diameter, volume, volume_error, voids };
        Ok(ClosedStore { store: closed, told, _file: file })
    }
}

fn voids_of(store: &Store, bars: &dyn Progress) -> Result<ShellRegions, Failure> {
    let found =
        label(store, Connectivity::default(), bars).map_err(|error| of_store(store, "voids", error))?;
    let count = found.components.iter().filter(|component| !component.solid).count();
    let Total { value, error } = found.total(store.root(), false);
    Ok(ShellRegions { count, volume: value, volume_error: Some(error) })
}

impl MeshClosing {
    /// For people.
    pub fn text(&self, unit: &str) -> String {
        let MeshClosing { diameter, volume, volume_error, voids } = self;
        let [before, after] = voids.map(|voids| {
            let volume = measured(voids.volume, voids.volume_error.unwrap_or_default());
            format!("{} ({volume} {unit}³)", voids.count)
        });
        let filled = measured(*volume, *volume_error);
        format!(
            "\n  closed   {filled} {unit}³ where no ball of {diameter} {unit} enters; enclosed voids: {before} before, {after} \
             after"
        )
    }
}
