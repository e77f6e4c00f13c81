//! Bindings of the likelihood of noise terms.

use numpy::ndarray::ArrayView2;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::spectral_likelihood::{self as likelihood, Bins, Statement};

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
    columns: Vec<f64>,
    deviance: f64,
    log_determinant: f64,
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
    strength_at_ends: Vec<Vec<f64>>,
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
        cross: PyReadonlyArray2<'_, f64>,
        square: PyReadonlyArray3<'_, f64>,
        basis: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let rows = |table: ArrayView2<'_, f64>| -> Vec<Vec<f64>> {
            table.outer_iter().map(|row| row.to_vec()).collect()
        };
        let pairs = square.as_array();
        let bins = Bins {
            count: count.as_array().to_vec(),
            power: power.as_array().to_vec(),
            cross: rows(cross.as_array()),
            square: pairs.outer_iter().flat_map(&rows).collect(),
            basis: rows(basis.as_array()),
        };
        super::run(py, || bins.check().map(|()| Self { bins }))
    }

    /// The most likely strengths of the active terms, the columns integrated out.
    fn fit(&self, py: Python<'_>, active: Vec<usize>) -> PyResult<SpectralFit> {
        self.know(&active)?;
        let fit = super::run_long(py, || likelihood::fit(&self.bins, &active))?;
        Ok(SpectralFit {
            strength: fit.strength,
            columns: fit.columns,
            deviance: fit.deviance,
            log_determinant: fit.log_determinant,
        })
    }

    /// Estimates and intervals of every term with all of them in the model and the columns integrated out.
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
        let ends = (found.terms.iter().flat_map(|t| t.strength_at_ends.clone())).collect();
        Ok(SpectralInversion {
            most_likely: of(|t| t.most_likely),
            median: of(|t| t.median),
            spread: of(|t| t.spread),
            lower: of(|t| t.lower),
            upper: of(|t| t.upper),
            rise_without: of(|t| t.rise_without),
            strength_at_ends: ends,
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
