//! The likelihood of noise terms across the seam.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::spectral_likelihood::{self as likelihood, Bins, Question};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<SpectralBins>()?;
    module.add_class::<SpectralFit>()?;
    Ok(())
}

/// Averages of spectral ordinates, and what each noise term of unit strength contributes to them.
#[pyclass(frozen, module = "trihedron._core")]
pub(crate) struct SpectralBins {
    bins: Bins,
}

/// The most likely strengths of the terms.
#[pyclass(frozen, get_all, module = "trihedron._core")]
pub(crate) struct SpectralFit {
    strength: Vec<f64>,
    slope: f64,
    sigma_slope: f64,
    deviance: f64,
    sigma_log: Vec<f64>,
    is_converged: bool,
}

#[pymethods]
impl SpectralBins {
    #[new]
    fn new(
        py: Python<'_>,
        count: PyReadonlyArray1<'_, f64>,
        power: PyReadonlyArray1<'_, f64>,
        line_cross: PyReadonlyArray1<'_, f64>,
        line_square: PyReadonlyArray1<'_, f64>,
        basis: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let flat: Vec<f64> = basis.as_array().iter().copied().collect();
        let bins = Bins {
            count: count.as_array().to_vec(),
            power: power.as_array().to_vec(),
            line_cross: line_cross.as_array().to_vec(),
            line_square: line_square.as_array().to_vec(),
            basis: flat
                .chunks(basis.shape()[1].max(1))
                .map(<[f64]>::to_vec)
                .collect(),
        };
        super::run(py, || bins.check().map(|()| Self { bins }))
    }

    /// Fit the strengths of the active terms.
    fn fit(&self, py: Python<'_>, active: Vec<usize>, has_line: bool) -> PyResult<SpectralFit> {
        self.know(&active)?;
        let question = Question {
            active,
            has_line,
            held: None,
        };
        let fit = super::run(py, || likelihood::fit(&self.bins, &question))?;
        Ok(SpectralFit {
            strength: fit.strength,
            slope: fit.slope,
            sigma_slope: fit.sigma_slope,
            deviance: fit.deviance,
            sigma_log: fit.sigma_log,
            is_converged: fit.is_converged,
        })
    }

    /// Strengths of term `k` at which the deviance exceeds its minimum by `rise`.
    fn interval(
        &self,
        py: Python<'_>,
        active: Vec<usize>,
        has_line: bool,
        k: usize,
        rise: f64,
    ) -> PyResult<(f64, f64)> {
        self.know(&active)?;
        self.know(&[k])?;
        let question = Question {
            active,
            has_line,
            held: None,
        };
        super::run(py, || {
            likelihood::profile_interval(&self.bins, &question, k, rise)
        })
    }
}

impl SpectralBins {
    fn know(&self, terms: &[usize]) -> PyResult<()> {
        if terms.iter().any(|&k| k >= self.bins.basis.len()) {
            return Err(pyo3::exceptions::PyValueError::new_err(format!(
                "there are {} terms, asked for {terms:?}",
                self.bins.basis.len()
            )));
        }
        Ok(())
    }
}
