//! Binding of the arm from the centre of rotation.

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, ToPyArray};
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3, matrices3, of3};
use super::ranges::ranges_within;
use crate::lever_arm::{self, Motion};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(lever_arm_of_moves, module)?)
}

type Found<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    f64,
    [f64; 2],
    usize,
);

/// The arm `(3,)`, its covariance `(3, 3)`, Hotelling's p, mean squares of force without gravity before and after, in
/// moves held out, and the number of moves; `None` where they do not determine it. `motion` is time `(n,)`, rate, force
/// and minus gravity `(n, 3)`, `attitude` `(n, 3, 3)` the rotation since each of the `moves` `(m, 2)` began.
#[pyfunction]
#[pyo3(signature = (motion, attitude, moves, *, rate_hz, fewest))]
fn lever_arm_of_moves<'py>(
    py: Python<'py>,
    motion: (
        PyReadonlyArray1<'py, f64>,
        PyReadonlyArray2<'py, f64>,
        PyReadonlyArray2<'py, f64>,
        PyReadonlyArray2<'py, f64>,
    ),
    attitude: PyReadonlyArray3<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    rate_hz: f64,
    fewest: usize,
) -> PyResult<Option<Found<'py>>> {
    let time = flat1(&motion.0);
    let rate = flat3("rate", &motion.1)?;
    let force = flat3("force", &motion.2)?;
    let gravity = flat3("gravity", &motion.3)?;
    let attitude = matrices3("attitude", &attitude)?;
    let moves = ranges_within(&moves, time.len())?;
    let found = super::run(py, || {
        let motion = Motion {
            time: &time,
            rate: as_rows(&rate),
            force: as_rows(&force),
            gravity: as_rows(&gravity),
            attitude: &attitude,
            moves: &moves,
            rate_hz,
        };
        lever_arm::arm(&motion, fewest)
    })?;
    let Some(one) = found else { return Ok(None) };
    let value = one.value.as_slice().to_pyarray(py);
    let covariance = of3(py, &one.covariance)?;
    Ok(Some((
        value,
        covariance,
        one.p_value,
        one.mean_squares,
        one.n_moves,
    )))
}
