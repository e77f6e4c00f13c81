//! Stillness across the seam.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::stillness;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(block_statistics, module)?)
}

type BlockArrays<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u32>>,
);

#[pyfunction]
fn block_statistics<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    length: usize,
) -> PyResult<BlockArrays<'py>> {
    if readings.shape()[1] != 3 {
        return Err(PyValueError::new_err(format!(
            "readings must have shape (n, 3), got ({}, {})",
            readings.shape()[0],
            readings.shape()[1]
        )));
    }
    // `as_slice` also succeeds on a Fortran-ordered array, whose memory runs down the columns.
    let owned: Vec<f64> = match readings.as_slice() {
        Ok(flat) if readings.is_c_contiguous() => flat.to_vec(),
        _ => readings.as_array().iter().copied().collect(),
    };
    let blocks = super::run(py, || stillness::block_statistics(&owned, length))?;
    let shape = [blocks.count.len(), 3];
    Ok((
        blocks.mean.as_flattened().to_pyarray(py).reshape(shape)?,
        blocks
            .variance
            .as_flattened()
            .to_pyarray(py)
            .reshape(shape)?,
        blocks.count.to_pyarray(py),
    ))
}
