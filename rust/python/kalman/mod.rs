//! The Kalman filter across the seam.

mod least_squares;
mod poses;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use self::poses::KalmanPoses;
use crate::kalman::axis::{self, AxisFilter, N_CONSTANTS, Pose, Prior};
use crate::kalman::shaping::{NoiseTerms, ShapingModel};
use crate::kalman::smoother;
use crate::python::arrays::matrix;

type Array1<'py> = Bound<'py, PyArray1<f64>>;
type Array2<'py> = Bound<'py, PyArray2<f64>>;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<AxisKalmanModel>()?;
    module.add_class::<AxisKalman>()?;
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

/// Noise of one axis and how it is shaped.
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

/// Where a filter starts: constants of one axis, their standard errors, how they walk.
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

/// The filter of one axis, fed a pose at a time.
#[pyclass(module = "trihedron._core")]
struct AxisKalman {
    inner: AxisFilter,
}

#[pymethods]
impl AxisKalman {
    #[new]
    fn new(py: Python<'_>, model: &AxisKalmanModel, start: &KalmanStart) -> PyResult<Self> {
        let (model, prior) = (model.inner.clone(), &start.prior);
        Ok(Self {
            inner: super::run(py, || AxisFilter::new(model, prior))?,
        })
    }

    /// Take one pose; innovation and its predicted variance.
    #[pyo3(signature = (reading, reference, start_s, pose_s, extra_variance=0.0))]
    fn add(
        &mut self,
        py: Python<'_>,
        reading: f64,
        reference: [f64; 3],
        start_s: f64,
        pose_s: f64,
        extra_variance: f64,
    ) -> PyResult<(f64, f64)> {
        let pose = Pose {
            reading,
            reference,
            start: start_s,
            pose_s,
            extra_variance,
        };
        let filter = &mut self.inner;
        let seen = super::run(py, || filter.add(&pose))?;
        Ok((seen.innovation, seen.innovation_variance))
    }

    /// Pass a pose that has not been measured: the covariance changes, the estimate does not.
    fn imagine(
        &mut self,
        py: Python<'_>,
        reference: [f64; 3],
        start_s: f64,
        pose_s: f64,
    ) -> PyResult<()> {
        let filter = &mut self.inner;
        super::run(py, || filter.imagine(reference, start_s, pose_s))
    }

    /// An independent filter in the same state.
    fn copy(&self) -> Self {
        Self {
            inner: self.inner.clone(),
        }
    }

    #[getter]
    fn constants<'py>(&self, py: Python<'py>) -> Array1<'py> {
        self.inner.constants().to_pyarray(py)
    }

    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> Array1<'py> {
        self.inner.sigma().to_pyarray(py)
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Array2<'py>> {
        matrix(py, &self.inner.covariance())
    }

    /// Slow noise at the end of the last pose, and its standard error.
    #[getter]
    fn drift(&self) -> (f64, f64) {
        self.inner.drift()
    }

    #[getter]
    fn n_poses(&self) -> usize {
        self.inner.n_poses()
    }

    #[getter]
    fn n_states(&self) -> usize {
        self.inner.n_noise() + N_CONSTANTS
    }

    #[getter]
    fn end_s(&self) -> Option<f64> {
        self.inner.end()
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
