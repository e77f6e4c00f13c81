//! One move as the session sees it: forward for the residuals, backward for their response to every sample.
//!
//! The rate `ω = S (w' - z) - D p` is carried through the fourth-order steps of [`crate::poisson`]; the velocity is a
//! sum over the same samples. One backward pass gives the derivative of the five residuals with respect to the rate and
//! the force at every sample, exactly as they were computed; the columns of all parameters and of any effect are
//! products with it (docs/model-session.md, equations 11.3-11.6).

use nalgebra::{DMatrix, Matrix2x3, Matrix3, Matrix3x2, SMatrix, SVector, Vector3};

use crate::poisson::{RateModel, StepWeights, step_weights};
use crate::rotation::{exp_and_left_jacobian, skew};

/// Residuals of a move: gravity across the vertical after it (2), velocity over it (3).
pub const N_MOVE: usize = 5;
/// Covariance of these residuals.
pub type MoveCovariance = SMatrix<f64, N_MOVE, N_MOVE>;

/// A step longer than this many usual ones has lost samples.
const GAP: f64 = 1.5;

/// What is read in one move and does not depend on the model.
#[derive(Debug, Clone)]
pub struct Move {
    /// Hold before; the move ends in the next one.
    pub before: usize,
    /// Raw rate of each sample, centred.
    pub rate: Vec<Vector3<f64>>,
    /// Raw force of each sample, centred.
    pub force: Vec<Vector3<f64>>,
    /// Where each sample lies between the anchors of the zeros: 0 before, 1 after.
    pub fraction: Vec<f64>,
    /// Trapezoid weights, s.
    pub weight: Vec<f64>,
    /// Steps of the attitude.
    pub steps: Vec<StepWeights>,
    /// From first to last sample, s.
    pub duration_s: f64,
    /// Mean step, s.
    pub step_s: f64,
    /// Variance of the integrals of force and rate by motion faster than the samples, (raw unit · s)².
    pub unresolved: [Vector3<f64>; 2],
    /// First of its samples among the points of all moves.
    pub first_point: usize,
}

impl Move {
    /// Prepares a move; samples that share a stamp carry no weight.
    #[must_use]
    pub fn new(
        before: usize,
        time_s: &[f64],
        rate: Vec<Vector3<f64>>,
        force: Vec<Vector3<f64>>,
        anchors_s: [f64; 2],
        unresolved: [Vector3<f64>; 2],
        first_point: usize,
    ) -> Self {
        let n = time_s.len();
        let mut used: Vec<usize> = Vec::with_capacity(n);
        for k in 0..n {
            if used.last().is_none_or(|&last| time_s[k] > time_s[last]) {
                used.push(k);
            }
        }
        let mut weight = vec![0.0; n];
        for pair in used.windows(2) {
            let h = time_s[pair[1]] - time_s[pair[0]];
            weight[pair[0]] += 0.5 * h;
            weight[pair[1]] += 0.5 * h;
        }
        let (first, last) = (time_s[0], time_s[used.last().copied().unwrap_or_default()]);
        let duration_s = last - first;
        // Zeros belong to the middles of their holds.
        let span = (anchors_s[1] - anchors_s[0]).max(duration_s);
        Self {
            before,
            fraction: time_s
                .iter()
                .map(|t| ((t - anchors_s[0]) / span).clamp(0.0, 1.0))
                .collect(),
            weight,
            steps: step_weights(time_s, &used, RateModel::Coning),
            duration_s,
            step_s: duration_s / (used.len().max(2) - 1) as f64,
            rate,
            force,
            unresolved,
            first_point,
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn n_samples(&self) -> usize {
        self.rate.len()
    }
}

/// Model values that a move needs: both sensors, zeros of its two holds, verticals, distortion of each sample.
#[derive(Debug)]
pub struct Sees<'a> {
    /// |g|.
    pub gravity: f64,
    /// Accelerometer `S`.
    pub force_scale: Matrix3<f64>,
    /// Accelerometer `b`, for centred readings.
    pub force_bias: Vector3<f64>,
    /// Gyro `S`.
    pub rate_scale: Matrix3<f64>,
    /// Raw zeros of the gyro in the holds before and after.
    pub rate_zero: [Vector3<f64>; 2],
    /// Raw zeros of the accelerometer there.
    pub force_zero: [Vector3<f64>; 2],
    /// Verticals there.
    pub up: [Vector3<f64>; 2],
    /// Plane in which the vertical after is compared.
    pub plane: Matrix3x2<f64>,
    /// What effects add to the force at a sample, SI.
    pub force_effect: Option<&'a [Vector3<f64>]>,
    /// What effects add to the rate at a sample, SI.
    pub rate_effect: Option<&'a [Vector3<f64>]>,
}

/// Noise of the samples.
#[derive(Debug, Clone, Copy)]
pub struct MoveNoise {
    /// White noise of the accelerometer, raw unit · √s.
    pub force_density: Vector3<f64>,
    /// White noise of the gyro, raw unit · √s.
    pub rate_density: Vector3<f64>,
    /// Scatter of sample instants about their stamps, s.
    pub jitter_s: f64,
    /// Usual sample step, s.
    pub nominal_step_s: f64,
    /// Factors on the standard errors of the two kinds of residuals.
    pub inflation: [f64; 2],
}

/// A move carried forward.
#[derive(Debug, Clone)]
pub struct Carried {
    /// Corrected rate of each sample, rad/s.
    pub rate: Vec<Vector3<f64>>,
    /// Corrected force of each sample, m/s².
    pub force: Vec<Vector3<f64>>,
    /// Start → each sample.
    pub attitude: Vec<Matrix3<f64>>,
    /// The five residuals, SI.
    pub residual: SVector<f64, N_MOVE>,
}

/// Response of the five residuals to rate and force at each sample.
#[derive(Debug, Clone)]
pub struct Response {
    /// `(5, 3)` a sample.
    pub by_rate: Vec<SMatrix<f64, N_MOVE, 3>>,
    /// `(3, 3)` a sample: the velocity alone answers to the force.
    pub by_force: Vec<Matrix3<f64>>,
    /// Covariance of the residuals.
    pub covariance: MoveCovariance,
    /// `g Tᵀ C` at the end.
    pub lever: Matrix2x3<f64>,
}

/// Integrates a move (11.3, 11.4).
#[must_use]
pub fn carry(one: &Move, sees: &Sees<'_>) -> Carried {
    let n = one.n_samples();
    let mut rate = Vec::with_capacity(n);
    let mut force = Vec::with_capacity(n);
    for k in 0..n {
        let x = one.fraction[k];
        let zero = sees.rate_zero[0] * (1.0 - x) + sees.rate_zero[1] * x;
        let mut w = sees.rate_scale * (one.rate[k] - zero);
        if let Some(effect) = sees.rate_effect {
            w -= effect[k];
        }
        rate.push(w);
        let zero = sees.force_zero[0] * (1.0 - x) + sees.force_zero[1] * x;
        let mut f = sees.force_scale * (one.force[k] - zero) + sees.force_bias;
        if let Some(effect) = sees.force_effect {
            f -= effect[k];
        }
        force.push(f);
    }
    let mut attitude = vec![Matrix3::identity(); n];
    let mut velocity = force[0] * one.weight[0];
    let mut done = 0;
    for step in &one.steps {
        let (phi0, phi1) = step.moments(|k| rate[k]);
        let (turn, _) = exp_and_left_jacobian(&(phi0 + phi0.cross(&phi1)));
        let here = turn.transpose() * attitude[step.from];
        // Samples that share a stamp share its attitude.
        for k in done + 1..step.to {
            attitude[k] = attitude[step.from];
        }
        attitude[step.to] = here;
        done = step.to;
        velocity += here.tr_mul(&force[step.to]) * one.weight[step.to];
    }
    for k in done + 1..n {
        attitude[k] = attitude[done];
    }
    let gravity = sees.gravity;
    let across = sees.plane.transpose() * (attitude[done] * sees.up[0] - sees.up[1]) * gravity;
    let gained = velocity - sees.up[0] * (gravity * one.duration_s);
    let mut residual = SVector::<f64, N_MOVE>::zeros();
    residual.fixed_rows_mut::<2>(0).copy_from(&across);
    residual.fixed_rows_mut::<3>(2).copy_from(&gained);
    Carried {
        rate,
        force,
        attitude,
        residual,
    }
}

/// Response of the residuals to every sample, and their covariance (11.5, 11.6).
#[must_use]
pub fn respond(one: &Move, sees: &Sees<'_>, carried: &Carried, noise: &MoveNoise) -> Response {
    let n = one.n_samples();
    let last = one.steps.last().map_or(0, |step| step.to);
    let lever: Matrix2x3<f64> = sees.plane.transpose() * carried.attitude[last] * sees.gravity;
    let mut by_rate = vec![SMatrix::<f64, N_MOVE, 3>::zeros(); n];
    let mut by_force = vec![Matrix3::zeros(); n];
    for k in 0..n {
        by_force[k] = carried.attitude[k].transpose() * one.weight[k];
    }
    let mut covariance = MoveCovariance::zeros();
    // What the residuals answer to a turn made now: the vertical at the end, the velocity still to be gained.
    let mut to_turn = SMatrix::<f64, N_MOVE, 3>::zeros();
    to_turn
        .fixed_rows_mut::<2>(0)
        .copy_from(&(lever * skew(&sees.up[0])));
    let var_jitter = noise.jitter_s * noise.jitter_s;
    let mut still_to_come = Vector3::zeros();
    for step in one.steps.iter().rev() {
        still_to_come += by_force[step.to] * carried.force[step.to];
        to_turn
            .fixed_rows_mut::<3>(2)
            .copy_from(&(-skew(&still_to_come)));
        let (phi0, phi1) = step.moments(|k| carried.rate[k]);
        let (_, left) = exp_and_left_jacobian(&(phi0 + phi0.cross(&phi1)));
        let to_start = to_turn * (carried.attitude[step.from].transpose() * left);
        let zeroth = to_start - to_start * skew(&phi1);
        let first = to_start * skew(&phi0);
        for j in 0..4 {
            if step.zeroth[j] != 0.0 || step.first[j] != 0.0 {
                by_rate[step.sample[j]] += zeroth * step.zeroth[j] + first * step.first[j];
            }
        }
        let is_gap = step.h > GAP * noise.nominal_step_s;
        if var_jitter > 0.0 || is_gap {
            // A lost sample leaves the rate anywhere between its neighbours: uniform, so h²/12.
            let var = var_jitter + if is_gap { step.h * step.h / 12.0 } else { 0.0 };
            let jump = zeroth * (carried.rate[step.to] - carried.rate[step.from]);
            covariance.ger(var, &jump, &jump, 1.0);
            let jump = carried.attitude[step.from]
                .tr_mul(&(carried.force[step.to] - carried.force[step.from]));
            let mut velocity = covariance.fixed_view_mut::<3, 3>(2, 2);
            velocity.ger(var, &jump, &jump, 1.0);
        }
    }
    add_white(one, sees, noise, &by_rate, &by_force, &mut covariance);
    for i in 0..N_MOVE {
        for j in 0..N_MOVE {
            covariance[(i, j)] *=
                noise.inflation[usize::from(i >= 2)] * noise.inflation[usize::from(j >= 2)];
        }
    }
    Response {
        by_rate,
        by_force,
        covariance,
        lever,
    }
}

fn add_white(
    one: &Move,
    sees: &Sees<'_>,
    noise: &MoveNoise,
    by_rate: &[SMatrix<f64, N_MOVE, 3>],
    by_force: &[Matrix3<f64>],
    covariance: &mut MoveCovariance,
) {
    let diagonal = |density: &Vector3<f64>| density.component_mul(density) / one.step_s;
    let spread = |scale: &Matrix3<f64>, density: &Vector3<f64>, fast: &Vector3<f64>| {
        let white = scale * Matrix3::from_diagonal(&diagonal(density)) * scale.transpose();
        // Motion faster than the samples has no known direction: the same on every axis.
        let extra = (scale.component_mul(scale) * fast).mean() / (one.duration_s * one.step_s);
        white + Matrix3::identity() * extra
    };
    let rate = spread(&sees.rate_scale, &noise.rate_density, &one.unresolved[1]);
    let force = spread(&sees.force_scale, &noise.force_density, &one.unresolved[0]);
    let mut of_velocity = Matrix3::zeros();
    for (r, f) in by_rate.iter().zip(by_force) {
        *covariance += r * rate * r.transpose();
        of_velocity += f * force * f.transpose();
    }
    let mut velocity = covariance.fixed_view_mut::<3, 3>(2, 2);
    velocity += of_velocity;
}

/// Derivatives of the residuals with respect to the parameters that act on the samples, `(5, k)` each.
#[derive(Debug, Clone)]
pub struct Sums {
    /// With respect to the lower elements of the accelerometer's `S`, then `b`.
    pub force_model: SMatrix<f64, N_MOVE, 9>,
    /// With respect to the gyro's `S`, row by row.
    pub rate_model: SMatrix<f64, N_MOVE, 9>,
    /// With respect to the raw zeros of the gyro before and after.
    pub rate_zero: [SMatrix<f64, N_MOVE, 3>; 2],
    /// With respect to the raw zeros of the accelerometer before and after.
    pub force_zero: [SMatrix<f64, N_MOVE, 3>; 2],
}

/// Sums of the response over the samples.
#[must_use]
pub fn sums(one: &Move, sees: &Sees<'_>, response: &Response, lower: &[(usize, usize); 6]) -> Sums {
    let mut force_model = SMatrix::<f64, N_MOVE, 9>::zeros();
    let mut rate_model = SMatrix::<f64, N_MOVE, 9>::zeros();
    let mut rates = [SMatrix::<f64, N_MOVE, 3>::zeros(); 2];
    let mut forces = [Matrix3::zeros(); 2];
    for k in 0..one.n_samples() {
        let x = one.fraction[k];
        let (r, f) = (&response.by_rate[k], &response.by_force[k]);
        let w = one.rate[k] - (sees.rate_zero[0] * (1.0 - x) + sees.rate_zero[1] * x);
        let a = one.force[k] - (sees.force_zero[0] * (1.0 - x) + sees.force_zero[1] * x);
        for i in 0..3 {
            for j in 0..3 {
                rate_model
                    .column_mut(3 * i + j)
                    .axpy(w[j], &r.column(i), 1.0);
            }
        }
        for (c, &(i, j)) in lower.iter().enumerate() {
            let mut column = force_model.fixed_view_mut::<3, 1>(2, c);
            column.axpy(a[j], &f.column(i), 1.0);
        }
        let mut by_bias = force_model.fixed_view_mut::<3, 3>(2, 6);
        by_bias += f;
        rates[0] += r * (1.0 - x);
        rates[1] += r * x;
        forces[0] += f * (1.0 - x);
        forces[1] += f * x;
    }
    let of_velocity = |part: Matrix3<f64>| {
        let mut out = SMatrix::<f64, N_MOVE, 3>::zeros();
        out.fixed_view_mut::<3, 3>(2, 0)
            .copy_from(&(-part * sees.force_scale));
        out
    };
    Sums {
        force_model,
        rate_model,
        rate_zero: rates.map(|part| -part * sees.rate_scale),
        force_zero: forces.map(of_velocity),
    }
}

/// `(5, k)` change of the residuals per effect parameter: `force`, `rate` are `(3, k)` a sample, parameter after
/// parameter (11.7).
#[must_use]
pub fn effect_columns(
    response: &Response,
    force: Option<&[f64]>,
    rate: Option<&[f64]>,
    k: usize,
) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(N_MOVE, k);
    for (s, (r, f)) in response.by_rate.iter().zip(&response.by_force).enumerate() {
        if let Some(rate) = rate {
            let row = &rate[3 * k * s..3 * k * (s + 1)];
            for c in 0..k {
                let d = Vector3::new(row[c], row[k + c], row[2 * k + c]);
                let change = r * d;
                for i in 0..N_MOVE {
                    out[(i, c)] -= change[i];
                }
            }
        }
        if let Some(force) = force {
            let row = &force[3 * k * s..3 * k * (s + 1)];
            for c in 0..k {
                let d = Vector3::new(row[c], row[k + c], row[2 * k + c]);
                let change = f * d;
                for i in 0..3 {
                    out[(2 + i, c)] -= change[i];
                }
            }
        }
    }
    out
}
