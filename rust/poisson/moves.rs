//! The rotation of one move, step by step.

use nalgebra::{Matrix3, Vector3};

use super::steps::{StepWeights, step_weights};
use super::{MoveRange, RateModel, RateNoise, Turn, WrtScale};
use crate::aliasing::GAP;
use crate::error::{Error, Result};
use crate::rotation::{exp_and_left_jacobian, skew};

/// A move as integration steps between those of its samples that are finite and of increasing time.
pub(super) struct SteppedMove<'a> {
    time_s: &'a [f64],
    raw: &'a [Vector3<f64>],
    anchor_before_s: f64,
    span_s: f64,
    steps: Vec<StepWeights>,
}

impl<'a> SteppedMove<'a> {
    /// # Errors
    /// When the range leaves the record, the anchors coincide or time runs backward.
    pub(super) fn of(
        time_s: &'a [f64],
        raw: &'a [Vector3<f64>],
        range: &MoveRange,
        model: RateModel,
    ) -> Result<Self> {
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
        let is_number = |&k: &usize| raw[k].iter().all(|x| x.is_finite()) && time_s[k].is_finite();
        let mut used: Vec<usize> = Vec::with_capacity(range.stop - range.start);
        for k in (range.start..range.stop).filter(is_number) {
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
        Ok(Self {
            time_s,
            raw,
            anchor_before_s: range.anchor_before_s,
            span_s,
            steps: step_weights(time_s, &used, model),
        })
    }

    /// `∫ w' dt` over the move, raw unit · s: the rotation angle by the gyro where the axis of rotation is fixed; and
    /// the integrated time, s.
    pub(super) fn raw_integral(&self) -> (Vector3<f64>, f64) {
        let angles = self
            .steps
            .iter()
            .map(|step| step.moments(|k| self.raw[k]).0);
        (angles.sum(), self.steps.iter().map(|step| step.h).sum())
    }

    /// Rotation and sensitivities for `ω = S w' + b`, `b` linear from `before` to `after`, rad/s (equation 5.4).
    pub(super) fn integrate(
        &self,
        scale: &Matrix3<f64>,
        before: &Vector3<f64>,
        after: &Vector3<f64>,
        noise: &RateNoise,
    ) -> Turn {
        let change = (after - before) / self.span_s;
        let density2 = noise.density.component_mul(&noise.density);
        let mut turn = Turn {
            rotation: Matrix3::identity(),
            wrt_scale: WrtScale::zeros(),
            wrt_bias_before: Matrix3::zeros(),
            wrt_bias_after: Matrix3::zeros(),
            wrt_room: Matrix3::zeros(),
            cov_noise: Matrix3::zeros(),
        };
        let lasts_s: f64 = self.steps.iter().map(|step| step.h).sum();
        // ∫ R and ∫ R t/T of the attitude R = Bᵀ, by trapezoids.
        let (mut whole, mut weighed, mut share) = (Matrix3::zeros(), Matrix3::zeros(), 0.0);
        for step in &self.steps {
            let h = step.h;
            let (half, attitude) = (0.5 * h, turn.rotation.transpose());
            whole += attitude * half;
            weighed += attitude * (half * share);
            let (m0, m1) = step.moments(|k| self.raw[k]);
            let middle_s = 0.5 * (self.time_s[step.from] + self.time_s[step.to]);
            let since_s = middle_s - self.anchor_before_s;
            let phi0 = scale * m0 + (before + change * since_s) * h;
            let phi1 = scale * m1 + change * (h * h / 12.0);
            let phi = phi0 + phi0.cross(&phi1);
            // δθ = Bᵀ J(φ) δφ, δφ = (I − [φ₁]×) δφ₀ + [φ₀]× δφ₁.
            let (back, left) = exp_and_left_jacobian(&phi);
            let to_start = turn.rotation.transpose() * left;
            let p = to_start - to_start * skew(&phi1);
            let q = to_start * skew(&phi0);
            for j in 0..3 {
                for k in 0..3 {
                    let mut column = turn.wrt_scale.column_mut(3 * j + k);
                    column += p.column(j) * m0[k] + q.column(j) * m1[k];
                }
            }
            let (late, slope) = (h * since_s / self.span_s, h * h / 12.0 / self.span_s);
            turn.wrt_bias_before += p * (h - late) - q * slope;
            turn.wrt_bias_after += p * late + q * slope;
            let of_raw = to_start * scale;
            turn.cov_noise += of_raw * Matrix3::from_diagonal(&(density2 * h)) * of_raw.transpose();
            // Lost samples change the rate at an unknown time, uniform over h.
            let is_gap = h > GAP * noise.nominal_step_s;
            let var_time = noise.sigma_time_s.powi(2) + if is_gap { h * h / 12.0 } else { 0.0 };
            if var_time > 0.0 {
                let jump = of_raw * (self.raw[step.to] - self.raw[step.from]);
                turn.cov_noise += jump * jump.transpose() * var_time;
            }
            turn.rotation = back.transpose() * turn.rotation;
            share += h / lasts_s;
            whole += turn.rotation.transpose() * half;
            weighed += turn.rotation.transpose() * (half * share);
        }
        turn.wrt_room = Matrix3::identity() * lasts_s - whole + weighed - weighed * turn.rotation;
        turn
    }
}
