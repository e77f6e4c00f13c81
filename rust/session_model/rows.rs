//! Whitened residual rows of a session and their derivatives (docs/model-session.md, equations 11.1-11.8).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::chain::{Layout, Rows};
use super::move_rows::{Effects, Passed, Weights};
use super::moves::{Carried, N_MOVE, carry};
use super::rest_rows::{collapsed, rest_columns, weight_of};
use super::{Distortion, N_MODEL, N_SCATTER, Session, State, Strengths};
use crate::error::{Error, Result};

/// Part of the recording that a row tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// Accelerometer in static poses.
    StaticForce = 0,
    /// Gyro in static poses.
    StaticRate = 1,
    /// Tilt error after a rotation.
    Moves = 2,
    /// Velocity error over a rotation; rows of a move begin with two of `Moves`.
    Dynamics = 3,
    /// Priors that keep undetermined directions finite.
    Prior = 4,
}

/// Process to which a row belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A reading.
    Reading = 0,
    /// Walk of the accelerometer's bias.
    ForceWalk = 1,
    /// Walk of the gyro's bias.
    RateWalk = 2,
    /// Scatter of the accelerometer's bias.
    ForceScatter = 3,
    /// Scatter of the gyro's bias on X.
    RateScatterX = 4,
    /// Scatter of the gyro's bias on Y.
    RateScatterY = 5,
    /// Scatter of the gyro's bias on Z.
    RateScatterZ = 6,
    /// Prior, or row that pins an unknown.
    Prior = 7,
}

/// Number of kinds whose strength is free.
pub const N_PROCESSES: usize = 2 + N_SCATTER;

impl Kind {
    /// Index of the process, if its strength is free.
    #[must_use]
    pub fn process(self) -> Option<usize> {
        match self {
            Self::ForceWalk => Some(0),
            Self::RateWalk => Some(1),
            Self::ForceScatter => Some(2),
            Self::RateScatterX => Some(3),
            Self::RateScatterY => Some(4),
            Self::RateScatterZ => Some(5),
            Self::Reading | Self::Prior => None,
        }
    }
}

/// Rows of one pose, move or step of a walk.
#[derive(Debug, Clone)]
pub struct Group {
    /// The rows.
    pub rows: Rows,
    /// Part of the recording that they test.
    pub domain: Domain,
    /// Their process.
    pub kind: Kind,
    /// Index of the pose or move.
    pub segment: usize,
    /// `ln` of the density's normalisation, for groups whose strength is free.
    pub log_weight: f64,
}

impl Session {
    /// All rows at a state.
    ///
    /// # Errors
    /// When a triad has collapsed.
    pub fn groups(
        &self,
        state: &State,
        strengths: &Strengths,
        distortion: &Distortion,
        weights: &Weights,
        passed: &[Passed],
    ) -> Result<Vec<Group>> {
        let layout = self.layout(distortion.k);
        let mut out = Vec::with_capacity(7 * layout.n_poses);
        self.rest_rows(state, distortion, layout, &mut out)?;
        let moves: Vec<Group> = (0..self.moves.len())
            .into_par_iter()
            .map(|m| self.move_rows(m, state, distortion, layout, weights, &passed[m]))
            .collect();
        out.extend(moves);
        self.process_rows(state, strengths, layout, &mut out);
        self.prior_rows(state, distortion, layout, &mut out);
        Ok(out)
    }

    /// χ² of a state without derivatives, for trial steps, and the moves integrated there.
    ///
    /// # Errors
    /// When a triad has collapsed.
    pub fn chi2(
        &self,
        state: &State,
        strengths: &Strengths,
        distortion: &Distortion,
        weights: &Weights,
    ) -> Result<(f64, Vec<Carried>)> {
        let layout = self.layout(distortion.k);
        let mut rest = Vec::with_capacity(6 * layout.n_poses);
        self.rest_rows(state, distortion, layout, &mut rest)?;
        self.process_rows(state, strengths, layout, &mut rest);
        self.prior_rows(state, distortion, layout, &mut rest);
        let effects = Effects::at(distortion, state);
        let carried: Vec<Carried> = (0..self.moves.len())
            .into_par_iter()
            .map(|m| {
                let move_model = self.move_model(state, m, weights.plane[m], &effects);
                carry(&self.moves[m], &move_model)
            })
            .collect();
        let moves: f64 = carried
            .iter()
            .zip(&weights.white)
            .map(|(one, white)| (white * one.residual).norm_squared())
            .sum();
        let still: f64 = rest.iter().map(|g| g.rows.residual.norm_squared()).sum();
        Ok((moves + still, carried))
    }

    fn prior_rows(
        &self,
        state: &State,
        distortion: &Distortion,
        layout: Layout,
        out: &mut Vec<Group>,
    ) {
        for (c, size) in distortion.sizes.iter().enumerate() {
            if size.is_finite() {
                out.push(size_row(layout.border, N_MODEL + c, state.effect[c], *size));
            }
        }
        let Some(prior) = &self.prior else { return };
        let residual = prior.white * (state.model() - prior.mean);
        for (first, domain) in [(0, Domain::StaticForce), (9, Domain::Moves)] {
            let rows = Rows {
                residual: DVector::from_column_slice(&residual.as_slice()[first..first + 9]),
                border: {
                    let mut border = DMatrix::zeros(9, layout.border);
                    border
                        .columns_mut(0, N_MODEL)
                        .copy_from(&prior.white.fixed_rows::<9>(first));
                    border
                },
                pose: None,
                here: DMatrix::zeros(9, 0),
                next: DMatrix::zeros(9, 0),
            };
            out.push(Group {
                rows,
                // A contradiction of a given calibration shows in its sensor's own domain.
                domain: if prior.is_weak { Domain::Prior } else { domain },
                kind: Kind::Prior,
                segment: 0,
                log_weight: 0.0,
            });
        }
    }
}

/// Prior row of one effect parameter with standard deviation `size`.
pub(super) fn size_row(n_border: usize, column: usize, value: f64, size: f64) -> Group {
    let mut border = DMatrix::zeros(1, n_border);
    border[(0, column)] = 1.0 / size;
    Group {
        rows: Rows {
            residual: DVector::from_element(1, value / size),
            border,
            pose: None,
            here: DMatrix::zeros(1, 0),
            next: DMatrix::zeros(1, 0),
        },
        domain: Domain::Prior,
        kind: Kind::Prior,
        segment: 0,
        log_weight: -size.ln(),
    }
}

impl Session {
    /// `(rows, k)` whitened change of every row per parameter of further effects (11.7), group after group.
    ///
    /// # Errors
    /// When a triad has collapsed, or the columns do not have one entry per point.
    pub fn columns(
        &self,
        state: &State,
        groups: &[Group],
        weights: &Weights,
        passed: &[Passed],
        distortion: &Distortion,
    ) -> Result<Vec<DMatrix<f64>>> {
        let k = distortion.k;
        for given in [&distortion.force, &distortion.rate].into_iter().flatten() {
            let n = self.n_points();
            if ![n, n + self.n_poses()].contains(&(given.len() / (3 * k).max(1))) {
                return Err(Error::bad_input(format!(
                    "an effect of {k} parameters at {n} points needs {} numbers, got {}",
                    n * 3 * k,
                    given.len()
                )));
            }
        }
        let force = state.force_scale.try_inverse().ok_or_else(collapsed)?;
        let rate = state.rate_scale.try_inverse().ok_or_else(collapsed)?;
        let one = |group: &Group| -> DMatrix<f64> {
            let mut out = DMatrix::zeros(group.rows.len(), k);
            if group.kind != Kind::Reading {
                return out;
            }
            match group.domain {
                Domain::StaticForce => {
                    let weight = weight_of(&self.force, group.segment);
                    rest_columns(
                        distortion.force.as_ref(),
                        k,
                        group.segment,
                        &force,
                        &weight,
                        &mut out,
                    );
                }
                Domain::StaticRate => {
                    if let Some(sensor) = &self.rate {
                        let weight = weight_of(sensor, group.segment);
                        rest_columns(
                            distortion.rate.as_ref(),
                            k,
                            group.segment,
                            &rate,
                            &weight,
                            &mut out,
                        );
                    }
                }
                _ => {
                    let m = group.segment;
                    let columns = self.move_effect(m, distortion, &passed[m]);
                    out.gemm(
                        1.0,
                        &DMatrix::from_column_slice(N_MOVE, N_MOVE, weights.white[m].as_slice()),
                        &columns,
                        0.0,
                    );
                }
            }
            out
        };
        Ok(groups.par_iter().map(one).collect())
    }
}

impl Group {
    /// Whether these are the rows of a move, whose weights depend on the strengths.
    #[must_use]
    pub fn is_move(&self) -> bool {
        self.domain == Domain::Moves && self.rows.len() == N_MOVE
    }

    pub(super) fn of(
        residual: DVector<f64>,
        layout: Layout,
        pose: usize,
        domain: Domain,
        kind: Kind,
    ) -> Self {
        let mut rows = Rows::new(residual, layout, pose);
        if kind != Kind::Reading {
            rows.border = DMatrix::zeros(rows.len(), 0);
        }
        Self {
            rows,
            domain,
            kind,
            segment: pose,
            log_weight: 0.0,
        }
    }
}
