//! Bindings of the regressors of effects.

use numpy::{
    PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, as_vectors, flat1, flat3, matrix3, of3, vector3};
use crate::{move_moments as kernel, move_signals};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(play, module)?)?;
    module.add_function(wrap_pyfunction!(move_derivative, module)?)?;
    module.add_function(wrap_pyfunction!(move_shifted, module)?)?;
    module.add_function(wrap_pyfunction!(move_moments, module)?)?;
    module.add_function(wrap_pyfunction!(rotated_moments, module)?)?;
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

/// `∫ (S a + b) (w - bias)ᵀ dt` `(3, 3)` of readings `a` and rates `w` `(n, 3)` over each of the moves `(m, 2)`, with a
/// `bias` `(m, 3)` each; `None` where fewer than two rows of a move are finite.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "two sensors and their moves by name"
)]
fn move_moments<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    reading: PyReadonlyArray2<'py, f64>,
    direct_s: PyReadonlyArray2<'py, f64>,
    direct_b: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    bias: PyReadonlyArray2<'py, f64>,
) -> PyResult<Vec<Option<Array2<'py>>>> {
    let n = time_s.len();
    if reading.shape()[0] != n || rate.shape()[0] != n || bias.shape()[0] != moves.shape()[0] {
        return Err(PyValueError::new_err(
            "readings and rates (n, 3) belong to times (n,), and a bias to every move",
        ));
    }
    let moves = edges(&moves, n)?;
    let (time, reading, rate) = (
        flat1(&time_s),
        flat3("reading", &reading)?,
        flat3("rate", &rate)?,
    );
    let biases = flat3("bias", &bias)?;
    let (scale, bias) = (matrix3("S", &direct_s)?, vector3("b", &direct_b)?);
    let found = super::run(py, || {
        let (reading, rate) = (as_vectors(&reading), as_vectors(&rate));
        Ok(kernel::moments(
            &time,
            reading,
            (&scale, &bias),
            rate,
            &moves,
            as_vectors(&biases),
        ))
    })?;
    let array = |moment: &Option<_>| moment.as_ref().map(|one| of3(py, one)).transpose();
    found.iter().map(array).collect()
}

/// `∫ f (w - bias)ᵀ dt` `(m, 3, 3)` over each of the moves, of the force `f` that the rate of `scale` rotates from the
/// pose `before` `(m, 3)` to the pose `after`.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "a sensor, its moves and their ends by name"
)]
fn rotated_moments<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    bias: PyReadonlyArray2<'py, f64>,
    scale: PyReadonlyArray2<'py, f64>,
    before: PyReadonlyArray2<'py, f64>,
    after: PyReadonlyArray2<'py, f64>,
) -> PyResult<Vec<Array2<'py>>> {
    let (n, m) = (time_s.len(), moves.shape()[0]);
    if rate.shape()[0] != n
        || [&bias, &before, &after]
            .iter()
            .any(|one| one.shape()[0] != m)
    {
        return Err(PyValueError::new_err(
            "rates (n, 3) belong to times (n,); a bias and two forces to every move",
        ));
    }
    let moves = edges(&moves, n)?;
    let (time, rate, biases) = (flat1(&time_s), flat3("rate", &rate)?, flat3("bias", &bias)?);
    let (before, after) = (flat3("before", &before)?, flat3("after", &after)?);
    let scale = matrix3("scale", &scale)?;
    let found = super::run(py, || {
        let ends: Vec<_> = as_vectors(&before)
            .iter()
            .zip(as_vectors(&after))
            .map(|(before, after)| [*before, *after])
            .collect();
        let (rate, biases) = (as_vectors(&rate), as_vectors(&biases));
        Ok(kernel::rotated_moments(
            &time, rate, &moves, biases, &scale, &ends,
        ))
    })?;
    found.iter().map(|moment| of3(py, moment)).collect()
}
