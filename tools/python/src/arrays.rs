//! Arrays from Python as the engine takes them, and back.

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Rows of three numbers.
pub fn rows(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; 3]>> {
    let [count, width] = [array.shape()[0], array.shape()[1]];
    if width != 3 {
        return Err(PyValueError::new_err(format!("an array of shape ({count}, {width}), not (n, 3)")));
    }
    if let Ok(numbers) = array.as_slice() {
        return Ok(numbers.as_chunks::<3>().0.to_vec());
    }
    let view = array.as_array();
    Ok(view.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

/// Rows of three corners, whatever integers they are.
pub fn corners(array: &Bound<'_, PyAny>) -> PyResult<Vec<[u32; 3]>> {
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind != "i" && kind != "u" {
        return Err(PyValueError::new_err(format!(
            "triangles of type {}, not integers",
            array.getattr("dtype")?
        )));
    }
    let array: PyReadonlyArray2<'_, i64> = array.call_method1("astype", ("int64",))?.extract()?;
    let [count, width] = [array.shape()[0], array.shape()[1]];
    if width != 3 {
        return Err(PyValueError::new_err(format!("triangles of shape ({count}, {width}), not (n, 3)")));
    }
    let view = array.as_array();
    let corner = |corner: &i64| {
        u32::try_from(*corner)
            .map_err(|_| PyValueError::new_err(format!("{corner} is no number of a vertex")))
    };
    let row =
        |row: numpy::ndarray::ArrayView1<'_, i64>| Ok([corner(&row[0])?, corner(&row[1])?, corner(&row[2])?]);
    view.rows().into_iter().map(row).collect()
}
