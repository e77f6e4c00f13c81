//! How likely the rows of a session are at other strengths of its processes (docs/model-session.md, 11.11, 11.12).

use nalgebra::DMatrix;

use super::Strengths;
use super::blocks::{add_gram, add_product, forward};
use super::chain::{Chain, add_ridge, indefinite, lengths, scaled};
use super::fit::{Fit, RIDGE, chi2_of, gradient};
use super::moves::N_MOVE;
use super::rows::{Domain, Group, N_PROCESSES};
use super::strengths::DEAF;
use crate::error::{Error, Result};

/// Normal equations of some rows: `JᵀJ`, `Jᵀr`, `Σ r²`, number of rows.
#[derive(Clone)]
pub(super) struct Part {
    pub chain: Chain,
    pub side: DMatrix<f64>,
    pub sum: f64,
    pub n: usize,
}

impl Part {
    /// This and another one, whose rows count `factor` times.
    fn and(&self, other: &Self, factor: f64) -> Self {
        let squared = factor * factor;
        let mut out = self.clone();
        out.chain.add_scaled(&other.chain, squared);
        out.side += &other.side * squared;
        out.sum += other.sum * squared;
        out
    }
}

/// Normal equations by process, ready to be weighed anew.
pub(super) struct Evidence {
    pub at: Strengths,
    /// Readings of the poses, and priors.
    rest: Part,
    /// These with readings of the moves that hardly count, and the logarithm of those rows' normalisation.
    heard: (Part, f64),
    process: Vec<Part>,
}

impl Evidence {
    pub(super) fn of(fit: &Fit) -> Self {
        let layout = fit.layout();
        let part = |is_in: &dyn Fn(&Group) -> bool, is_bordered: bool| {
            let groups: Vec<&Group> = fit.groups.iter().filter(|g| is_in(g)).collect();
            let rows = groups.iter().map(|group| &group.rows);
            Part {
                chain: if is_bordered {
                    Chain::of(layout, rows)
                } else {
                    Chain::of_poses(layout, rows)
                },
                side: gradient(layout, groups.iter().copied()),
                sum: chi2_of(groups.iter().copied()),
                n: groups.iter().map(|group| group.rows.len()).sum(),
            }
        };
        let is_move = |group: &Group| group.domain == Domain::Moves && group.rows.len() == N_MOVE;
        let is_fixed = |group: &Group| group.kind.process().is_none();
        let rest = part(&|g| is_fixed(g) && !is_move(g), true);
        let moves = part(&|g| is_fixed(g) && is_move(g), true);
        Self {
            at: fit.strengths,
            heard: (rest.and(&moves, DEAF), moves.n as f64 * DEAF.ln()),
            rest,
            process: (0..N_PROCESSES)
                .map(|p| part(&|g: &Group| g.kind.process() == Some(p), false))
                .collect(),
        }
    }

    /// How much the rows of every process count at other strengths.
    fn factors(&self, strengths: &Strengths) -> [f64; N_PROCESSES] {
        [
            strengths.corner_s[0] / self.at.corner_s[0],
            strengths.corner_s[1] / self.at.corner_s[1],
            self.at.scatter[0] / strengths.scatter[0],
            self.at.scatter[1] / strengths.scatter[1],
        ]
    }

    /// Normal equations and `Jᵀr` at other strengths, with the rows of the moves as given.
    pub(super) fn combined(&self, strengths: &Strengths, moves: &Part) -> (Chain, DMatrix<f64>) {
        let mut out = self.rest.and(moves, 1.0);
        for (part, factor) in self.process.iter().zip(self.factors(strengths)) {
            out = out.and(part, factor);
        }
        (out.chain, out.side)
    }

    /// Log-evidence at other strengths, from the linear problem here, beside rows that no strength changes.
    fn beside(&self, strengths: &Strengths, fixed: &Part) -> f64 {
        let mut side = fixed.side.clone();
        let (mut sum, mut weight) = (fixed.sum, 0.0);
        let mut weighed = Vec::with_capacity(N_PROCESSES);
        for (part, factor) in self.process.iter().zip(self.factors(strengths)) {
            let squared = factor * factor;
            weighed.push((&part.chain, squared));
            side += &part.side * squared;
            sum += part.sum * squared;
            weight += part.n as f64 * factor.ln();
        }
        eliminated(&fixed.chain, &weighed, &side)
            .map_or(f64::NEG_INFINITY, |(log_det, explained)| {
                -0.5 * (sum - explained) - 0.5 * log_det + weight
            })
    }

    /// Log-evidence at other strengths where moves hardly count.
    pub(super) fn at(&self, strengths: &Strengths) -> f64 {
        self.beside(strengths, &self.heard.0) + self.heard.1
    }

    /// Log-evidence at other strengths with the rows of the moves as given.
    pub(super) fn with(&self, strengths: &Strengths, moves: &Part) -> f64 {
        self.beside(strengths, &self.rest.and(moves, 1.0))
    }
}

/// `ln det A` and `sideᵀ A⁻¹ side`, `A` the sum of a chain and of others times their factors that have no border: one
/// pass forward, which carries `side` as one more column of the border. Nothing is substituted back.
fn eliminated(chain: &Chain, others: &[(&Chain, f64)], side: &DMatrix<f64>) -> Result<(f64, f64)> {
    let layout = chain.layout;
    let (n_border, width) = (layout.border, layout.border + 1);
    let mut diagonal = chain.diagonal();
    for (other, factor) in others {
        for (i, block) in other.diagonal.iter().enumerate() {
            let mut part = diagonal.rows_mut(layout.at(i), layout.pose);
            part.axpy(*factor, &block.diagonal(), 1.0);
        }
    }
    let scale = lengths(&diagonal);
    let inverse = scale.map(f64::recip);
    let d_border = inverse.rows(0, n_border).into_owned();
    let mut log_det = 2.0 * scale.iter().map(|v| v.ln()).sum::<f64>();
    // The border with `side` behind it; only the lower triangle is kept true.
    let mut schur = scaled(&chain.corner, &d_border, &d_border);
    add_ridge(&mut schur, RIDGE);
    let mut schur = schur.resize(width, width, 0.0);
    for j in 0..n_border {
        schur[(n_border, j)] = side[(j, 0)] * d_border[j];
    }
    let summed = |own: &DMatrix<f64>, blocks: &dyn Fn(&Chain) -> DMatrix<f64>| {
        let mut out = own.clone();
        for (other, factor) in others {
            out += blocks(other) * *factor;
        }
        out
    };
    let mut before: Option<(nalgebra::Cholesky<f64, nalgebra::Dyn>, DMatrix<f64>)> = None;
    for i in 0..layout.n_poses {
        let d = inverse.rows(layout.at(i), layout.pose).into_owned();
        let own = summed(&chain.diagonal[i], &|other| other.diagonal[i].clone());
        let mut block = scaled(&own, &d, &d);
        add_ridge(&mut block, RIDGE);
        let mut edge = scaled(&chain.border[i], &d, &d_border).resize_horizontally(width, 0.0);
        for r in 0..layout.pose {
            edge[(r, n_border)] = side[(layout.at(i) + r, 0)] * d[r];
        }
        if let Some((half, along)) = &before {
            let d_before = inverse.rows(layout.at(i - 1), layout.pose).into_owned();
            let own = summed(&chain.next[i - 1], &|other| other.next[i - 1].clone());
            let rows = forward(half, &scaled(&own, &d_before, &d));
            add_gram(&mut block, -1.0, &rows, layout.pose);
            let coupling = DMatrix::from_row_slice(layout.pose, layout.pose, &rows);
            add_product(&mut edge, -1.0, &coupling, along);
        }
        let half = block.cholesky().ok_or_else(indefinite)?;
        log_det += 2.0
            * half
                .l_dirty()
                .diagonal()
                .iter()
                .map(|v| v.ln())
                .sum::<f64>();
        let rows = forward(&half, &edge);
        add_gram(&mut schur, -1.0, &rows, width);
        before = Some((half, DMatrix::from_row_slice(layout.pose, width, &rows)));
    }
    let mut explained = -schur[(n_border, n_border)];
    if n_border > 0 {
        let left = schur.view((n_border, 0), (1, n_border)).transpose();
        let corner = schur
            .view((0, 0), (n_border, n_border))
            .into_owned()
            .cholesky()
            .ok_or_else(|| Error::not_determined("the session leaves its model undetermined"))?;
        log_det += 2.0
            * corner
                .l_dirty()
                .diagonal()
                .iter()
                .map(|v| v.ln())
                .sum::<f64>();
        explained += forward(&corner, &left).iter().map(|v| v * v).sum::<f64>();
    }
    Ok((log_det, explained))
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::super::chain::{Chain, Layout, Rows};
    use super::super::fit::RIDGE;
    use super::eliminated;

    /// Numbers between -1 and 1 that look like chance.
    fn numbers(rows: usize, columns: usize, seed: f64) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |i, j| {
            let x = (seed + 12.9898 * i as f64 + 78.233 * j as f64).sin() * 43758.5453;
            2.0 * (x - x.floor()) - 1.0
        })
    }

    fn rows(layout: Layout, pose: usize, n: usize, seed: f64) -> Rows {
        let mut out = Rows::new(DVector::zeros(n), layout, pose);
        out.border = numbers(n, layout.border, seed);
        out.here = numbers(n, layout.pose, seed + 0.3);
        if pose + 1 < layout.n_poses {
            out.next = numbers(n, layout.pose, seed + 0.7);
        }
        out
    }

    /// Against the sum factored as a whole and solved there and back.
    #[test]
    fn one_pass_forward_gives_what_the_factor_of_the_sum_gives() {
        let layout = Layout {
            border: 5,
            pose: 4,
            n_poses: 7,
        };
        let all: Vec<Rows> = (0..7).map(|i| rows(layout, i, 6, i as f64)).collect();
        let mut process: Vec<Rows> = (0..7)
            .map(|i| rows(layout, i, 3, 20.0 + i as f64))
            .collect();
        for one in &mut process {
            one.border = DMatrix::zeros(3, 0);
        }
        let (fixed, other) = (Chain::of(layout, &all), Chain::of_poses(layout, &process));
        let side = numbers(layout.n(), 1, 5.0);
        let mut whole = fixed.clone();
        whole.add_scaled(&other, 3.7);
        let factor = whole.factor(RIDGE, None).expect("positive definite");
        let (log_det, explained) =
            eliminated(&fixed, &[(&other, 3.7)], &side).expect("positive definite");
        // Rounding of some hundred operations on a matrix of moderate condition.
        assert!((log_det - factor.log_det()).abs() < 1e-9);
        assert!((explained - side.dot(&factor.solve(&side))).abs() < 1e-9 * explained);
    }
}
