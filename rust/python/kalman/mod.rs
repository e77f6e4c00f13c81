//! Bindings of the Kalman filter.

mod least_squares;
mod poses;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use self::poses::KalmanPoses;
use crate::kalman::axis::{self, N_CONSTANTS, Prior};
use crate::kalman::shaping::{NoiseTerms, ShapingModel};
use crate::kalman::smoother;
use crate::python::arrays::matrix;

type Array2<'py> = Bound<'py, PyArray2<f64>>;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<AxisKalmanModel>()?;
    module.add_class::<KalmanStart>()?;
    module.add_class::<KalmanPoses>()?;
    module.add_function(wrap_pyfunction!(kalman_track, module)?)?;
    module.add_function(wrap_pyfunction!(kalman_smooth, module)?)?;
    module.add_function(wrap_pyfunction!(
        least_squares::kalman_noise_covariance,
        module
    )?)?;
    module.add_function(wrap_pyfunction!(
        least_squares::kalman_least_squares,
        module
    )?)?;
    module.add_function(wrap_pyfunction!(
        least_squares::kalman_generalised_least_squares,
        module
    )?)?;
    Ok(())
}

fn four(name: &str, array: &PyReadonlyArray1<'_, f64>) -> PyResult<[f64; N_CONSTANTS]> {
    let values: Vec<f64> = array.as_array().iter().copied().collect();
    values.try_into().map_err(|values: Vec<f64>| {
        PyValueError::new_err(format!(
            "{name} must have shape (4,), got ({},)",
            values.len()
        ))
    })
}

fn rows4(py: Python<'_>, rows: Vec<[f64; N_CONSTANTS]>) -> PyResult<Py<PyArray2<f64>>> {
    let n = rows.len();
    Ok(rows
        .into_flattened()
        .into_pyarray(py)
        .reshape([n, N_CONSTANTS])?
        .unbind())
}

/// Noise of one axis, and its representation by states.
#[pyclass(module = "trihedron._core", frozen)]
pub(super) struct AxisKalmanModel {
    pub(super) inner: ShapingModel,
}

#[pymethods]
impl AxisKalmanModel {
    #[new]
    #[pyo3(signature = (*, quantisation, white, flicker, walk, ramp, gauss_markov, gauss_markov_rate, resolution, dither, flicker_rates, ramp_frequency, ramp_damping, averages))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        quantisation: f64,
        white: f64,
        flicker: f64,
        walk: f64,
        ramp: f64,
        gauss_markov: f64,
        gauss_markov_rate: f64,
        resolution: f64,
        dither: f64,
        flicker_rates: Vec<f64>,
        ramp_frequency: f64,
        ramp_damping: f64,
        averages: bool,
    ) -> PyResult<Self> {
        let inner = ShapingModel {
            terms: NoiseTerms {
                quantisation,
                white,
                flicker,
                walk,
                ramp,
                gauss_markov,
                gauss_markov_rate,
                resolution,
            },
            flicker_rates,
            ramp_frequency,
            ramp_damping,
            dither,
            averages,
        };
        inner
            .system()
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(Self { inner })
    }

    /// Variance of a reading over a pose that is white from pose to pose.
    fn white_variance(&self, pose_s: f64) -> f64 {
        self.inner.white_variance(pose_s)
    }

    /// Variance of a reading without the slow terms.
    fn fast_variance(&self, pose_s: f64) -> f64 {
        self.inner.fast_variance(pose_s)
    }
}

/// Prior of a filter: constants of one axis, their standard deviations, intensities of their random walks.
#[pyclass(module = "trihedron._core", frozen)]
pub(super) struct KalmanStart {
    pub(super) prior: Prior,
}

#[pymethods]
impl KalmanStart {
    #[new]
    fn new(
        mean: PyReadonlyArray1<'_, f64>,
        sigma: PyReadonlyArray1<'_, f64>,
        walk: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        Ok(Self {
            prior: Prior {
                mean: four("mean", &mean)?,
                sigma: four("sigma", &sigma)?,
                walk: four("walk", &walk)?,
            },
        })
    }
}

type Track = (
    Py<PyArray2<f64>>,
    Py<PyArray2<f64>>,
    Py<PyArray2<f64>>,
    Py<PyArray1<f64>>,
    Py<PyArray1<f64>>,
    Py<PyArray1<f64>>,
    Py<PyArray1<f64>>,
);

/// Constants, sigma, final covariance, innovations, their variances, drift, its sigma.
#[pyfunction]
fn kalman_track(
    py: Python<'_>,
    model: &AxisKalmanModel,
    start: &KalmanStart,
    poses: &KalmanPoses,
) -> PyResult<Track> {
    let (model, prior, poses) = (&model.inner, &start.prior, &poses.poses);
    let out = super::run_long(py, || axis::track(model, prior, poses))?;
    let column = |values: Vec<f64>| values.into_pyarray(py).unbind();
    Ok((
        rows4(py, out.constants)?,
        rows4(py, out.sigma)?,
        matrix(py, &out.covariance)?.unbind(),
        column(out.innovation),
        column(out.innovation_variance),
        column(out.drift),
        column(out.drift_sigma),
    ))
}

type SmoothedArrays = (
    Py<PyArray2<f64>>,
    Py<PyArray2<f64>>,
    Py<PyArray1<f64>>,
    Py<PyArray1<f64>>,
);

/// Smoothed constants, sigma, drift, its sigma.
#[pyfunction]
fn kalman_smooth(
    py: Python<'_>,
    model: &AxisKalmanModel,
    start: &KalmanStart,
    poses: &KalmanPoses,
) -> PyResult<SmoothedArrays> {
    let (model, prior, poses) = (&model.inner, &start.prior, &poses.poses);
    let out = super::run_long(py, || smoother::smooth(model, prior, poses))?;
    let column = |values: Vec<f64>| values.into_pyarray(py).unbind();
    Ok((
        rows4(py, out.constants)?,
        rows4(py, out.sigma)?,
        column(out.drift.iter().map(|d| d.0).collect()),
        column(out.drift.iter().map(|d| d.1).collect()),
    ))
}
