//! The octree as Python sees it.

use crate::arrays::{corners, rows};
use crate::work::{failed, run};
use brickfield_engine::analysis::{BrickBlock, covering, sample_at, winding_range};
use brickfield_engine::build::ThinDepth;
use brickfield_engine::contour::{ContourOptions, MeshArrays, MeshSink, MeshTriangle, contour};
use brickfield_engine::lattice::BRICK_CELLS;
use brickfield_engine::store::BrickTree;
use brickfield_engine::{Axis, Builder, Error, Progress, Result};
use brickfield_terminal::memory::available;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Points between two looks at whether the user stops.
const POINTS_AT_ONCE: usize = 1 << 21;

/// An octree of winding numbers, in a store or in memory.
#[pyclass(frozen)]
pub struct Octree {
    octree: brickfield_engine::Octree,
}

/// Opens a store.
#[pyfunction]
pub fn open(py: Python<'_>, path: PathBuf) -> PyResult<Octree> {
    let octree = py.detach(|| brickfield_engine::Octree::open(path));
    Ok(Octree { octree: octree.map_err(|error| failed(py, &error))? })
}

/// How an octree is built: options of the program by their names, of which `None` leaves what it has by default.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct BuildSettings {
    depth: Option<u8>,
    max_depth: Option<u8>,
    cell: Option<f64>,
    boundary_error: Option<f64>,
    stddev: Option<f64>,
    gwn_error: Option<f64>,
    memory: Option<u64>,
    threads: Option<usize>,
    identity: bool,
    restart: bool,
    unit: Option<String>,
}

impl BuildSettings {
    fn applied<'p>(&self, mut builder: Builder<'p>) -> Builder<'p> {
        if let Some(depth) = self.depth {
            builder = builder.depth(depth);
        }
        if let Some(cell) = self.cell {
            builder = builder.cell(cell);
        }
        if let Some(error) = self.gwn_error {
            builder = builder.sample_error(error);
        }
        if let Some(unit) = &self.unit {
            builder = builder.unit(unit);
        }
        if self.identity {
            builder = builder.identity();
        }
        // As the program does where no memory is given.
        let memory = self.memory.or_else(|| available().map(|size| size.0 / 2));
        builder.options(|options| {
            options.thin = self.max_depth.map_or(ThinDepth::None, ThinDepth::Level);
            options.tolerance = self.boundary_error.unwrap_or(0.0);
            options.stddev = self.stddev.unwrap_or(0.0);
            options.keeping.restart = self.restart;
            // Stores have the bytes of those that the program writes.
            options.program = concat!("brickfield ", env!("CARGO_PKG_VERSION")).to_owned();
            if let Some(memory) = memory {
                options.resources.memory = memory;
                options.resources.index = memory / 5 * 4;
            }
        })
    }

    /// Does work on as many threads as were asked for.
    fn threaded<T: Send>(&self, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
        let Some(threads) = self.threads else { return work() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| {
            Error::setting(format!("cannot start {threads} threads: {error}"), "give fewer `threads`")
        })?;
        pool.install(work)
    }
}

/// Builds an octree of inputs: paths, `(vertices, triangles)`, or `(points, normals)` with normals of floats.
#[pyfunction]
pub fn build(
    py: Python<'_>,
    inputs: Vec<Bound<'_, PyAny>>,
    out: Option<PathBuf>,
    settings: BuildSettings,
    progress: Option<Py<PyAny>>,
) -> PyResult<Octree> {
    let mut sources = Vec::new();
    for input in &inputs {
        sources.push(source(input)?);
    }
    let octree = run(py, progress.as_ref(), move |progress| {
        settings.threaded(|| {
            let inputs = Builder::new().progress(progress);
            let builder = sources.into_iter().fold(inputs, |builder, source| match source {
                Source::File(path) => builder.file(path),
                Source::Triangles(vertices, triangles) => builder.triangles(vertices, triangles),
                Source::Points(points, normals) => builder.points(points, normals),
            });
            let builder = settings.applied(builder);
            match out {
                Some(path) => builder.write(path),
                None => builder.in_memory(),
            }
        })
    })?;
    Ok(Octree { octree })
}

enum Source {
    File(PathBuf),
    Triangles(Vec<[f64; 3]>, Vec<[u32; 3]>),
    Points(Vec<[f64; 3]>, Vec<[f64; 3]>),
}

/// An input: a path, or a pair of arrays of which the second has integers (triangles) or floats (normals).
fn source(input: &Bound<'_, PyAny>) -> PyResult<Source> {
    if let Ok(path) = input.extract::<PathBuf>() {
        return Ok(Source::File(path));
    }
    let Ok((first, second)) = input.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() else {
        return Err(PyTypeError::new_err("an input is a path, (vertices, triangles) or (points, normals)"));
    };
    let first = rows(&first.extract::<PyReadonlyArray2<'_, f64>>()?)?;
    let kind: String = second.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind == "f" {
        return Ok(Source::Points(first, rows(&second.extract::<PyReadonlyArray2<'_, f64>>()?)?));
    }
    Ok(Source::Triangles(first, corners(&second)?))
}

#[pymethods]
impl Octree {
    /// Path of the store; `None` in memory.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.octree.store().map(|store| store.path().to_owned())
    }

    /// Least and greatest coordinates of the inputs.
    #[getter]
    fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        self.octree.bounds()
    }

    /// The unit of length.
    #[getter]
    fn unit(&self) -> &str {
        self.octree.unit()
    }

    /// The deepest level.
    #[getter]
    fn depth(&self) -> u8 {
        self.octree.tree().deepest_level()
    }

    /// Smallest and largest w.
    #[getter]
    fn range(&self) -> Option<(i16, i16)> {
        winding_range(self.octree.tree())
    }

    /// How many bricks were read from the store so far; `None` in memory.
    #[getter]
    fn bricks_read(&self) -> Option<u64> {
        self.octree.store().map(|store| store.cache_stats().misses)
    }

    /// w at points, an array of a row each.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let points = rows(&points)?;
        let values = run(py, None, |progress| sample_all(self.octree.tree(), &points, progress))?;
        Ok(values.into_pyarray(py))
    }

    /// World position of the sample [0, 0, 0] of every level, x, y, z.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.octree.root().to_world([1.0; 3])
    }

    /// World distance of two samples of a level.
    fn spacing(&self, level: u8) -> f64 {
        self.octree.root().spacing(level)
    }

    /// Samples of a box of a level: `first` and `last` are indices x, y, z, the last ones outside. Reads the bricks that the
    /// box needs.
    fn read<'py>(
        &self,
        py: Python<'py>,
        level: u8,
        first: [usize; 3],
        last: [usize; 3],
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let array = run(py, None, |_| samples(self.octree.tree(), level, first, last))?;
        Ok(array.into_pyarray(py))
    }

    /// The isosurface as `(vertices, triangles)`, with `normals` as `(vertices, triangles, normals)`.
    #[pyo3(signature = (iso=0.5, tolerance=0.0, level=None, normals=false, progress=None))]
    fn mesh<'py>(
        &self,
        py: Python<'py>,
        iso: f64,
        tolerance: f64,
        level: Option<u8>,
        normals: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let options = ContourOptions { iso, tolerance, level, ..ContourOptions::default() };
        let mut found = MeshWithNormals::default();
        if normals {
            run(py, progress.as_ref(), |progress| {
                contour(self.octree.tree(), &options, &mut found, progress)
            })?;
        } else {
            run(py, progress.as_ref(), |progress| {
                contour(self.octree.tree(), &options, &mut found.mesh, progress)
            })?;
        }
        let mut arrays = vec![
            triples(py, found.mesh.positions)?.into_any(),
            triples(py, found.mesh.triangles)?.into_any(),
        ];
        if normals {
            arrays.push(triples(py, found.normals)?.into_any());
        }
        PyTuple::new(py, arrays)
    }

    /// Volumes of union and overlap with their errors.
    fn volumes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyDict>> {
        let volumes =
            run(py, None, |progress| brickfield_engine::analysis::volume(self.octree.tree(), progress))?;
        let all = pyo3::types::PyDict::new(py);
        for (name, value) in [
            ("union", volumes.union),
            ("union_error", volumes.union_error),
            ("overlap", volumes.overlap),
            ("overlap_error", volumes.overlap_error),
            ("negative", volumes.negative),
            ("negative_error", volumes.negative_error),
        ] {
            all.set_item(name, value)?;
        }
        Ok(all)
    }

    /// Writes the mesh of the union, by the ending of the name.
    fn write_mesh(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        run(py, None, |progress| {
            self.octree.write_mesh_with(&path, &ContourOptions::default(), progress).map(|_| ())
        })
    }

    /// A section as pixels of red, green and blue.
    fn slice<'py>(&self, py: Python<'py>, axis: &str, at: f64) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let axis = match axis {
            "x" => Axis::X,
            "y" => Axis::Y,
            "z" => Axis::Z,
            _ => return Err(PyValueError::new_err(format!("no axis is called {axis:?}"))),
        };
        let pixels = run(py, None, |_| picture(|path| self.octree.write_slice(path, axis, at).map(|_| ())))?;
        Ok(pixels.into_pyarray(py))
    }

    /// The part seen from a side, as pixels of red, green and blue.
    #[pyo3(signature = (view="iso"))]
    fn render<'py>(&self, py: Python<'py>, view: &str) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let pixels = run(py, None, |_| picture(|path| self.octree.write_picture(path, view)))?;
        Ok(pixels.into_pyarray(py))
    }
}

/// w at points, of which some are asked between two looks at whether the user stops.
fn sample_all(tree: &dyn BrickTree, points: &[[f64; 3]], progress: &dyn Progress) -> Result<Vec<f32>> {
    let mut values = Vec::with_capacity(points.len());
    for part in points.chunks(POINTS_AT_ONCE) {
        progress.check()?;
        values.extend(sample_at(tree, part)?.into_iter().map(|w| w as f32));
    }
    Ok(values)
}

/// A mesh with the outward unit normals of its vertices.
#[derive(Default)]
struct MeshWithNormals {
    mesh: MeshArrays,
    normals: Vec<[f32; 3]>,
}

impl MeshSink for MeshWithNormals {
    fn wants_normals(&self) -> bool {
        true
    }

    fn takes_triangles_between(&self) -> bool {
        true
    }

    fn shares_vertices(&self) -> bool {
        true
    }

    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<()> {
        self.mesh.positions.extend_from_slice(positions);
        self.normals.extend_from_slice(normals);
        Ok(())
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        self.mesh.triangles.extend(facets.iter().map(|facet| facet.ids));
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Rows of three as an array.
fn triples<T: numpy::Element>(py: Python<'_>, rows: Vec<[T; 3]>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let array = Array2::from_shape_vec((rows.len(), 3), rows.into_flattened());
    let array = array.map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// Samples of a box, indexed z, y, x.
fn samples(tree: &dyn BrickTree, level: u8, first: [usize; 3], last: [usize; 3]) -> Result<Array3<f32>> {
    let size: [usize; 3] = std::array::from_fn(|a| last[a].saturating_sub(first[a]));
    let axis = BRICK_CELLS << level;
    if level > tree.deepest_level() || last.iter().any(|&end| end > axis) {
        let what = format!("there are no samples to {last:?} at level {level}");
        return Err(Error::setting(what, format!("choose a level up to {}", tree.deepest_level())));
    }
    let mut all = Array3::zeros([size[2], size[1], size[0]]);
    if size.contains(&0) {
        return Ok(all);
    }
    let bricks = |a: usize| first[a] / BRICK_CELLS..(last[a] - 1) / BRICK_CELLS + 1;
    let places = bricks(2).flat_map(|z| bricks(1).flat_map(move |y| bricks(0).map(move |x| [x, y, z])));
    let parts = places.collect::<Vec<_>>().into_par_iter().map(|place| {
        let corner = place.map(|p| p * BRICK_CELLS);
        let low: [usize; 3] = std::array::from_fn(|a| first[a].max(corner[a]));
        let high: [usize; 3] = std::array::from_fn(|a| last[a].min(corner[a] + BRICK_CELLS));
        let mut values = Vec::new();
        let (key, _) = covering(tree, level, place.map(|p| p as u32))?;
        let brick = tree.brick(key)?;
        let block = BrickBlock::new(&brick, key, level, place.map(|p| p as u32));
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                values.extend(
                    (low[0]..high[0]).map(|x| block.float([x - corner[0], y - corner[1], z - corner[2]])),
                );
            }
        }
        Ok((low, high, values))
    });
    for part in parts.collect::<Result<Vec<_>>>()? {
        let (low, high, values) = part;
        let mut values = values.into_iter();
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                for x in low[0]..high[0] {
                    all[[z - first[2], y - first[1], x - first[0]]] = values.next().unwrap_or(0.0);
                }
            }
        }
    }
    Ok(all)
}

/// The pixels of a picture that is written to a file.
fn picture(write: impl FnOnce(&Path) -> Result<()>) -> Result<Array3<u8>> {
    let folder = std::env::temp_dir();
    let failed = |source: std::io::Error| Error::io(&folder, "write a picture in")(source);
    let file = tempfile::Builder::new().suffix(".png").tempdir().map_err(failed)?;
    let path = file.path().join("picture.png");
    write(&path)?;
    let bytes = std::fs::read(&path).map_err(failed)?;
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let damaged = |error: png::DecodingError| failed(std::io::Error::other(error));
    let mut reader = decoder.read_info().map_err(damaged)?;
    let mut pixels = vec![0; reader.output_buffer_size().unwrap_or(0)];
    let info = reader.next_frame(&mut pixels).map_err(damaged)?;
    let channels = info.color_type.samples();
    let shape = [info.height as usize, info.width as usize, 3];
    // Grey is written once for all three.
    let channel = |c: usize| if channels < 3 { 0 } else { c };
    Ok(Array3::from_shape_fn(shape, |(y, x, c)| pixels[(y * shape[1] + x) * channels + channel(c)]))
}
