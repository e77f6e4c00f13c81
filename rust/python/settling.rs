//! Binding of supports that settle.

use nalgebra::Vector3;
use numpy::{PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3, matrix3};
use super::ranges::ranges_within;
use crate::settling::{self, PoseMotion, Poses};
use crate::slow_noise::quiet_errors;
use crate::time_errors;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(settling_of_poses, module)?)?;
    module.add_function(wrap_pyfunction!(common_time_variance, module)?)
}

type Matrix<'py> = PyReadonlyArray2<'py, f64>;
/// Of every pose, at both ends.
type Ends<'py> = Bound<'py, PyArray3<f64>>;
type Moving<'py> = (f64, f64, Ends<'py>, Ends<'py>, Bound<'py, PyArray2<f64>>);

/// Score of settling beside scatter, the score of a bias that settles, and of every pose: mean rate by motion with its
/// variance `(h, 2, 3)`, change of the vertical from the mean to both edges `(h, 2, 3)`, variance of that rotation
/// `(h, 2)`. `None` with fewer poses than `fewest`. Gyro first: `readings` `(n, 3)`, `scale` `(3, 3)`, `noise`
/// `(h, 3)` white, to which the slow noise of quiet poses is added; `up` `(h, 3)`; `spans` `(h, 2)` of the poses, then from the end of the move before to the beginning of
/// the next.
#[pyfunction]
#[pyo3(signature = (readings, scale, noise, up, spans, *, gravity_m_s2, step_s, fewest, certain))]
#[expect(
    clippy::too_many_arguments,
    reason = "two sensors and their poses by name"
)]
fn settling_of_poses<'py>(
    py: Python<'py>,
    readings: [Matrix<'py>; 2],
    scale: [Matrix<'py>; 2],
    noise: [Matrix<'py>; 2],
    up: Matrix<'py>,
    spans: [PyReadonlyArray2<'_, i64>; 2],
    gravity_m_s2: f64,
    step_s: f64,
    fewest: usize,
    certain: f64,
) -> PyResult<Option<Moving<'py>>> {
    let [rate, force] = [flat3("rate", &readings[0])?, flat3("force", &readings[1])?];
    let [of_rate, of_force] = [flat3("noise", &noise[0])?, flat3("noise", &noise[1])?];
    let up = flat3("up", &up)?;
    let scale = [matrix3("S", &scale[0])?, matrix3("S", &scale[1])?];
    let n = rate.len().min(force.len()) / 3;
    let [spans, edges] = [ranges_within(&spans[0], n)?, ranges_within(&spans[1], n)?];
    if [&of_rate, &of_force]
        .iter()
        .any(|of| of.len() != 3 * spans.len())
    {
        return Err(PyValueError::new_err("every pose has noise"));
    }
    let found = super::run(py, || {
        let readings = [as_rows(&rate), as_rows(&force)];
        let noise = [
            quiet_errors(readings[0], &spans, as_rows(&of_rate)),
            quiet_errors(readings[1], &spans, as_rows(&of_force)),
        ];
        let poses = Poses {
            readings,
            scale,
            noise: [&noise[0], &noise[1]],
            up: as_rows(&up),
            spans: &spans,
            edges: &edges,
            gravity: gravity_m_s2,
            step: step_s,
        };
        settling::settling(&poses, fewest, certain)
    })?;
    let Some(found) = found else { return Ok(None) };
    let of_poses = |of: fn(&PoseMotion) -> [Vector3<f64>; 2]| {
        let flat: Vec<f64> = found
            .motion
            .iter()
            .flat_map(|one| of(one).into_iter().flat_map(<[f64; 3]>::from))
            .collect();
        flat.to_pyarray(py).reshape([found.motion.len(), 2, 3])
    };
    let variance: Vec<f64> = found
        .motion
        .iter()
        .flat_map(|one| one.edge_variance)
        .collect();
    Ok(Some((
        found.score,
        found.of_bias,
        of_poses(|one| one.rate)?,
        of_poses(|one| one.leans)?,
        variance.to_pyarray(py).reshape([found.motion.len(), 2])?,
    )))
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
