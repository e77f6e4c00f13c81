//! A move of a hypothesis, before it is whitened (docs/model-session.md, 11.18).

use nalgebra::{DMatrix, DVector};

use super::Strengths;
use super::chain::Layout;
use super::move_rows::{MoveResidual, Passed, Whitening, with_tails};
use super::moves::N_MOVE;
use super::rows::Group;

/// A move in SI: derivatives with respect to the border, the pose before and the pose after, and the residual, column
/// after column; and the terms of its covariance.
pub(super) struct Open {
    pub pose: usize,
    pub columns: DMatrix<f64>,
    pub passed: Passed,
    /// The residual about which the tails of its noise are: that of the fit, or of one linear step from it.
    pub left: MoveResidual,
}

impl Open {
    pub(super) fn of(group: &Group, back: &Whitening, passed: &Passed) -> Self {
        let rows = &group.rows;
        let parts = [&rows.border, &rows.here, &rows.next].map(DMatrix::as_slice);
        let flat: Vec<f64> = parts
            .into_iter()
            .flatten()
            .chain(rows.residual.as_slice())
            .copied()
            .collect();
        let white = DMatrix::from_vec(N_MOVE, flat.len() / N_MOVE, flat);
        Self {
            pose: rows.pose.unwrap_or(group.segment),
            columns: DMatrix::from_column_slice(N_MOVE, white.ncols(), (back * &white).as_slice()),
            passed: passed.clone(),
            left: passed.carried.residual,
        }
    }

    /// `L⁻¹` of its covariance `L Lᵀ` at some strengths, its weight by heavy tails, and the logarithm of that weight's
    /// prior.
    pub(super) fn whitening(&self, strengths: &Strengths) -> Option<(Whitening, f64, f64)> {
        with_tails(&self.passed.covariance(strengths), &self.left)
    }

    /// The residual one linear `step` of all unknowns further.
    pub(super) fn moved(&self, layout: Layout, step: &DVector<f64>) -> MoveResidual {
        let (b, p, at) = (layout.border, layout.pose, layout.at(self.pose));
        let n = b + 2 * p;
        let unknown = |c: usize| if c < b { step[c] } else { step[at + c - b] };
        let columns = (0..n).map(|c| self.columns.fixed_view::<N_MOVE, 1>(0, c) * unknown(c));
        columns.fold(
            self.columns.fixed_view::<N_MOVE, 1>(0, n).into_owned(),
            |sum, column| sum + column,
        )
    }
}
