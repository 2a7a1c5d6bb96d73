//! Brickfield for Python: NumPy arrays in and out, and the program itself.
//!
//! Work runs on a thread of its own while the interpreter's lock is free. The calling thread looks at signals and reports
//! progress meanwhile, so that Ctrl-C stops the work.

mod arrays;
mod octree;
mod work;

use arrays::{corners, rows};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use octree::Octree;
use pyo3::prelude::*;
use work::{failed, run};

/// The winding number of triangles at points, a reusable object.
#[pyclass(frozen)]
struct Winding {
    field: brickfield_engine::Field,
}

#[pymethods]
impl Winding {
    #[new]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        triangles: &Bound<'_, PyAny>,
    ) -> PyResult<Winding> {
        let (vertices, triangles) = (rows(&vertices)?, corners(triangles)?);
        let field = py.detach(|| brickfield_engine::Field::new(vertices, triangles));
        Ok(Winding { field: field.map_err(|error| failed(py, &error))? })
    }

    /// w at points, an array of a row each.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = rows(&points)?;
        let values = run(py, None, |progress| self.field.at_with(&points, progress))?;
        Ok(values.into_pyarray(py))
    }
}

/// Runs the program with arguments, its name first. Returns its exit status.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<String>) -> u8 {
    let status = py.detach(|| brickfield_program::main(arguments.into_iter().map(Into::into)));
    // A status has no other way out.
    (0..=u8::MAX).find(|&code| std::process::ExitCode::from(code) == status).unwrap_or(1)
}

#[pymodule(gil_used = false)]
fn _brickfield(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Octree>()?;
    module.add_class::<Winding>()?;
    module.add_function(wrap_pyfunction!(octree::open, module)?)?;
    module.add_function(wrap_pyfunction!(octree::build, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
