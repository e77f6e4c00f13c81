//! The evidence of a hypothesis: the rows of a session at one point, with the columns of further effects, at any strengths
//! of its noise (docs/model-session.md, 11.18).

use nalgebra::{DMatrix, DVector};

use super::chain::{Chain, Layout};
use super::elimination::eliminated;
use super::evidence::Part;
use super::fit::{Fit, RIDGE, chi2_of, gradient};
use super::moves::N_MOVE;
use super::rows::{Domain, Group, N_PROCESSES, size_row};
use super::strength_search::{Search, Within};
use super::{Session, Strengths};
use crate::error::{Error, Result};

/// A session at a point with its rows laid open: those of moves not yet weighed.
pub struct Hypothesis {
    layout: Layout,
    at: Strengths,
    fixed: Part,
    fixed_weight: f64,
    pub(super) process: Vec<Part>,
    pub(super) moves: Vec<Open>,
    pub(super) has_rate: bool,
    n_added: usize,
}

/// A move in SI, and what its covariance is made of.
pub(super) struct Open {
    group: Group,
    passed: super::move_rows::Passed,
}

/// What a hypothesis comes to.
#[derive(Debug, Clone)]
pub struct Found {
    /// Log-evidence: everything but the strengths integrated out.
    pub log_evidence: f64,
    /// Strengths there.
    pub strengths: Strengths,
    /// Added parameters, one linear step from the point.
    pub estimate: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
}

impl Hypothesis {
    /// A fitted session with further columns, whitened as its rows are, group after group; `sizes` are the standard
    /// deviations of their parameters beforehand.
    ///
    /// # Errors
    /// When a move's weight cannot be undone.
    pub fn of(
        session: &Session,
        fit: &Fit,
        columns: &[DMatrix<f64>],
        sizes: &[f64],
    ) -> Result<Self> {
        let k = sizes.len();
        let layout = Layout {
            border: fit.layout().border + k,
            ..fit.layout()
        };
        let is_move = |group: &Group| group.domain == Domain::Moves && group.rows.len() == N_MOVE;
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
            if !is_move(&group) {
                fixed.push(group);
                continue;
            }
            let back = fit.weights.white[group.segment]
                .try_inverse()
                .ok_or_else(|| Error::not_determined("the weight of a move cannot be undone"))?;
            let back = DMatrix::from_column_slice(N_MOVE, N_MOVE, back.as_slice());
            weigh(&mut group, &back);
            let passed = fit.passed[group.segment].clone();
            moves.push(Open { group, passed });
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
            has_rate: session.rate.is_some(),
            n_added: k,
        })
    }

    /// The rows that no process changes, at some strengths, and the logarithm of their normalisation.
    pub(super) fn heard(&self, strengths: &Strengths) -> Option<(Part, f64)> {
        let mut weight = self.fixed_weight;
        let mut groups = Vec::with_capacity(self.moves.len());
        for open in &self.moves {
            let half = open.passed.covariance(strengths).cholesky()?;
            let white = half.l().try_inverse()?;
            weight += white.diagonal().map(f64::ln).sum();
            let mut group = open.group.clone();
            let white = DMatrix::from_column_slice(N_MOVE, N_MOVE, white.as_slice());
            weigh(&mut group, &white);
            groups.push(group);
        }
        let mut chain = Chain::of(self.layout, groups.iter().map(|group| &group.rows));
        chain.add_scaled(&self.fixed.chain, 1.0);
        let part = Part {
            chain,
            side: gradient(self.layout, &groups) + &self.fixed.side,
            sum: chi2_of(&groups) + self.fixed.sum,
            n: N_MOVE * groups.len() + self.fixed.n,
        };
        Some((part, weight))
    }

    fn factors(&self, strengths: &Strengths) -> [f64; N_PROCESSES] {
        [
            strengths.corner_s[0] / self.at.corner_s[0],
            strengths.corner_s[1] / self.at.corner_s[1],
            self.at.scatter[0] / strengths.scatter[0],
            self.at.scatter[1] / strengths.scatter[1],
        ]
    }

    /// Log-evidence at some strengths beside rows that were weighed for them.
    pub(super) fn beside(&self, strengths: &Strengths, heard: &(Part, f64)) -> f64 {
        let (part, mut weight) = (&heard.0, heard.1);
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
    #[must_use]
    pub fn at_each(&self, strengths: &[Strengths]) -> Vec<f64> {
        let one = |s: &Strengths| {
            let heard = self.heard(s);
            heard.map_or(f64::NEG_INFINITY, |heard| self.beside(s, &heard))
        };
        strengths.iter().map(one).collect()
    }

    /// The strengths that make the rows likeliest, sought from the best of some, and all that follows there.
    ///
    /// # Errors
    /// When there are none, or nothing determines the session there.
    pub fn tuned(&self, starts: &[Strengths], within: &Within) -> Result<Found> {
        let values = self.at_each(starts);
        let best = starts
            .iter()
            .zip(values)
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .ok_or_else(|| Error::bad_input("strengths to begin from are missing"))?;
        let mut search = Search::new(self, best.0, within);
        search.run();
        self.found(&search.strengths())
    }

    /// All that follows at given strengths.
    ///
    /// # Errors
    /// When nothing determines the session there.
    pub fn found(&self, strengths: &Strengths) -> Result<Found> {
        let heard = self
            .heard(strengths)
            .ok_or_else(|| Error::not_determined("a move has no noise"))?;
        let log_evidence = self.beside(strengths, &heard);
        let mut chain = heard.0.chain;
        let mut side = heard.0.side;
        for (process, factor) in self.process.iter().zip(self.factors(strengths)) {
            chain.add_scaled(&process.chain, factor * factor);
            side += &process.side * (factor * factor);
        }
        let factor = chain.factor(RIDGE, None)?;
        let first = self.layout.border - self.n_added;
        let mut columns = DMatrix::zeros(self.layout.n(), self.n_added + 1);
        columns.column_mut(0).copy_from(&side.column(0));
        for c in 0..self.n_added {
            columns[(first + c, 1 + c)] = 1.0;
        }
        let solved = factor.solve(&columns);
        Ok(Found {
            log_evidence,
            strengths: *strengths,
            estimate: -solved.view((first, 0), (self.n_added, 1)).column(0),
            covariance: solved
                .view((first, 1), (self.n_added, self.n_added))
                .into_owned(),
        })
    }
}

/// Multiplies the rows of a move by a lower triangular matrix.
fn weigh(group: &mut Group, by: &DMatrix<f64>) {
    group.rows.residual = by * &group.rows.residual;
    group.rows.border = by * &group.rows.border;
    group.rows.here = by * &group.rows.here;
    group.rows.next = by * &group.rows.next;
}
