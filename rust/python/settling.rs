//! Binding of supports that settle.

use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3, matrix3};
use super::ranges::ranges_within;
use crate::settling::{self, Poses};
use crate::time_errors;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(settling_of_poses, module)?)?;
    module.add_function(wrap_pyfunction!(common_time_variance, module)?)
}

type Matrix<'py> = PyReadonlyArray2<'py, f64>;

/// Score of settling beside scatter, its rate at the start of poses, rad/s, its time constant, s, and the score of a bias
/// that settles; `None` with fewer poses than `fewest`. Gyro first: `readings` `(n, 3)`, `scale` `(3, 3)`, `noise` `(h, 3)`; `up` `(h, 3)`, `spans`
/// `(h, 2)`.
#[pyfunction]
#[pyo3(signature = (readings, scale, noise, up, spans, *, gravity_m_s2, step_s, fewest))]
#[expect(
    clippy::too_many_arguments,
    reason = "two sensors and their poses by name"
)]
fn settling_of_poses(
    py: Python<'_>,
    readings: [Matrix<'_>; 2],
    scale: [Matrix<'_>; 2],
    noise: [Matrix<'_>; 2],
    up: Matrix<'_>,
    spans: PyReadonlyArray2<'_, i64>,
    gravity_m_s2: f64,
    step_s: f64,
    fewest: usize,
) -> PyResult<Option<(f64, f64, f64, f64)>> {
    let [rate, force] = [flat3("rate", &readings[0])?, flat3("force", &readings[1])?];
    let [of_rate, of_force] = [flat3("noise", &noise[0])?, flat3("noise", &noise[1])?];
    let up = flat3("up", &up)?;
    let scale = [matrix3("S", &scale[0])?, matrix3("S", &scale[1])?];
    let spans = ranges_within(&spans, rate.len().min(force.len()) / 3)?;
    let found = super::run(py, || {
        let poses = Poses {
            readings: [as_rows(&rate), as_rows(&force)],
            scale,
            noise: [as_rows(&of_rate), as_rows(&of_force)],
            up: as_rows(&up),
            spans: &spans,
            gravity: gravity_m_s2,
            step: step_s,
        };
        settling::settling(&poses, fewest)
    })?;
    Ok(found.map(|one| (one.score, one.rate, one.tau, one.of_bias)))
}

/// Variance of the sampling instants about `time_s` `(n,)` [s²], its standard error, and the number of samples that
/// tell, by the `readings` `(n, 3)` of two sensors in units of their noise, inside `moves` `(m, 2)`.
#[pyfunction]
fn common_time_variance(
    py: Python<'_>,
    time_s: PyReadonlyArray1<'_, f64>,
    step_s: f64,
    readings: [Matrix<'_>; 2],
    is_clipped: PyReadonlyArray1<'_, bool>,
    moves: PyReadonlyArray2<'_, i64>,
) -> PyResult<(f64, f64, usize)> {
    let (time, is_clipped) = (flat1(&time_s), flat1(&is_clipped));
    let [one, other] = [
        flat3("readings", &readings[0])?,
        flat3("readings", &readings[1])?,
    ];
    let n = time
        .len()
        .min(is_clipped.len())
        .min(one.len() / 3)
        .min(other.len() / 3);
    let moves = ranges_within(&moves, n)?;
    super::run(py, || {
        let sensors = [as_rows(&one), as_rows(&other)];
        Ok(time_errors::common_variance(
            (&time, step_s),
            sensors,
            &is_clipped,
            &moves,
        ))
    })
}
