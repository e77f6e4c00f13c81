//! One forward pass over a weighted sum of chains: its log-determinant and `sideᵀ A⁻¹ side`, for likelihoods that a
//! search evaluates hundreds of times (docs/model-session.md, 11.12).
//!
//! Blocks are rows of whole vectors, padded with zeros: every loop runs along a row, nothing is allocated between
//! poses, and there is no back substitution.

use nalgebra::DMatrix;

use super::chain::{Chain, Layout, lengths};
use super::fit::RIDGE;
use super::lanes::{Rows, cholesky, forward, take_product};
use crate::simd::{Instructions, for_each_instruction_set};

/// Workspace of the elimination of one pose.
struct Pass {
    /// Number of unknowns of a pose; columns of the border and `side`.
    pose: usize,
    width: usize,
    /// The pose's own block, then its upper factor `U`, `UᵀU` the block.
    block: Rows,
    inverse: Vec<f64>,
    /// Its border columns, followed by `side`, then `U⁻ᵀ` times that.
    edge: Rows,
    /// Rows of the pose before, columns of this one, then `U⁻ᵀ` of the pose before times that.
    coupling: Rows,
    /// `U`, its inverse diagonal and edge of the pose before.
    half_before: Rows,
    inverse_before: Vec<f64>,
    edge_before: Rows,
    /// Schur complement of the border, followed by `side`.
    schur: Rows,
    /// `½ ln det` of the poses eliminated.
    half_log_det: f64,
}

/// `ln det A` and `sideᵀ A⁻¹ side`, `A` the sum of a chain and of others without border times their factors; `None`
/// where `A` is not positive definite.
pub(super) fn eliminated(
    chain: &Chain,
    others: &[(&Chain, f64)],
    side: &DMatrix<f64>,
) -> Option<(f64, f64)> {
    let instructions = Instructions::detect();
    let layout = chain.layout;
    let Layout {
        border,
        pose,
        n_poses,
    } = layout;
    let mut diagonal = chain.diagonal();
    for (other, factor) in others {
        for (i, block) in other.diagonal.iter().enumerate() {
            let mut part = diagonal.rows_mut(layout.at(i), pose);
            part.axpy(*factor, &block.diagonal(), 1.0);
        }
    }
    let scale = lengths(&diagonal);
    let log_scale: f64 = scale.iter().map(|v| v.ln()).sum();
    let inverse = scale.map(f64::recip);
    let d = inverse.as_slice();
    let mut pass = Pass::new(layout);
    pass.add_border(chain, side, d);
    let mut summed = vec![0.0; pose * pose];
    for i in 0..n_poses {
        let own = &d[layout.at(i)..][..pose];
        sum_blocks(&mut summed, others, chain, |one| &one.diagonal[i]);
        for r in 0..pose {
            let row = &mut pass.block.row(r)[..pose];
            for ((out, sum), d) in row.iter_mut().zip(&summed[r * pose..]).zip(own) {
                *out = sum * own[r] * d;
            }
            row[r] += RIDGE;
            let edge = &mut pass.edge.row(r)[..=border];
            let values = chain.border[i].as_slice();
            for ((out, value), d) in edge.iter_mut().zip(values[r..].iter().step_by(pose)).zip(d) {
                *out = value * own[r] * d;
            }
            edge[border] = side[(layout.at(i) + r, 0)] * own[r];
        }
        if i > 0 {
            let before = &d[layout.at(i - 1)..][..pose];
            sum_blocks(&mut summed, others, chain, |one| &one.next[i - 1]);
            for r in 0..pose {
                let row = &mut pass.coupling.row(r)[..pose];
                let values = summed[r..].iter().step_by(pose);
                for ((out, value), d) in row.iter_mut().zip(values).zip(own) {
                    *out = value * before[r] * d;
                }
            }
        }
        if !advance(instructions, &mut pass, i > 0) {
            return None;
        }
        pass.keep();
    }
    let explained_border = close(instructions, &mut pass)?;
    Some((2.0 * (pass.half_log_det + log_scale), explained_border))
}

/// Sum over all chains of the same block times its factor, column after column.
fn sum_blocks<'a>(
    out: &mut [f64],
    others: &[(&'a Chain, f64)],
    chain: &'a Chain,
    block: impl Fn(&'a Chain) -> &'a DMatrix<f64>,
) {
    out.copy_from_slice(block(chain).as_slice());
    for (other, factor) in others {
        for (sum, value) in out.iter_mut().zip(block(other).as_slice()) {
            *sum += factor * value;
        }
    }
}

impl Pass {
    fn new(layout: Layout) -> Self {
        let (pose, width) = (layout.pose, layout.border + 1);
        Self {
            pose,
            width,
            block: Rows::zeros(pose, pose),
            inverse: vec![0.0; pose],
            edge: Rows::zeros(pose, width),
            coupling: Rows::zeros(pose, pose),
            half_before: Rows::zeros(pose, pose),
            inverse_before: vec![0.0; pose],
            edge_before: Rows::zeros(pose, width),
            schur: Rows::zeros(width, width),
            half_log_det: 0.0,
        }
    }

    fn add_border(&mut self, chain: &Chain, side: &DMatrix<f64>, d: &[f64]) {
        let border = self.width - 1;
        for r in 0..border {
            for c in r..border {
                *self.schur.at(r, c) = chain.corner[(r, c)] * d[r] * d[c];
            }
            *self.schur.at(r, r) += RIDGE;
            *self.schur.at(r, border) = side[(r, 0)] * d[r];
        }
    }

    /// The pose eliminated last becomes the pose before.
    fn keep(&mut self) {
        std::mem::swap(&mut self.block, &mut self.half_before);
        std::mem::swap(&mut self.inverse, &mut self.inverse_before);
        std::mem::swap(&mut self.edge, &mut self.edge_before);
    }
}

for_each_instruction_set! {
    /// Eliminates one pose; returns whether its block is positive definite.
    fn advance(pass: &mut Pass, has_before: bool) -> bool = advance_body
}

for_each_instruction_set! {
    /// `sideᵀ A⁻¹ side` once all poses are eliminated, and the border's share of `½ ln det`.
    fn close(pass: &mut Pass) -> Option<f64> = close_body
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn advance_body<const FUSED: bool>(pass: &mut Pass, has_before: bool) -> bool {
    let pose = pass.pose;
    if has_before {
        forward::<FUSED>(
            &pass.half_before,
            &pass.inverse_before,
            &mut pass.coupling,
            pose,
        );
        take_product::<FUSED>(
            &mut pass.block,
            pose,
            &pass.coupling,
            &pass.coupling.data,
            pass.coupling.n,
        );
        take_product::<FUSED>(
            &mut pass.edge,
            pose,
            &pass.coupling,
            &pass.edge_before.data,
            pass.edge_before.n,
        );
    }
    let Some(log_det) = cholesky::<FUSED>(&mut pass.block, &mut pass.inverse, pose) else {
        return false;
    };
    pass.half_log_det += log_det;
    forward::<FUSED>(&pass.block, &pass.inverse, &mut pass.edge, pose);
    take_product::<FUSED>(
        &mut pass.schur,
        pass.width,
        &pass.edge,
        &pass.edge.data,
        pass.edge.n,
    );
    true
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn close_body<const FUSED: bool>(pass: &mut Pass) -> Option<f64> {
    let border = pass.width - 1;
    let mut inverse = vec![0.0; border];
    pass.half_log_det += cholesky::<FUSED>(&mut pass.schur, &mut inverse, border)?;
    let mut explained = -*pass.schur.at(border, border);
    for r in 0..border {
        explained += pass.schur.at(r, border).powi(2);
    }
    Some(explained)
}
