//! Bindings of the timestamps.

use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray1, PyUntypedArrayMethods, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::flat1;
use crate::timestamps::{self, Course, phase_sum};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(timestamp_steps, module)?)?;
    module.add_function(wrap_pyfunction!(usual_step, module)?)?;
    module.add_function(wrap_pyfunction!(steps_above, module)?)?;
    module.add_function(wrap_pyfunction!(inside_steps, module)?)?;
    module.add_function(wrap_pyfunction!(timestamp_lateness, module)?)?;
    module.add_function(wrap_pyfunction!(earliest_timestamps, module)?)?;
    module.add_function(wrap_pyfunction!(block_medians, module)?)?;
    module.add_function(wrap_pyfunction!(block_mean_ticks, module)?)?;
    module.add_function(wrap_pyfunction!(robust_line, module)?)?;
    module.add_function(wrap_pyfunction!(phase_power, module)?)?;
    module.add_function(wrap_pyfunction!(direct_power, module)?)?;
    module.add_function(wrap_pyfunction!(timestamp_errors, module)?)?;
    module.add_function(wrap_pyfunction!(errors_deviation, module)?)?;
    module.add_function(wrap_pyfunction!(errors_falls, module)?)?;
    module.add_function(wrap_pyfunction!(lay_even_clock, module)?)
}

/// Ticks in the reader's integer type: half the memory where their range allows it.
#[derive(FromPyObject)]
enum Ticks<'py> {
    Short(PyReadonlyArray1<'py, i32>),
    Long(PyReadonlyArray1<'py, i64>),
}

fn same_length(what: &str, expected: usize, found: usize) -> PyResult<()> {
    if expected == found {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{what} must be {expected} numbers, got {found}"
    )))
}

/// Numbers of steps back, of zero, forward, and of timestamps that are not finite.
#[pyfunction]
fn timestamp_steps(
    py: Python<'_>,
    time: PyReadonlyArray1<'_, f64>,
) -> PyResult<(usize, usize, usize, usize)> {
    let time = flat1(&time);
    let found = super::run(py, || Ok(timestamps::steps(&time)))?;
    Ok((found.back, found.same, found.forward, found.missing))
}

/// Median of the steps forward.
#[pyfunction]
fn usual_step(py: Python<'_>, time: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
    let time = flat1(&time);
    super::run(py, || Ok(timestamps::usual_step(&time)))
}

/// Rows `(k,)` after which the step is longer than `limit`.
#[pyfunction]
fn steps_above<'py>(
    py: Python<'py>,
    time: PyReadonlyArray1<'py, f64>,
    limit: f64,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let time = flat1(&time);
    let found = super::run(py, || Ok(timestamps::steps_above(&time, limit)))?;
    let rows: Vec<i64> = found
        .into_iter()
        .map(|row| i64::try_from(row).unwrap_or(i64::MAX))
        .collect();
    Ok(rows.to_pyarray(py))
}

/// Number, sum, standard deviation, least and greatest of the steps above `above` and not above `limit`.
#[pyfunction]
fn inside_steps(
    py: Python<'_>,
    time: PyReadonlyArray1<'_, f64>,
    above: f64,
    limit: f64,
) -> PyResult<(usize, f64, f64, f64, f64)> {
    let time = flat1(&time);
    let found = super::run(py, || Ok(timestamps::inside(&time, above, limit)))?;
    Ok((
        found.count,
        found.sum,
        found.deviation,
        found.least,
        found.most,
    ))
}

/// Writes `time - period tick` `(n,)` to `late`; without ticks the tick is the row number.
#[pyfunction]
#[pyo3(signature = (time, ticks, period, late))]
fn timestamp_lateness<'py>(
    py: Python<'py>,
    time: PyReadonlyArray1<'py, f64>,
    ticks: Option<Ticks<'py>>,
    period: f64,
    mut late: PyReadwriteArray1<'py, f64>,
) -> PyResult<()> {
    let time = flat1(&time);
    let late = late.as_slice_mut()?;
    same_length("late", time.len(), late.len())?;
    match &ticks {
        None => super::run(py, || {
            timestamps::lateness::<i64>(&time, None, period, late);
            Ok(())
        }),
        Some(Ticks::Short(ticks)) => {
            same_length("ticks", time.len(), ticks.len())?;
            let ticks = flat1(ticks);
            super::run(py, || {
                timestamps::lateness(&time, Some(&ticks), period, late);
                Ok(())
            })
        }
        Some(Ticks::Long(ticks)) => {
            same_length("ticks", time.len(), ticks.len())?;
            let ticks = flat1(ticks);
            super::run(py, || {
                timestamps::lateness(&time, Some(&ticks), period, late);
                Ok(())
            })
        }
    }
}

/// Row of the earliest timestamp in every block of `width`.
#[pyfunction]
fn earliest_timestamps<'py>(
    py: Python<'py>,
    late: PyReadonlyArray1<'py, f64>,
    width: usize,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let late = flat1(&late);
    if late.is_empty() {
        return Err(PyValueError::new_err("there must be timestamps, got none"));
    }
    let found = super::run(py, || Ok(timestamps::earliest(&late, width)))?;
    Ok(found.to_pyarray(py))
}

/// Median of every whole block of `width` numbers.
#[pyfunction]
fn block_medians<'py>(
    py: Python<'py>,
    late: PyReadonlyArray1<'py, f64>,
    width: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let late = flat1(&late);
    let found = super::run(py, || Ok(timestamps::block_medians(&late, width)))?;
    Ok(found.to_pyarray(py))
}

/// Mean of every whole block of `width` ticks.
#[pyfunction]
fn block_mean_ticks<'py>(
    py: Python<'py>,
    ticks: Ticks<'py>,
    width: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let found = match &ticks {
        Ticks::Short(ticks) => {
            let ticks = flat1(ticks);
            super::run(py, || Ok(timestamps::block_means(&ticks, width)))?
        }
        Ticks::Long(ticks) => {
            let ticks = flat1(ticks);
            super::run(py, || Ok(timestamps::block_means(&ticks, width)))?
        }
    };
    Ok(found.to_pyarray(py))
}

/// `(slope, level)` of a line through points with outliers.
#[pyfunction]
fn robust_line(
    py: Python<'_>,
    u: PyReadonlyArray1<'_, f64>,
    y: PyReadonlyArray1<'_, f64>,
) -> PyResult<(f64, f64)> {
    same_length("y", u.len(), y.len())?;
    let (u, y) = (flat1(&u), flat1(&y));
    super::run(py, || Ok(timestamps::robust_line(&u, &y)))
}

/// Writes `slope (tick - origin) / scale + level + period tick` to `even`.
#[pyfunction]
fn lay_even_clock(
    py: Python<'_>,
    ticks: Ticks<'_>,
    line: (f64, f64),
    origin: f64,
    scale: f64,
    period: f64,
    mut even: PyReadwriteArray1<'_, f64>,
) -> PyResult<()> {
    let course = Course {
        slope: line.0,
        level: line.1,
        origin,
        scale,
    };
    let even = even
        .as_slice_mut()
        .map_err(|_| PyValueError::new_err("even must be a contiguous array"))?;
    match &ticks {
        Ticks::Short(ticks) => {
            same_length("even", ticks.len(), even.len())?;
            let ticks = flat1(ticks);
            super::run(py, || {
                timestamps::lay(&ticks, &course, period, even);
                Ok(())
            })
        }
        Ticks::Long(ticks) => {
            same_length("even", ticks.len(), even.len())?;
            let ticks = flat1(ticks);
            super::run(py, || {
                timestamps::lay(&ticks, &course, period, even);
                Ok(())
            })
        }
    }
}

/// Power `(length / 2 + 1,)` of the phase sums of windows of timestamps on a grid of `length` cells, and that length:
/// the first from `least` on with a fast transform.
#[pyfunction]
fn phase_power<'py>(
    py: Python<'py>,
    windows: Vec<PyReadonlyArray1<'py, f64>>,
    cell: f64,
    least: usize,
) -> PyResult<(Bound<'py, PyArray1<f64>>, usize)> {
    let length = phase_sum::next_fast_length(least);
    let windows: Vec<_> = windows.iter().map(flat1).collect();
    let lent: Vec<&[f64]> = windows.iter().map(AsRef::as_ref).collect();
    let power = super::run_long(py, || phase_sum::phase_power(&lent, cell, length))?;
    Ok((PyArray1::from_vec(py, power), length))
}

/// Power `(count,)` of the phase sum of timestamps at frequencies `step` apart.
#[pyfunction]
fn direct_power<'py>(
    py: Python<'py>,
    timestamps: PyReadonlyArray1<'py, f64>,
    first: f64,
    step: f64,
    count: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let timestamps = flat1(&timestamps);
    let power = super::run(py, || {
        Ok(phase_sum::direct_power(&timestamps, first, step, count))
    })?;
    Ok(PyArray1::from_vec(py, power))
}

/// Writes `time - even` `(n,)` to `even`.
#[pyfunction]
fn timestamp_errors(
    py: Python<'_>,
    time: PyReadonlyArray1<'_, f64>,
    mut even: PyReadwriteArray1<'_, f64>,
) -> PyResult<()> {
    same_length("even", time.len(), even.len())?;
    let time = flat1(&time);
    let even = even
        .as_slice_mut()
        .map_err(|_| PyValueError::new_err("even must be a contiguous array"))?;
    super::run(py, || {
        timestamps::less(&time, even);
        Ok(())
    })
}

/// Root mean square of errors `(n,)` about their mean.
#[pyfunction]
fn errors_deviation(py: Python<'_>, errors: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
    let errors = flat1(&errors);
    super::run(py, || Ok(timestamps::deviation(&errors)))
}

/// Number of errors `(n,)` that are less than the one before by more than `fall`.
#[pyfunction]
fn errors_falls(py: Python<'_>, errors: PyReadonlyArray1<'_, f64>, fall: f64) -> PyResult<usize> {
    let errors = flat1(&errors);
    super::run(py, || Ok(timestamps::falls(&errors, fall)))
}
