//! Strengths of the processes behind the zeros, by marginal likelihood (docs/model-session.md, 11.12).

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::chain::Chain;
use super::evidence::{Evidence, Part};
use super::fit::{Fit, chi2_of, fit, fit_from, gradient};
use super::move_rows::{Weights, Whitening};
use super::moves::N_MOVE;
use super::rows::Domain;
use super::{Distortion, Session, State, Strengths};
use crate::error::Result;

/// Corner times tried, s. A bias that walks faster than the first is drift.
pub const CORNER_GRID_S: [f64; 7] = [20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 2560.0];
/// Scatter that counts as none, in units of the session's reference.
pub const NO_SCATTER: f64 = 1e-3;
/// Scatters tried beyond none: a factor of 1.5 apart, up to a thousand times the reference.
const N_SCATTER: i32 = 26;
/// Every so many of them are tried first, then the neighbours of the best.
const COARSE: i32 = 4;
const SCATTER_FROM: f64 = 0.05;
const SCATTER_RATIO: f64 = 1.5;
/// Scatter below the usual standard error of a pose is left out of the answer, as `diagnose` does not name it (flicker
/// makes zeros differ by as much); error bars allow for it.
const LEAST_SCATTER: f64 = 1.0;
/// Twice the gain in log-likelihood that makes a scatter count: 5.41 is passed in 1 % of sessions without any (half of
/// χ² with one degree of freedom, the variance being at its boundary).
const SCATTER_GATE: f64 = 5.41;

/// How far a zero leaves the line between its poses, tried in units of its scatter: a leap at an instant that may be any
/// is √(1/12) of a leap of √2 (0.4), a leap at either end of the move √2/2 (0.7), a third zero √(3/2) (1.2).
const BETWEEN: [f64; 8] = [0.15, 0.3, 0.42, 0.6, 0.85, 1.2, 1.7, 2.4];
/// Rows of moves count this much less while strengths of walk and scatter are chosen.
pub(super) const DEAF: f64 = 1e-3;

/// Fits a session with the strengths of its processes chosen by marginal likelihood (11.12).
///
/// Only rows of the processes depend on a strength, each in proportion: the evidence of every strength follows from the
/// rows already made, in time linear in the poses. Walk and scatter are what the poses show: moves that contradict them
/// would otherwise be explained as scatter, and the poses then be believed less. How far a zero that scatters strays
/// between its poses is what the moves show.
///
/// # Errors
/// As [`fit`].
pub fn tune(
    session: &Session,
    start: State,
    strengths: Strengths,
    distortion: &Distortion,
) -> Result<Fit> {
    let mut found = fit(session, start, strengths, distortion)?;
    let evidence = Evidence::of(&found);
    let likely = evidence.search(session);
    let best = evidence.without_small_scatter(&likely, session);
    if best != found.strengths {
        found = fit_from(session, found.state, Some(found.passed), best, distortion)?;
    }
    found.likely_scatter = likely.scatter;
    if session.scatter.is_none() || best.scatter == [NO_SCATTER; 2] || session.moves.is_empty() {
        return Ok(found);
    }
    let between = Evidence::of(&found).search_between(&found);
    let best = Strengths {
        between,
        ..found.strengths
    };
    if best == found.strengths {
        return Ok(found);
    }
    let likely_scatter = found.likely_scatter;
    let found = fit_from(session, found.state, Some(found.passed), best, distortion)?;
    Ok(Fit {
        likely_scatter,
        ..found
    })
}

impl Evidence {
    /// One process after the other until none moves.
    fn search(&self, session: &Session) -> Strengths {
        let has_rate = session.rate.is_some();
        let mut best = self.at;
        let is_free = session.scatter.is_some() && !session.is_scatter_given;
        if is_free {
            best.scatter = [NO_SCATTER; 2];
        }
        self.search_corners(&mut best, has_rate);
        if !is_free {
            // A scatter that was named is known beside what the model held then: another effect may leave less of it.
            for sensor in (0..2).filter(|&sensor| self.at.scatter[sensor] > NO_SCATTER) {
                for _ in 0..2 {
                    self.search_scatter(&mut best, sensor);
                    self.search_corners(&mut best, has_rate);
                }
            }
            return best;
        }
        let none = self.at(&best);
        for sensor in 0..if has_rate { 2 } else { 1 } {
            let mut tried = best;
            for _ in 0..2 {
                self.search_scatter(&mut tried, sensor);
                self.search_corners(&mut tried, has_rate);
            }
            let base = if best.scatter == [NO_SCATTER; 2] {
                none
            } else {
                self.at(&best)
            };
            if 2.0 * (self.at(&tried) - base) > SCATTER_GATE {
                best = tried;
            }
        }
        best
    }

    /// The same strengths without scatter that is smaller than the errors of the poses.
    fn without_small_scatter(&self, likely: &Strengths, session: &Session) -> Strengths {
        let mut best = *likely;
        if session.scatter.is_none() || session.is_scatter_given {
            return best;
        }
        for scatter in &mut best.scatter {
            if *scatter < LEAST_SCATTER {
                *scatter = NO_SCATTER;
            }
        }
        if best != *likely {
            self.search_corners(&mut best, session.rate.is_some());
        }
        best
    }

    fn search_corners(&self, best: &mut Strengths, has_rate: bool) {
        // One sensor after the other, and the first again: their walks hardly meet in a row.
        for sensor in [0, 1, 0] {
            if sensor == 1 && !has_rate {
                continue;
            }
            let values = best_of(&CORNER_GRID_S, |corner| {
                let mut tried = *best;
                tried.corner_s[sensor] = corner;
                self.at(&tried)
            });
            if let Some(corner) = values {
                best.corner_s[sensor] = corner;
            }
        }
    }

    /// A coarse pass over the grid, then the neighbours of the best.
    fn search_scatter(&self, best: &mut Strengths, sensor: usize) {
        let value = |k: i32| {
            let mut tried = *best;
            tried.scatter[sensor] = SCATTER_FROM * SCATTER_RATIO.powi(k);
            self.at(&tried)
        };
        let all: Vec<i32> = (0..=N_SCATTER / COARSE).map(|k| k * COARSE).collect();
        let coarse = best_of(&all, value).unwrap_or(0);
        let reach = COARSE - 1;
        let near: Vec<i32> =
            ((coarse - reach).max(0)..(coarse + reach + 1).min(N_SCATTER)).collect();
        let fine = best_of(&near, value).unwrap_or(0);
        let shift = peak([fine - 1, fine, fine + 1].map(value));
        best.scatter[sensor] = SCATTER_FROM * SCATTER_RATIO.powf(f64::from(fine) + shift);
    }

    /// How far zeros that scatter leave the line between their poses, from the rows of the moves weighed anew.
    fn search_between(&self, fit: &Fit) -> [f64; 2] {
        let mut best = fit.strengths;
        for sensor in [1, 0, 1] {
            if best.scatter[sensor] <= NO_SCATTER {
                continue;
            }
            let values = best_of(&BETWEEN, |between| {
                let mut tried = best;
                tried.between[sensor] = between;
                reweighed(fit, &tried).map_or(f64::NEG_INFINITY, |(moves, weight)| {
                    self.with(&tried, &moves) + weight
                })
            });
            if let Some(between) = values {
                best.between[sensor] = between;
            }
        }
        best.between
    }
}

/// The candidate of the greatest value, the last of equal ones: candidates are tried side by side.
fn best_of<T: Copy + Send + Sync>(candidates: &[T], value: impl Fn(T) -> f64 + Sync) -> Option<T> {
    let values: Vec<f64> = candidates.par_iter().map(|&one| value(one)).collect();
    let best = candidates.iter().zip(values);
    best.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(one, _)| *one)
}

/// Where a parabola through three values at -1, 0, 1 is highest, within half a step.
fn peak([before, here, after]: [f64; 3]) -> f64 {
    let bend = before - 2.0 * here + after;
    if bend < 0.0 && bend.is_finite() {
        (0.5 * (before - after) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

/// The rows of the moves at other strengths, and the logarithm of their normalisation.
pub(super) fn reweighed(fit: &Fit, strengths: &Strengths) -> Result<(Part, f64)> {
    let layout = fit.layout();
    let weights = Weights::of(&fit.passed, strengths)?;
    let mut weight = 0.0;
    let mut groups = Vec::with_capacity(fit.passed.len());
    for group in &fit.groups {
        if group.domain != Domain::Moves || group.rows.len() != N_MOVE {
            continue;
        }
        let new: &Whitening = &weights.white[group.segment];
        weight += new.diagonal().map(f64::ln).sum();
        let Some(back) = fit.weights.white[group.segment].try_inverse() else {
            continue;
        };
        let again = DMatrix::from_column_slice(N_MOVE, N_MOVE, (new * back).as_slice());
        let mut group = group.clone();
        group.rows.residual = &again * &group.rows.residual;
        group.rows.border = &again * &group.rows.border;
        group.rows.here = &again * &group.rows.here;
        group.rows.next = &again * &group.rows.next;
        groups.push(group);
    }
    let part = Part {
        chain: Chain::of(layout, groups.iter().map(|group| &group.rows)),
        side: gradient(layout, &groups),
        sum: chi2_of(&groups),
        n: N_MOVE * groups.len(),
    };
    Ok((part, weight))
}
