//! Chi-square probabilities across the seam.

use numpy::{PyArray1, PyReadonlyArray1, ToPyArray};
use pyo3::prelude::*;

use crate::chi_square;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(chi_square_quantile, module)?)?;
    module.add_function(wrap_pyfunction!(chi_square_above, module)?)?;
    Ok(())
}

/// Values `(n,)` that chi-square variates of `dof` `(n,)` degrees of freedom stay below with `probability`.
#[pyfunction]
fn chi_square_quantile<'py>(
    py: Python<'py>,
    probability: f64,
    dof: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let dof = dof.as_array().to_vec();
    let found = super::run(py, || {
        Ok(dof
            .iter()
            .map(|&k| chi_square::chi_square_quantile(probability, k))
            .collect::<Vec<f64>>())
    })?;
    Ok(found.to_pyarray(py))
}

/// Probability that a chi-square variate of `dof` degrees of freedom exceeds `value`.
#[pyfunction]
fn chi_square_above(value: f64, dof: f64) -> f64 {
    chi_square::chi_square_tails(value, dof).1
}
