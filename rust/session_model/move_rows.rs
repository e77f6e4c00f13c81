//! Rows of the moves (docs/model-session.md, 11.3-11.7).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3x2, SMatrix, SVector, Vector3};
use rayon::prelude::*;

use super::chain::{Layout, Rows};
use super::moves::{Carried, MoveCovariance, MoveModel, N_MOVE, PoseBiases, carry};
use super::response::{Response, Sums, effect_columns, loosened, respond, sums};
use super::rows::{Domain, Group, Kind};
use super::sample_noise::widened;
use super::{
    Distortion, N_MODEL, N_POSE_SCATTER, N_SCATTER, Session, State, Strengths, tangent_plane,
};
use crate::error::{Error, Result};
use crate::sensor_model::LOWER;

/// `L⁻¹` of a move's covariance `L Lᵀ`.
pub type Whitening = SMatrix<f64, N_MOVE, N_MOVE>;
/// Five residuals of a move, SI.
pub type MoveResidual = SVector<f64, N_MOVE>;

/// Degrees of freedom of the tails of moves: a residual of a hundred times the noise, as a jolt or lost samples leave,
/// costs 70 in twice a log-likelihood and not ten thousand; one of the size of the noise has its full weight.
pub(super) const DEGREES: f64 = 4.0;

/// Whitening of a move under Student t noise of this `covariance` about its `residual`, the weight of that residual and
/// the logarithm of the weight's prior, which is 0 at 1 (11.18a): the tightest Gaussian bound of the t density.
pub(super) fn with_tails(
    covariance: &MoveCovariance,
    residual: &MoveResidual,
) -> Option<(Whitening, f64, f64)> {
    let white = covariance.cholesky()?.l().try_inverse()?;
    let chi2 = (white * residual).norm_squared();
    let weight = ((DEGREES + N_MOVE as f64) / (DEGREES + chi2)).min(1.0);
    Some((white * weight.sqrt(), weight, prior_of(weight)))
}

/// Logarithm of the prior of a move's weight.
pub(super) fn prior_of(weight: f64) -> f64 {
    0.5 * DEGREES * (weight.ln() - weight + 1.0)
}

/// Whitening of the moves, fixed while the solver runs and renewed between runs: more noise would lower the cost.
#[derive(Debug, Clone)]
pub struct Weights {
    /// Whitening of each move.
    pub white: Vec<Whitening>,
    /// Weight of each move's residuals under heavy tails, at most 1; contained in `white`.
    pub tail: Vec<f64>,
    /// Plane in which the vertical after each move is compared.
    pub plane: Vec<Matrix3x2<f64>>,
    /// Covariance of each move.
    covariance: Vec<MoveCovariance>,
}

impl Weights {
    /// Weights from integrated moves, with heavy tails about their residuals.
    ///
    /// # Errors
    /// When the noise of a move cannot be whitened.
    pub fn of(passed: &[Passed], strengths: &Strengths) -> Result<Self> {
        let covariance = passed.iter().map(|one| one.covariance(strengths));
        let residual = passed.iter().map(|one| one.carried.residual);
        Self::whitening(passed, covariance.collect(), residual)
    }

    /// Weights of Gaussian noise.
    ///
    /// # Errors
    /// When the noise of a move cannot be whitened.
    pub fn gaussian(passed: &[Passed], strengths: &Strengths) -> Result<Self> {
        let covariance = passed.iter().map(|one| one.covariance(strengths));
        let nothing = passed.iter().map(|_| MoveResidual::zeros());
        Self::whitening(passed, covariance.collect(), nothing)
    }

    /// Weights from integrated moves half way from `before`: the solution under weights that follow it may alternate
    /// between two points, while half way it converges to the one that gives its own weights.
    ///
    /// # Errors
    /// When the noise of a move cannot be whitened.
    pub fn between(before: &Self, passed: &[Passed], strengths: &Strengths) -> Result<Self> {
        let each = passed.iter().zip(&before.covariance);
        let covariance = each.map(|(one, known)| 0.5 * (one.covariance(strengths) + known));
        let residual = passed.iter().map(|one| one.carried.residual);
        Self::whitening(passed, covariance.collect(), residual)
    }

    fn whitening(
        passed: &[Passed],
        covariance: Vec<MoveCovariance>,
        residual: impl Iterator<Item = MoveResidual>,
    ) -> Result<Self> {
        let each = covariance
            .iter()
            .zip(residual)
            .enumerate()
            .map(|(m, (one, residual))| {
                with_tails(one, &residual).ok_or_else(|| {
                    Error::not_determined(format!(
                        "move {m} has no noise or turns nothing: its residuals cannot be weighed"
                    ))
                })
            });
        let each: Vec<_> = each.collect::<Result<_>>()?;
        Ok(Self {
            white: each.iter().map(|one| one.0).collect(),
            tail: each.iter().map(|one| one.1).collect(),
            plane: passed.iter().map(|one| one.plane).collect(),
            covariance,
        })
    }
}

/// One move integrated at a state, with its derivatives.
#[derive(Debug, Clone)]
pub struct Passed {
    /// Forward integration.
    pub carried: Arc<Carried>,
    /// Derivatives with respect to every sample, from the backward pass.
    pub response: Arc<Response>,
    /// Derivatives with respect to parameters: products of the response with the readings.
    pub sums: Sums,
    /// Plane in which the vertical after the move is compared.
    pub plane: Matrix3x2<f64>,
    /// Covariance added by biases of unit scatter (accelerometer, each axis of the gyro) that depart from the line
    /// between their poses.
    pub loose: Option<[MoveCovariance; N_SCATTER]>,
}

impl Passed {
    /// Covariance of the residuals: noise of the samples, and biases that depart from the line between their poses.
    #[must_use]
    pub fn covariance(&self, strengths: &Strengths) -> MoveCovariance {
        let mut out = widened(&self.response, strengths.excess);
        if let Some(loose) = &self.loose {
            for (s, loose) in loose.iter().enumerate() {
                out += loose * (strengths.scatter[s] * strengths.between[s.min(1)]).powi(2);
            }
        }
        out
    }
}

impl Session {
    pub(super) fn move_model<'a>(
        &self,
        state: &State,
        index: usize,
        plane: Matrix3x2<f64>,
        effects: &'a Effects,
    ) -> MoveModel<'a> {
        let one = &self.moves[index];
        let (i, j) = (one.before, one.before + 1);
        let first = self.n_poses() + one.first_point;
        let part = |values: Option<&'a Vec<Vector3<f64>>>| -> Option<&'a [Vector3<f64>]> {
            values.map(|v| &v[first..first + one.n_samples()])
        };
        let of_poses = |bias: &[Vector3<f64>], own: &[Vector3<f64>]| PoseBiases {
            walking: [bias[i] - own[i], bias[j] - own[j]],
            own: [own[i], own[j]],
        };
        MoveModel {
            gravity: self.gravity,
            force_scale: state.force_scale,
            force_bias: state.force_bias,
            rate_scale: state.rate_scale,
            pose_rate_bias: of_poses(&state.pose_rate_bias, &state.own[1]),
            pose_force_bias: of_poses(&state.pose_force_bias, &state.own[0]),
            up: [0, 1].map(|end| (state.up[i + end] + one.leans[end]).normalize()),
            plane,
            force_effect: part(effects.force.as_ref()),
            rate_effect: part(effects.rate.as_ref()),
        }
    }

    /// Planes of comparison of all moves at a state.
    #[must_use]
    pub fn planes(&self, state: &State) -> Vec<Matrix3x2<f64>> {
        let plane = |m: usize| tangent_plane(&state.up[self.moves[m].before + 1]);
        (0..self.moves.len()).map(plane).collect()
    }

    /// All moves integrated at a state, with their derivatives.
    #[must_use]
    pub fn pass(
        &self,
        state: &State,
        distortion: &Distortion,
        planes: &[Matrix3x2<f64>],
    ) -> Vec<Passed> {
        self.pass_carried(state, distortion, planes, vec![None; self.moves.len()])
    }

    /// [`pass`](Self::pass) with moves that may be integrated at that state already.
    pub(super) fn pass_carried(
        &self,
        state: &State,
        distortion: &Distortion,
        planes: &[Matrix3x2<f64>],
        known: Vec<Option<Carried>>,
    ) -> Vec<Passed> {
        let effects = Effects::at(distortion, state);
        known
            .into_par_iter()
            .enumerate()
            .map(|(m, known)| {
                let one = &self.moves[m];
                let move_model = self.move_model(state, m, planes[m], &effects);
                let carried = known.unwrap_or_else(|| carry(one, &move_model));
                let response = respond(one, &move_model, &carried, &self.noise);
                let sums = sums(one, &move_model, &response, &LOWER);
                let loose = self
                    .scatter
                    .as_ref()
                    .map(|scatter| loosened(one, &move_model, &response, scatter));
                Passed {
                    carried: Arc::new(carried),
                    response: Arc::new(response),
                    sums,
                    plane: planes[m],
                    loose,
                }
            })
            .collect()
    }

    /// (11.3)-(11.7): five rows of a move.
    pub(super) fn move_rows(
        &self,
        index: usize,
        state: &State,
        distortion: &Distortion,
        layout: Layout,
        weights: &Weights,
        passed: &Passed,
    ) -> Group {
        let one = &self.moves[index];
        let (i, j) = (one.before, one.before + 1);
        let mut rows = Rows::new(
            DVector::from_column_slice(passed.carried.residual.as_slice()),
            layout,
            i,
        );
        rows.next = DMatrix::zeros(N_MOVE, layout.pose);
        let Sums {
            force_model,
            rate_model,
            pose_rate_bias,
            pose_force_bias,
            own,
        } = &passed.sums;
        rows.border.columns_mut(0, 9).copy_from(force_model);
        rows.border.columns_mut(9, 9).copy_from(rate_model);
        rows.here.columns_mut(2, 3).copy_from(&pose_rate_bias[0]);
        rows.next.columns_mut(2, 3).copy_from(&pose_rate_bias[1]);
        rows.here.columns_mut(5, 3).copy_from(&pose_force_bias[0]);
        rows.next.columns_mut(5, 3).copy_from(&pose_force_bias[1]);
        if layout.pose == N_POSE_SCATTER {
            for (by_own, column) in own.iter().zip([11, 8]) {
                rows.here.columns_mut(column, 3).copy_from(by_own);
                rows.next.columns_mut(column, 3).copy_from(&-by_own);
            }
        }
        let (from, to) = (tangent_plane(&state.up[i]), tangent_plane(&state.up[j]));
        rows.here
            .view_mut((0, 0), (2, 2))
            .copy_from(&(passed.response.lever * from));
        rows.here
            .view_mut((2, 0), (3, 2))
            .copy_from(&(-from * (self.gravity * one.duration_s)));
        rows.next
            .view_mut((0, 0), (2, 2))
            .copy_from(&(-passed.plane.transpose() * to * self.gravity));
        if distortion.k > 0 {
            let columns = self.move_effect(index, distortion, passed);
            rows.border
                .columns_mut(N_MODEL, distortion.k)
                .copy_from(&columns);
        }
        let white = weights.white[index];
        let whiten = |block: &DMatrix<f64>| -> DMatrix<f64> {
            DMatrix::from_fn(N_MOVE, block.ncols(), |r, c| {
                (0..=r).map(|k| white[(r, k)] * block[(k, c)]).sum()
            })
        };
        rows.residual = DVector::from_column_slice((white * passed.carried.residual).as_slice());
        rows.border = whiten(&rows.border);
        rows.here = whiten(&rows.here);
        rows.next = whiten(&rows.next);
        Group {
            rows,
            domain: Domain::Moves,
            kind: Kind::Reading,
            segment: index,
            // Models with different weights of the moves are compared: a smaller weight lowers the normalisation.
            log_weight: white.diagonal().map(f64::ln).sum() + prior_of(weights.tail[index]),
        }
    }

    pub(super) fn move_effect(
        &self,
        index: usize,
        distortion: &Distortion,
        passed: &Passed,
    ) -> DMatrix<f64> {
        let one = &self.moves[index];
        let width = 3 * distortion.k;
        let first = self.n_poses() + one.first_point;
        let span = first * width..(first + one.n_samples()) * width;
        effect_columns(
            &passed.response,
            distortion.force.as_ref().map(|v| &v[span.clone()]),
            distortion.rate.as_ref().map(|v| &v[span.clone()]),
            distortion.k,
        )
    }
}

/// Effects of both sensors at every point.
pub(super) struct Effects {
    force: Option<Vec<Vector3<f64>>>,
    rate: Option<Vec<Vector3<f64>>>,
}

impl Effects {
    pub(super) fn at(distortion: &Distortion, state: &State) -> Self {
        Self {
            force: Distortion::at(distortion.force.as_ref(), distortion.k, &state.effect),
            rate: Distortion::at(distortion.rate.as_ref(), distortion.k, &state.effect),
        }
    }
}
