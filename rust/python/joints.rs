//! Binding of the joints of a motion.

use numpy::{
    PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{flat1, flat2};
use super::ranges::ranges_within;
use crate::joints::{self, Contrasts, FREE, HALF, Limits};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(motion_joints, module)?)
}

type Flags<'py> = Bound<'py, PyArray1<bool>>;

/// Flags `(k,)` of the sample intervals of moves `(m, 2)`, one after the other: a lost sample is detectable, one sample
/// too long, one too short. Readings `(n, c)` have the `noise` `(c,)`; `left` is the largest misfit that may remain, in
/// ordinary misfits, and at a short interval as a part of the misfit before.
#[pyfunction]
#[pyo3(signature = (readings, noise, moves, contrasts, *, nearby, sharp, part, whole, left))]
#[expect(clippy::too_many_arguments, reason = "limits by name")]
fn motion_joints<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    noise: PyReadonlyArray1<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    contrasts: PyReadonlyArray3<'py, f64>,
    nearby: usize,
    sharp: f64,
    part: (f64, f64),
    whole: (f64, f64),
    left: (f64, f64),
) -> PyResult<(Flags<'py>, Flags<'py>, Flags<'py>)> {
    if contrasts.shape() != [3, FREE, 2 * HALF] {
        return Err(PyValueError::new_err(format!(
            "contrasts must have shape (3, {FREE}, {}), got {:?}",
            2 * HALF,
            contrasts.shape()
        )));
    }
    if nearby.is_multiple_of(2) {
        return Err(PyValueError::new_err(format!(
            "nearby must be odd, got {nearby}"
        )));
    }
    let weights = contrasts.as_array();
    let of = |c: usize| -> Contrasts {
        std::array::from_fn(|i| std::array::from_fn(|j| weights[[c, i, j]]))
    };
    let contrasts = [of(0), of(1), of(2)];
    if readings.shape()[1] != noise.len() {
        return Err(PyValueError::new_err(
            "every channel of the readings has a noise",
        ));
    }
    let moves = ranges_within(&moves, readings.shape()[0])?;
    let (readings, noise) = (flat2(&readings), flat1(&noise));
    let limits = Limits {
        nearby,
        sharp,
        part,
        whole,
        left: left.0,
        mirrored: left.1,
    };
    let found = super::run(py, || {
        joints::joints_of_moves(&readings, &noise, &moves, &contrasts, &limits)
    })?;
    Ok((
        PyArray1::from_vec(py, found.is_sharp),
        PyArray1::from_vec(py, found.is_long),
        PyArray1::from_vec(py, found.is_short),
    ))
}
