//! Bindings of spectral lines inside poses.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat2, flat3, vector3};
use crate::lines::{pose, session};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(pose_beside_lines, module)?)?;
    module.add_function(wrap_pyfunction!(session_lines, module)?)
}

type Beside = ([f64; 3], [f64; 3], [f64; 3], [bool; 3]);

/// Mean, its standard error, the variance of the lines' integral, (reading · samples)², and the axes with a line, of a
/// pose's `readings` `(n, 3)`; `None` without a line. `sigma` `(3,)` is the noise of a quiet pose.
#[pyfunction]
fn pose_beside_lines(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    sigma: PyReadonlyArray1<'_, f64>,
) -> PyResult<Option<Beside>> {
    let flat = flat3("readings", &readings)?;
    let sigma = vector3("sigma", &sigma)?.into();
    let found = super::run(py, || Ok(pose::beside_lines(as_rows(&flat), sigma)))?;
    Ok(found.map(|one| (one.mean, one.error, one.swing, one.has_line)))
}

type Line = (usize, [f64; 3], [f64; 2], f64, f64, [f64; 2]);

/// Lines of the stretches, `times` `(n,)` and `readings` `(n, channels)` each: channel; frequency, its standard error
/// and the resolution of a pose; amplitude and its standard error; p-value; noise; held-out rms without and with it.
#[pyfunction]
fn session_lines(
    py: Python<'_>,
    times: Vec<PyReadonlyArray1<'_, f64>>,
    readings: Vec<PyReadonlyArray2<'_, f64>>,
    rate_hz: f64,
    p_limit: f64,
) -> PyResult<Vec<Line>> {
    let channels = readings.first().map_or(0, |one| one.shape()[1]);
    let is_whole = |(t, x): (&PyReadonlyArray1<'_, f64>, &PyReadonlyArray2<'_, f64>)| {
        x.shape() == [t.shape()[0], channels]
    };
    if times.len() != readings.len() || !times.iter().zip(&readings).all(is_whole) {
        return Err(PyValueError::new_err(
            "every stretch has times (n,) and readings (n, channels)",
        ));
    }
    let (t, x): (Vec<_>, Vec<_>) = (
        times.iter().map(flat1).collect(),
        readings.iter().map(flat2).collect(),
    );
    let stretches: Vec<(&[f64], &[f64])> = t.iter().zip(&x).map(|(t, x)| (&**t, &**x)).collect();
    let found = super::run(py, || {
        Ok(session::lines(&stretches, channels, rate_hz, p_limit))
    })?;
    let told = |one: session::Line| {
        (
            one.channel,
            one.frequency,
            one.amplitude,
            one.p_value,
            one.noise,
            one.rms,
        )
    };
    Ok(found.into_iter().map(told).collect())
}
