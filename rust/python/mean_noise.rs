//! Bindings of the noise of means: differences between halves of stretches, and variance against length.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3};
use crate::halves::halves;
use crate::mean_noise;

/// Squares, blocks in a half, depth and stretch of each.
type Differences<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
);

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(halves_of, module)?)?;
    module.add_function(wrap_pyfunction!(mean_noise_terms, module)?)
}

/// Deviance and non-negative terms of a choice of columns of the variance of a mean.
#[pyfunction]
fn mean_noise_terms(
    py: Python<'_>,
    design: PyReadonlyArray2<'_, f64>,
    seen: PyReadonlyArray1<'_, f64>,
    n: PyReadonlyArray1<'_, f64>,
    chosen: Vec<usize>,
) -> PyResult<(f64, [f64; 3])> {
    let design = flat3("design", &design)?;
    let (seen, n) = (flat1(&seen), flat1(&n));
    let found = super::run(py, || {
        mean_noise::terms(as_rows(&design), &seen, &n, &chosen)
    })?;
    Ok((found.deviance, found.terms))
}

/// Half the squared differences `(k, channels)` between the means of halves of stretches `(s, 2)` of `blocks`
/// `(m, channels)`, blocks in a half, depth and stretch `(k,)` of each.
#[pyfunction]
fn halves_of<'py>(
    py: Python<'py>,
    blocks: PyReadonlyArray2<'py, f64>,
    stretches: PyReadonlyArray2<'py, i64>,
) -> PyResult<Differences<'py>> {
    let (n, channels) = (blocks.shape()[0], blocks.shape()[1]);
    let within = |first: i64, last: i64| {
        let (first, last) = (usize::try_from(first).ok()?, usize::try_from(last).ok()?);
        (first <= last && last <= n).then_some((first, last))
    };
    let pairs = stretches.as_array();
    let limits: Option<Vec<_>> = pairs
        .rows()
        .into_iter()
        .map(|row| within(*row.first()?, *row.get(1)?))
        .collect();
    let limits = limits.filter(|_| pairs.ncols() == 2).ok_or_else(|| {
        PyValueError::new_err(format!("stretches must lie within the {n} blocks"))
    })?;
    let values: Vec<f64> = blocks.as_array().iter().copied().collect();
    let found = super::run(py, || Ok(halves(&values, channels, &limits)))?;
    let k = found.size.len();
    Ok((
        found.square.to_pyarray(py).reshape([k, channels])?,
        found.size.to_pyarray(py),
        found.depth.to_pyarray(py),
        found.stretch.to_pyarray(py),
    ))
}
