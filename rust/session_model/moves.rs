//! One move in the session model: forward for the residuals, backward for their derivatives by every sample.
//!
//! The rate `ω = S (w' - z) - D p` is integrated by the fourth-order steps of [`crate::poisson`]; the velocity is a sum
//! over the same samples. One backward pass gives the derivative of the five residuals with respect to the rate and the
//! force at every sample, exactly as they were computed; the columns of all parameters and of any effect are products
//! with it (docs/model-session.md, equations 11.3-11.6).

use nalgebra::{Matrix3, Matrix3x2, SMatrix, SVector, Vector3};

use super::gaps::Gap;
use crate::poisson::{RateModel, StepWeights, step_weights};
use crate::rotation::exp_and_left_jacobian;

/// Residuals of a move: tilt error of gravity after it (2, m/s²), velocity error over it (3, m/s).
pub const N_MOVE: usize = 5;
/// Covariance of these residuals.
pub type MoveCovariance = SMatrix<f64, N_MOVE, N_MOVE>;

/// Readings of one move, and what follows from them without the model.
#[derive(Debug, Clone)]
pub struct Move {
    /// Pose before; the move ends in the next one.
    pub before: usize,
    /// Raw rate of each sample, centred.
    pub rate: Vec<Vector3<f64>>,
    /// Raw force of each sample, centred.
    pub force: Vec<Vector3<f64>>,
    /// Position of each sample between the anchors of the biases: 0 before, 1 after.
    pub fraction: Vec<f64>,
    /// Position of each sample in the move: 0 at its first, 1 at its last.
    pub progress: Vec<f64>,
    /// Trapezoid weights, s.
    pub weight: Vec<f64>,
    /// Steps of the attitude.
    pub steps: Vec<StepWeights>,
    /// From first to last sample, s.
    pub duration_s: f64,
    /// Mean step, s.
    pub step_s: f64,
    /// Variance of the integrals of force and rate, (raw unit · s)², from motion faster than the samples; then from
    /// rounding, slow noise and poses that turn at their ends.
    pub unresolved: [Vector3<f64>; 4],
    /// Change of the vertical from the means of the poses before and after to its own ends.
    pub leans: [Vector3<f64>; 2],
    /// Steps over lost samples, by [`super::gaps::find_gaps`].
    pub gaps: Vec<Gap>,
    /// Index of its first sample among the points of all moves.
    pub first_point: usize,
}

impl Move {
    /// Prepares a move; samples that share a timestamp carry no weight.
    #[must_use]
    pub fn new(
        before: usize,
        time_s: &[f64],
        rate: Vec<Vector3<f64>>,
        force: Vec<Vector3<f64>>,
        anchors_s: [f64; 2],
        unresolved: [Vector3<f64>; 4],
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
        // Biases belong to the middles of their poses.
        let span = (anchors_s[1] - anchors_s[0]).max(duration_s);
        let steps = step_weights(time_s, &used, RateModel::Coning);
        Self {
            before,
            fraction: time_s
                .iter()
                .map(|t| ((t - anchors_s[0]) / span).clamp(0.0, 1.0))
                .collect(),
            progress: time_s
                .iter()
                .map(|t| ((t - first) / duration_s.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0))
                .collect(),
            weight,
            gaps: Vec::new(),
            steps,
            duration_s,
            step_s: duration_s / (used.len().max(2) - 1) as f64,
            rate,
            force,
            unresolved,
            leans: [Vector3::zeros(); 2],
            first_point,
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn n_samples(&self) -> usize {
        self.rate.len()
    }
}

/// Biases of the poses before and after a move.
#[derive(Debug, Clone, Copy)]
pub struct PoseBiases {
    /// What walks, between the anchors.
    pub walking: [Vector3<f64>; 2],
    /// What belongs to one pose alone, constant in it: it changes during the move.
    pub own: [Vector3<f64>; 2],
}

impl PoseBiases {
    /// Bias at a sample of a move.
    #[must_use]
    pub fn at(&self, one: &Move, k: usize) -> Vector3<f64> {
        let (x, y) = (one.fraction[k], one.progress[k]);
        self.walking[0] * (1.0 - x)
            + self.walking[1] * x
            + self.own[0] * (1.0 - y)
            + self.own[1] * y
    }
}

/// Model values that a move needs: both sensors, biases of its two poses, verticals, distortion of each sample.
#[derive(Debug)]
pub struct MoveModel<'a> {
    /// |g|.
    pub gravity: f64,
    /// Accelerometer `S`.
    pub force_scale: Matrix3<f64>,
    /// Accelerometer `b`, for centred readings.
    pub force_bias: Vector3<f64>,
    /// Gyro `S`.
    pub rate_scale: Matrix3<f64>,
    /// Raw biases of the gyro in the poses before and after.
    pub pose_rate_bias: PoseBiases,
    /// Raw biases of the accelerometer there.
    pub pose_force_bias: PoseBiases,
    /// Verticals at both ends of the move.
    pub up: [Vector3<f64>; 2],
    /// Plane in which the vertical after is compared.
    pub plane: Matrix3x2<f64>,
    /// Error of the force at every sample by effects, SI.
    pub force_effect: Option<&'a [Vector3<f64>]>,
    /// Error of the rate at every sample by effects, SI.
    pub rate_effect: Option<&'a [Vector3<f64>]>,
}

/// Noise of the samples.
#[derive(Debug, Clone, Copy)]
pub struct MoveNoise {
    /// White noise of the accelerometer, raw unit · √s.
    pub force_density: Vector3<f64>,
    /// White noise of the gyro, raw unit · √s.
    pub rate_density: Vector3<f64>,
    /// Scatter of sample instants about their timestamps, s.
    pub jitter_s: f64,
    /// Usual sample step, s.
    pub nominal_step_s: f64,
}

/// One step of the attitude.
#[derive(Debug, Clone, Copy)]
pub struct Turn {
    /// Zeroth and first moment of the rate.
    pub moments: [Vector3<f64>; 2],
    /// Left Jacobian of the exponential of its rotation vector.
    pub left: Matrix3<f64>,
}

/// A move integrated forward.
#[derive(Debug, Clone)]
pub struct Carried {
    /// Corrected rate of each sample, rad/s.
    pub rate: Vec<Vector3<f64>>,
    /// Corrected force of each sample, m/s².
    pub force: Vec<Vector3<f64>>,
    /// Rotation from the body at the start to the body at each sample.
    pub attitude: Vec<Matrix3<f64>>,
    /// Every step of the attitude.
    pub turns: Vec<Turn>,
    /// The five residuals, SI.
    pub residual: SVector<f64, N_MOVE>,
}

/// Integrates a move (11.3, 11.4).
#[must_use]
pub fn carry(one: &Move, move_model: &MoveModel<'_>) -> Carried {
    let n = one.n_samples();
    let mut rate = Vec::with_capacity(n);
    let mut force = Vec::with_capacity(n);
    for k in 0..n {
        let bias = move_model.pose_rate_bias.at(one, k);
        let mut w = move_model.rate_scale * (one.rate[k] - bias);
        if let Some(effect) = move_model.rate_effect {
            w -= effect[k];
        }
        rate.push(w);
        let bias = move_model.pose_force_bias.at(one, k);
        let mut f = move_model.force_scale * (one.force[k] - bias) + move_model.force_bias;
        if let Some(effect) = move_model.force_effect {
            f -= effect[k];
        }
        force.push(f);
    }
    let mut attitude = vec![Matrix3::identity(); n];
    let mut turns = Vec::with_capacity(one.steps.len());
    let mut velocity = force[0] * one.weight[0];
    let mut done = 0;
    for step in &one.steps {
        let (phi0, phi1) = step.moments(|k| rate[k]);
        let (turn, left) = exp_and_left_jacobian(&(phi0 + phi0.cross(&phi1)));
        turns.push(Turn {
            moments: [phi0, phi1],
            left,
        });
        let here = turn.transpose() * attitude[step.from];
        // Samples that share a timestamp share its attitude.
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
    let gravity = move_model.gravity;
    let across = move_model.plane.transpose()
        * (attitude[done] * move_model.up[0] - move_model.up[1])
        * gravity;
    let gained = velocity - move_model.up[0] * (gravity * one.duration_s);
    let mut residual = SVector::<f64, N_MOVE>::zeros();
    residual.fixed_rows_mut::<2>(0).copy_from(&across);
    residual.fixed_rows_mut::<3>(2).copy_from(&gained);
    Carried {
        rate,
        force,
        attitude,
        turns,
        residual,
    }
}
