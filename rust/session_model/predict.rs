//! Results of a fit beyond its optimum: leverage, projections for score tests, fits without some rows, covariance of
//! both linear models (docs/model-session.md, 11.13-11.16).

use nalgebra::{DMatrix, SMatrix, Vector3};

use super::chain::{Chain, Layout};
use super::fit::{Fit, gradient};
use super::rows::{Domain, Group};

use super::{N_POSE_SCATTER, Session, State};
use crate::error::Result;
use crate::sensor_model::LOWER;

/// Domains that are tested: all but the prior.
pub const N_DOMAINS: usize = 4;
/// Ridge of the rows that remain when some are removed: a pose without its accelerometer may have no vertical.
const LEFT_OUT_RIDGE: f64 = 1e-9;

/// Domain of row `r` of a group.
#[must_use]
pub fn domain_of(group: &Group, r: usize) -> Domain {
    if group.domain == Domain::Moves && group.rows.len() == super::moves::N_MOVE && r >= 2 {
        Domain::Dynamics
    } else {
        group.domain
    }
}

impl Fit {
    /// First row of every group.
    #[must_use]
    pub fn first_rows(&self) -> Vec<usize> {
        let mut at = 0;
        self.groups
            .iter()
            .map(|group| {
                let first = at;
                at += group.rows.len();
                first
            })
            .collect()
    }

    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.groups.iter().map(|group| group.rows.len()).sum()
    }

    /// Square root of the weight that a group's rows have by heavy tails.
    #[must_use]
    pub fn tail_of(&self, group: &Group) -> f64 {
        if group.is_move() {
            self.weights.tail[group.segment].sqrt()
        } else {
            1.0
        }
    }

    /// `(rows)` residuals in units of their noise, of moves without the weights of heavy tails.
    #[must_use]
    pub fn residual(&self) -> Vec<f64> {
        let of_group = |group: &Group| {
            (&group.rows.residual / self.tail_of(group))
                .as_slice()
                .to_vec()
        };
        self.groups.iter().flat_map(of_group).collect()
    }

    /// `(rows)` leverage of every row.
    #[must_use]
    pub fn leverage(&self) -> Vec<f64> {
        let marginals = self.factor.marginals();
        self.groups
            .iter()
            .flat_map(|group| marginals.leverage(&group.rows).as_slice().to_vec())
            .collect()
    }

    /// `(24, 24)` covariance of `(S_a, b_a, S_ω, b_ω)` row by row, on raw readings whose centres were `origins`
    /// (accelerometer, gyro), and `b_ω` itself.
    ///
    /// # Errors
    /// When a possible scatter of the biases leaves the session undetermined.
    pub fn linear_covariance(
        &self,
        session: &Session,
        origins: &[Vector3<f64>; 2],
    ) -> Result<(DMatrix<f64>, Vector3<f64>)> {
        let layout = self.layout();
        let mut map = force_map(&self.state, layout, &origins[0], 24);
        let mut bias = Vector3::zeros();
        if session.rate.is_some() {
            let center = origins[1] + self.state.mean_pose_bias(1);
            let scale = &self.state.rate_scale;
            bias = -(scale * center);
            for i in 0..3 {
                for j in 0..3 {
                    map[(9 + 3 * i + j, 12 + 3 * i + j)] = 1.0;
                    map[(9 + 3 * i + j, 21 + i)] = -center[j];
                    map_mean_bias(&mut map, layout, (1, j), (21 + i, -scale[(i, j)]));
                }
            }
        }
        let covariance = self.possible_covariance(session, &map)?;
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        Ok((covariance, bias))
    }

    /// Covariance of the border: both linear models, then effects.
    #[must_use]
    pub fn border_covariance(&self) -> DMatrix<f64> {
        let layout = self.layout();
        let mut picked = DMatrix::zeros(layout.n(), layout.border);
        picked
            .view_mut((0, 0), (layout.border, layout.border))
            .fill_with_identity();
        self.factor
            .solve(&picked)
            .rows(0, layout.border)
            .into_owned()
    }

    /// The fit without the rows of some groups: one linear step from the optimum, its model, and the `(12, 12)`
    /// covariance of `(S_a, b_a)` on raw readings whose centre was `origin`.
    ///
    /// # Errors
    /// When the remaining rows determine nothing.
    pub fn without(
        &self,
        groups: &[usize],
        origin: &Vector3<f64>,
    ) -> Result<(State, DMatrix<f64>)> {
        let layout = self.layout();
        let held = Chain::of(layout, groups.iter().map(|&g| &self.groups[g].rows));
        let mut rest = self.chain.clone();
        rest.add_scaled(&held, -1.0);
        let factor = rest.factor(LEFT_OUT_RIDGE, None)?;
        let mut side = gradient(layout, &self.groups);
        for &g in groups {
            let rows = &self.groups[g].rows;
            let r = DMatrix::from_column_slice(rows.len(), 1, rows.residual.as_slice());
            rows.add_transposed(layout, &-r, &mut side);
        }
        let step = -factor.solve(&side).column(0).into_owned();
        let map = force_map(&self.state, layout, origin, 12);
        Ok((self.state.moved(&step, layout), factor.inner(&map)))
    }

    /// `(rows, unknowns)` the Jacobian in full: border, then pose after pose. For tests and small sessions.
    #[must_use]
    pub fn jacobian(&self) -> DMatrix<f64> {
        let layout = self.layout();
        let mut out = DMatrix::zeros(self.n_rows(), layout.n());
        for (group, first) in self.groups.iter().zip(self.first_rows()) {
            let rows = group.rows.len();
            let mut part = DMatrix::zeros(layout.n(), rows);
            group
                .rows
                .add_transposed(layout, &DMatrix::identity(rows, rows), &mut part);
            out.rows_mut(first, rows).copy_from(&part.transpose());
        }
        out
    }

    /// Covariance of the five residuals of each move, SI, not reduced by the fit.
    #[must_use]
    pub fn move_covariance(&self) -> Vec<SMatrix<f64, 5, 5>> {
        self.passed
            .iter()
            .map(|one| one.covariance(&self.strengths))
            .collect()
    }
}

/// From all unknowns to `(S_a, b_a)` on raw readings, row by row, in the first of `n` columns; with one bias for the
/// session (11.16).
fn force_map(state: &State, layout: Layout, origin: &Vector3<f64>, n: usize) -> DMatrix<f64> {
    let mut map = DMatrix::zeros(layout.n(), n);
    let bias = origin + state.mean_pose_bias(0);
    for (c, &(i, j)) in LOWER.iter().enumerate() {
        map[(c, 3 * i + j)] = 1.0;
        map[(c, 9 + i)] -= bias[j];
        map_mean_bias(
            &mut map,
            layout,
            (0, j),
            (9 + i, -state.force_scale[(i, j)]),
        );
    }
    for i in 0..3 {
        map[(6 + i, 9 + i)] = 1.0;
    }
    map
}

/// Adds `factor` times the mean over the poses of one axis of a sensor's biases, without the parts of single poses, to
/// a parameter.
fn map_mean_bias(
    map: &mut DMatrix<f64>,
    layout: Layout,
    (sensor, axis): (usize, usize),
    (parameter, factor): (usize, f64),
) {
    let share = factor / layout.n_poses as f64;
    let (whole, own) = [(5, 11), (2, 8)][sensor];
    for h in 0..layout.n_poses {
        map[(layout.at(h) + whole + axis, parameter)] += share;
        if layout.pose == N_POSE_SCATTER {
            map[(layout.at(h) + own + axis, parameter)] -= share;
        }
    }
}
