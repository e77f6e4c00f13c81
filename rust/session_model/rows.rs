//! Whitened residual rows of a session and their derivatives (docs/model-session.md, equations 11.1-11.8).

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3x2, Vector3};
use rayon::prelude::*;

use super::chain::{Layout, Rows};
use super::moves::{Carried, N_MOVE, Response, Sees, Sums, carry, effect_columns, respond, sums};
use super::{
    AtRest, Distortion, LOWER, N_MODEL, N_POSE_SCATTER, Session, State, Strengths, tangent_plane,
};
use crate::error::{Error, Result};

/// Which part of the recording a row judges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// Accelerometer at rest.
    StaticForce = 0,
    /// Gyro at rest.
    StaticRate = 1,
    /// Gravity after a move.
    Moves = 2,
    /// Velocity over a move; rows of a move begin with two of `Moves`.
    Dynamics = 3,
    /// What keeps flat directions finite.
    Prior = 4,
}

/// What process a row belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A reading.
    Reading = 0,
    /// Walk of the accelerometer's zero.
    ForceWalk = 1,
    /// Walk of the gyro's zero.
    RateWalk = 2,
    /// Scatter of the accelerometer's zero.
    ForceScatter = 3,
    /// Scatter of the gyro's zero.
    RateScatter = 4,
    /// Prior or pin.
    Prior = 5,
}

/// Number of kinds whose strength is free.
pub const N_PROCESSES: usize = 4;

impl Kind {
    /// Number of the process, if its strength is free.
    #[must_use]
    pub fn process(self) -> Option<usize> {
        match self {
            Self::ForceWalk => Some(0),
            Self::RateWalk => Some(1),
            Self::ForceScatter => Some(2),
            Self::RateScatter => Some(3),
            Self::Reading | Self::Prior => None,
        }
    }
}

/// Rows of one pose, move or step of a walk.
#[derive(Debug, Clone)]
pub struct Group {
    /// The rows.
    pub rows: Rows,
    /// What they judge.
    pub domain: Domain,
    /// Their process.
    pub kind: Kind,
    /// Number of the pose or move.
    pub segment: usize,
    /// `ln` of the density's normalisation, for groups whose strength is free.
    pub log_weight: f64,
}

/// Whitening of the moves, held while the solver runs and renewed between runs: left free it would reward noise.
#[derive(Debug, Clone)]
pub struct Weights {
    /// `L⁻¹` of each move's covariance.
    pub white: Vec<nalgebra::SMatrix<f64, N_MOVE, N_MOVE>>,
    /// Plane in which the vertical after each move is compared.
    pub plane: Vec<Matrix3x2<f64>>,
}

/// Standard error that holds the accelerometer's constant zero at nothing (it is `b`), in units of its noise of 1 s.
const PINNED: f64 = 1e-3;

impl Session {
    pub(super) fn sees<'a>(
        &self,
        state: &State,
        index: usize,
        plane: Matrix3x2<f64>,
        effects: &'a Effects,
    ) -> Sees<'a> {
        let one = &self.moves[index];
        let (i, j) = (one.before, one.before + 1);
        let first = self.n_poses() + one.first_point;
        let part = |values: Option<&'a Vec<Vector3<f64>>>| -> Option<&'a [Vector3<f64>]> {
            values.map(|v| &v[first..first + one.n_samples()])
        };
        Sees {
            gravity: self.gravity,
            force_scale: state.force_scale,
            force_bias: state.force_bias,
            rate_scale: state.rate_scale,
            rate_zero: [state.rate_zero[i], state.rate_zero[j]],
            force_zero: [state.force_zero[i], state.force_zero[j]],
            up: [state.up[i], state.up[j]],
            plane,
            force_effect: part(effects.force.as_ref()),
            rate_effect: part(effects.rate.as_ref()),
        }
    }

    /// Weights of the moves at a state, and everything that was carried on the way.
    ///
    /// # Errors
    /// When the noise of a move cannot be whitened.
    pub fn weigh(&self, state: &State, distortion: &Distortion) -> Result<(Weights, Vec<Passed>)> {
        let effects = Effects::at(distortion, state);
        let passed: Vec<Passed> = (0..self.moves.len())
            .into_par_iter()
            .map(|m| {
                let plane = tangent_plane(&state.up[self.moves[m].before + 1]);
                let sees = self.sees(state, m, plane, &effects);
                let carried = carry(&self.moves[m], &sees);
                let response = respond(&self.moves[m], &sees, &carried, &self.noise);
                let sums = sums(&self.moves[m], &sees, &response, &LOWER);
                Passed {
                    carried,
                    response,
                    sums,
                    plane,
                }
            })
            .collect();
        let white = passed
            .iter()
            .enumerate()
            .map(|(m, one)| {
                let half = one
                    .response
                    .covariance
                    .cholesky()
                    .and_then(|half| half.l().try_inverse());
                half.ok_or_else(|| {
                    Error::not_determined(format!(
                        "move {m} has no noise or turns nothing: its residuals cannot be weighed"
                    ))
                })
            })
            .collect::<Result<_>>()?;
        let plane = passed.iter().map(|one| one.plane).collect();
        Ok((Weights { white, plane }, passed))
    }

    /// The same pass with planes that are given: derivatives of the residuals that [`Session::residual_groups`] has.
    #[must_use]
    pub fn pass(&self, state: &State, distortion: &Distortion, weights: &Weights) -> Vec<Passed> {
        let effects = Effects::at(distortion, state);
        (0..self.moves.len())
            .into_par_iter()
            .map(|m| {
                let sees = self.sees(state, m, weights.plane[m], &effects);
                let carried = carry(&self.moves[m], &sees);
                let response = respond(&self.moves[m], &sees, &carried, &self.noise);
                let sums = sums(&self.moves[m], &sees, &response, &LOWER);
                Passed {
                    carried,
                    response,
                    sums,
                    plane: weights.plane[m],
                }
            })
            .collect()
    }

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
        self.prior_rows(state, layout, &mut out);
        Ok(out)
    }

    /// Residual parts that change between trial steps, without derivatives: the cost of a state.
    ///
    /// # Errors
    /// When a triad has collapsed.
    pub fn chi2(
        &self,
        state: &State,
        strengths: &Strengths,
        distortion: &Distortion,
        weights: &Weights,
    ) -> Result<f64> {
        let layout = self.layout(distortion.k);
        let mut rest = Vec::with_capacity(6 * layout.n_poses);
        self.rest_rows(
            state,
            &Distortion {
                k: distortion.k,
                ..distortion.clone()
            },
            layout,
            &mut rest,
        )?;
        self.process_rows(state, strengths, layout, &mut rest);
        self.prior_rows(state, layout, &mut rest);
        let effects = Effects::at(distortion, state);
        let moves: f64 = (0..self.moves.len())
            .into_par_iter()
            .map(|m| {
                let sees = self.sees(state, m, weights.plane[m], &effects);
                (weights.white[m] * carry(&self.moves[m], &sees).residual).norm_squared()
            })
            .collect::<Vec<f64>>()
            .iter()
            .sum();
        let still: f64 = rest.iter().map(|g| g.rows.residual.norm_squared()).sum();
        Ok(moves + still)
    }

    /// (11.1), (11.2): the raw mean less what the model would read.
    fn rest_rows(
        &self,
        state: &State,
        distortion: &Distortion,
        layout: Layout,
        out: &mut Vec<Group>,
    ) -> Result<()> {
        let collapsed =
            || Error::not_determined("a sensor's triad has collapsed: its S cannot be inverted");
        let inverse = state.force_scale.try_inverse().ok_or_else(collapsed)?;
        for i in 0..layout.n_poses {
            let mut asked = state.up[i] * self.gravity - state.force_bias;
            add_effect(
                distortion.force.as_ref(),
                distortion.k,
                i,
                state,
                &mut asked,
            );
            let read = inverse * asked;
            let mut group = at_rest(&self.force, i, &(read + state.force_zero[i]), layout);
            let weight = weight_of(&self.force, i);
            for (c, &(row, column)) in LOWER.iter().enumerate() {
                set(
                    &mut group.rows.border,
                    c,
                    &(inverse.column(row) * read[column]),
                    &weight,
                );
            }
            for c in 0..3 {
                set(
                    &mut group.rows.border,
                    6 + c,
                    &inverse.column(c).into_owned(),
                    &weight,
                );
                set(&mut group.rows.here, 5 + c, &-Vector3::ith(c, 1.0), &weight);
            }
            let tilt = inverse * tangent_plane(&state.up[i]) * self.gravity;
            for c in 0..2 {
                set(&mut group.rows.here, c, &-tilt.column(c), &weight);
            }
            set_effect(
                distortion.force.as_ref(),
                distortion.k,
                i,
                &inverse,
                &weight,
                &mut group,
            );
            group.domain = Domain::StaticForce;
            out.push(group);
        }
        let Some(rate) = &self.rate else {
            return Ok(());
        };
        let inverse = state.rate_scale.try_inverse().ok_or_else(collapsed)?;
        for i in 0..layout.n_poses {
            let mut asked = Vector3::zeros();
            add_effect(distortion.rate.as_ref(), distortion.k, i, state, &mut asked);
            let read = inverse * asked;
            let mut group = at_rest(rate, i, &(read + state.rate_zero[i]), layout);
            let weight = weight_of(rate, i);
            for row in 0..3 {
                for column in 0..3 {
                    let slope = inverse.column(row) * read[column];
                    set(
                        &mut group.rows.border,
                        9 + 3 * row + column,
                        &slope,
                        &weight,
                    );
                }
                set(
                    &mut group.rows.here,
                    2 + row,
                    &-Vector3::ith(row, 1.0),
                    &weight,
                );
            }
            set_effect(
                distortion.rate.as_ref(),
                distortion.k,
                i,
                &inverse,
                &weight,
                &mut group,
            );
            group.domain = Domain::StaticRate;
            out.push(group);
        }
        Ok(())
    }

    /// (11.3)-(11.7): five rows of a move.
    fn move_rows(
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
            rate_zero,
            force_zero,
        } = &passed.sums;
        rows.border.columns_mut(0, 9).copy_from(force_model);
        rows.border.columns_mut(9, 9).copy_from(rate_model);
        rows.here.columns_mut(2, 3).copy_from(&rate_zero[0]);
        rows.next.columns_mut(2, 3).copy_from(&rate_zero[1]);
        rows.here.columns_mut(5, 3).copy_from(&force_zero[0]);
        rows.next.columns_mut(5, 3).copy_from(&force_zero[1]);
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
            log_weight: 0.0,
        }
    }

    fn move_effect(&self, index: usize, distortion: &Distortion, passed: &Passed) -> DMatrix<f64> {
        let one = &self.moves[index];
        let width = 3 * distortion.k;
        let first = self.n_poses() + one.first_point;
        let part = |values: Option<&'_ Vec<f64>>| -> Option<Vec<f64>> {
            values.map(|v| v[first * width..(first + one.n_samples()) * width].to_vec())
        };
        effect_columns(
            &passed.response,
            part(distortion.force.as_ref()).as_deref(),
            part(distortion.rate.as_ref()).as_deref(),
            distortion.k,
        )
    }

    /// (11.8): walks between poses, and the scatter of each.
    fn process_rows(
        &self,
        state: &State,
        strengths: &Strengths,
        layout: Layout,
        out: &mut Vec<Group>,
    ) {
        let sensors = [
            (
                Some(&self.force),
                &state.force_zero,
                5,
                Kind::ForceWalk,
                Kind::ForceScatter,
            ),
            (
                self.rate.as_ref(),
                &state.rate_zero,
                2,
                Kind::RateWalk,
                Kind::RateScatter,
            ),
        ];
        for (s, (sensor, zero, column, walk, scatter)) in sensors.into_iter().enumerate() {
            let domain = [Domain::StaticForce, Domain::StaticRate][s];
            let Some(sensor) = sensor else {
                // No gyro: its unknowns are pinned so that the system stays regular.
                for i in 0..layout.n_poses {
                    let mut group =
                        Group::of(DVector::zeros(3), layout, i, Domain::Prior, Kind::Prior);
                    pin(&mut group.rows, column, 1.0);
                    if layout.pose == N_POSE_SCATTER {
                        let mut own =
                            Group::of(DVector::zeros(3), layout, i, Domain::Prior, Kind::Prior);
                        pin(&mut own.rows, 8, 1.0);
                        out.push(own);
                    }
                    out.push(group);
                }
                continue;
            };
            let own_column = [11, 8][s];
            let own = &state.own[s];
            if s == 0 {
                // The accelerometer's constant zero is b itself.
                let sigma = sensor.density.amax().max(f64::MIN_POSITIVE) * PINNED;
                let residual = (zero[0] - own[0]) / sigma;
                let mut group = Group::of(
                    DVector::from_column_slice(residual.as_slice()),
                    layout,
                    0,
                    Domain::Prior,
                    Kind::Prior,
                );
                pin(&mut group.rows, column, 1.0 / sigma);
                if layout.pose == N_POSE_SCATTER {
                    pin(&mut group.rows, own_column, -1.0 / sigma);
                }
                out.push(group);
            }
            for i in 0..layout.n_poses - 1 {
                let gap = (self.time_s[i + 1] - self.time_s[i]).max(1e-3);
                // K with N²/τ = K²τ/3 at the corner τ.
                let sigma = sensor.density * (3.0 * gap).sqrt() / strengths.corner_s[s];
                let change = zero[i + 1] - own[i + 1] - zero[i] + own[i];
                let mut group = Group::of(DVector::zeros(3), layout, i, domain, walk);
                group.rows.next = DMatrix::zeros(3, layout.pose);
                for c in 0..3 {
                    let inverse = 1.0 / sigma[c].max(f64::MIN_POSITIVE);
                    group.rows.residual[c] = change[c] * inverse;
                    group.rows.here[(c, column + c)] = -inverse;
                    group.rows.next[(c, column + c)] = inverse;
                    if layout.pose == N_POSE_SCATTER {
                        group.rows.here[(c, own_column + c)] = inverse;
                        group.rows.next[(c, own_column + c)] = -inverse;
                    }
                    group.log_weight += inverse.ln();
                }
                out.push(group);
            }
            if let Some(reference) = &self.scatter {
                for i in 0..layout.n_poses {
                    let mut group = Group::of(DVector::zeros(3), layout, i, domain, scatter);
                    for c in 0..3 {
                        let inverse = 1.0 / (reference[s][c] * strengths.scatter[s]);
                        group.rows.residual[c] = own[i][c] * inverse;
                        group.rows.here[(c, own_column + c)] = inverse;
                        group.log_weight += inverse.ln();
                    }
                    out.push(group);
                }
            }
        }
    }

    fn prior_rows(&self, state: &State, layout: Layout, out: &mut Vec<Group>) {
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
                // Where a given calibration is contradicted, its sensor's own domain says so.
                domain: if prior.is_weak { Domain::Prior } else { domain },
                kind: Kind::Prior,
                segment: 0,
                log_weight: 0.0,
            });
        }
    }
}

/// One move carried at a state, with its derivatives.
#[derive(Debug, Clone)]
pub struct Passed {
    /// Forward.
    pub carried: Carried,
    /// Backward.
    pub response: Response,
    /// Products with the readings.
    pub sums: Sums,
    /// Plane of comparison.
    pub plane: Matrix3x2<f64>,
}

impl Session {
    /// `(rows, k)` whitened change of every row per parameter of further effects (11.7), group after group.
    ///
    /// # Errors
    /// When a triad has collapsed, or the columns do not have one entry a point.
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
            if given.len() != self.n_points() * 3 * k {
                return Err(Error::bad_input(format!(
                    "an effect of {k} parameters at {} points needs {} numbers, got {}",
                    self.n_points(),
                    self.n_points() * 3 * k,
                    given.len()
                )));
            }
        }
        let collapsed =
            || Error::not_determined("a sensor's triad has collapsed: its S cannot be inverted");
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
    fn of(residual: DVector<f64>, layout: Layout, pose: usize, domain: Domain, kind: Kind) -> Self {
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

fn weight_of(sensor: &AtRest, pose: usize) -> Vector3<f64> {
    sensor.sigma[pose].map(f64::recip)
}

fn at_rest(sensor: &AtRest, pose: usize, read: &Vector3<f64>, layout: Layout) -> Group {
    let residual = (sensor.mean[pose] - read).component_mul(&weight_of(sensor, pose));
    Group::of(
        DVector::from_column_slice(residual.as_slice()),
        layout,
        pose,
        Domain::StaticForce,
        Kind::Reading,
    )
}

fn set(matrix: &mut DMatrix<f64>, column: usize, slope: &Vector3<f64>, weight: &Vector3<f64>) {
    for i in 0..3 {
        matrix[(i, column)] = slope[i] * weight[i];
    }
}

fn pin(rows: &mut Rows, column: usize, value: f64) {
    for c in 0..3 {
        rows.here[(c, column + c)] = value;
    }
}

fn add_effect(
    columns: Option<&Vec<f64>>,
    k: usize,
    pose: usize,
    state: &State,
    out: &mut Vector3<f64>,
) {
    if let Some(columns) = columns {
        let row = &columns[3 * k * pose..3 * k * (pose + 1)];
        for i in 0..3 {
            out[i] += (0..k)
                .map(|c| row[i * k + c] * state.effect[c])
                .sum::<f64>();
        }
    }
}

fn rest_columns(
    columns: Option<&Vec<f64>>,
    k: usize,
    pose: usize,
    inverse: &Matrix3<f64>,
    weight: &Vector3<f64>,
    out: &mut DMatrix<f64>,
) {
    if let Some(columns) = columns {
        let row = &columns[3 * k * pose..3 * k * (pose + 1)];
        for c in 0..k {
            let slope = -inverse * Vector3::new(row[c], row[k + c], row[2 * k + c]);
            set(out, c, &slope, weight);
        }
    }
}

fn set_effect(
    columns: Option<&Vec<f64>>,
    k: usize,
    pose: usize,
    inverse: &Matrix3<f64>,
    weight: &Vector3<f64>,
    group: &mut Group,
) {
    let mut out = DMatrix::zeros(3, k);
    rest_columns(columns, k, pose, inverse, weight, &mut out);
    group.rows.border.columns_mut(N_MODEL, k).copy_from(&out);
}
