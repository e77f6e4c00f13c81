//! The mathematics of `trihedron`: slices and nalgebra in, plain structs out.
//!
//! No module here reads files, prints, or depends on Python; `python` (feature `python`) is the only binding.
//! Vocabulary: `S`, `b` are the direct form `f = S a' + b` (raw to SI), `Mz` is the body frame (instrument frame).

pub mod adc_grid;
pub mod aliasing;
pub mod allan;
pub mod attitude;
pub mod audit;
pub mod autoregression;
pub mod before_adc;
pub mod block_motion;
pub mod channel_slope;
pub mod chi_square;
pub mod ellipsoid;
pub mod error;
pub mod first_look;
pub mod gauss_newton;
pub mod halves;
pub mod interrupt;
pub mod joints;
pub mod kalman;
pub mod levels;
pub mod lever_arm;
pub mod lines;
pub mod log_sum;
pub mod mean_noise;

pub mod move_signals;
pub mod noise_change;
pub mod noise_floor;
pub mod nonlinearity;
pub mod norm_invariant;
pub mod number_text;
pub mod order_statistics;
pub mod poisson;
pub mod ranges;
pub mod reference_motion;
pub mod rotation;
pub mod rounding;
pub mod running;
pub mod scale_from_moves;
pub mod screening;
pub mod sensor_model;
pub mod session_model;
pub mod settling;
pub mod simd;
pub mod simulate;
pub mod sinusoid;
pub mod slow_noise;
pub mod spectral_likelihood;
pub mod stillness;
pub mod telegraph;
pub mod time_errors;
pub mod timestamps;
pub mod two_levels;

#[cfg(feature = "python")]
mod python;

pub use error::{Error, Result};
