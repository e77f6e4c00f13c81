//! Accelerometer triad from static poses alone: `|S a' + b| = |g|` in every orientation (model.md, section 3).
//!
//! Nine parameters, `S` lower triangular. The residual `|S a' + b| - |g|` of a pose is divided by the
//! noise of its mean *projected on gravity*, `σ² = uᵀ S Σ Sᵀ u` with `u = f/|f|`. σ is fixed while the solver runs and
//! renewed between runs: if it varied with `S`, a large `S` would lower the cost.

mod fitting;
mod held_out;
mod parameters;
mod problem;
mod start;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

pub use fitting::fit;
pub use held_out::{HeldOut, held_out};
pub use problem::residual_gradient;

pub use crate::sensor_model::Model;

use crate::error::{Error, Result};
use crate::gauss_newton::{Certainty, Stop};

/// Free parameters: six of `S`, three of `b`.
pub const N_PARAMETERS: usize = 9;

/// Parameters of the solver.
type Parameters = SVector<f64, N_PARAMETERS>;

/// A fitted triad.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The fitted `S` and `b`.
    pub model: Model,
    /// Covariance of `S` row by row, then `b`; zero above the diagonal of `S`. For the stated noise, not rescaled.
    pub covariance: SMatrix<f64, 12, 12>,
    /// `|S a' + b| - |g|` in m/s² (less the mean inflation that noise across gravity gives a norm).
    pub residuals: Vec<f64>,
    /// Predicted standard error of each residual, m/s².
    pub sigmas: Vec<f64>,
    /// Σ (residual/sigma)².
    pub chi2: f64,
    /// Rank, singular values of the Jacobian in the solver's parameters.
    pub certainty: Certainty,
    /// Whether the poses determine so little that each parameter was kept near its start, to [`ANCHOR`] of |g|.
    pub is_anchored: bool,
    /// Why the solver stopped.
    pub stop: Stop,
    /// Linearisations over all renewals of σ.
    pub iterations: usize,
}

/// Readings with the noise covariance of each: `noise` has one entry for all, or one per reading.
#[derive(Debug, Clone, Copy)]
pub struct Readings<'a> {
    /// Raw readings.
    pub values: &'a [Vector3<f64>],
    /// Noise covariances, raw unit squared.
    pub noise: &'a [Matrix3<f64>],
}

impl Readings<'_> {
    fn noise_of(&self, i: usize) -> &Matrix3<f64> {
        self.noise.get(i).unwrap_or(&self.noise[0])
    }

    fn check(&self) -> Result<()> {
        if self.values.is_empty() {
            return Err(Error::bad_input("there are no static poses to fit"));
        }
        if self.noise.len() != 1 && self.noise.len() != self.values.len() {
            return Err(Error::bad_input(format!(
                "{} noise covariances do not belong to {} readings",
                self.noise.len(),
                self.values.len()
            )));
        }
        let is_finite = |a: &Vector3<f64>| a.iter().all(|value| value.is_finite());
        if let Some(i) = self.values.iter().position(|a| !is_finite(a)) {
            return Err(Error::bad_input(format!("reading {i} is not finite")));
        }
        for (i, noise) in self.noise.iter().enumerate() {
            // An axis without noise is valid (the audit reports stuck channels), a pose without any is not.
            if noise.iter().any(|value| !value.is_finite()) || noise.trace() <= 0.0 {
                return Err(Error::bad_input(format!(
                    "the standard error of reading {i} must be finite and positive"
                )));
            }
        }
        Ok(())
    }
}

/// Standard error, in |g|, above which a scale, an angle or a bias counts as undetermined by the poses: errors no
/// longer propagate linearly, and no triad is made that badly.
pub const UNKNOWN: f64 = 0.02;

/// Deviation, in |g|, of undetermined parameters from the sphere's: scales within 10 %, axes within 6°.
pub const ANCHOR: f64 = 0.1;
