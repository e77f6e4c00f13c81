//! Bindings of motion in block means.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat2, flat3, rows, vector3};
use super::ranges::ranges_within;
use crate::aliasing;
use crate::block_motion::{self, Edges, UNKNOWNS, Windows};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(ends_to_trim, module)?)?;
    module.add_function(wrap_pyfunction!(sharpened, module)?)?;
    module.add_function(wrap_pyfunction!(unresolved_variance, module)?)?;
    module.add_function(wrap_pyfunction!(share_of_gyroscope, module)?)
}

fn wrong(what: &str) -> PyErr {
    PyValueError::new_err(what.to_owned())
}

/// Blocks to trim from either end of a pose of `rows` `(n, c)` without `bumps`: `noise` `(3, c)` are the terms of the
/// variance of a mean, `rounding` `(c,)` its variance, `step_s` the length of a block, `variances` `(k, c)` those of
/// means of 1, 2, 4 ... blocks, `limit` that of the channels `is_live` `(c,)`.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "what ends are compared by, by name"
)]
fn ends_to_trim(
    py: Python<'_>,
    rows: PyReadonlyArray2<'_, f64>,
    bumps: Vec<[usize; 2]>,
    noise: PyReadonlyArray2<'_, f64>,
    rounding: PyReadonlyArray1<'_, f64>,
    step_s: f64,
    variances: PyReadonlyArray2<'_, f64>,
    is_live: PyReadonlyArray1<'_, bool>,
    limit: f64,
) -> PyResult<(usize, usize, bool)> {
    let channels = rows.shape()[1];
    let fits = channels > 0
        && noise.shape() == [3, channels]
        && variances.shape()[1] == channels
        && rounding.len() == channels
        && is_live.len() == channels;
    if !fits {
        return Err(wrong("rows (n, c) and their noise (c,) do not fit"));
    }
    let (rows, noise, variances) = (flat2(&rows), flat2(&noise), flat2(&variances));
    let (rounding, is_live) = (flat1(&rounding), flat1(&is_live));
    super::run(py, || {
        let edges = Edges {
            noise: &noise,
            rounding: &rounding,
            step_s,
            variances: &variances,
            is_live: &is_live,
            limit,
        };
        Ok(block_motion::ends_to_trim(&rows, &bumps, &edges))
    })
}

/// `readings` `(n, 3)` at the middle of their interval, with averaging over the `share` of it.
#[pyfunction]
fn sharpened<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    time_s: PyReadonlyArray1<'py, f64>,
    share: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (flat, time) = (flat3("readings", &readings)?, flat1(&time_s));
    let found = super::run(py, || Ok(aliasing::sharpened(as_rows(&flat), &time, share)))?;
    rows(py, found.as_flattened(), 3)
}

/// Variance `(m, 3)`, (raw unit · s)², of the integrals of `readings` `(n, 3)` over moves by motion faster than the
/// samples; `ranges` of moves and of poses, the LSB `quantum` `(3,)`.
#[pyfunction]
fn unresolved_variance<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    ranges: (PyReadonlyArray2<'py, i64>, PyReadonlyArray2<'py, i64>),
    time_s: PyReadonlyArray1<'py, f64>,
    step_s: f64,
    quantum: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (flat, time) = (flat3("readings", &readings)?, flat1(&time_s));
    let within = |one| ranges_within(one, flat.len() / 3);
    let (moves, poses) = (within(&ranges.0)?, within(&ranges.1)?);
    let quantum = vector3("quantum", &quantum)?.into();
    let found = super::run(py, || {
        let (spans, when) = ((moves.as_slice(), poses.as_slice()), (&*time, step_s));
        Ok(aliasing::unresolved(as_rows(&flat), spans, when, quantum))
    })?;
    rows(py, found.as_flattened(), 3)
}

/// Coefficients `(12,)` by which the gyro best predicts the changes of windows, in units of `scale`.
#[pyfunction]
fn share_of_gyroscope(
    py: Python<'_>,
    change: PyReadonlyArray2<'_, f64>,
    mean: PyReadonlyArray2<'_, f64>,
    rate: PyReadonlyArray2<'_, f64>,
    scale: [f64; 3],
) -> PyResult<[f64; UNKNOWNS]> {
    if mean.shape()[0] != change.shape()[0] || rate.shape()[0] != change.shape()[0] {
        return Err(wrong("change, mean and rate are of the same windows"));
    }
    let (change, mean, rate) = (
        flat3("change", &change)?,
        flat3("mean", &mean)?,
        flat3("rate", &rate)?,
    );
    let windows = Windows {
        change: as_rows(&change),
        mean: as_rows(&mean),
        rate: as_rows(&rate),
    };
    super::run(py, || Ok(windows.share(scale)))
}
