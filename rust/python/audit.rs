//! Bindings of the audit of readings.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat3};
use crate::audit;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(triad_extremes, module)?)?;
    module.add_function(wrap_pyfunction!(triad_largest_steps, module)?)?;
    module.add_function(wrap_pyfunction!(triad_repeats, module)?)?;
    module.add_function(wrap_pyfunction!(triad_leaps, module)?)?;
    module.add_function(wrap_pyfunction!(triad_copies, module)?)?;
    module.add_function(wrap_pyfunction!(readings_near, module)?)
}

/// `(low, count at low, high, count at high)` of each axis of `(n, 3)` readings.
#[pyfunction]
fn triad_extremes(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<(f64, usize, f64, usize)>> {
    let flat = flat3("readings", &readings)?;
    let found = super::run(py, || Ok(audit::extremes(as_rows(&flat))))?;
    Ok(found
        .iter()
        .map(|e| (e.low, e.n_low, e.high, e.n_high))
        .collect())
}

/// The largest change from one reading to the next of each axis of `(n, 3)` readings; missing ones are skipped.
#[pyfunction]
fn triad_largest_steps(py: Python<'_>, readings: PyReadonlyArray2<'_, f64>) -> PyResult<[f64; 3]> {
    let flat = flat3("readings", &readings)?;
    super::run(py, || Ok(audit::largest_steps(as_rows(&flat))))
}

type RepeatNumbers<'py> = (
    [u64; 4],
    [u64; 4],
    [u64; 4],
    Bound<'py, PyArray2<u8>>,
    u64,
    Option<u64>,
);

/// Counts, longest runs, their starts, equal rows of every window `(w, 4)`, number of missing rows, the first of them.
#[pyfunction]
fn triad_repeats<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
) -> PyResult<RepeatNumbers<'py>> {
    let flat = flat3("readings", &readings)?;
    let found = super::run(py, || Ok(audit::repeats(as_rows(&flat))))?;
    let n = found.windows.len();
    let windows = PyArray1::from_vec(py, found.windows.concat()).reshape([n, 4])?;
    Ok((
        found.count,
        found.longest,
        found.start,
        windows,
        found.missing,
        found.first_missing,
    ))
}

type LeapNumbers<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// Rows `(k,)` with a reading at least `least` standard errors from its neighbours' prediction; by how much, and the
/// standard errors, `(k, 3)` each.
#[pyfunction]
fn triad_leaps<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    noise: [f64; 3],
    least: f64,
) -> PyResult<LeapNumbers<'py>> {
    let flat = flat3("readings", &readings)?;
    let found = super::run(py, || Ok(audit::leaps(as_rows(&flat), &noise, least)))?;
    let rows = found
        .iter()
        .map(|one| i64::try_from(one.row).unwrap_or(i64::MAX));
    let of = |part: fn(&audit::Leap) -> [f64; 3]| {
        let values: Vec<f64> = found.iter().flat_map(part).collect();
        PyArray1::from_vec(py, values).reshape([found.len(), 3])
    };
    Ok((
        PyArray1::from_iter(py, rows),
        of(|one| one.away)?,
        of(|one| one.error)?,
    ))
}

/// First row, and the one behind the last, of every block of `(n, 3)` readings that repeats earlier ones.
#[pyfunction]
fn triad_copies(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    farthest: usize,
    least: usize,
) -> PyResult<Vec<(usize, usize)>> {
    let flat = flat3("readings", &readings)?;
    let found = super::run(py, || Ok(audit::copies(as_rows(&flat), farthest, least)))?;
    Ok(found.iter().map(|block| (block.start, block.end)).collect())
}

/// Number of readings of one axis within `depth` of a value, distance of the nearest other, rows `(k,)` of the value.
#[pyfunction]
fn readings_near<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    axis: usize,
    value: f64,
    depth: f64,
) -> PyResult<(usize, f64, Bound<'py, PyArray1<i64>>)> {
    if axis > 2 {
        return Err(PyValueError::new_err(format!(
            "axis must be 0, 1 or 2, got {axis}"
        )));
    }
    let flat = flat3("readings", &readings)?;
    let found = super::run(py, || Ok(audit::near(as_rows(&flat), axis, value, depth)))?;
    Ok((found.count, found.width, found.at.to_pyarray(py)))
}
