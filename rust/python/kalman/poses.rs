//! Arrays of readings, references and times as poses.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::super::rotation::rows3;
use crate::kalman::axis::Pose;

pub(super) fn poses(
    readings: &PyReadonlyArray1<'_, f64>,
    references: &PyReadonlyArray2<'_, f64>,
    start_s: &PyReadonlyArray1<'_, f64>,
    hold_s: &PyReadonlyArray1<'_, f64>,
    extra_variance: &PyReadonlyArray1<'_, f64>,
) -> PyResult<Vec<Pose>> {
    let rows = rows3("references", references)?;
    let n = rows.len();
    for (name, array) in [
        ("readings", readings),
        ("start_s", start_s),
        ("hold_s", hold_s),
        ("extra_variance", extra_variance),
    ] {
        if array.len() != n {
            return Err(PyValueError::new_err(format!(
                "{name} must have shape ({n},) like the references, got ({},)",
                array.len()
            )));
        }
    }
    let (z, t, hold, extra) = (
        readings.as_array(),
        start_s.as_array(),
        hold_s.as_array(),
        extra_variance.as_array(),
    );
    Ok((0..n)
        .map(|i| Pose {
            reading: z[i],
            reference: rows[i].into(),
            start: t[i],
            hold: hold[i],
            extra_variance: extra[i],
        })
        .collect())
}
