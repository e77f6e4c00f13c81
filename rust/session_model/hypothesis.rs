//! The evidence of a hypothesis: the rows of a session at one state, with the columns of further effects, at any noise
//! strengths (docs/model-session.md, 11.18).

use nalgebra::{DMatrix, DVector};

use super::Strengths;
use super::chain::{Chain, Layout};
use super::elimination::eliminated;
use super::equations::{Equations, OfPoses};
use super::fit::{Fit, RIDGE};
use super::move_rows::{MoveResidual, Whitening};
use super::open_move::Open;
use super::rows::{Group, N_PROCESSES, size_row};
use super::strength_search::{Search, Within};
use crate::error::{Error, Result};

/// Most renewals of the weights of moves for a hypothesis, and the change of their logarithm that needs none.
const RENEWALS: usize = 4;
const SAME_WEIGHT: f64 = 0.2;

/// All rows but those of the bias processes, and the logarithm of their normalisation.
pub(super) struct Weighed {
    pub equations: Equations,
    pub log_weight: f64,
}

/// A move to be weighed: its whitening, the residual in place of its own, the logarithm of its normalisation.
pub(super) type Weighing = (Whitening, Option<MoveResidual>, f64);

/// A session at one state, its rows by process; those of moves are not whitened yet.
pub struct Hypothesis {
    layout: Layout,
    at: Strengths,
    fixed: Equations,
    fixed_weight: f64,
    pub(super) process: Vec<OfPoses>,
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
        Ok(Self {
            layout,
            at: fit.strengths,
            fixed: Equations::of(layout, &fixed),
            fixed_weight,
            process: process
                .iter()
                .map(|groups| OfPoses::of(layout, groups))
                .collect(),
            moves,
            n_added: k,
        })
    }

    /// All rows but those of the bias processes at some strengths.
    pub(super) fn weighted_rows(&self, strengths: &Strengths) -> Option<Weighed> {
        self.with_moves(self.moves.iter().map(|open| {
            let (white, _, prior) = open.whitening(strengths)?;
            let log_weight = white.diagonal().map(f64::ln).sum() + prior;
            Some((white, None, log_weight))
        }))
    }

    /// The same with moves weighed otherwise.
    pub(super) fn with_moves(
        &self,
        moves: impl Iterator<Item = Option<Weighing>>,
    ) -> Option<Weighed> {
        let mut log_weight = self.fixed_weight;
        let mut equations = self.fixed.clone();
        for (open, one) in self.moves.iter().zip(moves) {
            let (white, residual, own) = one?;
            log_weight += own;
            equations.add_move(open, &white, residual.as_ref());
        }
        Some(Weighed {
            equations,
            log_weight,
        })
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
        let mut weight = weighted_rows.log_weight;
        let mut processes = Vec::with_capacity(N_PROCESSES);
        for (process, factor) in self.process.iter().zip(self.factors(strengths)) {
            if process.n == 0 {
                continue;
            }
            processes.push((process, factor * factor));
            weight += process.n as f64 * factor.ln();
        }
        eliminated(&weighted_rows.equations, &processes)
            .map_or(f64::NEG_INFINITY, |(log_det, left)| {
                -0.5 * left - 0.5 * log_det + weight
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
    /// Unless `is_first` only the weights of moves changed since a search.
    ///
    /// # Errors
    /// When there are no `starts`.
    pub fn likeliest(
        &self,
        starts: &[Strengths],
        within: &Within,
        is_first: bool,
    ) -> Result<(Strengths, f64)> {
        let each = starts.iter().map(|start| Search::new(self, start, within));
        let mut search = each
            .max_by(|a, b| a.value().total_cmp(&b.value()))
            .ok_or_else(|| Error::bad_input("strengths to begin from are missing"))?;
        let before = search.value();
        search.run(is_first);
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
        Ok(self.with_processes(rows, strengths))
    }

    /// Normal equations and `Jᵀr` of some rows with those of the processes at some strengths.
    pub(super) fn with_processes(
        &self,
        rows: Weighed,
        strengths: &Strengths,
    ) -> (Chain, DMatrix<f64>) {
        let mut equations = rows.equations;
        for (process, factor) in self.process.iter().zip(self.factors(strengths)) {
            equations.add(process, factor * factor);
        }
        equations.chain()
    }

    /// The most likely strengths, searched from the best of `starts`, with the evidence and the estimate there; the
    /// weights of moves are renewed by the residuals that the added parameters leave.
    ///
    /// # Errors
    /// When there are no `starts`, or the session is undetermined there.
    pub fn tuned(mut self, starts: &[Strengths], within: &Within) -> Result<Found> {
        let (mut strengths, _) = self.likeliest(starts, within, true)?;
        for _ in 0..RENEWALS {
            let step = -self.solved(&strengths)?.column(0);
            if !self.renew(&strengths, &step) {
                break;
            }
            (strengths, _) = self.likeliest(&[strengths], within, false)?;
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
