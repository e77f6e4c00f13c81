//! Bindings of the Poisson integration.

use numpy::{
    PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_vectors, flat1, flat3, matrices3, rows3, stack3, vector3};
use crate::poisson::{self, MoveRange, RateModel};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<RateNoise>()?;
    module.add_function(wrap_pyfunction!(integrate_moves, module)?)?;
    module.add_function(wrap_pyfunction!(integrate_raw_rate, module)?)?;
    Ok(())
}

/// Noise of the rate during moves, raw units, and of its timestamps.
#[pyclass(frozen, module = "trihedron._core")]
pub(super) struct RateNoise(pub(super) poisson::RateNoise);

#[pymethods]
impl RateNoise {
    #[new]
    fn new(
        density: PyReadonlyArray1<'_, f64>,
        sigma_time_s: f64,
        nominal_step_s: f64,
    ) -> PyResult<Self> {
        Ok(Self(poisson::RateNoise {
            density: vector3("density", &density)?,
            sigma_time_s,
            nominal_step_s,
        }))
    }
}

/// Ranges from an `(m, 2)` array `start, stop` and the instants `(m, 2)` between which the bias is interpolated.
pub(super) fn ranges(
    edges: &PyReadonlyArray2<'_, i64>,
    anchors_s: &PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<MoveRange>> {
    if edges.shape()[1] != 2 || anchors_s.shape() != edges.shape() {
        return Err(PyValueError::new_err(format!(
            "moves and anchors must both have shape (m, 2), got ({}, {}) and ({}, {})",
            edges.shape()[0],
            edges.shape()[1],
            anchors_s.shape()[0],
            anchors_s.shape()[1]
        )));
    }
    edges
        .as_array()
        .rows()
        .into_iter()
        .zip(anchors_s.as_array().rows())
        .map(|(edge, anchor)| {
            let index = |value: i64| {
                usize::try_from(value).map_err(|_| {
                    PyValueError::new_err(format!(
                        "a move has the edge {value}: sample numbers start at 0"
                    ))
                })
            };
            Ok(MoveRange {
                start: index(edge[0])?,
                stop: index(edge[1])?,
                anchor_before_s: anchor[0],
                anchor_after_s: anchor[1],
            })
        })
        .collect()
}

type Integrated<'py> = (
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray3<f64>>,
);

#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn integrate_moves<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    gyroscope: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    anchors_s: PyReadonlyArray2<'py, f64>,
    scale: PyReadonlyArray3<'py, f64>,
    bias_before: PyReadonlyArray2<'py, f64>,
    bias_after: PyReadonlyArray2<'py, f64>,
    rate_degree: u8,
    noise: &RateNoise,
) -> PyResult<Integrated<'py>> {
    let time_s = flat1(&time_s);
    let raw = flat3("gyroscope", &gyroscope)?;
    let ranges = ranges(&moves, &anchors_s)?;
    let scale = matrices3("scale", &scale)?;
    let before = rows3("bias_before", &bias_before)?;
    let after = rows3("bias_after", &bias_after)?;
    let m = ranges.len();
    let noise = &noise.0;
    let turns = super::run_long(py, || {
        let model = RateModel::of_degree(rate_degree)?;
        poisson::integrate_moves(
            &time_s,
            as_vectors(&raw),
            &ranges,
            model,
            &scale,
            &before,
            &after,
            noise,
        )
    })?;
    let wrt_scale: Vec<f64> = turns
        .iter()
        .flat_map(|turn| turn.wrt_scale.transpose().as_slice().to_vec())
        .collect();
    Ok((
        stack3(py, turns.iter().map(|turn| turn.rotation))?,
        wrt_scale.to_pyarray(py).reshape([m, 3, 9])?,
        stack3(py, turns.iter().map(|turn| turn.wrt_bias_before))?,
        stack3(py, turns.iter().map(|turn| turn.wrt_bias_after))?,
        stack3(py, turns.iter().map(|turn| turn.wrt_room))?,
        stack3(py, turns.iter().map(|turn| turn.cov_noise))?,
    ))
}

#[pyfunction]
fn integrate_raw_rate<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    gyroscope: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    rate_degree: u8,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Vec<f64>)> {
    let time_s = flat1(&time_s);
    let raw = flat3("gyroscope", &gyroscope)?;
    let shape = moves.shape().to_vec();
    // The raw integral does not involve the bias: any two ordered instants serve as anchors.
    let anchors_s =
        numpy::PyArray::from_vec(py, [0.0, 1.0].repeat(shape[0])).reshape([shape[0], 2])?;
    let ranges = ranges(&moves, &anchors_s.readonly())?;
    let found = super::run_long(py, || {
        let model = RateModel::of_degree(rate_degree)?;
        poisson::raw_integrals(&time_s, as_vectors(&raw), &ranges, model)
    })?;
    let angles: Vec<f64> = found
        .iter()
        .flat_map(|(angle, _)| angle.as_slice().to_vec())
        .collect();
    Ok((
        angles.to_pyarray(py).reshape([found.len(), 3])?,
        found.iter().map(|&(_, duration)| duration).collect(),
    ))
}
