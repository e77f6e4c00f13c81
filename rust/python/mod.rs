//! The Python bindings: the only place that may name `pyo3` or `numpy`. One file per module of the mathematics.
//!
//! Every entry borrows or copies its arrays (`arrays`), then calls [`run`] (or [`run_long`]), which releases the
//! interpreter and turns a kernel's error into a `ValueError` with the kernel's text.

// pyo3 passes arguments by value: that is its calling convention.
#![allow(clippy::needless_pass_by_value)]

use pyo3::prelude::*;

mod accelerometer;
mod allan;
mod arrays;
mod attitude;
mod audit;
mod binding;
mod block_motion;
mod chi_square;
mod first_look;
mod joints;
mod kalman;
mod kalman_norm;
mod lever_arm;
mod lines;
mod mean_noise;
mod move_signals;
mod noise_floor;
mod number_text;
mod order_statistics;
mod poisson;
mod ranges;
mod reference_motion;
mod rotation;
mod rounding;
mod screening;
mod session_model;
mod settling;
mod simulate;
mod sinusoid;
mod spectral_likelihood;
mod stillness;
mod telegraph;
mod timestamps;

pub(crate) use binding::{run, run_long};

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    binding::keep_panics_quiet();
    module.add("InputError", module.py().get_type::<binding::InputError>())?;
    allan::register(module)?;
    attitude::register(module)?;
    audit::register(module)?;
    block_motion::register(module)?;
    chi_square::register(module)?;
    first_look::register(module)?;
    joints::register(module)?;
    lever_arm::register(module)?;
    lines::register(module)?;
    mean_noise::register(module)?;
    move_signals::register(module)?;
    noise_floor::register(module)?;
    number_text::register(module)?;
    order_statistics::register(module)?;
    poisson::register(module)?;
    ranges::register(module)?;
    kalman::register(module)?;
    accelerometer::register(module)?;
    kalman_norm::register(module)?;
    reference_motion::register(module)?;
    rotation::register(module)?;
    rounding::register(module)?;
    screening::register(module)?;
    session_model::register(module)?;
    settling::register(module)?;
    simulate::register(module)?;
    sinusoid::register(module)?;
    spectral_likelihood::register(module)?;
    telegraph::register(module)?;
    timestamps::register(module)?;
    stillness::register(module)?;
    // The stub lists the names; a second list made at run time would have to be kept in step with it.
    module.delattr("__all__")?;
    Ok(())
}
