//! Bindings of the likelihood of noise terms.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::spectral_likelihood::{self as likelihood, Bins, Statement, Terms};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<SpectralBins>()?;
    module.add_class::<SpectralFit>()?;
    module.add_class::<SpectralInversion>()?;
    Ok(())
}

/// Averages of spectral ordinates, and the contribution of each noise term of unit strength to them.
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

/// Estimates and intervals of the amplitude of every term, of a pair of them, and of the line.
#[pyclass(frozen, get_all, module = "trihedron._core")]
pub(crate) struct SpectralInversion {
    most_likely: Vec<f64>,
    median: Vec<f64>,
    spread: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    rise_without: Vec<f64>,
    strength: Vec<f64>,
    strength_without_pair: Vec<f64>,
    rise_without_pair: f64,
    slope: f64,
    sigma_slope: f64,
    slope_lower: f64,
    slope_upper: f64,
    slope_tail: f64,
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
        let terms = Terms { active, has_line };
        let fit = super::run_long(py, || likelihood::fit(&self.bins, &terms))?;
        Ok(SpectralFit {
            strength: fit.strength,
            slope: fit.slope,
            sigma_slope: fit.sigma_slope,
            deviance: fit.deviance,
            sigma_log: fit.sigma_log,
            is_converged: fit.is_converged,
        })
    }

    /// Estimates and intervals of every term with all of them in the model and the line integrated out.
    fn invert(
        &self,
        py: Python<'_>,
        rise: f64,
        pair: (usize, usize),
        walk: usize,
        line_outside: f64,
    ) -> PyResult<SpectralInversion> {
        self.know(&[pair.0, pair.1, walk])?;
        let found = super::run(py, || {
            likelihood::invert(&self.bins, rise, pair, walk, line_outside)
        })?;
        let of = |pick: fn(&Statement) -> f64| found.terms.iter().map(pick).collect::<Vec<f64>>();
        Ok(SpectralInversion {
            most_likely: of(|t| t.most_likely),
            median: of(|t| t.median),
            spread: of(|t| t.spread),
            lower: of(|t| t.lower),
            upper: of(|t| t.upper),
            rise_without: of(|t| t.rise_without),
            strength: found.strength,
            strength_without_pair: found.strength_without_pair,
            rise_without_pair: found.rise_without_pair,
            slope: found.line.median,
            sigma_slope: found.line.sigma,
            slope_lower: found.line.lower,
            slope_upper: found.line.upper,
            slope_tail: found.line.tail,
        })
    }
}

impl SpectralBins {
    fn know(&self, terms: &[usize]) -> PyResult<()> {
        if terms.iter().any(|&k| k >= self.bins.basis.len()) {
            return Err(pyo3::exceptions::PyValueError::new_err(format!(
                "there are {} terms, requested {terms:?}",
                self.bins.basis.len()
            )));
        }
        Ok(())
    }
}
