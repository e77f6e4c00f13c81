//! Bindings of medians and quantiles.

use numpy::{PyArray1, PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat2, flat3, rows};
use crate::{order_statistics, running};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(column_medians, module)?)?;
    module.add_function(wrap_pyfunction!(column_quantiles, module)?)?;
    module.add_function(wrap_pyfunction!(roughness, module)?)
}

/// Running mean square `(n, 3)`, over `width` (odd) rows, of what a local parabola leaves of `values` `(n, 3)`.
#[pyfunction]
fn roughness<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    if width.is_multiple_of(2) {
        return Err(PyValueError::new_err(format!(
            "width must be odd, got {width}"
        )));
    }
    let flat = flat3("values", &values)?;
    let found = super::run(py, || Ok(running::roughness(as_rows(&flat), width)))?;
    rows(py, found.as_flattened(), 3)
}

/// Median of each column `(c,)`; NaN where one of its values is NaN.
#[pyfunction]
fn column_medians<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let width = values.shape()[1];
    let flat = flat2(&values);
    let found = super::run(py, || Ok(order_statistics::column_medians(&flat, width)))?;
    Ok(PyArray1::from_vec(py, found))
}

/// Quantiles `at` `(k,)` of each column, `(k, c)`.
#[pyfunction]
fn column_quantiles<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    at: Vec<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let width = values.shape()[1];
    if width == 0 || at.iter().any(|part| !(0.0..=1.0).contains(part)) {
        return Err(PyValueError::new_err(
            "quantiles lie between 0 and 1, of one column at least",
        ));
    }
    let flat = flat2(&values);
    let found = super::run(py, || {
        Ok(order_statistics::column_quantiles(&flat, width, &at))
    })?;
    rows(py, &found, width)
}
