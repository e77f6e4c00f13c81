//! Bindings of the regressors of effects.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, as_vectors, flat1, flat3, matrix3, of3, vector3};
use crate::channel_slope::slope;
use crate::move_signals;
use crate::scale_from_moves::Moves;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(play, module)?)?;
    module.add_function(wrap_pyfunction!(channel_slope, module)?)?;
    module.add_function(wrap_pyfunction!(move_derivative, module)?)?;
    module.add_function(wrap_pyfunction!(move_shifted, module)?)?;
    module.add_function(wrap_pyfunction!(scale_from_moves, module)?)?;
    Ok(())
}

type Array2<'py> = Bound<'py, PyArray2<f64>>;

/// Play (backlash): distance of a path `(n, 3)` from a follower dragged with slack, in half-widths `(n, 3)`.
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

/// Rate of change per second `(n,)` of a channel `(n,)` of finite values at its times, `rate_hz` of them in a second.
#[pyfunction]
fn channel_slope<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    time_s: PyReadonlyArray1<'py, f64>,
    rate_hz: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (values, time) = (flat1(&values), flat1(&time_s));
    if values.len() != time.len() || !(rate_hz.is_finite() && rate_hz > 0.0) {
        let said = "a channel has as many times as values, and a positive rate";
        return Err(PyValueError::new_err(said));
    }
    let out = super::run(py, || Ok(slope(&values, &time, rate_hz)))?;
    Ok(out.to_pyarray(py))
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

/// A kernel's answer `(n, 3)` to values inside moves.
fn inside_moves<'py>(
    py: Python<'py>,
    (time_s, values): (&PyReadonlyArray1<'py, f64>, &PyReadonlyArray2<'py, f64>),
    moves: &PyReadonlyArray2<'py, i64>,
    kernel: impl FnOnce(&[f64], &[[f64; 3]], &[[usize; 2]]) -> Vec<[f64; 3]> + Send,
) -> PyResult<Array2<'py>> {
    let (n, times) = (values.shape()[0], time_s.len());
    if times != n {
        return Err(PyValueError::new_err(format!(
            "{n} values need as many times, got {times}"
        )));
    }
    let ranges = edges(moves, n)?;
    let (time, flat) = (flat1(time_s), flat3("values", values)?);
    let out = super::run(py, || Ok(kernel(&time, as_rows(&flat), &ranges)))?;
    out.as_flattened().to_pyarray(py).reshape([n, 3])
}

/// Time derivative `(n, 3)` of values inside moves, zero outside.
#[pyfunction]
fn move_derivative<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
) -> PyResult<Array2<'py>> {
    inside_moves(py, (&time_s, &values), &moves, move_signals::derivative)
}

/// Values `(n, 3)` at a time `ahead_s` later inside moves, by the spline of every move with zero slope at its ends.
#[pyfunction]
fn move_shifted<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    ahead_s: f64,
) -> PyResult<Array2<'py>> {
    inside_moves(py, (&time_s, &values), &moves, |time, rows, ranges| {
        move_signals::shifted(time, rows, ranges, ahead_s)
    })
}

/// Scale `(3, 3)` of a gyro from moves `(m, 2)`, with a `bias` `(m, 3)` and forces before and after `(m, 3)` each, and
/// readings of both sensors `(n, 3)`: the one given, that of the moves, or the nominal one, improved along their paths.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "two sensors, their moves and the ends of these by name"
)]
fn scale_from_moves<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    sensors: [PyReadonlyArray2<'py, f64>; 2],
    direct: (PyReadonlyArray2<'py, f64>, PyReadonlyArray1<'py, f64>),
    moves: PyReadonlyArray2<'py, i64>,
    bias: PyReadonlyArray2<'py, f64>,
    ends: [PyReadonlyArray2<'py, f64>; 2],
    given: Option<PyReadonlyArray2<'py, f64>>,
    nominal: Option<f64>,
) -> PyResult<Option<Array2<'py>>> {
    let (n, m) = (time_s.len(), moves.shape()[0]);
    let each = [&bias, &ends[0], &ends[1]];
    if sensors.iter().any(|one| one.shape()[0] != n) || each.iter().any(|one| one.shape()[0] != m) {
        return Err(PyValueError::new_err(
            "readings (n, 3) belong to times (n,); a bias and two forces to every move",
        ));
    }
    let ranges = edges(&moves, n)?;
    let (time, reading, rate) = (
        flat1(&time_s),
        flat3("reading", &sensors[0])?,
        flat3("rate", &sensors[1])?,
    );
    let biases = flat3("bias", &bias)?;
    let (before, after) = (flat3("before", &ends[0])?, flat3("after", &ends[1])?);
    let direct = (matrix3("S", &direct.0)?, vector3("b", &direct.1)?);
    let given = given.map(|scale| matrix3("given", &scale)).transpose()?;
    let found = super::run(py, || {
        let pairs = as_vectors(&before).iter().zip(as_vectors(&after));
        let ends: Vec<_> = pairs.map(|(before, after)| [*before, *after]).collect();
        let moves = Moves {
            time: &time,
            reading: as_vectors(&reading),
            direct,
            rate: as_vectors(&rate),
            ranges: &ranges,
            bias: as_vectors(&biases),
            ends: &ends,
        };
        Ok(moves.scale(given, nominal))
    })?;
    found.map(|scale| of3(py, &scale)).transpose()
}
