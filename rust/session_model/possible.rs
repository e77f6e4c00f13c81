//! Error bars over the ways in which zeros may scatter, not over the likeliest alone (docs/model-session.md, 11.12b).

use nalgebra::DVector;
use rayon::prelude::*;

use super::Session;
use super::evidence::Evidence;
use super::factor::Factor;
use super::fit::{Fit, RIDGE};
use super::strengths::{NO_SCATTER, reweighed};
use crate::error::Result;

/// Scatters of the accelerometer's zero that its error bars allow for, in units of the reference, together as likely
/// beforehand as none; and corner times of its walk beside them, s.
const POSSIBLE_SCATTER: [f64; 8] = [0.35, 0.55, 0.85, 1.3, 2.0, 3.2, 5.0, 10.0];
const POSSIBLE_CORNER_S: [f64; 4] = [20.0, 80.0, 320.0, 2560.0];
/// Possibilities less likely than this beside the best change no error bar.
const LEAST_WEIGHT: f64 = 1e-2;

/// One way the accelerometer's zeros may scatter: how likely, the step that the fit would make, its normal equations.
pub(super) struct Possible {
    pub weight: f64,
    pub step: DVector<f64>,
    pub factor: Factor,
}

/// Ways the accelerometer's zeros may scatter and walk, weighed by their evidence (11.12b); nothing where that is not
/// asked, or known.
///
/// Some twenty lengths of gravity less nine unknowns tell a scatter as large as their noise in half of all sessions
/// only: error bars that take the one best answer for true cover too little there.
pub(super) fn possible_scatters(fit: &Fit, session: &Session) -> Result<Vec<Possible>> {
    if session.scatter.is_none() || session.is_scatter_given {
        return Ok(Vec::new());
    }
    let evidence = Evidence::of(fit);
    let n_some = POSSIBLE_SCATTER.len() as f64;
    let mut tried = Vec::new();
    let some = POSSIBLE_SCATTER.map(|scatter| (scatter, -n_some.ln()));
    for (scatter, prior) in std::iter::once((NO_SCATTER, 0.0)).chain(some) {
        for corner in POSSIBLE_CORNER_S {
            let mut at = fit.strengths;
            at.scatter = [scatter, fit.likely_scatter[1]];
            at.corner_s[0] = corner;
            tried.push((prior, at));
        }
    }
    let tried: Vec<_> = tried
        .into_par_iter()
        .map(|(prior, at)| (evidence.at(&at) + prior, at))
        .collect();
    let best = tried
        .iter()
        .map(|(v, _)| *v)
        .fold(f64::NEG_INFINITY, f64::max);
    let heard = tried
        .into_par_iter()
        .map(|(value, at)| (value - best, at))
        .filter(|(value, _)| *value >= LEAST_WEIGHT.ln())
        .map(|(value, at)| {
            let (moves, weight) = reweighed(fit, &at)?;
            let by_moves = evidence.with(&at, &moves) + weight - evidence.at(&at);
            Ok((value, by_moves, at, moves))
        })
        .collect::<Result<Vec<_>>>()?;
    let without = |corner: f64| {
        let none = heard
            .iter()
            .filter(|(_, _, at, _)| at.scatter[0] <= NO_SCATTER);
        none.filter(|(_, _, at, _)| at.corner_s[0].total_cmp(&corner).is_eq())
            .map(|(_, by_moves, _, _)| *by_moves)
            .next()
    };
    let mut out = heard
        .par_iter()
        .map(|(value, by_moves, at, moves)| {
            // Moves that a scatter would bend, and that are not bent, speak against it; those that are bent may be so
            // by anything, and do not speak for it.
            let against = without(at.corner_s[0]).map_or(0.0, |none| (by_moves - none).min(0.0));
            ((value + against).exp(), at, moves)
        })
        .filter(|(weight, _, _)| *weight >= LEAST_WEIGHT)
        .map(|(weight, at, moves)| {
            let (chain, side) = evidence.combined(at, moves);
            let factor = chain.factor(RIDGE, None)?;
            let step = -factor.solve(&side).column(0).into_owned();
            Ok(Possible {
                weight,
                step,
                factor,
            })
        })
        .collect::<Result<Vec<_>>>()?;
    let total: f64 = out.iter().map(|one| one.weight).sum();
    for one in &mut out {
        one.weight /= total;
    }
    Ok(out)
}
