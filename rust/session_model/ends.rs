//! A chain eliminated from both ends: the information of all other poses on a few neighbouring ones and the border.
//!
//! Folds of a cross-validation remove rows of a few poses each. The poses before and after them are eliminated once for
//! all folds, so that a fold costs only its own poses (docs/model-session.md, 11.15).

use nalgebra::{DMatrix, DVector};

use super::blocks::{add_gram, add_product, forward, mirror, solve};
use super::chain::{Chain, Layout, add_ridge, indefinite, lengths, scaled};
use crate::error::Result;

/// Reduction of a pose and the border by the poses eliminated on one side; the right-hand side is one more column.
struct End {
    /// `(pose, pose)`.
    block: DMatrix<f64>,
    /// `(pose, border + 1)`.
    edge: DMatrix<f64>,
    /// `(border + 1, border + 1)`.
    corner: DMatrix<f64>,
}

/// Reductions of every pose by the poses before it and by those after it.
pub(super) struct Ends {
    scale: DVector<f64>,
    ridge: f64,
    before: Vec<End>,
    after: Vec<End>,
}

impl Ends {
    /// Eliminates `JᵀJ` with a ridge on columns of unit length, and the right-hand side `side` `(n, 1)`.
    ///
    /// # Errors
    /// When it is not positive definite.
    pub(super) fn of(chain: &Chain, side: &DMatrix<f64>, ridge: f64) -> Result<Self> {
        let scale = lengths(&chain.diagonal());
        let eliminated = |is_backward| ends(chain, side, &scale, ridge, is_backward);
        let (before, after) = rayon::join(|| eliminated(false), || eliminated(true));
        let mut after = after?;
        after.reverse();
        Ok(Self {
            before: before?,
            after,
            scale,
            ridge,
        })
    }

    /// The chain of the poses from `first` to `last`, all others eliminated; the ridge is included.
    pub(super) fn between(&self, chain: &Chain, first: usize, last: usize) -> Chain {
        let layout = Layout {
            n_poses: last - first + 1,
            ..chain.layout
        };
        let nb = layout.border;
        let mut out = Chain {
            layout,
            corner: chain.corner.clone(),
            border: chain.border[first..=last].to_vec(),
            diagonal: chain.diagonal[first..=last].to_vec(),
            next: chain.next[first..last].to_vec(),
        };
        for (end, pose) in [(&self.before[first], 0), (&self.after[last], last - first)] {
            out.corner -= end.corner.view((0, 0), (nb, nb));
            out.border[pose] -= end.edge.columns(0, nb);
            out.diagonal[pose] -= &end.block;
        }
        let ridge = self.scale.map(|length| self.ridge * length * length);
        for i in 0..nb {
            out.corner[(i, i)] += ridge[i];
        }
        for (pose, block) in out.diagonal.iter_mut().enumerate() {
            let at = chain.layout.at(first + pose);
            for i in 0..layout.pose {
                block[(i, i)] += ridge[at + i];
            }
        }
        out
    }

    /// Lengths of the columns of that chain.
    pub(super) fn scale_between(&self, layout: Layout, first: usize) -> DVector<f64> {
        picked(&self.scale, layout, first)
    }

    /// The right-hand side of that chain.
    pub(super) fn side_between(
        &self,
        side: &DMatrix<f64>,
        layout: Layout,
        first: usize,
        last: usize,
    ) -> DMatrix<f64> {
        let (nb, pose) = (layout.border, layout.pose);
        let mut out = picked(&side.column(0).into_owned(), layout, first);
        for (end, at) in [
            (&self.before[first], layout.at(0)),
            (&self.after[last], layout.at(last - first)),
        ] {
            let mut part = out.rows_mut(0, nb);
            part -= end.corner.view((0, nb), (nb, 1));
            let mut part = out.rows_mut(at, pose);
            part -= end.edge.column(nb);
        }
        DMatrix::from_column_slice(layout.n(), 1, out.as_slice())
    }
}

/// The border's entries and those of some poses.
fn picked(values: &DVector<f64>, layout: Layout, first: usize) -> DVector<f64> {
    let mut out = DVector::zeros(layout.n());
    out.rows_mut(0, layout.border)
        .copy_from(&values.rows(0, layout.border));
    let n = layout.pose * layout.n_poses;
    out.rows_mut(layout.border, n)
        .copy_from(&values.rows(layout.at(first), n));
    out
}

/// Reductions, in the order of elimination, of every pose by those before it.
fn ends(
    chain: &Chain,
    side: &DMatrix<f64>,
    scale: &DVector<f64>,
    ridge: f64,
    is_backward: bool,
) -> Result<Vec<End>> {
    let layout = chain.layout;
    let (nb, pose) = (layout.border, layout.pose);
    let width = nb + 1;
    let of = |i: usize| scale.rows(layout.at(i), pose).into_owned();
    let border = scale.rows(0, nb).insert_row(nb, 1.0);
    let d_border = border.map(f64::recip);
    let mut corner = DMatrix::zeros(width, width);
    let mut out = Vec::with_capacity(layout.n_poses);
    let mut done = None;
    for k in 0..layout.n_poses {
        let i = if is_backward {
            layout.n_poses - 1 - k
        } else {
            k
        };
        let (length, d) = (of(i), of(i).map(f64::recip));
        let mut edge = chain.border[i].clone().insert_column(nb, 0.0);
        edge.column_mut(nb)
            .copy_from(&side.view((layout.at(i), 0), (pose, 1)));
        let mut edge = scaled(&edge, &d, &d_border);
        let mut block = scaled(&chain.diagonal[i], &d, &d);
        add_ridge(&mut block, ridge);
        let mut taken = (DMatrix::zeros(pose, pose), DMatrix::zeros(pose, width));
        if let Some((half, edge_before, d_before)) = &done {
            let coupling = if is_backward {
                scaled(&chain.next[i].transpose(), d_before, &d)
            } else {
                scaled(&chain.next[i - 1], d_before, &d)
            };
            let along = solve(half, &coupling);
            add_product(&mut taken.0, 1.0, &coupling, &along);
            add_product(&mut taken.1, 1.0, &along, edge_before);
            block -= &taken.0;
            edge -= &taken.1;
        }
        let mut whole = corner.clone();
        mirror(&mut whole);
        out.push(End {
            block: scaled(&taken.0, &length, &length),
            edge: scaled(&taken.1, &length, &border),
            corner: scaled(&whole, &border, &border),
        });
        let half = block.cholesky().ok_or_else(indefinite)?;
        add_gram(&mut corner, 1.0, &forward(&half, &edge), width);
        done = Some((half, edge, d));
    }
    Ok(out)
}
