//! Bindings of random telegraph signals.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{dmatrix, flat1, samples};
use crate::telegraph::{self, Inside, Means};
use crate::two_levels as levels;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(telegraph_inside, module)?)?;
    module.add_function(wrap_pyfunction!(telegraph_levels, module)?)?;
    module.add_function(wrap_pyfunction!(two_levels, module)?)
}

type Seen<'py> = (Bound<'py, PyArray1<bool>>, Bound<'py, PyArray1<f64>>, f64);

/// Whether the signal switches inside each of the poses `(h,)`, its mean state there, and the gain in log-likelihood,
/// from the readings `(n,)` of one axis in all of them, `counts` a pose.
#[pyfunction]
fn telegraph_inside<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray1<'py, f64>,
    counts: Vec<usize>,
) -> PyResult<Seen<'py>> {
    let flat = flat1(&readings);
    if counts.iter().sum::<usize>() != flat.len() {
        return Err(PyValueError::new_err("counts add up to the readings"));
    }
    let found = super::run(py, || {
        let mut left: &[f64] = &flat;
        let poses: Vec<&[f64]> = counts
            .iter()
            .map(|&n| {
                let (own, others) = left.split_at(n);
                left = others;
                own
            })
            .collect();
        Ok(telegraph::inside(&poses))
    })?;
    Ok((
        found.switches.to_pyarray(py),
        found.state.to_pyarray(py),
        found.gain,
    ))
}

type Told<'py> = (
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    f64,
);

/// State `(h,)` in every pose and its gain in log-likelihood, or `None` with one level; `inside` as above, `known`
/// `(h, k)`, and of the `means` the reading, what the signal adds, the time `(h,)`, and the variance of their noise.
#[pyfunction]
fn telegraph_levels<'py>(
    py: Python<'py>,
    inside: (PyReadonlyArray1<'py, bool>, PyReadonlyArray1<'py, f64>, f64),
    known: PyReadonlyArray2<'py, f64>,
    means: Told<'py>,
) -> PyResult<Option<(Bound<'py, PyArray1<f64>>, f64)>> {
    let inside = Inside {
        switches: samples(&inside.0),
        state: samples(&inside.1),
        gain: inside.2,
    };
    let means = Means {
        reading: samples(&means.0).into(),
        seen: samples(&means.1).into(),
        known: dmatrix(&known),
        time: samples(&means.2),
        noise: means.3,
    };
    let found = super::run(py, || telegraph::levels(&means, &inside))?;
    Ok(found.map(|(state, gain)| (state.to_pyarray(py), gain)))
}

/// Log-likelihood of values `(n,)` about two levels that switch, these levels, and whether each value `(n,)` is of the
/// second; from a guess of the levels.
#[pyfunction]
fn two_levels<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    guess: [f64; 2],
) -> PyResult<(f64, [f64; 2], Bound<'py, PyArray1<bool>>)> {
    let flat = flat1(&values);
    if flat.len() < 2 {
        return Err(PyValueError::new_err("two levels need two values"));
    }
    let found = super::run(py, || Ok(levels::two_levels(&flat, guess)))?;
    Ok((
        found.log_likelihood,
        found.levels,
        found.is_second.to_pyarray(py),
    ))
}
