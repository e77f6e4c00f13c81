//! Binding of sinusoids in a series.

use numpy::{PyArray1, PyReadonlyArray1, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::flat1;
use crate::sinusoid;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(sinusoid_power, module)?)?;
    Ok(())
}

/// Sum of squares `(count,)` of `readings` `(n,)` explained by a sinusoid, at frequencies from `start_hz` on.
#[pyfunction]
#[pyo3(signature = (time_s, readings, *, start_hz, step_hz, count))]
fn sinusoid_power<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    readings: PyReadonlyArray1<'py, f64>,
    start_hz: f64,
    step_hz: f64,
    count: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (time, x) = (flat1(&time_s), flat1(&readings));
    if time.len() != x.len() || time.is_empty() {
        return Err(PyValueError::new_err(format!(
            "{} readings need as many times, at least one, got {}",
            x.len(),
            time.len()
        )));
    }
    let out = super::run(py, || {
        Ok(sinusoid::explained(&time, &x, start_hz, step_hz, count))
    })?;
    Ok(out.to_pyarray(py))
}
