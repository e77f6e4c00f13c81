//! Bindings of the noise floor of a log.

use numpy::{
    PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{flat1, flat2, rows};
use crate::noise_floor::{self as kernel, Blocks, Search, Tails};
use crate::running;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(noise_floor, module)?)?;
    module.add_function(wrap_pyfunction!(still_limit, module)?)?;
    module.add_function(wrap_pyfunction!(rolling_mean, module)?)
}

type FloorArrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    [f64; 2],
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// Activities `(m,)` inside blocks and between them, their limits, quiet windows `(m,)`, and the floors `(c,)`, of
/// blocks `(m, c)` of `length` readings: `search` is blocks per window, windows of the seed, median of a window's
/// variance over the variance; `tails` the part of windows a deviation below the median, and the limit above.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "blocks by name")]
fn noise_floor<'py>(
    py: Python<'py>,
    mean: PyReadonlyArray2<'py, f64>,
    variance: PyReadonlyArray2<'py, f64>,
    is_valid: PyReadonlyArray1<'py, bool>,
    tells: PyReadonlyArray2<'py, bool>,
    rounding: PyReadonlyArray1<'py, f64>,
    length: usize,
    search: (usize, usize, f64),
    tails: (f64, f64),
) -> PyResult<FloorArrays<'py>> {
    let (m, channels) = (mean.shape()[0], mean.shape()[1]);
    let fits = variance.shape() == [m, channels]
        && tells.shape() == [m, channels]
        && is_valid.len() == m
        && rounding.len() == channels;
    if !fits || length == 0 {
        return Err(PyValueError::new_err(
            "blocks (m, c), their validity (m,) and rounding (c,) do not fit",
        ));
    }
    let (mean, variance, tells) = (flat2(&mean), flat2(&variance), flat2(&tells));
    let (is_valid, rounding) = (flat1(&is_valid), flat1(&rounding));
    let floor = super::run(py, || {
        let blocks = Blocks {
            channels,
            length,
            mean: &mean,
            variance: &variance,
            is_valid: &is_valid,
            tells: &tells,
            rounding: &rounding,
        };
        let search = Search {
            width: search.0,
            seed: search.1,
            median_ratio: search.2,
            tails: Tails {
                lower: tails.0,
                deviations: tails.1,
            },
        };
        Ok(kernel::noise_floor(&blocks, &search))
    })?;
    Ok((
        PyArray1::from_vec(py, floor.fast),
        PyArray1::from_vec(py, floor.slow),
        floor.limits,
        floor.is_quiet.to_pyarray(py),
        PyArray1::from_vec(py, floor.white),
        PyArray1::from_vec(py, floor.wander),
    ))
}

/// Highest activity of a static sensor, from the activities `(k,)` of static windows.
#[pyfunction]
fn still_limit(
    py: Python<'_>,
    activity: PyReadonlyArray1<'_, f64>,
    freedom: usize,
    tails: (f64, f64),
) -> PyResult<f64> {
    let mut activity = flat1(&activity).into_owned();
    let (lower, deviations) = tails;
    super::run(py, || {
        let tails = Tails { lower, deviations };
        Ok(kernel::still_limit(&mut activity, freedom, &tails))
    })
}

/// `(m, c)` mean over `width` rows centred on each; at the ends the nearest whole window.
#[pyfunction]
fn rolling_mean<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let channels = values.shape()[1];
    if channels == 0 || width == 0 {
        return Err(PyValueError::new_err(
            "values (m, c) need a column, and a window a row",
        ));
    }
    let flat = flat2(&values);
    let found = super::run(py, || Ok(running::rolling_mean(&flat, channels, width)))?;
    rows(py, &found, channels)
}
