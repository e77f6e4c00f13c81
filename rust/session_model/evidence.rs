//! How likely the rows of a session are at other strengths of its processes (docs/model-session.md, 11.11, 11.12).

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use nalgebra::DMatrix;

use super::Strengths;
use super::chain::Chain;
use super::elimination::eliminated;
use super::fit::{Fit, chi2_of, gradient};
use super::moves::N_MOVE;
use super::rows::{Domain, Group, N_PROCESSES};
use super::strengths::DEAF;

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
        let mut out = self.clone();
        out.add(other, factor);
        out
    }

    fn add(&mut self, other: &Self, factor: f64) {
        let squared = factor * factor;
        self.chain.add_scaled(&other.chain, squared);
        self.side += &other.side * squared;
        self.sum += other.sum * squared;
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
    /// What was asked for already: searches come back to the same corner times and scatters.
    known: Mutex<HashMap<[u64; N_PROCESSES], f64>>,
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
            known: Mutex::default(),
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
            out.add(part, factor);
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
        let [a, b] = strengths.corner_s.map(f64::to_bits);
        let [c, d] = strengths.scatter.map(f64::to_bits);
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = known().get(&[a, b, c, d]) {
            return *value;
        }
        let value = self.beside(strengths, &self.heard.0) + self.heard.1;
        known().insert([a, b, c, d], value);
        value
    }

    /// Log-evidence at other strengths with the rows of the moves as given.
    pub(super) fn with(&self, strengths: &Strengths, moves: &Part) -> f64 {
        self.beside(strengths, &self.rest.and(moves, 1.0))
    }
}
