//! The evidence of a hypothesis: the rows of a session at one state, with the columns of further effects, at any noise
//! strengths (docs/model-session.md, 11.18).

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};

use super::Strengths;
use super::chain::{Chain, Layout};
use super::elimination::eliminated;
use super::fit::{Fit, RIDGE, chi2_of, gradient};
use super::move_rows::{MoveResidual, Whitening};
use super::moves::N_MOVE;
use super::open_move::Open;
use super::rows::{Group, N_PROCESSES, size_row};
use super::strength_search::{Search, Within};
use crate::error::{Error, Result};

/// Most renewals of the weights of moves for a hypothesis, and the change of their logarithm that needs none.
const RENEWALS: usize = 4;
const SAME_WEIGHT: f64 = 0.2;

/// Normal equations of some rows: `JᵀJ`, `Jᵀr`, `Σ r²`, number of rows.
pub(super) struct Part {
    pub chain: Chain,
    pub side: DMatrix<f64>,
    pub sum: f64,
    pub n: usize,
}

/// All rows but those of the bias processes, and the logarithm of their normalisation.
pub(super) struct Weighed {
    pub part: Part,
    pub log_weight: f64,
}

/// A session at one state, its rows by process; those of moves are not whitened yet.
pub struct Hypothesis {
    layout: Layout,
    at: Strengths,
    fixed: Part,
    fixed_weight: f64,
    pub(super) process: Vec<Part>,
    pub(super) moves: Vec<Open>,
    n_added: usize,
}

/// Evidence and estimate of a hypothesis.
#[derive(Debug, Clone)]
pub struct Found {
    /// Log-evidence: all but the strengths integrated out.
    pub log_evidence: f64,
    /// Strengths of largest evidence.
    pub strengths: Strengths,
    /// Added parameters, one linear step from the state.
    pub estimate: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
}

impl Hypothesis {
    /// A fitted session with further columns, whitened as its rows are, group after group; `sizes` are the prior
    /// standard deviations of their parameters.
    ///
    /// # Errors
    /// When a move's whitening cannot be inverted.
    pub fn of(fit: &Fit, columns: &[DMatrix<f64>], sizes: &[f64]) -> Result<Self> {
        let k = sizes.len();
        let layout = Layout {
            border: fit.layout().border + k,
            ..fit.layout()
        };
        let mut fixed = Vec::new();
        let mut moves = Vec::new();
        let mut process: Vec<Vec<Group>> = vec![Vec::new(); N_PROCESSES];
        for (g, group) in fit.groups.iter().enumerate() {
            if let Some(p) = group.kind.process() {
                process[p].push(group.clone());
                continue;
            }
            let mut group = group.clone();
            if group.rows.border.ncols() > 0 {
                let first = fit.layout().border;
                group.rows.border = group.rows.border.resize_horizontally(layout.border, 0.0);
                if let Some(own) = columns.get(g) {
                    group.rows.border.columns_mut(first, k).copy_from(own);
                }
            }
            if !group.is_move() {
                fixed.push(group);
                continue;
            }
            let m = group.segment;
            let back = unweighed(&fit.weights.white[m])?;
            moves.push(Open::of(&group, &back, &fit.passed[m]));
        }
        for (c, size) in sizes.iter().enumerate() {
            let column = fit.layout().border + c;
            fixed.push(size_row(layout.border, column, 0.0, *size));
        }
        let weighed = fixed.iter().chain(process.iter().flatten());
        let fixed_weight = weighed.map(|group| group.log_weight).sum();
        let part = |groups: &[Group], is_bordered: bool| Part {
            chain: if is_bordered {
                Chain::of(layout, groups.iter().map(|group| &group.rows))
            } else {
                Chain::of_poses(layout, groups.iter().map(|group| &group.rows))
            },
            side: gradient(layout, groups),
            sum: chi2_of(groups),
            n: groups.iter().map(|group| group.rows.len()).sum(),
        };
        Ok(Self {
            layout,
            at: fit.strengths,
            fixed: part(&fixed, true),
            fixed_weight,
            process: process.iter().map(|groups| part(groups, false)).collect(),
            moves,
            n_added: k,
        })
    }

    /// All rows but those of the bias processes at some strengths.
    pub(super) fn weighted_rows(&self, strengths: &Strengths) -> Option<Weighed> {
        self.with_moves(self.moves.iter().map(|open| {
            let (white, _, prior) = open.whitening(strengths)?;
            let log_weight = white.diagonal().map(f64::ln).sum() + prior;
            Some((Cow::Borrowed(&open.columns), white, log_weight))
        }))
    }

    /// The same with other rows of the moves: columns, whitening and the logarithm of the normalisation of each.
    pub(super) fn with_moves<'a>(
        &self,
        moves: impl Iterator<Item = Option<(Cow<'a, DMatrix<f64>>, Whitening, f64)>>,
    ) -> Option<Weighed> {
        let mut log_weight = self.fixed_weight;
        let mut chain = self.fixed.chain.clone();
        let mut side = self.fixed.side.clone();
        let mut sum = self.fixed.sum;
        for (open, one) in self.moves.iter().zip(moves) {
            let (columns, white, own) = one?;
            log_weight += own;
            sum += chain.add_move(open.pose, &columns, &white, &mut side);
        }
        chain.mirror();
        let n = N_MOVE * self.moves.len() + self.fixed.n;
        let part = Part {
            chain,
            side,
            sum,
            n,
        };
        Some(Weighed { part, log_weight })
    }

    /// `L⁻¹` of every move's covariance at some strengths, by index of the move.
    pub(super) fn whitenings(&self, strengths: &Strengths) -> Option<Vec<Whitening>> {
        self.moves
            .iter()
            .map(|open| open.whitening(strengths).map(|(white, ..)| white))
            .collect()
    }

    /// The hypothesis with Gaussian noise of the moves.
    pub(super) fn without_tails(mut self) -> Self {
        for open in &mut self.moves {
            open.left = MoveResidual::zeros();
        }
        self
    }

    fn factors(&self, strengths: &Strengths) -> [f64; N_PROCESSES] {
        std::array::from_fn(|p| {
            if p < 2 {
                strengths.corner_s[p] / self.at.corner_s[p]
            } else {
                self.at.scatter[p - 2] / strengths.scatter[p - 2]
            }
        })
    }

    /// Log-evidence at some strengths; `weighted_rows` are the rows outside the processes at them.
    pub(super) fn beside(&self, strengths: &Strengths, weighted_rows: &Weighed) -> f64 {
        let (part, mut weight) = (&weighted_rows.part, weighted_rows.log_weight);
        let mut side = part.side.clone();
        let mut sum = part.sum;
        let mut weighed = Vec::with_capacity(N_PROCESSES);
        for (process, factor) in self.process.iter().zip(self.factors(strengths)) {
            if process.n == 0 {
                continue;
            }
            let squared = factor * factor;
            weighed.push((&process.chain, squared));
            side += &process.side * squared;
            sum += process.sum * squared;
            weight += process.n as f64 * factor.ln();
        }
        eliminated(&part.chain, &weighed, &side)
            .map_or(f64::NEG_INFINITY, |(log_det, explained)| {
                -0.5 * (sum - explained) - 0.5 * log_det + weight
            })
    }

    /// Log-evidence at each of some strengths.
    pub(super) fn at_each(&self, strengths: &[Strengths]) -> Vec<f64> {
        let one = |s: &Strengths| {
            let weighted_rows = self.weighted_rows(s);
            weighted_rows.map_or(f64::NEG_INFINITY, |weighted_rows| {
                self.beside(s, &weighted_rows)
            })
        };
        strengths.iter().map(one).collect()
    }

    /// The most likely strengths, searched from the best of `starts`, and their gain in log-evidence over that one.
    ///
    /// # Errors
    /// When there are no `starts`.
    pub fn likeliest(&self, starts: &[Strengths], within: &Within) -> Result<(Strengths, f64)> {
        let values = self.at_each(starts);
        let best = starts
            .iter()
            .zip(values)
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .ok_or_else(|| Error::bad_input("strengths to begin from are missing"))?;
        let mut search = Search::new(self, best.0, within);
        let before = search.value();
        search.run();
        Ok((search.strengths(), search.value() - before))
    }

    /// Normal equations and `Jᵀr` at some strengths.
    ///
    /// # Errors
    /// When a move has no noise.
    pub(super) fn system(&self, strengths: &Strengths) -> Result<(Chain, DMatrix<f64>)> {
        let rows = self
            .weighted_rows(strengths)
            .ok_or_else(|| Error::not_determined("a move has no noise"))?;
        Ok(self.with_processes(rows.part, strengths))
    }

    /// Normal equations and `Jᵀr` of some rows with those of the processes at some strengths.
    pub(super) fn with_processes(
        &self,
        part: Part,
        strengths: &Strengths,
    ) -> (Chain, DMatrix<f64>) {
        let (mut chain, mut side) = (part.chain, part.side);
        for (process, factor) in self.process.iter().zip(self.factors(strengths)) {
            chain.add_scaled(&process.chain, factor * factor);
            side += &process.side * (factor * factor);
        }
        (chain, side)
    }

    /// The most likely strengths, searched from the best of `starts`, with the evidence and the estimate there; the
    /// weights of moves are renewed by the residuals that the added parameters leave.
    ///
    /// # Errors
    /// When there are no `starts`, or the session is undetermined there.
    pub fn tuned(mut self, starts: &[Strengths], within: &Within) -> Result<Found> {
        let (mut strengths, _) = self.likeliest(starts, within)?;
        for _ in 0..RENEWALS {
            let step = -self.solved(&strengths)?.column(0);
            if !self.renew(&strengths, &step) {
                break;
            }
            (strengths, _) = self.likeliest(&[strengths], within)?;
        }
        let log_evidence = self.at_each(&[strengths])[0];
        let first = self.layout.border - self.n_added;
        let solved = self.solved(&strengths)?;
        Ok(Found {
            log_evidence,
            strengths,
            estimate: -solved.view((first, 0), (self.n_added, 1)).column(0),
            covariance: solved
                .view((first, 1), (self.n_added, self.n_added))
                .into_owned(),
        })
    }

    /// `(unknowns, 1 + added)` the step away from the optimum, and the covariance of all unknowns with those added.
    fn solved(&self, strengths: &Strengths) -> Result<DMatrix<f64>> {
        let (chain, side) = self.system(strengths)?;
        let factor = chain.factor(RIDGE, None)?;
        let first = self.layout.border - self.n_added;
        let mut columns = DMatrix::zeros(self.layout.n(), self.n_added + 1);
        columns.column_mut(0).copy_from(&side.column(0));
        for c in 0..self.n_added {
            columns[(first + c, 1 + c)] = 1.0;
        }
        Ok(factor.solve(&columns))
    }

    /// Moves the residuals about which tails are by a `step`; whether the weight of any move changes by it.
    fn renew(&mut self, strengths: &Strengths, step: &DVector<f64>) -> bool {
        let layout = self.layout;
        let mut changed = false;
        for open in &mut self.moves {
            let before = open.whitening(strengths).map_or(1.0, |one| one.1);
            open.left = open.moved(layout, step);
            let after = open.whitening(strengths).map_or(1.0, |one| one.1);
            changed |= (after / before).ln().abs() > SAME_WEIGHT;
        }
        changed
    }
}

/// Inverse of a move's whitening: from whitened rows back to SI.
pub(super) fn unweighed(white: &Whitening) -> Result<Whitening> {
    white
        .try_inverse()
        .ok_or_else(|| Error::not_determined("the weight of a move cannot be undone"))
}
