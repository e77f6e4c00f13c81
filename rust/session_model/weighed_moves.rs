//! Moves weighted for other strengths and added to the normal equations, hundreds of times in a search
//! (docs/model-session.md, 11.18).

use nalgebra::DMatrix;

use super::blocks::{add_gram, add_rows};
use super::chain::{Chain, Layout};
use super::move_rows::Whitening;
use super::moves::N_MOVE;

impl Chain {
    /// Adds the rows of a move, given as `columns` by border, pose, next pose and residual and multiplied by the lower
    /// triangular `white`; `Jᵀr` to `side`. Returns their sum of squares. Blocks must be mirrored afterwards.
    pub(super) fn add_move(
        &mut self,
        pose: usize,
        columns: &DMatrix<f64>,
        white: &Whitening,
        side: &mut DMatrix<f64>,
    ) -> f64 {
        let Layout {
            border: b, pose: p, ..
        } = self.layout;
        let n = columns.ncols();
        let mut weighed = Vec::with_capacity(N_MOVE * n);
        for column in columns.as_slice().chunks_exact(N_MOVE) {
            for r in 0..N_MOVE {
                weighed.push((0..=r).map(|k| white[(r, k)] * column[k]).sum());
            }
        }
        let residual = &weighed[N_MOVE * (n - 1)..];
        let at = self.layout.at(pose);
        for (unknown, column) in (0..b)
            .chain(at..at + 2 * p)
            .zip(weighed.chunks_exact(N_MOVE))
        {
            let product: f64 = column.iter().zip(residual).map(|(a, r)| a * r).sum();
            side[(unknown, 0)] += product;
        }
        let part = |first: usize, width: usize| &weighed[N_MOVE * first..N_MOVE * (first + width)];
        let laid = |first: usize, width: usize| -> Vec<f64> {
            let row = |r: usize| part(first, width).iter().skip(r).step_by(N_MOVE).copied();
            (0..N_MOVE).flat_map(row).collect()
        };
        let (of_border, here, next) = (laid(0, b), laid(b, p), laid(b + p, p));
        add_gram(&mut self.corner, 1.0, &of_border, b);
        add_gram(&mut self.diagonal[pose], 1.0, &here, p);
        add_gram(&mut self.diagonal[pose + 1], 1.0, &next, p);
        add_rows(&mut self.border[pose], &here, part(0, b));
        add_rows(&mut self.border[pose + 1], &next, part(0, b));
        add_rows(&mut self.next[pose], &here, part(b + p, p));
        residual.iter().map(|r| r * r).sum()
    }
}
