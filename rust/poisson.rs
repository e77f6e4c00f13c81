//! Poisson's equation `B' = −[ω]× B`: the rotation of a move and its sensitivities in one pass.
//!
//! `B` takes a vector from the body frame at the start of the move to the body frame at its end: `f_after = B f_before`.
//! The rate is `ω(t) = S w'(t) + b(t)`; `w'` are raw readings and `b` runs linearly between two anchor instants, the
//! middles of the still poses before and after. Over one step the rate is a polynomial through the neighbouring
//! samples; with its zeroth and first moments `φ₀ = ∫ω dτ`, `φ₁ = (1/h)∫τω dτ` about the middle of the step the rotation
//! vector is `φ = φ₀ + φ₀ × φ₁` (fourth-order Magnus), and the step is the exact exponential `B ← exp(−[φ]×) B`.
//! Equations (5.1)-(5.6) of docs/model-gyroscope.md.

use crate::error::{Error, Result};
use crate::rotation::{exp_and_left_jacobian, skew};
use nalgebra::{Matrix3, SMatrix, Vector3};
use rayon::prelude::*;

/// 3 × 9 sensitivity of a rotation vector to `S`, column `3 i + j` for `S_ij`.
pub type WrtScale = SMatrix<f64, 3, 9>;

/// How the rate runs between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RateModel {
    /// The sample holds until the next one: first order.
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

/// A move to be integrated: samples `[start, stop)`, and the instants between which the zero reading is interpolated.
#[derive(Debug, Clone, Copy)]
pub struct MoveRange {
    /// First sample.
    pub start: usize,
    /// One past the last sample.
    pub stop: usize,
    /// Middle of the still pose before, s.
    pub anchor_before_s: f64,
    /// Middle of the still pose after, s.
    pub anchor_after_s: f64,
}

/// What the samples contribute to the uncertainty of a rotation.
#[derive(Debug, Clone, Copy)]
pub struct RateNoise {
    /// Angle random walk of each raw axis, raw unit · √s (white density `N`).
    pub density: Vector3<f64>,
    /// Standard deviation of a time stamp, s.
    pub sigma_time_s: f64,
    /// A step longer than one and a half of these has lost samples, s.
    pub nominal_step_s: f64,
}

/// One step of a move, reduced to what does not depend on the calibration.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// `∫ w' dτ`.
    moment0: Vector3<f64>,
    /// `(1/h) ∫ τ w' dτ`, τ from the middle of the step.
    moment1: Vector3<f64>,
    /// Change of the raw reading over the step.
    change: Vector3<f64>,
    h: f64,
    /// Where the middle of the step lies between the anchors: 0 before, 1 after.
    fraction: f64,
    /// Variance of the reading over this step beyond the rate noise, raw unit².
    var_extra: Vector3<f64>,
}

/// A move prepared for repeated integration: the moments of its raw readings.
#[derive(Debug, Clone)]
pub struct PreparedMove {
    steps: Vec<Step>,
    span_s: f64,
}

/// The rotation of one move and how it answers to everything it was computed from.
///
/// Sensitivities are rotation vectors `θ` in the frame at the start of the move: `B(p + δp) ≈ B exp(−[θ]×)`, `θ = G δp`.
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
    /// Covariance of `θ` from rate noise, time stamps and lost samples, rad².
    pub cov_noise: Matrix3<f64>,
    /// Integrated time, s.
    pub duration_s: f64,
}

impl Turn {
    /// `∂B/∂p` for the parameter whose column of `G` is `theta`: `−B [θ]×`.
    #[must_use]
    pub fn derivative(&self, theta: &Vector3<f64>) -> Matrix3<f64> {
        -self.rotation * skew(theta)
    }
}

/// `∫ L dτ` and `(1/h) ∫ τ L dτ` over `[−h/2, h/2]` of the cubic with roots `a, b, c`.
fn cubic_moments(a: f64, b: f64, c: f64, h: f64) -> (f64, f64) {
    let h2 = h * h;
    (
        -h * ((a + b + c) * h2 / 12.0 + a * b * c),
        h2 * (h2 / 80.0 + (a * b + a * c + b * c) / 12.0),
    )
}

/// One integration step as sums over samples: `∫ w dτ = Σ zeroth_j w_j`, `(1/h) ∫ τ w dτ = Σ first_j w_j`, τ from the
/// middle of the step.
#[derive(Debug, Clone, Copy)]
pub struct StepWeights {
    /// The samples that the rate polynomial runs through; unused ones carry no weight.
    pub sample: [usize; 4],
    /// Weights of the zeroth moment, s.
    pub zeroth: [f64; 4],
    /// Weights of the first moment, s.
    pub first: [f64; 4],
    /// Sample at which the step begins.
    pub from: usize,
    /// Sample at which it ends.
    pub to: usize,
    /// Its duration, s.
    pub h: f64,
}

impl StepWeights {
    fn constant(from: usize, to: usize, h: f64) -> Self {
        Self {
            sample: [from; 4],
            zeroth: [h, 0.0, 0.0, 0.0],
            first: [0.0; 4],
            from,
            to,
            h,
        }
    }

    fn line(from: usize, to: usize, h: f64) -> Self {
        Self {
            sample: [from, to, from, to],
            zeroth: [0.5 * h, 0.5 * h, 0.0, 0.0],
            first: [-h / 12.0, h / 12.0, 0.0, 0.0],
            from,
            to,
            h,
        }
    }

    /// The cubic through four samples at `t`, over the step between the samples `left` and `left + 1` of them.
    fn cubic(sample: [usize; 4], t: &[f64; 4], left: usize, h: f64) -> Self {
        let middle = 0.5 * (t[left] + t[left + 1]);
        let tau = t.map(|x| x - middle);
        let (mut zeroth, mut first) = ([0.0; 4], [0.0; 4]);
        for j in 0..4 {
            let [a, b, c] = [tau[(j + 1) % 4], tau[(j + 2) % 4], tau[(j + 3) % 4]];
            let (i0, i1) = cubic_moments(a, b, c, h);
            let scale = 1.0 / ((tau[j] - a) * (tau[j] - b) * (tau[j] - c));
            zeroth[j] = i0 * scale;
            first[j] = i1 * scale;
        }
        Self {
            sample,
            zeroth,
            first,
            from: sample[left],
            to: sample[left + 1],
            h,
        }
    }

    /// Both moments of a signal.
    pub fn moments(&self, signal: impl Fn(usize) -> Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let (mut zeroth, mut first) = (Vector3::zeros(), Vector3::zeros());
        for j in 0..4 {
            if self.zeroth[j] != 0.0 || self.first[j] != 0.0 {
                let value = signal(self.sample[j]);
                zeroth += value * self.zeroth[j];
                first += value * self.first[j];
            }
        }
        (zeroth, first)
    }
}

/// Neighbouring steps may differ by this factor (jitter, one lost sample) before a cubic through them is worse than a
/// straight line: across a longer gap it overshoots.
const UNEVEN_STEPS: f64 = 3.0;

/// Reduces the samples of a move to moments; non-finite rows and repeated stamps are bridged.
///
/// `var_extra`, as long as `raw` where given, is the variance of single readings beyond the rate noise: readings that
/// were reconstructed where the gyro met its limit.
///
/// # Errors
/// When the range leaves the record, the anchors coincide or time runs backward.
pub fn prepare(
    time_s: &[f64],
    raw: &[Vector3<f64>],
    var_extra: Option<&[Vector3<f64>]>,
    range: &MoveRange,
    model: RateModel,
) -> Result<PreparedMove> {
    if var_extra.is_some_and(|var| var.len() != raw.len()) {
        return Err(Error::bad_input(
            "the extra variance must have one row per reading",
        ));
    }
    if range.start >= range.stop || range.stop > time_s.len() || time_s.len() != raw.len() {
        return Err(Error::bad_input(format!(
            "a move covers samples {}..{} of {}: it must hold at least one sample and stay inside the record",
            range.start,
            range.stop,
            time_s.len().min(raw.len())
        )));
    }
    let span_s = range.anchor_after_s - range.anchor_before_s;
    if !(span_s > 0.0 && span_s.is_finite()) {
        return Err(Error::bad_input(format!(
            "the still pose after the move at sample {} must be later than the one before it",
            range.start
        )));
    }
    let mut used: Vec<usize> = Vec::with_capacity(range.stop - range.start);
    for k in range.start..range.stop {
        if !(raw[k].iter().all(|x| x.is_finite()) && time_s[k].is_finite()) {
            continue;
        }
        if let Some(&last) = used.last() {
            if time_s[k] < time_s[last] {
                return Err(Error::bad_input(format!(
                    "time runs backward at sample {k}: sort the record first"
                )));
            }
            if time_s[k] <= time_s[last] {
                continue;
            }
        }
        used.push(k);
    }
    let steps = step_weights(time_s, &used, model)
        .into_iter()
        .map(|step| {
            let (moment0, moment1) = step.moments(|k| raw[k]);
            let (p, q) = (step.from, step.to);
            Step {
                moment0,
                moment1,
                change: raw[q] - raw[p],
                h: step.h,
                fraction: (0.5 * (time_s[p] + time_s[q]) - range.anchor_before_s) / span_s,
                var_extra: var_extra.map_or_else(Vector3::zeros, |var| var[p]),
            }
        })
        .collect();
    Ok(PreparedMove { steps, span_s })
}

/// Integration steps between the samples `used` (ascending, of strictly rising time).
#[must_use]
pub fn step_weights(time_s: &[f64], used: &[usize], model: RateModel) -> Vec<StepWeights> {
    let n = used.len();
    (0..n.saturating_sub(1))
        .map(|i| {
            let (p, q) = (used[i], used[i + 1]);
            let h = time_s[q] - time_s[p];
            match model {
                RateModel::Constant => StepWeights::constant(p, q, h),
                RateModel::Coning if n >= 4 => {
                    let first = i.saturating_sub(1).min(n - 4);
                    let index = [0, 1, 2, 3].map(|j| used[first + j]);
                    let t = index.map(|k| time_s[k]);
                    let gaps = [t[1] - t[0], t[2] - t[1], t[3] - t[2]];
                    let widest = gaps[0].max(gaps[1]).max(gaps[2]);
                    let narrowest = gaps[0].min(gaps[1]).min(gaps[2]);
                    if widest > UNEVEN_STEPS * narrowest {
                        StepWeights::line(p, q, h)
                    } else {
                        StepWeights::cubic(index, &t, i - first, h)
                    }
                }
                RateModel::Linear | RateModel::Coning => StepWeights::line(p, q, h),
            }
        })
        .collect()
}

impl PreparedMove {
    /// Number of integration steps.
    #[must_use]
    pub fn n_steps(&self) -> usize {
        self.steps.len()
    }

    /// Time between the anchors, s.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        self.span_s
    }

    /// `∫ w' dt` over the move, raw unit · s: the turn as the gyro saw it when its axis stays fixed.
    #[must_use]
    pub fn raw_angle(&self) -> Vector3<f64> {
        self.steps.iter().map(|step| step.moment0).sum()
    }

    /// Integrated time, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps.iter().map(|step| step.h).sum()
    }

    /// Rotation and sensitivities for `ω = S w' + b`, `b` from `bias_before` to `bias_after` (rad/s) between the anchors.
    #[must_use]
    pub fn integrate(
        &self,
        scale: &Matrix3<f64>,
        bias_before: &Vector3<f64>,
        bias_after: &Vector3<f64>,
        noise: &RateNoise,
    ) -> Turn {
        let mut rotation = Matrix3::identity();
        let mut wrt_scale = WrtScale::zeros();
        let mut wrt_bias_before = Matrix3::zeros();
        let mut wrt_bias_after = Matrix3::zeros();
        let mut cov_noise = Matrix3::zeros();
        let mut duration_s = 0.0;
        let bias_slope = (bias_after - bias_before) / self.span_s;
        let density2 = noise.density.component_mul(&noise.density);
        let var_time = noise.sigma_time_s * noise.sigma_time_s;
        for step in &self.steps {
            let h = step.h;
            let bias = bias_before + (bias_after - bias_before) * step.fraction;
            let phi0 = scale * step.moment0 + bias * h;
            let phi1 = scale * step.moment1 + bias_slope * (h * h / 12.0);
            let phi = phi0 + phi0.cross(&phi1);
            let (turn, left) = exp_and_left_jacobian(&phi);
            // δθ = Bᵀ J(φ) δφ, δφ = (I − [φ₁]×) δφ₀ + [φ₀]× δφ₁.
            let to_start: Matrix3<f64> = rotation.transpose() * left;
            let wrt_phi0: Matrix3<f64> = to_start - to_start * skew(&phi1);
            let wrt_phi1: Matrix3<f64> = to_start * skew(&phi0);
            for i in 0..3 {
                let from0 = wrt_phi0.column(i);
                let from1 = wrt_phi1.column(i);
                for j in 0..3 {
                    let mut column = wrt_scale.column_mut(3 * i + j);
                    column.axpy(step.moment0[j], &from0, 1.0);
                    column.axpy(step.moment1[j], &from1, 1.0);
                }
            }
            let by_slope = wrt_phi1 * (h * h / (12.0 * self.span_s));
            wrt_bias_before += wrt_phi0 * (h * (1.0 - step.fraction)) - by_slope;
            wrt_bias_after += wrt_phi0 * (h * step.fraction) + by_slope;
            let of_raw: Matrix3<f64> = to_start * scale;
            let var = density2 * h + step.var_extra * (h * h);
            cov_noise += of_raw * Matrix3::from_diagonal(&var) * of_raw.transpose();
            let is_gap = h > 1.5 * noise.nominal_step_s;
            if var_time > 0.0 || is_gap {
                let jump = to_start * (scale * step.change);
                // A lost sample leaves the rate anywhere between its neighbours: uniform, so h²/12.
                let var = var_time + if is_gap { h * h / 12.0 } else { 0.0 };
                cov_noise += jump * jump.transpose() * var;
            }
            rotation = turn.transpose() * rotation;
            duration_s += h;
        }
        Turn {
            rotation,
            wrt_scale,
            wrt_bias_before,
            wrt_bias_after,
            cov_noise,
            duration_s,
        }
    }
}

/// Prepares every move, in parallel.
///
/// # Errors
/// As [`prepare`], for the first move that fails.
pub fn prepare_all(
    time_s: &[f64],
    raw: &[Vector3<f64>],
    var_extra: Option<&[Vector3<f64>]>,
    ranges: &[MoveRange],
    model: RateModel,
) -> Result<Vec<PreparedMove>> {
    ranges
        .par_iter()
        .map(|range| prepare(time_s, raw, var_extra, range, model))
        .collect()
}

/// Integrates every move, in parallel; biases are per move.
#[must_use]
pub fn integrate_all(
    moves: &[PreparedMove],
    scale: &Matrix3<f64>,
    bias_before: &[Vector3<f64>],
    bias_after: &[Vector3<f64>],
    noise: &RateNoise,
) -> Vec<Turn> {
    moves
        .par_iter()
        .zip(bias_before.par_iter().zip(bias_after))
        .map(|(prepared, (before, after))| prepared.integrate(scale, before, after, noise))
        .collect()
}
