//! An octree to be asked: in a store or in memory.

use crate::analysis::{Dense, Element, Volumes, sample_at, volume};
use crate::contour::{ContourOptions, MeshArrays, MeshSummary, contour, create_sink};
use crate::lattice::{RootCube, millimetres};
use crate::store::{BrickTree, MemoryTree, Store};
use crate::{Error, Progress, Result, Silent};
use std::path::Path;
use std::sync::Mutex;

/// Bytes for the decoded bricks of a store.
const CACHE_BYTES: u64 = 256 << 20;

enum OctreeStorage {
    Store(Box<Store>),
    Memory(MemoryTree),
}

/// An adaptive octree of 32³-sample bricks of the generalized winding number w.
///
/// Each method reads what it needs. Those that take long report nothing; what they call, in the modules of the same
/// subject, takes a [`Progress`].
///
/// ```
/// # fn main() -> brickfield_engine::Result<()> {
/// use brickfield_engine::{Axis, Builder};
/// # let folder = tempfile::tempdir().expect("a folder");
/// # std::env::set_current_dir(&folder).expect("the folder");
/// # let vertices = vec![[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
/// # let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let octree = Builder::new().triangles(vertices, triangles).depth(2).write("tetrahedron.brf")?;
/// let volumes = octree.volumes()?;
/// assert!((volumes.union - 1000.0 / 6.0).abs() <= volumes.union_error);
/// assert!(volumes.union_error < 0.5);
/// octree.write_mesh("tetrahedron.stl")?;
/// octree.write_slice("section.png", Axis::Z, 2.5)?;
/// octree.write_picture("tetrahedron.png", "iso")?;
/// # Ok(())
/// # }
/// ```
pub struct Octree {
    kept: OctreeStorage,
    bounds: ([f64; 3], [f64; 3]),
    unit: String,
}

impl Octree {
    /// Opens a store.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open(path: impl AsRef<Path>) -> Result<Octree> {
        let store = Store::open(path.as_ref(), CACHE_BYTES)?;
        let meta = store.meta();
        let (bounds, unit) = ((meta.bounds_min, meta.bounds_max), meta.unit.clone());
        Ok(Octree { kept: OctreeStorage::Store(Box::new(store)), bounds, unit })
    }

    pub(crate) fn of_tree(tree: MemoryTree, bounds: ([f64; 3], [f64; 3]), unit: String) -> Octree {
        Octree { kept: OctreeStorage::Memory(tree), bounds, unit }
    }

    /// The tree itself, for what the other modules do with trees.
    pub fn tree(&self) -> &dyn BrickTree {
        match &self.kept {
            OctreeStorage::Store(store) => store.as_ref(),
            OctreeStorage::Memory(tree) => tree,
        }
    }

    /// The store, if the octree is one.
    pub fn store(&self) -> Option<&Store> {
        match &self.kept {
            OctreeStorage::Store(store) => Some(store),
            OctreeStorage::Memory(_) => None,
        }
    }

    /// Where the lattice lies in the world.
    pub fn root(&self) -> RootCube {
        self.tree().root()
    }

    /// Least and greatest world coordinates of the inputs.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        self.bounds
    }

    /// The unit of length, as in "mm".
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// w at points in the world, of the nearest sample below and above by trilinear interpolation; 0 outside the root cube.
    ///
    /// # Errors
    /// As [`sample_at`].
    pub fn sample(&self, points: &[[f64; 3]]) -> Result<Vec<f64>> {
        sample_at(self.tree(), points)
    }

    /// The volumes of union and overlap in cubic units, with bounds on their errors.
    ///
    /// # Errors
    /// As [`volume`].
    pub fn volumes(&self) -> Result<Volumes> {
        volume(self.tree(), &Silent)
    }

    /// The boundary of the union as a closed manifold mesh in memory.
    ///
    /// # Errors
    /// As [`contour`].
    pub fn mesh(&self) -> Result<MeshArrays> {
        let mut arrays = MeshArrays::default();
        contour(self.tree(), &ContourOptions::default(), &mut arrays, &Silent)?;
        Ok(arrays)
    }

    /// The same as a file, whose name has one of [`crate::contour::listed_mesh_endings`]. It gets its name only when it is complete.
    ///
    /// # Errors
    /// As [`contour`]; a name of another ending.
    pub fn write_mesh(&self, path: impl AsRef<Path>) -> Result<MeshSummary> {
        self.write_mesh_with(path, &ContourOptions::default(), &Silent)
    }

    /// As [`Self::write_mesh`], with options.
    ///
    /// # Errors
    /// As [`Self::write_mesh`].
    pub fn write_mesh_with(
        &self,
        path: impl AsRef<Path>,
        options: &ContourOptions,
        progress: &dyn Progress,
    ) -> Result<MeshSummary> {
        let metres = millimetres(&self.unit).map(|length| length / 1000.0);
        let mut sink = create_sink(path.as_ref(), metres)?;
        contour(self.tree(), options, sink.as_mut(), progress)
    }

    /// All samples of a level, indexed `[z][y][x]` with as many along each axis: w at the corners of its cells, from
    /// [`Dense::origin`] in steps of [`Dense::spacing`].
    ///
    /// # Errors
    /// A level that the octree lacks; what reading gives; more samples than fit into memory.
    pub fn samples(&self, level: u8) -> Result<Vec<f32>> {
        let dense = Dense::new(self.tree(), level, Element::F32)?;
        let bytes = usize::try_from(dense.bytes()).unwrap_or(usize::MAX);
        let mut samples = Vec::new();
        samples.try_reserve_exact(bytes / 4).map_err(|_| {
            Error::setting(format!("{bytes} bytes of samples do not fit into memory"), "choose a lower level")
        })?;
        samples.resize(bytes / 4, 0.0f32);
        let all = Mutex::new(samples);
        dense.write(&Silent, &|offset, bytes| {
            let numbers = bytes.as_chunks::<4>().0.iter().map(|number| f32::from_le_bytes(*number));
            let mut all = all.lock().expect("no thread panics");
            let first = (offset / 4) as usize;
            all[first..first + bytes.len() / 4].iter_mut().zip(numbers).for_each(|(slot, w)| *slot = w);
            Ok(())
        })?;
        Ok(all.into_inner().expect("no thread panicked"))
    }
}
