//! Bindings of the search for events.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::allan::Column;
use crate::screening::{self, Scale};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(find_jumps, module)?)?;
    module.add_function(wrap_pyfunction!(block_scatter, module)?)?;
    Ok(())
}

fn slice<'a>(x: &'a PyReadonlyArray1<'_, f64>) -> PyResult<&'a [f64]> {
    x.as_slice()
        .map_err(|_| PyValueError::new_err("a channel must be a contiguous array"))
}

/// `(score, at, size, difference)` of every event; a scale is `(size, stride, limit)`.
#[pyfunction]
fn find_jumps(
    py: Python<'_>,
    x: PyReadonlyArray1<'_, f64>,
    scales: Vec<(usize, usize, f64)>,
) -> PyResult<Vec<(f64, usize, usize, f64)>> {
    let x = slice(&x)?;
    let scales: Vec<Scale> = scales
        .into_iter()
        .map(|(size, stride, limit)| Scale {
            size,
            stride,
            limit,
        })
        .collect();
    // NumPy requests large pages from the system, which halves the time.
    let workspace = PyArray1::<f64>::zeros(py, x.len() + 1, false);
    let mut workspace = workspace.try_readwrite()?;
    let workspace = workspace.as_slice_mut()?;
    let found = super::run_long(py, || {
        screening::jumps_in(
            &Column {
                data: x,
                channels: 1,
                channel: 0,
            },
            &scales,
            workspace,
        )
    })?;
    Ok(found
        .into_iter()
        .map(|j| (j.score, j.at, j.size, j.difference))
        .collect())
}

/// Mean squares `(n / size,)` of the differences from reading to reading.
#[pyfunction]
fn block_scatter<'py>(
    py: Python<'py>,
    x: PyReadonlyArray1<'py, f64>,
    size: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let x = slice(&x)?;
    let found = super::run_long(py, || Ok(screening::scatter(x.len(), |i| x[i], size)))?;
    Ok(found.to_pyarray(py))
}
