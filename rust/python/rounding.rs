//! Bindings of rounding errors.

#![expect(
    clippy::redundant_closure_for_method_calls,
    reason = "the methods are of one lifetime"
)]

use numpy::{
    PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3, rows};
use super::ranges::ranges_within;
use crate::rounding::Coarse;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(rounding_variance, module)?)?;
    module.add_function(wrap_pyfunction!(rounding_in_moves, module)?)
}

/// LSB, reading of the bias, and whether noise does not dither, of three axes each.
type Adc<'py> = (
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, bool>,
);

/// As [`rounding::InMoves`](crate::rounding::InMoves).
type InMoves<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray3<f64>>,
);

/// A kernel's answer about `readings` `(n, 3)` of an `adc`; `steady` as [`Coarse`] has them.
fn asked<T: Send>(
    py: Python<'_>,
    readings: &PyReadonlyArray2<'_, f64>,
    adc: &Adc<'_>,
    (in_step, chatter): (f64, usize),
    of: impl FnOnce(&Coarse<'_>) -> T + Send,
) -> PyResult<T> {
    let flat = flat3("readings", readings)?;
    let wrong = |_| PyValueError::new_err("three axes each");
    let coarse = Coarse {
        readings: as_rows(&flat),
        quantum: flat1(&adc.0).as_ref().try_into().map_err(wrong)?,
        rest: flat1(&adc.1).as_ref().try_into().map_err(wrong)?,
        axes: flat1(&adc.2).as_ref().try_into().map_err(wrong)?,
        in_step,
        chatter,
    };
    super::run(py, || Ok(of(&coarse)))
}

/// Rounding variance `(n, 3)` of readings for sums that treat them as independent.
#[pyfunction]
fn rounding_variance<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    adc: Adc<'py>,
    steady: (f64, usize),
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let out = asked(py, &readings, &adc, steady, |one| one.variance())?;
    rows(py, out.as_flattened(), 3)
}

/// Rounding in the moves `edges` `(m, 2)`: variance `(n, 3)` of readings, 1 where an axis is in the LSB of its bias
/// `(n, 3)`, and errors `(n, 3, k)` of one standard deviation each that all moves share.
#[pyfunction]
fn rounding_in_moves<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    adc: Adc<'py>,
    edges: PyReadonlyArray2<'py, i64>,
    steady: (f64, usize),
) -> PyResult<InMoves<'py>> {
    let edges = ranges_within(&edges, readings.shape()[0])?;
    let of_moves = |one: &Coarse<'_>| one.in_moves(&edges);
    let (variance, is_static, shared) = asked(py, &readings, &adc, steady, of_moves)?;
    let is_static: Vec<f64> = is_static
        .as_flattened()
        .iter()
        .map(|&is| f64::from(is))
        .collect();
    let (n, k) = (variance.len(), shared.len());
    let mut errors = vec![0.0; 3 * n * k];
    for (at, (axis, error)) in shared.iter().enumerate() {
        for (row, value) in error.iter().enumerate() {
            errors[(3 * row + axis) * k + at] = *value;
        }
    }
    Ok((
        rows(py, variance.as_flattened(), 3)?,
        rows(py, &is_static, 3)?,
        errors.to_pyarray(py).reshape([n, 3, k])?,
    ))
}
