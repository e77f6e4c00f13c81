//! The evidence of a hypothesis: the rows of a session at one point, with the columns of further effects, at any strengths
//! of its noise (docs/model-session.md, 11.18).

use nalgebra::{DMatrix, DVector};

use super::chain::{Chain, Layout};
use super::elimination::eliminated;
use super::evidence::Part;
use super::fit::{Fit, RIDGE, chi2_of, gradient};
use super::moves::N_MOVE;
use super::rows::{Domain, Group, N_PROCESSES, size_row};
use super::strengths::NO_SCATTER;
use super::{Session, Strengths};
use crate::error::{Error, Result};

/// Number of strengths: corner time, scatter, straying between poses of either sensor, excess of both kinds of rows.
const N_STRENGTHS: usize = 8;
/// Natural logarithms between which each kind is sought. No bound on noise is physical: these only end the search, a
/// walk that meets white noise in a fifth of a second, scatter of thousands of errors of a pose, rows thousands of times off.
const CORNER: (f64, f64) = (-1.6, 8.5);
const SCATTER: (f64, f64) = (-6.9, 9.2);
const BETWEEN: (f64, f64) = (-3.0, 1.6);
const EXCESS: (f64, f64) = (0.0, 9.2);
/// Scatter, and excess of moves, that are sought from nothing begin at these: near nothing the evidence is flat.
const FROM_NOTHING: [f64; 4] = [0.5, 1.5, 5.0, 20.0];
/// Scatter below which how far zeros stray between poses shows nowhere.
const LEAST_SCATTER: f64 = 0.2;
/// A pass over all strengths that gains less than this ends the search.
const ENOUGH: f64 = 0.1;
const MOST_PASSES: usize = 8;
/// Steps, of the logarithm, at which the search along one strength begins and ends.
const FIRST_STEP: f64 = 0.8;
const LAST_STEP: f64 = 0.1;

/// A session at a point with its rows laid open: those of moves not yet weighed.
pub struct Hypothesis {
    layout: Layout,
    at: Strengths,
    fixed: Part,
    fixed_weight: f64,
    process: Vec<Part>,
    moves: Vec<Open>,
    has_rate: bool,
    n_added: usize,
}

/// A move in SI, and what its covariance is made of.
struct Open {
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
    fn heard(&self, strengths: &Strengths) -> Option<(Part, f64)> {
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
    fn beside(&self, strengths: &Strengths, heard: &(Part, f64)) -> f64 {
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

    /// The strengths that make the rows likeliest, sought from some, and all that follows there.
    ///
    /// # Errors
    /// When nothing determines the session there.
    pub fn tuned(&self, start: &Strengths, within: &Within) -> Result<Found> {
        let mut search = Search::new(self, start, within);
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

/// Bounds of some strengths, where a hypothesis says that they are no larger than noise alone makes them.
#[derive(Debug, Clone, Copy)]
pub struct Within {
    /// Shortest corner times, s.
    pub corner_s: [f64; 2],
    /// Largest scatter, in units of the session's reference.
    pub scatter: [f64; 2],
    /// Largest excess of moves.
    pub excess: [f64; 2],
}

impl Within {
    /// None.
    pub const ANYTHING: Self = Self {
        corner_s: [0.0; 2],
        scatter: [f64::INFINITY; 2],
        excess: [f64::INFINITY; 2],
    };

    fn bounds(&self) -> [(f64, f64); N_STRENGTHS] {
        let kinds = [CORNER, SCATTER, BETWEEN, EXCESS];
        std::array::from_fn(|i| {
            let ((low, high), k) = (kinds[i / 2], i % 2);
            match i / 2 {
                0 => (self.corner_s[k].ln().clamp(low, high), high),
                1 => (low, self.scatter[k].ln().clamp(low, high)),
                3 => (low, self.excess[k].ln().clamp(low, high)),
                _ => (low, high),
            }
        })
    }
}

/// A search along one strength after the other, in logarithms.
struct Search<'a> {
    hypothesis: &'a Hypothesis,
    bounds: [(f64, f64); N_STRENGTHS],
    x: [f64; N_STRENGTHS],
    value: f64,
    /// The rows of moves as they were weighed last, and for what.
    heard: Option<([u64; 6], (Part, f64))>,
}

impl<'a> Search<'a> {
    fn new(hypothesis: &'a Hypothesis, start: &Strengths, within: &Within) -> Self {
        let s = start;
        let x = [
            s.corner_s[0], s.corner_s[1], s.scatter[0], s.scatter[1], s.between[0], s.between[1], s.excess[0],
            s.excess[1],
        ];
        let mut x = x.map(f64::ln);
        let bounds = within.bounds();
        for (value, (low, high)) in x.iter_mut().zip(bounds) {
            *value = value.clamp(low, high);
        }
        let mut search = Self {
            hypothesis,
            bounds,
            x,
            value: 0.0,
            heard: None,
        };
        search.value = search.at(&x);
        search
    }

    fn strengths(&self) -> Strengths {
        strengths_of(&self.x)
    }

    fn at(&mut self, x: &[f64; N_STRENGTHS]) -> f64 {
        let strengths = strengths_of(x);
        let key = [x[2], x[3], x[4], x[5], x[6], x[7]].map(f64::to_bits);
        if self.heard.as_ref().is_none_or(|(known, _)| *known != key) {
            let Some(heard) = self.hypothesis.heard(&strengths) else {
                return f64::NEG_INFINITY;
            };
            self.heard = Some((key, heard));
        }
        let Some((_, heard)) = &self.heard else {
            return f64::NEG_INFINITY;
        };
        self.hypothesis.beside(&strengths, heard)
    }

    fn is_free(&self, i: usize) -> bool {
        let h = self.hypothesis;
        let has_moves = !h.moves.is_empty();
        match i {
            0 => h.process[0].n > 0,
            1 => h.has_rate && h.process[1].n > 0,
            2 => h.process[2].n > 0,
            3 => h.has_rate && h.process[3].n > 0,
            4 | 5 => has_moves && self.x[i - 2] > LEAST_SCATTER.ln(),
            _ => has_moves,
        }
    }

    fn run(&mut self) {
        let mut step = [FIRST_STEP; N_STRENGTHS];
        for _ in 0..MOST_PASSES {
            let before = self.value;
            for i in 0..N_STRENGTHS {
                if self.is_free(i) {
                    self.along(i, &mut step[i]);
                }
            }
            if self.value - before < ENOUGH {
                break;
            }
        }
    }

    fn tried(&mut self, i: usize, value: f64) -> f64 {
        let mut x = self.x;
        x[i] = value;
        self.at(&x)
    }

    /// A step either way, doubled while it gains; then where a parabola is highest.
    fn along(&mut self, i: usize, step: &mut f64) {
        let (low, high) = self.bounds[i];
        let nothing = if i < 4 { LEAST_SCATTER.ln() } else { LAST_STEP };
        if matches!(i, 2 | 3 | 6 | 7) && self.x[i] < nothing {
            for value in FROM_NOTHING {
                if value.ln() > low && value.ln() < high {
                    self.take(i, value.ln());
                }
            }
            if self.x[i] < LEAST_SCATTER.ln() {
                *step *= 0.5;
                return;
            }
        }
        let here = self.x[i];
        let (down, up) = ((here - *step).max(low), (here + *step).min(high));
        let (below, above) = (
            if down < here { self.tried(i, down) } else { f64::NEG_INFINITY },
            if up > here { self.tried(i, up) } else { f64::NEG_INFINITY },
        );
        if below.max(above) > self.value {
            let sign = if above > below { 1.0 } else { -1.0 };
            let (mut to, mut value) = if above > below { (up, above) } else { (down, below) };
            let mut stride = *step;
            loop {
                stride *= 2.0;
                let next = (to + sign * stride).clamp(low, high);
                if (next - to).abs() < LAST_STEP {
                    break;
                }
                let further = self.tried(i, next);
                if further <= value {
                    break;
                }
                (to, value) = (next, further);
            }
            (self.x[i], self.value) = (to, value);
        } else {
            if down < here && up > here {
                let (a, b) = (here - down, up - here);
                // A parabola through three points.
                let (p, q) = ((below - self.value) / a, (above - self.value) / b);
                let bend = (p + q) / (a + b);
                if bend < 0.0 && bend.is_finite() {
                    let slope = (q * a - p * b) / (a + b);
                    let to = (here - slope / (2.0 * bend)).clamp(down, up);
                    if (to - here).abs() > 0.02 {
                        self.take(i, to);
                    }
                }
            }
            *step = (*step * 0.5).max(LAST_STEP);
        }
    }

    fn take(&mut self, i: usize, value: f64) {
        let found = self.tried(i, value);
        if found > self.value {
            (self.x[i], self.value) = (value, found);
        }
    }
}

fn strengths_of(x: &[f64; N_STRENGTHS]) -> Strengths {
    let e = x.map(f64::exp);
    Strengths {
        corner_s: [e[0], e[1]],
        scatter: [e[2].max(NO_SCATTER), e[3].max(NO_SCATTER)],
        between: [e[4], e[5]],
        excess: [e[6], e[7]],
    }
}
