//! Bindings of the norm-invariant Kalman filter.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{matrix, rows3};
use super::kalman::AxisKalmanModel;
use crate::kalman::norm::{Frame, N_PARAMETERS, NormFilter, NormPose, NormPrior};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<NormKalman>()?;
    Ok(())
}

fn nine(name: &str, array: &PyReadonlyArray1<'_, f64>) -> PyResult<[f64; N_PARAMETERS]> {
    let values: Vec<f64> = array.as_array().iter().copied().collect();
    values.try_into().map_err(|values: Vec<f64>| {
        PyValueError::new_err(format!(
            "{name} must have shape (9,), got ({},)",
            values.len()
        ))
    })
}

fn pose(reading: [f64; 3], start: f64, pose_s: f64, extra_variance: [f64; 3]) -> NormPose {
    NormPose {
        reading,
        start,
        pose_s,
        extra_variance,
    }
}

/// The filter of a triad that needs only the norm of gravity.
#[pyclass(module = "trihedron._core")]
struct NormKalman {
    inner: NormFilter,
}

#[pymethods]
impl NormKalman {
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        model_x: &AxisKalmanModel,
        model_y: &AxisKalmanModel,
        model_z: &AxisKalmanModel,
        symmetric: bool,
        gravity: f64,
        prior_mean: PyReadonlyArray1<'_, f64>,
        prior_sigma: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let models = [
            model_x.inner.clone(),
            model_y.inner.clone(),
            model_z.inner.clone(),
        ];
        let frame = if symmetric {
            Frame::Symmetric
        } else {
            Frame::Lower
        };
        let prior = NormPrior {
            mean: nine("prior_mean", &prior_mean)?,
            sigma: nine("prior_sigma", &prior_sigma)?,
        };
        Ok(Self {
            inner: super::run(py, || NormFilter::new(models, frame, gravity, &prior))?,
        })
    }

    /// Processes one pose; returns its innovation and the predicted variance.
    #[pyo3(signature = (reading, start_s, pose_s, extra_variance=[0.0; 3]))]
    fn add(
        &mut self,
        py: Python<'_>,
        reading: [f64; 3],
        start_s: f64,
        pose_s: f64,
        extra_variance: [f64; 3],
    ) -> PyResult<(f64, f64)> {
        let filter = &mut self.inner;
        let seen = super::run(py, || {
            filter.add(&pose(reading, start_s, pose_s, extra_variance))
        })?;
        Ok((seen.value, seen.variance))
    }

    /// Stores many poses without estimating.
    fn load(
        &mut self,
        py: Python<'_>,
        readings: PyReadonlyArray2<'_, f64>,
        start_s: PyReadonlyArray1<'_, f64>,
        pose_s: PyReadonlyArray1<'_, f64>,
        extra_variance: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        let rows = rows3("readings", &readings)?;
        let extra = rows3("extra_variance", &extra_variance)?;
        if [start_s.len(), pose_s.len(), extra.len()] != [rows.len(); 3] {
            return Err(PyValueError::new_err(format!(
                "start_s, pose_s and extra_variance must have {} rows like the readings",
                rows.len()
            )));
        }
        let (t, pose_s) = (start_s.as_array(), pose_s.as_array());
        let poses: Vec<NormPose> = (0..rows.len())
            .map(|i| pose(rows[i].into(), t[i], pose_s[i], extra[i].into()))
            .collect();
        let filter = &mut self.inner;
        super::run_long(py, || filter.load(&poses))
    }

    /// Repeats the run over all poses at the latest constants until convergence; the number of runs, or None.
    fn relinearise(&mut self, py: Python<'_>, most: usize) -> PyResult<Option<usize>> {
        let filter = &mut self.inner;
        super::run_long(py, || filter.relinearise(most))
    }

    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.parameters().to_pyarray(py)
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.inner.covariance())
    }

    /// Innovations of the latest run and their variances, as rows (n, 2).
    #[getter]
    fn innovations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat: Vec<f64> = self
            .inner
            .innovations()
            .iter()
            .flat_map(|seen| [seen.value, seen.variance])
            .collect();
        flat.to_pyarray(py).reshape([flat.len() / 2, 2])
    }
}
