//! Poisson's equation `B' = −[ω]× B`: the rotation of a move and its sensitivities in one pass.
//!
//! `B` takes a vector from the body frame at the start of the move to the body frame at its end:
//! `f_after = B f_before`. The rate is `ω(t) = S w'(t) + b(t)`; `w'` are raw readings and `b` runs linearly between two
//! anchor instants, the middles of the static poses before and after. Over one step the rate is a polynomial through
//! the neighbouring samples; with its zeroth and first moments `φ₀ = ∫ω dτ`, `φ₁ = (1/h)∫τω dτ` about the middle of the
//! step the rotation vector is `φ = φ₀ + φ₀ × φ₁` (fourth-order Magnus), and the step is the exact exponential
//! `B ← exp(−[φ]×) B`. Equations (5.1)-(5.5) of docs/model-gyroscope.md.

mod moves;
mod steps;

use nalgebra::{Matrix3, SMatrix, Vector3};
use rayon::prelude::*;

use self::moves::SteppedMove;
use crate::error::{Error, Result};
pub use steps::{StepWeights, step_weights};

/// 3 × 9 sensitivity of a rotation vector to `S`, column `3 i + j` for `S_ij`.
pub type WrtScale = SMatrix<f64, 3, 9>;

/// Rate between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RateModel {
    /// The sample is valid until the next one: first order.
    Constant,
    /// A straight line from sample to sample, with the commutator of that line: second order.
    Linear,
    /// A cubic through four samples, so that coning inside a step is integrated: fourth order.
    Coning,
}

impl RateModel {
    /// The model whose rate polynomial has this degree (0, 1 or 3).
    ///
    /// # Errors
    /// When no model has that degree.
    pub fn of_degree(degree: u8) -> Result<Self> {
        match degree {
            0 => Ok(Self::Constant),
            1 => Ok(Self::Linear),
            3 => Ok(Self::Coning),
            _ => Err(Error::bad_input(format!(
                "the rate model has degree 0 (constant), 1 (linear) or 3 (coning), got {degree}"
            ))),
        }
    }
}

/// A move to be integrated: samples `[start, stop)`, and the instants between which the bias is interpolated.
#[derive(Debug, Clone, Copy)]
pub struct MoveRange {
    /// First sample.
    pub start: usize,
    /// One past the last sample.
    pub stop: usize,
    /// Middle of the static pose before, s.
    pub anchor_before_s: f64,
    /// Middle of the static pose after, s.
    pub anchor_after_s: f64,
}

/// Noise of the samples, from which the uncertainty of a rotation follows.
#[derive(Debug, Clone, Copy)]
pub struct RateNoise {
    /// Angle random walk of each raw axis, raw unit · √s (white density `N`).
    pub density: Vector3<f64>,
    /// Standard deviation of a timestamp, s.
    pub sigma_time_s: f64,
    /// A step longer than one and a half of these has lost samples, s.
    pub nominal_step_s: f64,
}

/// The rotation of one move, with its sensitivities and its covariance.
///
/// Sensitivities are rotation vectors `θ` in the frame where the move starts: `B(p + δp) ≈ B exp(−[θ]×)`, `θ = G δp`.
#[derive(Debug, Clone)]
pub struct Turn {
    /// `B`, body at the start → body at the end.
    pub rotation: Matrix3<f64>,
    /// `G` with respect to `S`, row by row.
    pub wrt_scale: WrtScale,
    /// `G` with respect to the rate bias at the anchor before, s.
    pub wrt_bias_before: Matrix3<f64>,
    /// `G` with respect to the rate bias at the anchor after, s.
    pub wrt_bias_after: Matrix3<f64>,
    /// `G` with respect to a constant rate in the room, in the frame where the move starts, less what a bias that is
    /// linear in time contains of it where it equals it at either end.
    pub wrt_room: Matrix3<f64>,
    /// Covariance of `θ` from rate noise, timestamp errors and lost samples, rad².
    pub cov_noise: Matrix3<f64>,
}

/// Rotation and sensitivities of every move, in parallel, for `ω = S w' + b` with a `scale` each, `b` linear from
/// `bias_before` to `bias_after`, rad/s; non-finite rows and repeated timestamps are bridged.
///
/// # Errors
/// When the range leaves the record, the anchors coincide or time runs backward, for the first move that fails; and
/// when there are not as many scales and biases as moves.
#[expect(
    clippy::too_many_arguments,
    reason = "what is read and what it is integrated with"
)]
pub fn integrate_moves(
    time_s: &[f64],
    raw: &[Vector3<f64>],
    ranges: &[MoveRange],
    model: RateModel,
    scale: &[Matrix3<f64>],
    bias_before: &[Vector3<f64>],
    bias_after: &[Vector3<f64>],
    noise: &RateNoise,
) -> Result<Vec<Turn>> {
    if [scale.len(), bias_before.len(), bias_after.len()] != [ranges.len(); 3] {
        return Err(Error::bad_input(format!(
            "there are {} moves but {} scales, {} biases before and {} after them",
            ranges.len(),
            scale.len(),
            bias_before.len(),
            bias_after.len()
        )));
    }
    (0..ranges.len())
        .into_par_iter()
        .map(|k| {
            let steps = SteppedMove::of(time_s, raw, &ranges[k], model)?;
            Ok(steps.integrate(&scale[k], &bias_before[k], &bias_after[k], noise))
        })
        .collect()
}

/// `∫ w' dt` over every move, raw unit · s, and the integrated times, s.
///
/// # Errors
/// As [`integrate_moves`].
pub fn raw_integrals(
    time_s: &[f64],
    raw: &[Vector3<f64>],
    ranges: &[MoveRange],
    model: RateModel,
) -> Result<Vec<(Vector3<f64>, f64)>> {
    ranges
        .par_iter()
        .map(|range| Ok(SteppedMove::of(time_s, raw, range, model)?.raw_integral()))
        .collect()
}
