//! Binding of the joints of a motion.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3};
use super::ranges::ranges_within;
use crate::aliasing;
use crate::joints::{self, Readings};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(motion_joints, module)?)
}

type Seen<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    usize,
);

/// Samples missing in moves `(m, 2)`: the samples behind which they are missing, clearest first, their numbers, gains in
/// log-likelihood over none missing, and over unrelated sides as well; and the number of joints at which as many
/// missing samples as the median loss has would be seen. `readings` has an array `(n, 3)` a sensor, in units of its
/// noise, at `time_s` `(n,)`, usually `step_s` apart: no joint is asked at a gap, or near samples `is_cut` `(n,)`.
#[pyfunction]
fn motion_joints<'py>(
    py: Python<'py>,
    readings: Vec<PyReadonlyArray2<'py, f64>>,
    moves: PyReadonlyArray2<'py, i64>,
    time_s: (PyReadonlyArray1<'py, f64>, f64),
    is_cut: Option<PyReadonlyArray1<'py, bool>>,
    most: usize,
    least: f64,
) -> PyResult<Seen<'py>> {
    let flat: Vec<_> = readings
        .iter()
        .map(|one| flat3("readings", one))
        .collect::<PyResult<_>>()?;
    let (time_s, step_s) = time_s;
    let n = time_s.len();
    let mut is_broken = is_cut.map_or_else(|| vec![false; n], |cut| flat1(&cut).into_owned());
    for k in aliasing::behind_gaps(&flat1(&time_s), step_s) {
        // A length that differs is refused below.
        if let Some(at) = is_broken.get_mut(k) {
            *at = true;
        }
    }
    let moves = ranges_within(&moves, n)?;
    let sensors: Vec<Readings<'_>> = flat.iter().map(|one| as_rows(one)).collect();
    let found = super::run(py, || {
        joints::joints(&sensors, &moves, &is_broken, most, least)
    })?;
    let losses = || found.losses.iter();
    let whole = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
    Ok((
        PyArray1::from_iter(py, losses().map(|one| whole(one.sample))),
        PyArray1::from_iter(py, losses().map(|one| whole(one.count))),
        PyArray1::from_iter(py, losses().map(|one| one.gain)),
        PyArray1::from_iter(py, losses().map(|one| one.over_unrelated)),
        found.telling,
    ))
}
