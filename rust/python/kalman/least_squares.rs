//! Baselines of the filter: least squares, recursive and batch, ordinary and generalised.

use numpy::{
    PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::super::{run, run_long};
use super::{Array2, AxisKalmanModel, KalmanPoses, KalmanStart, four, rows4};
use crate::kalman::axis::Pose;
use crate::kalman::least_squares;
use crate::python::arrays::{matrix, rows3};

/// Covariance of the readings under the noise model.
#[pyfunction]
pub(super) fn kalman_noise_covariance<'py>(
    py: Python<'py>,
    model: &AxisKalmanModel,
    start_s: PyReadonlyArray1<'py, f64>,
    pose_s: PyReadonlyArray1<'py, f64>,
    extra_variance: PyReadonlyArray1<'py, f64>,
) -> PyResult<Array2<'py>> {
    if pose_s.len() != start_s.len() || extra_variance.len() != start_s.len() {
        return Err(PyValueError::new_err(
            "start_s, pose_s and extra_variance must have the same length",
        ));
    }
    let (t, pose_s, extra) = (
        start_s.as_array(),
        pose_s.as_array(),
        extra_variance.as_array(),
    );
    let poses: Vec<Pose> = (0..t.len())
        .map(|i| Pose {
            reading: 0.0,
            reference: [0.0; 3],
            start: t[i],
            pose_s: pose_s[i],
            extra_variance: extra[i],
        })
        .collect();
    let model = &model.inner;
    let c = run_long(py, || least_squares::noise_covariance(model, &poses))?;
    matrix(py, &c)
}

type Recursion = (Py<PyArray2<f64>>, Py<PyArray2<f64>>);

/// Recursive ordinary least squares: constants, sigma for white noise.
#[pyfunction]
pub(super) fn kalman_least_squares(
    py: Python<'_>,
    readings: PyReadonlyArray1<'_, f64>,
    references: PyReadonlyArray2<'_, f64>,
    variance: f64,
    prior_mean: PyReadonlyArray1<'_, f64>,
    prior_sigma: PyReadonlyArray1<'_, f64>,
) -> PyResult<Recursion> {
    let rows = rows3("references", &references)?;
    if rows.len() != readings.len() {
        return Err(PyValueError::new_err(format!(
            "readings must have shape ({},) like the references, got ({},)",
            rows.len(),
            readings.len()
        )));
    }
    let poses: Vec<Pose> = rows
        .iter()
        .zip(readings.as_array())
        .map(|(f, z)| Pose {
            reading: *z,
            reference: (*f).into(),
            start: 0.0,
            pose_s: 1.0,
            extra_variance: 0.0,
        })
        .collect();
    let (mean, sigma) = (
        four("prior_mean", &prior_mean)?,
        four("prior_sigma", &prior_sigma)?,
    );
    let out = run(py, || {
        Ok(least_squares::recursive(&poses, variance, &mean, &sigma))
    })?;
    Ok((rows4(py, out.constants)?, rows4(py, out.sigma)?))
}

type Generalised = (
    Py<PyArray1<f64>>,
    Py<PyArray2<f64>>,
    Py<PyArray1<f64>>,
    Py<PyArray2<f64>>,
    Py<PyArray2<f64>>,
    Py<PyArray2<f64>>,
);

/// Batch ordinary (constants, covariance), batch generalised (constants, covariance), recursive generalised.
#[pyfunction]
pub(super) fn kalman_generalised_least_squares(
    py: Python<'_>,
    model: &AxisKalmanModel,
    start: &KalmanStart,
    poses: &KalmanPoses,
) -> PyResult<Generalised> {
    let (model, prior, poses) = (&model.inner, &start.prior, &poses.poses);
    let (ordinary, generalised, recursion) = run(py, || {
        let noise = least_squares::noise_covariance(model, poses)?;
        let ordinary = least_squares::ordinary(poses, &noise)?;
        let (batch, recursion) =
            least_squares::generalised(poses, noise, &prior.mean, &prior.sigma)?;
        Ok((ordinary, batch, recursion))
    })?;
    Ok((
        ordinary.constants.to_pyarray(py).unbind(),
        matrix(py, &ordinary.covariance)?.unbind(),
        generalised.constants.to_pyarray(py).unbind(),
        matrix(py, &generalised.covariance)?.unbind(),
        rows4(py, recursion.constants)?,
        rows4(py, recursion.sigma)?,
    ))
}
