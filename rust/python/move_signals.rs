//! Signals of effects across the seam.

use numpy::{
    PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3};
use crate::move_signals;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(play, module)?)?;
    module.add_function(wrap_pyfunction!(move_derivative, module)?)?;
    module.add_function(wrap_pyfunction!(move_shifted, module)?)?;
    Ok(())
}

type Array2<'py> = Bound<'py, PyArray2<f64>>;

/// How far a path `(n, 3)` leads a follower dragged with slack, in half-widths `(n, 3)`.
#[pyfunction]
fn play<'py>(
    py: Python<'py>,
    path: PyReadonlyArray2<'py, f64>,
    half_width: f64,
) -> PyResult<Array2<'py>> {
    if !(half_width.is_finite() && half_width > 0.0) {
        return Err(PyValueError::new_err(format!(
            "half_width must be positive, got {half_width}"
        )));
    }
    let flat = flat3("path", &path)?;
    let out = super::run(py, || Ok(move_signals::play(&flat, 3, half_width)))?;
    out.to_pyarray(py).reshape([path.shape()[0], 3])
}

/// Ranges `(m, 2)` of moves inside `n` points.
fn edges(moves: &PyReadonlyArray2<'_, i64>, n: usize) -> PyResult<Vec<[usize; 2]>> {
    let wrong = || {
        PyValueError::new_err(format!(
            "moves must be ranges start, stop within {n} points, (m, 2)"
        ))
    };
    if moves.shape()[1] != 2 {
        return Err(wrong());
    }
    moves
        .as_array()
        .rows()
        .into_iter()
        .map(|row| {
            let start = usize::try_from(row[0]).map_err(|_| wrong())?;
            let stop = usize::try_from(row[1]).map_err(|_| wrong())?;
            if start > stop || stop > n {
                return Err(wrong());
            }
            Ok([start, stop])
        })
        .collect()
}

fn same_length(
    time: &PyReadonlyArray1<'_, f64>,
    values: &PyReadonlyArray2<'_, f64>,
) -> PyResult<usize> {
    let n = values.shape()[0];
    if time.shape()[0] != n {
        return Err(PyValueError::new_err(format!(
            "{n} values need as many times, got {}",
            time.shape()[0]
        )));
    }
    Ok(n)
}

/// Time derivative `(n, 3)` of values inside moves, nothing outside.
#[pyfunction]
fn move_derivative<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
) -> PyResult<Array2<'py>> {
    let n = same_length(&time_s, &values)?;
    let ranges = edges(&moves, n)?;
    let (time, flat) = (flat1(&time_s), flat3("values", &values)?);
    let out = super::run(py, || {
        Ok(move_signals::derivative(&time, as_rows(&flat), &ranges))
    })?;
    out.as_flattened().to_pyarray(py).reshape([n, 3])
}

/// Values `(n, 3)` read `ahead_s` later inside moves, by the spline with level ends of every move.
#[pyfunction]
fn move_shifted<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    ahead_s: f64,
) -> PyResult<Array2<'py>> {
    let n = same_length(&time_s, &values)?;
    let ranges = edges(&moves, n)?;
    let (time, flat) = (flat1(&time_s), flat3("values", &values)?);
    let out = super::run(py, || {
        Ok(move_signals::shifted(
            &time,
            as_rows(&flat),
            &ranges,
            ahead_s,
        ))
    })?;
    out.as_flattened().to_pyarray(py).reshape([n, 3])
}
