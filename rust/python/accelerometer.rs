//! Bindings of the accelerometer fits.

use nalgebra::Vector3;
use numpy::{PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArray3, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_vectors, flat3, matrices3, rows};
use crate::nonlinearity;
use crate::norm_invariant::{self, Fit, Readings};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("ANCHOR", norm_invariant::ANCHOR)?;
    module.add_class::<NormFit>()?;
    module.add_function(wrap_pyfunction!(fit_norm, module)?)?;
    module.add_function(wrap_pyfunction!(fit_norm_held_out, module)?)?;
    module.add_function(wrap_pyfunction!(errors_of_lengths, module)?)?;
    Ok(())
}

/// A fitted triad; arrays are copies.
#[pyclass(frozen)]
struct NormFit(Fit);

#[pymethods]
impl NormFit {
    /// `S` (3, 3), m/s² per raw unit.
    #[getter]
    #[pyo3(name = "S")]
    fn s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.0.model.s.transpose().as_slice(), 3)
    }

    /// `b` (3,), m/s².
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.model.b.as_slice().to_pyarray(py)
    }

    /// Residuals (n,), m/s².
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.residuals.to_pyarray(py)
    }

    /// Standard errors (n,) of the residuals, m/s².
    #[getter]
    fn sigmas<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.sigmas.to_pyarray(py)
    }

    #[getter]
    fn chi2(&self) -> f64 {
        self.0.chi2
    }

    #[getter]
    fn rank(&self) -> usize {
        self.0.certainty.rank
    }

    #[getter]
    fn is_anchored(&self) -> bool {
        self.0.is_anchored
    }

    #[getter]
    fn is_converged(&self) -> bool {
        self.0.stop.is_converged()
    }

    #[getter]
    fn stopped_because(&self) -> &'static str {
        self.0.stop.name()
    }

    #[getter]
    fn n_iterations(&self) -> usize {
        self.0.iterations
    }
}

#[pyfunction]
fn fit_norm(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    noise: PyReadonlyArray3<'_, f64>,
    gravity_m_s2: f64,
) -> PyResult<NormFit> {
    let readings = flat3("readings", &readings)?;
    let noise = matrices3("noise", &noise)?;
    super::run(py, || {
        norm_invariant::fit(
            Readings {
                values: as_vectors(&readings),
                noise: &noise,
            },
            gravity_m_s2,
            None,
        )
    })
    .map(NormFit)
}

#[pyfunction]
fn fit_norm_held_out<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    noise: PyReadonlyArray3<'py, f64>,
    gravity_m_s2: f64,
    fit: &Bound<'py, NormFit>,
    folds: Vec<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let readings = flat3("readings", &readings)?;
    let noise = matrices3("noise", &noise)?;
    let full = fit.get().0.clone();
    let flat = super::run(py, || {
        let poses = norm_invariant::held_out(
            Readings {
                values: as_vectors(&readings),
                noise: &noise,
            },
            gravity_m_s2,
            &full,
            &folds,
        )?;
        Ok(poses
            .iter()
            .flat_map(|pose| [pose.residual, pose.sigma, pose.chi2_per_dof])
            .collect::<Vec<f64>>())
    })?;
    rows(py, &flat, 3)
}

type ErrorsOfLengths<'py> = (Bound<'py, PyArray2<f64>>, [f64; 3], Vec<f64>);

/// Covariance `(9, 9)` of relative errors of `S` and `b`, log-odds `(3)` of each shape of nonlinear axes against none,
/// and the mean error `(9)` by them, from unit verticals `(n, 3)`, gravity errors and their noise
/// `(n,)` in units of |g|; `prior` is their standard deviation beforehand, if any.
#[pyfunction]
#[pyo3(signature = (up, residual, sigma, prior=None))]
fn errors_of_lengths<'py>(
    py: Python<'py>,
    up: PyReadonlyArray2<'py, f64>,
    residual: Vec<f64>,
    sigma: Vec<f64>,
    prior: Option<f64>,
) -> PyResult<ErrorsOfLengths<'py>> {
    let up: Vec<Vector3<f64>> = as_vectors(&flat3("up", &up)?).to_vec();
    if (residual.len(), sigma.len()) != (up.len(), up.len()) {
        return Err(PyValueError::new_err(
            "every vertical needs a residual and its noise",
        ));
    }
    let found = super::run(py, || {
        nonlinearity::of_lengths(&up, &residual, &sigma, prior)
    })?;
    let second = rows(py, found.second.as_slice(), 9)?;
    Ok((second, found.log_odds, found.mean.as_slice().to_vec()))
}
