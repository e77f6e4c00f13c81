//! A move of a hypothesis, before it is whitened (docs/model-session.md, 11.18).

use nalgebra::{DMatrix, DVector};

use super::Strengths;
use super::chain::Layout;
use super::lanes::Rows;
use super::move_rows::{MoveResidual, Passed, Whitening, with_tails};
use super::moves::N_MOVE;
use super::rows::Group;

/// A move in SI: derivatives with respect to the border, followed by the residual, the pose before and the pose after;
/// and the terms of its covariance.
pub(super) struct Open {
    pub pose: usize,
    pub edge: Rows,
    pub here: Rows,
    pub next: Rows,
    pub passed: Passed,
    /// The residual about which the tails of its noise are: that of the fit, or of one linear step from it.
    pub left: MoveResidual,
}

impl Open {
    pub(super) fn of(group: &Group, back: &Whitening, passed: &Passed) -> Self {
        let rows = &group.rows;
        let edge = rows.border.clone().insert_column(rows.border.ncols(), 0.0);
        let mut edge: DMatrix<f64> = edge;
        edge.column_mut(rows.border.ncols())
            .copy_from(&rows.residual);
        let in_si = |white: &DMatrix<f64>| {
            let si = back * white;
            Rows::from_fn(N_MOVE, white.ncols(), |r, c| si[(r, c)])
        };
        Self {
            pose: rows.pose.unwrap_or(group.segment),
            edge: in_si(&edge),
            here: in_si(&rows.here),
            next: in_si(&rows.next),
            passed: passed.clone(),
            left: passed.carried.residual,
        }
    }

    /// Residual at the fit.
    pub(super) fn residual(&self) -> MoveResidual {
        MoveResidual::from_fn(|r, _| self.edge[(r, self.edge.columns() - 1)])
    }

    /// `L⁻¹` of its covariance `L Lᵀ` at some strengths, its weight by heavy tails, and the logarithm of that weight's
    /// prior.
    pub(super) fn whitening(&self, strengths: &Strengths) -> Option<(Whitening, f64, f64)> {
        with_tails(&self.passed.covariance(strengths), &self.left)
    }

    /// The residual one linear `step` of all unknowns further.
    pub(super) fn moved(&self, layout: Layout, step: &DVector<f64>) -> MoveResidual {
        let at = layout.at(self.pose);
        let parts = [
            (&self.edge, 0, layout.border),
            (&self.here, at, layout.pose),
            (&self.next, at + layout.pose, layout.pose),
        ];
        let by_step = |r: usize| -> f64 {
            let each = parts
                .iter()
                .flat_map(|&(rows, first, n)| (0..n).map(move |c| rows[(r, c)] * step[first + c]));
            each.sum()
        };
        self.residual() + MoveResidual::from_fn(|r, _| by_step(r))
    }
}
