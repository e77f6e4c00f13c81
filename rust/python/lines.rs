//! Bindings of spectral lines inside poses.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat2, flat3, rows, vector3};
use super::ranges::ranges_within;
use crate::lines::{pose, session};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(poses_beside_lines, module)?)?;
    module.add_function(wrap_pyfunction!(session_lines, module)?)
}

type Rows<'py> = Bound<'py, PyArray2<f64>>;

/// Means, their standard errors and the variances of the lines' integrals, (reading · samples)², `(h, 3)` each, of the
/// poses `spans` `(h, 2)` of `readings` `(n, 3)`; NaN on axes without a line, and of poses with fewer than `fewest`
/// readings or a missing one. `sigma` `(3,)` is the noise of a quiet pose.
#[pyfunction]
fn poses_beside_lines<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    spans: PyReadonlyArray2<'py, i64>,
    sigma: PyReadonlyArray1<'py, f64>,
    fewest: usize,
) -> PyResult<(Rows<'py>, Rows<'py>, Rows<'py>)> {
    let flat = flat3("readings", &readings)?;
    let (spans, sigma) = (
        ranges_within(&spans, readings.shape()[0])?,
        vector3("sigma", &sigma)?.into(),
    );
    let of_pose = |&[start, stop]: &[usize; 2]| {
        let part = &as_rows(&flat)[start..stop];
        let is_whole = part.len() >= fewest && part.as_flattened().iter().all(|v| v.is_finite());
        is_whole.then(|| pose::beside_lines(part, sigma)).flatten()
    };
    let found: Vec<_> = super::run(py, || Ok(spans.iter().map(of_pose).collect()))?;
    let each = |value: fn(&pose::Beside) -> [f64; 3]| {
        let rows_of = |one: &Option<pose::Beside>| {
            let known = |b: &pose::Beside, axis: usize| b.has_line[axis].then(|| value(b)[axis]);
            [0, 1, 2].map(|axis| {
                one.as_ref()
                    .and_then(|b| known(b, axis))
                    .unwrap_or(f64::NAN)
            })
        };
        let flat: Vec<[f64; 3]> = found.iter().map(rows_of).collect();
        rows(py, flat.as_flattened(), 3)
    };
    Ok((
        each(|one| one.mean)?,
        each(|one| one.error)?,
        each(|one| one.swing)?,
    ))
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
