//! Normal equations of a session as rows of whole vectors: a search weighs moves anew for other strengths and adds them
//! hundreds of times (docs/model-session.md, 11.18).

use nalgebra::{DMatrix, DVector};

use super::chain::{Chain, Layout};
use super::fit::gradient;
use super::lanes::{Part, Rows, add_gram, add_product, add_scaled};
use super::move_rows::{MoveResidual, Whitening};
use super::moves::N_MOVE;
use super::open_move::Open;
use super::rows::Group;
use crate::simd::{FUSED_BASELINE, Instructions, for_each_instruction_set};

/// `JᵀJ`, `Jᵀr` and `Σ r²` of some rows.
#[derive(Debug, Clone)]
pub(super) struct Equations {
    pub layout: Layout,
    /// Blocks of all poses, their upper triangles.
    pub own: Rows,
    /// Rows of every pose but the last, columns of the next.
    pub next: Rows,
    /// Border columns of every pose, followed by its `Jᵀr`.
    pub edge: Rows,
    /// The border's, its upper triangle, followed by its `Jᵀr`; the last is `Σ r²`.
    pub corner: Rows,
}

/// The same of `n` rows that involve poses alone, `side` their `Jᵀr`.
#[derive(Debug)]
pub(super) struct OfPoses {
    pub own: Rows,
    pub next: Rows,
    pub side: Vec<f64>,
    pub sum: f64,
    pub n: usize,
}

/// Blocks of all poses below one another.
fn stacked(blocks: &[DMatrix<f64>], pose: usize, columns: usize) -> Rows {
    Rows::from_fn(blocks.len() * pose, columns, |r, c| {
        blocks[r / pose][(r % pose, c)]
    })
}

impl OfPoses {
    pub(super) fn of(layout: Layout, groups: &[Group]) -> Self {
        let chain = Chain::of_poses(layout, groups.iter().map(|group| &group.rows));
        let side = gradient(layout, groups);
        Self {
            own: stacked(&chain.diagonal, layout.pose, layout.pose),
            next: stacked(&chain.next, layout.pose, layout.pose),
            side: side.as_slice()[layout.border..].to_vec(),
            sum: super::fit::chi2_of(groups),
            n: groups.iter().map(|group| group.rows.len()).sum(),
        }
    }
}

impl Equations {
    pub(super) fn of(layout: Layout, groups: &[Group]) -> Self {
        let chain = Chain::of(layout, groups.iter().map(|group| &group.rows));
        let (side, sum) = (gradient(layout, groups), super::fit::chi2_of(groups));
        let (b, p) = (layout.border, layout.pose);
        let edge = |r: usize, c: usize| {
            if c < b {
                chain.border[r / p][(r % p, c)]
            } else {
                side[(b + r, 0)]
            }
        };
        let corner = |r: usize, c: usize| match (r < b, c < b) {
            (true, true) => chain.corner[(r, c)],
            (false, false) => sum,
            _ => side[(r.min(c), 0)],
        };
        Self {
            layout,
            own: stacked(&chain.diagonal, p, p),
            next: stacked(&chain.next, p, p),
            edge: Rows::from_fn(p * layout.n_poses, b + 1, edge),
            corner: Rows::from_fn(b + 1, b + 1, corner),
        }
    }

    /// Adds the rows of a move multiplied by `white`, in place of its own `residual` another.
    pub(super) fn add_move(
        &mut self,
        open: &Open,
        white: &Whitening,
        residual: Option<&MoveResidual>,
    ) {
        add_move(Instructions::detect(), self, open, white, residual);
    }

    pub(super) fn add(&mut self, process: &OfPoses, factor: f64) {
        let Layout { border, .. } = self.layout;
        add_scaled::<FUSED_BASELINE>(&mut self.own.data, factor, &process.own.data);
        add_scaled::<FUSED_BASELINE>(&mut self.next.data, factor, &process.next.data);
        for (r, value) in process.side.iter().enumerate() {
            self.edge[(r, border)] += factor * value;
        }
    }

    /// `diag(JᵀJ)` with processes times their factors.
    pub(super) fn diagonal(&self, processes: &[(&OfPoses, f64)]) -> DVector<f64> {
        let Layout { border, pose, .. } = self.layout;
        DVector::from_fn(self.layout.n(), |i, _| {
            if i < border {
                return self.corner[(i, i)];
            }
            let at = (i - border, (i - border) % pose);
            let each = processes.iter().map(|(one, factor)| factor * one.own[at]);
            self.own[at] + each.sum::<f64>()
        })
    }

    /// The same as a chain, and `Jᵀr` `(n, 1)`.
    pub(super) fn chain(&self) -> (Chain, DMatrix<f64>) {
        let layout = self.layout;
        let (b, p) = (layout.border, layout.pose);
        let block = |rows: &Rows, i: usize, columns: usize| {
            DMatrix::from_fn(p, columns, |r, c| rows[(i * p + r, c)])
        };
        let upper = |rows: &Rows, first: usize, n: usize| {
            DMatrix::from_fn(n, n, |r, c| rows[(first + r.min(c), r.max(c))])
        };
        let each = |n: usize| 0..n;
        let chain = Chain {
            layout,
            corner: upper(&self.corner, 0, b),
            border: each(layout.n_poses)
                .map(|i| block(&self.edge, i, b))
                .collect(),
            diagonal: each(layout.n_poses)
                .map(|i| upper(&self.own, i * p, p))
                .collect(),
            next: each(layout.n_poses.saturating_sub(1))
                .map(|i| block(&self.next, i, p))
                .collect(),
        };
        let side = DMatrix::from_fn(layout.n(), 1, |i, _| {
            if i < b {
                self.corner[(i, b)]
            } else {
                self.edge[(i - b, b)]
            }
        });
        (chain, side)
    }
}

for_each_instruction_set! {
    fn add_move(
        equations: &mut Equations, open: &Open, white: &Whitening, residual: Option<&MoveResidual>,
    ) = add_move_body
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn add_move_body<const FUSED: bool>(
    equations: &mut Equations,
    open: &Open,
    white: &Whitening,
    residual: Option<&MoveResidual>,
) {
    let Layout { border, pose, .. } = equations.layout;
    let here = whitened::<FUSED>(white, &open.here);
    let next = whitened::<FUSED>(white, &open.next);
    let mut edge = whitened::<FUSED>(white, &open.edge);
    if let Some(residual) = residual {
        for (r, value) in (white * residual).iter().enumerate() {
            edge[(r, border)] = *value;
        }
    }
    let [here, next, edge]: [Part<'_>; 3] = [here.whole(), next.whole(), edge.whole()];
    for (i, rows) in [(open.pose, here), (open.pose + 1, next)] {
        add_gram::<FUSED>(equations.own.part_mut(i * pose, pose), 1.0, rows);
        add_product::<FUSED>(equations.edge.part_mut(i * pose, pose), 1.0, rows, edge);
    }
    let coupling = equations.next.part_mut(open.pose * pose, pose);
    add_product::<FUSED>(coupling, 1.0, here, next);
    add_gram::<FUSED>(&mut equations.corner.data, 1.0, edge);
}

/// Rows multiplied by a lower triangle.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn whitened<const FUSED: bool>(white: &Whitening, rows: &Rows) -> Rows {
    let mut out = Rows::zeros(N_MOVE, rows.columns());
    for (r, own) in out.data.chunks_exact_mut(rows.n).enumerate() {
        for k in 0..=r {
            add_scaled::<FUSED>(own, white[(r, k)], rows.part(k, 1).data);
        }
    }
    out
}
