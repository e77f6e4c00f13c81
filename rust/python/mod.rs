//! THE SEAM: the only place that may name `pyo3` or `numpy`. One file per room of the mathematics.
//!
//! Every entry lends or copies its arrays (`arrays`), then calls [`run`], which releases the interpreter and
//! turns a kernel's refusal into a `ValueError` with the kernel's own sentence.

// pyo3 hands arguments over by value; that is its calling convention, not a choice of ours.
#![allow(clippy::needless_pass_by_value)]

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error::Result as KernelResult;

mod accelerometer;
mod allan;
mod arrays;
mod attitude;
mod chi_square;
mod gyro_alignment;
mod kalman;
mod kalman_norm;
mod number_text;
mod poisson;
mod rotation;
mod screening;
mod session_model;
mod simulate;
mod spectral_likelihood;
mod stillness;
mod zero_process;

/// The one doorway: run a kernel without holding the interpreter, map its refusal to `ValueError`.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    kernel: impl FnOnce() -> KernelResult<T> + Send,
) -> PyResult<T> {
    py.detach(kernel)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    allan::register(module)?;
    attitude::register(module)?;
    chi_square::register(module)?;
    gyro_alignment::register(module)?;
    number_text::register(module)?;
    poisson::register(module)?;
    kalman::register(module)?;
    accelerometer::register(module)?;
    kalman_norm::register(module)?;
    rotation::register(module)?;
    screening::register(module)?;
    session_model::register(module)?;
    simulate::register(module)?;
    spectral_likelihood::register(module)?;
    stillness::register(module)?;
    zero_process::register(module)?;
    // The stub is the list of names; a second one made on the fly would have to be kept in step with it.
    module.delattr("__all__")?;
    Ok(())
}
