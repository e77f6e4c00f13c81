//! Derivatives of the residuals of a move by every sample: one backward pass, and products with it
//! (docs/model-session.md, equations 11.5-11.7).

use std::f64::consts::PI;

use nalgebra::{DMatrix, Matrix2x3, Matrix3, SMatrix, Vector3};

use super::N_SCATTER;
use super::moves::{Carried, Move, MoveCovariance, MoveModel, MoveNoise, N_MOVE};
use super::sample_noise::of_samples;
use crate::aliasing::GAP;
use crate::rotation::skew;

/// Derivatives of the five residuals by rate and force at each sample.
#[derive(Debug, Clone)]
pub struct Response {
    /// `(5, 3)` per sample.
    pub by_rate: Vec<SMatrix<f64, N_MOVE, 3>>,
    /// `(3, 3)` per sample: only the velocity depends on the force.
    pub by_force: Vec<Matrix3<f64>>,
    /// Covariance of the residuals from noise that is measured, not widened.
    pub covariance: MoveCovariance,
    /// Covariance by motion faster than the samples, extrapolated from their spectrum.
    pub unresolved: MoveCovariance,
    /// `g Tᵀ C` at the end.
    pub lever: Matrix2x3<f64>,
}

/// Derivatives of the residuals by every sample, and their covariance (11.5, 11.6).
#[must_use]
pub fn respond(
    one: &Move,
    move_model: &MoveModel<'_>,
    carried: &Carried,
    noise: &MoveNoise,
) -> Response {
    let n = one.n_samples();
    let last = one.steps.last().map_or(0, |step| step.to);
    let lever: Matrix2x3<f64> =
        move_model.plane.transpose() * carried.attitude[last] * move_model.gravity;
    let mut by_rate = vec![SMatrix::<f64, N_MOVE, 3>::zeros(); n];
    let mut by_force = vec![Matrix3::zeros(); n];
    for k in 0..n {
        by_force[k] = carried.attitude[k].transpose() * one.weight[k];
    }
    let mut covariance = MoveCovariance::zeros();
    // Derivative of the residuals by a rotation at this step: the vertical at the end, the velocity still to be gained.
    let mut to_turn = SMatrix::<f64, N_MOVE, 3>::zeros();
    to_turn
        .fixed_rows_mut::<2>(0)
        .copy_from(&(lever * skew(&move_model.up[0])));
    let var_jitter = noise.jitter_s * noise.jitter_s;
    let mut still_to_come = Vector3::zeros();
    let mut gaps = one.gaps.iter().rev().peekable();
    for (i, (step, turn)) in one.steps.iter().zip(&carried.turns).enumerate().rev() {
        still_to_come += by_force[step.to] * carried.force[step.to];
        to_turn
            .fixed_rows_mut::<3>(2)
            .copy_from(&(-skew(&still_to_come)));
        let [phi0, phi1] = &turn.moments;
        let to_start = to_turn * carried.attitude[step.from].tr_mul(&turn.left);
        let zeroth = to_start - times_skew(&to_start, phi1);
        let first = times_skew(&to_start, phi0);
        for j in 0..4 {
            if step.zeroth[j] != 0.0 || step.first[j] != 0.0 {
                by_rate[step.sample[j]] += zeroth * step.zeroth[j] + first * step.first[j];
            }
        }
        let gap = gaps.next_if(|gap| gap.step == i);
        let density = [&noise.force_density, &noise.rate_density];
        let missed = gap.and_then(|gap| gap.variance(density, one.step_s));
        if let Some([of_force, of_rate]) = &missed {
            let spread = |scale: &Matrix3<f64>, v: &Vector3<f64>| {
                scale * Matrix3::from_diagonal(v) * scale.transpose()
            };
            covariance += zeroth * spread(&move_model.rate_scale, of_rate) * zeroth.transpose();
            let turned = carried.attitude[step.from].transpose();
            let mut velocity = covariance.fixed_view_mut::<3, 3>(2, 2);
            velocity += turned * spread(&move_model.force_scale, of_force) * turned.transpose();
        }
        if missed.is_none() && step.h > GAP * noise.nominal_step_s {
            // Nothing is known of a turn in a gap longer than any move, or of a force, but that a hand's is about |g|.
            covariance += zeroth * zeroth.transpose() * (PI * PI / 3.0);
            let mut velocity = covariance.fixed_view_mut::<3, 3>(2, 2);
            velocity += Matrix3::identity() * (move_model.gravity * step.h).powi(2);
        }
        if var_jitter > 0.0 {
            let jump = zeroth * (carried.rate[step.to] - carried.rate[step.from]);
            covariance.ger(var_jitter, &jump, &jump, 1.0);
            let jump = carried.attitude[step.from]
                .tr_mul(&(carried.force[step.to] - carried.force[step.from]));
            let mut velocity = covariance.fixed_view_mut::<3, 3>(2, 2);
            velocity.ger(var_jitter, &jump, &jump, 1.0);
        }
    }
    let [white, unresolved] = of_samples(one, move_model, noise, &by_rate, &by_force);
    Response {
        by_rate,
        by_force,
        covariance: covariance + white,
        unresolved,
        lever,
    }
}

/// `M [v]×`.
fn times_skew(m: &SMatrix<f64, N_MOVE, 3>, v: &Vector3<f64>) -> SMatrix<f64, N_MOVE, 3> {
    let (x, y, z) = (m.column(0), m.column(1), m.column(2));
    SMatrix::from_columns(&[y * v.z - z * v.y, z * v.x - x * v.z, x * v.y - y * v.x])
}

/// Derivatives of the residuals with respect to the parameters that act on the samples, `(5, k)` each.
#[derive(Debug, Clone)]
pub struct Sums {
    /// With respect to the lower elements of the accelerometer's `S`, then `b`.
    pub force_model: SMatrix<f64, N_MOVE, 9>,
    /// With respect to the gyro's `S`, row by row.
    pub rate_model: SMatrix<f64, N_MOVE, 9>,
    /// With respect to the raw biases of the gyro before and after.
    pub pose_rate_bias: [SMatrix<f64, N_MOVE, 3>; 2],
    /// With respect to the raw biases of the accelerometer before and after.
    pub pose_force_bias: [SMatrix<f64, N_MOVE, 3>; 2],
    /// With respect to the part of either bias (accelerometer, gyro) that belongs to the pose before alone, the bias
    /// itself held; to that of the pose after with the opposite sign.
    pub own: [SMatrix<f64, N_MOVE, 3>; 2],
}

/// Sums of the response over the samples.
#[must_use]
pub fn sums(
    one: &Move,
    move_model: &MoveModel<'_>,
    response: &Response,
    lower: &[(usize, usize); 6],
) -> Sums {
    let mut force_model = SMatrix::<f64, N_MOVE, 9>::zeros();
    let mut rate_model = SMatrix::<f64, N_MOVE, 9>::zeros();
    let mut rates = [SMatrix::<f64, N_MOVE, 3>::zeros(); 2];
    let mut forces = [Matrix3::zeros(); 2];
    let (mut own_rate, mut own_force) = (SMatrix::<f64, N_MOVE, 3>::zeros(), Matrix3::zeros());
    for k in 0..one.n_samples() {
        let x = one.fraction[k];
        let (r, f) = (&response.by_rate[k], &response.by_force[k]);
        let w = one.rate[k] - move_model.pose_rate_bias.at(one, k);
        let a = one.force[k] - move_model.pose_force_bias.at(one, k);
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
        own_rate += r * (x - one.progress[k]);
        own_force += f * (x - one.progress[k]);
    }
    let of_velocity = |part: Matrix3<f64>| {
        let mut out = SMatrix::<f64, N_MOVE, 3>::zeros();
        out.fixed_view_mut::<3, 3>(2, 0)
            .copy_from(&(-part * move_model.force_scale));
        out
    };
    Sums {
        force_model,
        rate_model,
        pose_rate_bias: rates.map(|part| -part * move_model.rate_scale),
        pose_force_bias: forces.map(of_velocity),
        own: [of_velocity(own_force), -own_rate * move_model.rate_scale],
    }
}

/// Covariance of the residuals where biases (accelerometer, each axis of the gyro) depart from the line between their
/// poses during the move, by `scatter` at its first and at its last sample, independently (11.6).
///
/// A bias that differs from pose to pose jumps somewhere, or takes a third value on the way: the line is then wrong by
/// about its scatter, and no reading of a pose shows by how much.
#[must_use]
pub fn loosened(
    one: &Move,
    move_model: &MoveModel<'_>,
    response: &Response,
    scatter: &[Vector3<f64>; 2],
) -> [MoveCovariance; N_SCATTER] {
    let mut rates = [SMatrix::<f64, N_MOVE, 3>::zeros(); 2];
    let mut forces = [Matrix3::zeros(); 2];
    for k in 0..one.n_samples() {
        let y = one.progress[k];
        let (r, f) = (&response.by_rate[k], &response.by_force[k]);
        rates[0] += r * (1.0 - y);
        rates[1] += r * y;
        forces[0] += f * (1.0 - y);
        forces[1] += f * y;
    }
    let mut out = [MoveCovariance::zeros(); N_SCATTER];
    for end in 0..2 {
        let rate = rates[end] * move_model.rate_scale * Matrix3::from_diagonal(&scatter[1]);
        for axis in 0..3 {
            out[1 + axis] += rate.column(axis) * rate.column(axis).transpose();
        }
        let force = forces[end] * move_model.force_scale * Matrix3::from_diagonal(&scatter[0]);
        let mut velocity = out[0].fixed_view_mut::<3, 3>(2, 2);
        velocity += force * force.transpose();
    }
    out
}

/// `(5, k)` change of the residuals per effect parameter: `force`, `rate` are `(3, k)` per sample, parameter after
/// parameter (11.7).
#[must_use]
pub fn effect_columns(
    response: &Response,
    force: Option<&[f64]>,
    rate: Option<&[f64]>,
    k: usize,
) -> DMatrix<f64> {
    // Row by row, so that the loop runs along the parameters; small numbers of them are known to the compiler.
    let mut out = vec![0.0; N_MOVE * k];
    let sum = match k {
        1 => add_effects::<1>,
        2 => add_effects::<2>,
        3 => add_effects::<3>,
        // Of a session with a g-sensitivity.
        11 => add_effects::<11>,
        _ => add_effects::<0>,
    };
    if k > 0 {
        sum(response, force, rate, k, &mut out);
    }
    DMatrix::from_row_slice(N_MOVE, k, &out)
}

/// The sums of [`effect_columns`] with `K` parameters, or with any number for `K = 0`.
fn add_effects<const K: usize>(
    response: &Response,
    force: Option<&[f64]>,
    rate: Option<&[f64]>,
    k: usize,
    out: &mut [f64],
) {
    let k = if K == 0 { k } else { K };
    if let Some(rate) = rate {
        for (r, row) in response.by_rate.iter().zip(rate.chunks_exact(3 * k)) {
            for (i, own) in out.chunks_exact_mut(k).enumerate() {
                subtract_along(own, [r[(i, 0)], r[(i, 1)], r[(i, 2)]], row);
            }
        }
    }
    if let Some(force) = force {
        for (f, row) in response.by_force.iter().zip(force.chunks_exact(3 * k)) {
            for (i, own) in out[2 * k..].chunks_exact_mut(k).enumerate() {
                subtract_along(own, [f[(i, 0)], f[(i, 1)], f[(i, 2)]], row);
            }
        }
    }
}

/// Subtracts `Σ response_i row_i`, where `row` holds three vectors one after the other.
#[inline]
fn subtract_along(out: &mut [f64], response: [f64; 3], row: &[f64]) {
    let k = out.len();
    let (x, rest) = row.split_at(k);
    let (y, z) = rest.split_at(k);
    for (((o, x), y), z) in out.iter_mut().zip(x).zip(y).zip(z) {
        *o -= response[0] * x + response[1] * y + response[2] * z;
    }
}
