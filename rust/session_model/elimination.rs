//! One forward pass over normal equations: their log-determinant and the sum of squares that is left, for likelihoods
//! that a search evaluates hundreds of times (docs/model-session.md, 11.12).
//!
//! Nothing is allocated between poses, and there is no back substitution.

use super::chain::{Layout, lengths};
use super::equations::{Equations, OfPoses};
use super::fit::RIDGE;
use super::lanes::{Rows, add_gram, add_product, add_scaled, cholesky, forward, padded, stretch};
use crate::simd::{Instructions, for_each_instruction_set};

/// Workspace of the elimination of one pose.
struct Pass {
    /// The pose's own block, then its upper factor `U`, `UᵀU` the block.
    block: Rows,
    inverse: Vec<f64>,
    /// Its border columns, followed by `Jᵀr`, then `U⁻ᵀ` times that.
    edge: Rows,
    /// Rows of the pose before, columns of this one, then `U⁻ᵀ` of the pose before times that.
    coupling: Rows,
    /// `U`, its inverse diagonal and edge of the pose before.
    half_before: Rows,
    inverse_before: Vec<f64>,
    edge_before: Rows,
}

/// `ln det A` and the sum of squares left at the minimum, of normal equations and those of processes times their
/// factors; `None` where `A` is not positive definite.
pub(super) fn eliminated(
    equations: &Equations,
    processes: &[(&OfPoses, f64)],
) -> Option<(f64, f64)> {
    let scale = lengths(&equations.diagonal(processes));
    let log_scale: f64 = scale.iter().map(|v| v.ln()).sum();
    let inverse = scale.map(f64::recip);
    let (half_log_det, left) = eliminate(
        Instructions::detect(),
        equations,
        processes,
        inverse.as_slice(),
    )?;
    let of_processes: f64 = processes.iter().map(|(one, factor)| factor * one.sum).sum();
    Some((2.0 * (half_log_det + log_scale), left + of_processes))
}

for_each_instruction_set! {
    /// `½ ln det` of equations whose unknowns are divided by `d`, and the sum of squares left but that of the
    /// processes' own rows.
    fn eliminate(
        equations: &Equations, processes: &[(&OfPoses, f64)], d: &[f64],
    ) -> Option<(f64, f64)> = eliminate_body
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn eliminate_body<const FUSED: bool>(
    equations: &Equations,
    processes: &[(&OfPoses, f64)],
    d: &[f64],
) -> Option<(f64, f64)> {
    let layout = equations.layout;
    let Layout { border, pose, .. } = layout;
    let of_border = padded(&d[..border], Some(1.0));
    let mut schur = equations.corner.clone();
    stretch(&mut schur.data, of_border.as_flattened(), &of_border);
    for r in 0..border {
        schur[(r, r)] += RIDGE;
    }
    let mut pass = Pass::new(layout);
    let mut half_log_det = 0.0;
    let mut own_before: &[f64] = &[];
    for i in 0..layout.n_poses {
        let own = &d[layout.at(i)..][..pose];
        let columns = padded(own, None);
        pass.block
            .data
            .copy_from_slice(equations.own.part(i * pose, pose).data);
        pass.edge
            .data
            .copy_from_slice(equations.edge.part(i * pose, pose).data);
        for (process, factor) in processes {
            add_scaled::<FUSED>(
                &mut pass.block.data,
                *factor,
                process.own.part(i * pose, pose).data,
            );
            for (r, value) in process.side[i * pose..][..pose].iter().enumerate() {
                pass.edge[(r, border)] += factor * value;
            }
        }
        stretch(&mut pass.block.data, own, &columns);
        stretch(&mut pass.edge.data, own, &of_border);
        for r in 0..pose {
            pass.block[(r, r)] += RIDGE;
        }
        if i > 0 {
            pass.coupling
                .data
                .copy_from_slice(equations.next.part((i - 1) * pose, pose).data);
            for (process, factor) in processes {
                add_scaled::<FUSED>(
                    &mut pass.coupling.data,
                    *factor,
                    process.next.part((i - 1) * pose, pose).data,
                );
            }
            stretch(&mut pass.coupling.data, own_before, &columns);
            forward::<FUSED>(
                &pass.half_before,
                &pass.inverse_before,
                &mut pass.coupling,
                pose,
            );
            let coupling = pass.coupling.whole();
            add_gram::<FUSED>(&mut pass.block.data, -1.0, coupling);
            add_product::<FUSED>(
                &mut pass.edge.data,
                -1.0,
                coupling,
                pass.edge_before.whole(),
            );
        }
        half_log_det += cholesky::<FUSED>(&mut pass.block, &mut pass.inverse, pose)?;
        forward::<FUSED>(&pass.block, &pass.inverse, &mut pass.edge, pose);
        add_gram::<FUSED>(&mut schur.data, -1.0, pass.edge.whole());
        pass.keep();
        own_before = own;
    }
    let mut inverse = vec![0.0; border];
    half_log_det += cholesky::<FUSED>(&mut schur, &mut inverse, border)?;
    let explained: f64 = (0..border).map(|r| schur[(r, border)].powi(2)).sum();
    Some((half_log_det, schur[(border, border)] - explained))
}

impl Pass {
    fn new(layout: Layout) -> Self {
        let (pose, width) = (layout.pose, layout.border + 1);
        Self {
            block: Rows::zeros(pose, pose),
            inverse: vec![0.0; pose],
            edge: Rows::zeros(pose, width),
            coupling: Rows::zeros(pose, pose),
            half_before: Rows::zeros(pose, pose),
            inverse_before: vec![0.0; pose],
            edge_before: Rows::zeros(pose, width),
        }
    }

    /// The pose eliminated last becomes the pose before.
    fn keep(&mut self) {
        std::mem::swap(&mut self.block, &mut self.half_before);
        std::mem::swap(&mut self.inverse, &mut self.inverse_before);
        std::mem::swap(&mut self.edge, &mut self.edge_before);
    }
}
