//! Poisson integration across the seam.

use nalgebra::{Matrix3, Vector3};
use numpy::{
    PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::lent::{as_vectors, flat1, flat3};
use super::rotation::rows3;
use crate::error::Result as KernelResult;
use crate::poisson::{self, MoveRange, RateModel, RateNoise};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(integrate_moves, module)?)?;
    module.add_function(wrap_pyfunction!(integrate_raw_rate, module)?)?;
    Ok(())
}

/// Owned 3-vector of a `(3,)` array.
pub(crate) fn vector3(name: &str, array: &PyReadonlyArray1<'_, f64>) -> PyResult<Vector3<f64>> {
    let view = array.as_array();
    if view.len() != 3 {
        return Err(PyValueError::new_err(format!(
            "{name} must have shape (3,), got ({},)",
            view.len()
        )));
    }
    Ok(Vector3::new(view[0], view[1], view[2]))
}

/// Owned matrix of a `(3, 3)` array.
pub(crate) fn matrix3(name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Matrix3<f64>> {
    if array.shape() != [3, 3] {
        return Err(PyValueError::new_err(format!(
            "{name} must have shape (3, 3), got ({}, {})",
            array.shape()[0],
            array.shape()[1]
        )));
    }
    let view = array.as_array();
    Ok(Matrix3::from_fn(|i, j| view[[i, j]]))
}

/// Owned samples of an `(n,)` array of any stride.
pub(crate) fn samples<T: numpy::Element + Copy>(array: &PyReadonlyArray1<'_, T>) -> Vec<T> {
    array.as_array().iter().copied().collect()
}

/// Ranges from an `(m, 2)` array `start, stop` and the instants `(m, 2)` between which the bias runs.
pub(crate) fn ranges(
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
);

#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn integrate_moves<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    gyroscope: PyReadonlyArray2<'py, f64>,
    moves: PyReadonlyArray2<'py, i64>,
    anchors_s: PyReadonlyArray2<'py, f64>,
    scale: PyReadonlyArray2<'py, f64>,
    bias_before: PyReadonlyArray2<'py, f64>,
    bias_after: PyReadonlyArray2<'py, f64>,
    rate_degree: u8,
    noise_density: PyReadonlyArray1<'py, f64>,
    sigma_time_s: f64,
    nominal_step_s: f64,
) -> PyResult<Integrated<'py>> {
    let time_s = flat1(&time_s);
    let raw = flat3("gyroscope", &gyroscope)?;
    let ranges = ranges(&moves, &anchors_s)?;
    let scale = matrix3("scale", &scale)?;
    let before = rows3("bias_before", &bias_before)?;
    let after = rows3("bias_after", &bias_after)?;
    let m = ranges.len();
    let noise = RateNoise {
        density: vector3("noise_density", &noise_density)?,
        sigma_time_s,
        nominal_step_s,
    };
    let turns = super::run_long(py, || {
        let model = RateModel::of_degree(rate_degree)?;
        poisson::integrate_once(
            &time_s,
            as_vectors(&raw),
            &ranges,
            model,
            &scale,
            &before,
            &after,
            &noise,
        )
    })?;
    let stack = |matrices: Vec<Matrix3<f64>>| {
        let flat: Vec<f64> = matrices
            .iter()
            .flat_map(|matrix| matrix.transpose().as_slice().to_vec())
            .collect();
        flat.to_pyarray(py).reshape([m, 3, 3])
    };
    let wrt_scale: Vec<f64> = turns
        .iter()
        .flat_map(|turn| turn.wrt_scale.transpose().as_slice().to_vec())
        .collect();
    Ok((
        stack(turns.iter().map(|turn| turn.rotation).collect())?,
        wrt_scale.to_pyarray(py).reshape([m, 3, 9])?,
        stack(turns.iter().map(|turn| turn.wrt_bias_before).collect())?,
        stack(turns.iter().map(|turn| turn.wrt_bias_after).collect())?,
        stack(turns.iter().map(|turn| turn.cov_noise).collect())?,
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
    let prepared = super::run_long(py, || {
        let model = RateModel::of_degree(rate_degree)?;
        ranges
            .par_iter()
            .map(|range| {
                let one = poisson::prepare(&time_s, as_vectors(&raw), None, range, model)?;
                Ok((one.raw_angle(), one.duration_s()))
            })
            .collect::<KernelResult<Vec<_>>>()
    })?;
    let angles: Vec<f64> = prepared
        .iter()
        .flat_map(|(angle, _)| angle.as_slice().to_vec())
        .collect();
    Ok((
        angles.to_pyarray(py).reshape([prepared.len(), 3])?,
        prepared.iter().map(|&(_, duration)| duration).collect(),
    ))
}
