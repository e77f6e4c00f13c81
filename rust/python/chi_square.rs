//! Bindings of probabilities and quantiles.

use pyo3::prelude::*;

use crate::chi_square::{self, beta};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(chi_square_above, module)?)?;
    module.add_function(wrap_pyfunction!(chi_square_upper, module)?)?;
    module.add_function(wrap_pyfunction!(normal_above, module)?)?;
    module.add_function(wrap_pyfunction!(normal_upper, module)?)?;
    module.add_function(wrap_pyfunction!(f_above, module)?)?;
    module.add_function(wrap_pyfunction!(f_upper, module)?)?;
    module.add_function(wrap_pyfunction!(student_upper, module)?)?;
    module.add_function(wrap_pyfunction!(binomial_above, module)?)?;
    Ok(())
}

/// Probability that a chi-square variate of `dof` degrees of freedom exceeds `value`.
#[pyfunction]
fn chi_square_above(value: f64, dof: f64) -> f64 {
    chi_square::chi_square_tails(value, dof).1
}

/// Value that a chi-square variate of `dof` degrees of freedom exceeds with probability `above`.
#[pyfunction]
fn chi_square_upper(above: f64, dof: f64) -> f64 {
    chi_square::chi_square_upper(above, dof)
}

/// Probability that a standard normal variate exceeds `value`.
#[pyfunction]
fn normal_above(value: f64) -> f64 {
    chi_square::normal_above(value)
}

/// Value that a standard normal variate exceeds with probability `above`.
#[pyfunction]
fn normal_upper(above: f64) -> f64 {
    chi_square::normal_upper(above)
}

/// Probability that an F variate of `top` and `bottom` degrees of freedom exceeds `value`.
#[pyfunction]
fn f_above(value: f64, top: f64, bottom: f64) -> f64 {
    beta::f_above(value, top, bottom)
}

/// Value that an F variate of `top` and `bottom` degrees of freedom exceeds with probability `above`.
#[pyfunction]
fn f_upper(above: f64, top: f64, bottom: f64) -> f64 {
    beta::f_upper(above, top, bottom)
}

/// Value that a Student variate of `dof` degrees of freedom exceeds with probability `above`.
#[pyfunction]
fn student_upper(above: f64, dof: f64) -> f64 {
    beta::student_upper(above, dof)
}

/// Probability of more than `count` successes in `trials`, each with probability `chance`.
#[pyfunction]
fn binomial_above(count: f64, trials: f64, chance: f64) -> f64 {
    beta::binomial_above(count, trials, chance)
}
