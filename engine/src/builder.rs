//! The builder: inputs and settings in, an octree out.

use crate::build::{
    BuildOptions, MixedInput, Resolution, TreeInMemory, build_clouds, build_clouds_in_memory,
    build_inputs_in_memory, build_mixed, build_mixed_in_memory, build_opened,
};
use crate::ingest::{CloudInput, Input, PointCloud};
use crate::large_array::ArrayRoom;
use crate::octree::Octree;
use crate::solid::Outline;
use crate::{Error, Progress, Result, Silent};
use std::path::{Path, PathBuf};

/// Name of arrays in messages and in stores.
const ARRAYS: &str = "(memory)";
/// Largest error of the samples of point clouds: where points lie moves w near them by more.
const CLOUD_ERROR: f64 = 5e-2;

/// One input, not opened yet.
enum Source {
    File(PathBuf),
    Triangles(Vec<[f64; 3]>, Vec<[u32; 3]>),
    Points(PointCloud),
}

/// The builder of an octree: inputs, then settings, then where it goes.
///
/// All inputs together are one field: their winding numbers add up. Lengths are in the unit of the input; toolpaths are in
/// mm. Work runs on the threads of the current rayon pool, and the result is the same for any number of them.
///
/// ```
/// # fn main() -> brickfield_engine::Result<()> {
/// use brickfield_engine::Builder;
/// // A tetrahedron: four vertices, and four triangles that name them.
/// let vertices = vec![[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
/// let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let octree = Builder::new().triangles(vertices, triangles).depth(1).in_memory()?;
/// assert_eq!(octree.sample(&[[1.0, 1.0, 1.0], [9.0, 9.0, 9.0]])?, [1.0, 0.0]);
/// # Ok(())
/// # }
/// ```
#[must_use = "a builder does nothing before `write` or `in_memory`"]
pub struct Builder<'p> {
    sources: Vec<Source>,
    options: BuildOptions,
    /// Whether the caller chose an error of the samples.
    has_error: bool,
    solids: bool,
    progress: &'p dyn Progress,
}

impl Default for Builder<'_> {
    fn default() -> Self {
        Builder {
            sources: Vec::new(),
            options: BuildOptions::default(),
            has_error: false,
            solids: true,
            progress: &Silent,
        }
    }
}

impl<'p> Builder<'p> {
    /// Without inputs, with [`BuildOptions::default`].
    pub fn new() -> Self {
        Builder::default()
    }

    /// Adds a file: a mesh, a toolpath or a point cloud, known by its content.
    pub fn file(mut self, path: impl Into<PathBuf>) -> Self {
        self.sources.push(Source::File(path.into()));
        self
    }

    /// Adds triangles in memory, which name their corners among `vertices`, counter-clockwise seen from outside.
    pub fn triangles(mut self, vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        self.sources.push(Source::Triangles(vertices, triangles));
        self
    }

    /// Adds points of a surface in memory, with an outward normal of any length for each. Without normals they are estimated.
    pub fn points(mut self, points: Vec<[f64; 3]>, normals: Vec<[f64; 3]>) -> Self {
        self.sources.push(Source::Points(PointCloud::of(points, normals)));
        self
    }

    /// Deepest level: 32 · 2^`depth` cells along the edge of the root cube.
    pub fn depth(mut self, depth: u8) -> Self {
        self.options.resolution = Resolution::Depth(depth);
        self
    }

    /// Edge of the deepest cells.
    pub fn cell(mut self, edge: f64) -> Self {
        self.options.resolution = Resolution::Cell(edge);
        self
    }

    /// Largest error of the samples of open meshes and clouds; those of closed input are exact.
    pub fn sample_error(mut self, error: f64) -> Self {
        self.options.gwn_error = error;
        self.has_error = true;
        self
    }

    /// Bytes that [`Self::write`] may take beside the inputs.
    pub fn memory(mut self, bytes: u64) -> Self {
        self.options.resources.memory = bytes;
        self
    }

    /// Records in each leaf which beads it counts, for toolpaths that are written to a store.
    pub fn identity(mut self) -> Self {
        self.options.identity = true;
        self
    }

    /// Sweeps beads to triangles. By default toolpaths alone are analytic solids.
    pub fn swept(mut self) -> Self {
        self.solids = false;
        self
    }

    /// The unit of length that the store records, as in "mm".
    pub fn unit(mut self, unit: impl Into<String>) -> Self {
        self.options.unit = unit.into();
        self
    }

    /// Whom to tell of progress, and who may stop the work.
    pub fn progress(mut self, progress: &'p dyn Progress) -> Self {
        self.progress = progress;
        self
    }

    /// All other settings.
    pub fn options(mut self, change: impl FnOnce(&mut BuildOptions)) -> Self {
        change(&mut self.options);
        self
    }

    /// Builds the store `path`, and opens it. An interrupted build goes on from where it was.
    ///
    /// # Errors
    /// Inputs that cannot be read, settings that do not fit them, a path that cannot be written. Nothing is left under the
    /// final name unless the build succeeds.
    pub fn write(self, path: impl AsRef<Path>) -> Result<Octree> {
        let path = path.as_ref();
        let room = self.options.resources.array_room(path);
        let (inputs, mut options, progress) = self.open(&room)?;
        match inputs {
            OpenInputs::Meshes(inputs) => build_opened(&inputs, path, &options, progress)?,
            OpenInputs::Clouds(clouds) => {
                options.identity = false;
                let estimate = lack_normals(clouds.iter());
                build_clouds(clouds, estimate, path, &options, progress)?
            }
            OpenInputs::Mixed(inputs) => {
                options.identity = false;
                let estimate = lack_normals(clouds_of(&inputs));
                build_mixed(inputs, estimate, path, &options, progress)?
            }
        };
        Octree::open(path)
    }

    /// Builds the octree in memory: some 70 KB a brick that is not uniform.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn in_memory(self) -> Result<Octree> {
        let (inputs, options, progress) = self.open(&ArrayRoom::unbounded())?;
        let TreeInMemory { tree, bounds } = match inputs {
            OpenInputs::Meshes(inputs) => build_inputs_in_memory(&inputs, &options, progress)?,
            OpenInputs::Clouds(clouds) => {
                let estimate = lack_normals(clouds.iter());
                build_clouds_in_memory(clouds, estimate, &options, progress)?
            }
            OpenInputs::Mixed(inputs) => {
                let estimate = lack_normals(clouds_of(&inputs));
                build_mixed_in_memory(inputs, estimate, &options, progress)?
            }
        };
        Ok(Octree::of_tree(tree, bounds, options.unit))
    }

    /// The inputs, opened, and the settings that fit them.
    fn open(self, room: &ArrayRoom) -> Result<(OpenInputs, BuildOptions, &'p dyn Progress)> {
        let Builder { sources, mut options, has_error, solids, progress } = self;
        if sources.is_empty() {
            return Err(Error::setting("there is no input", "add a file, triangles or points"));
        }
        let open = |source: Source| {
            Ok(match source {
                Source::File(path) if CloudInput::is_one(&path)? => {
                    MixedInput::Cloud(CloudInput::open_within(&path, room, progress)?)
                }
                Source::File(path) => MixedInput::Mesh(Input::open(&path, progress)?),
                Source::Triangles(vertices, triangles) => {
                    MixedInput::Mesh(Input::of_triangles(ARRAYS, vertices, triangles)?)
                }
                Source::Points(cloud) => MixedInput::Cloud(CloudInput::of_points(ARRAYS, cloud)?),
            })
        };
        let inputs = OpenInputs::of(sources.into_iter().map(open).collect::<Result<_>>()?);
        if let OpenInputs::Meshes(meshes) = &inputs {
            let toolpaths = meshes.iter().filter(|input| input.beads().is_some()).count();
            if toolpaths == meshes.len() && solids && options.solids.is_none() {
                options.solids = Some(Outline::Stadium);
            }
        } else if !has_error {
            options.gwn_error = CLOUD_ERROR;
        }
        Ok((inputs, options, progress))
    }
}

/// Inputs of one kind, or of both.
enum OpenInputs {
    Meshes(Vec<Input>),
    Clouds(Vec<CloudInput>),
    Mixed(Vec<MixedInput>),
}

impl OpenInputs {
    fn of(inputs: Vec<MixedInput>) -> OpenInputs {
        let clouds = clouds_of(&inputs).count();
        if clouds > 0 && clouds < inputs.len() {
            return OpenInputs::Mixed(inputs);
        }
        let (mut meshes, mut clouds) = (Vec::new(), Vec::new());
        for input in inputs {
            match input {
                MixedInput::Mesh(mesh) => meshes.push(mesh),
                MixedInput::Cloud(cloud) => clouds.push(cloud),
            }
        }
        if clouds.is_empty() { OpenInputs::Meshes(meshes) } else { OpenInputs::Clouds(clouds) }
    }
}

fn clouds_of(inputs: &[MixedInput]) -> impl Iterator<Item = &CloudInput> {
    inputs.iter().filter_map(|input| match input {
        MixedInput::Mesh(_) => None,
        MixedInput::Cloud(cloud) => Some(cloud),
    })
}

fn lack_normals<'a>(mut clouds: impl Iterator<Item = &'a CloudInput>) -> bool {
    clouds.any(|input| input.cloud.normals.is_empty())
}
