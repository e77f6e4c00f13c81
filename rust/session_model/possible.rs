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
/// Where flicker inside poses lets expect a scatter: that it stops there all the same, and how well its size is known
/// (logarithm); one half of the rest lies around it, the other is as where nothing is expected.
const NONE_ALL_THE_SAME: f64 = 0.1;
const EXPECTED_TO: f64 = 0.4;
const POSSIBLE_CORNER_S: [f64; 4] = [20.0, 80.0, 320.0, 2560.0];
/// Around strengths that the fit itself has beyond these grids.
const AROUND: [f64; 3] = [0.4, 1.0, 2.5];
/// Possibilities less likely than this beside the best change no error bar.
const LEAST_WEIGHT: f64 = 1e-2;

/// One way the accelerometer's zeros may scatter: how likely, the step that the fit would make, its normal equations.
pub(super) struct Possible {
    pub weight: f64,
    pub step: DVector<f64>,
    pub factor: Factor,
}

/// Scatters and the logarithm of how likely each is beforehand (11.12b, 11.12d).
fn scatters_beforehand(expected: f64) -> Vec<(f64, f64)> {
    let n_some = POSSIBLE_SCATTER.len() as f64;
    if expected < POSSIBLE_SCATTER[0] {
        let some = POSSIBLE_SCATTER.map(|scatter| (scatter, -n_some.ln()));
        return std::iter::once((NO_SCATTER, 0.0)).chain(some).collect();
    }
    let near = POSSIBLE_SCATTER.map(|s| (-0.5 * ((s / expected).ln() / EXPECTED_TO).powi(2)).exp());
    let total: f64 = near.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let some = POSSIBLE_SCATTER.iter().zip(near).map(|(&scatter, near)| {
        let part = 0.5 * (near / total + 1.0 / n_some);
        (scatter, ((1.0 - NONE_ALL_THE_SAME) * part).ln())
    });
    std::iter::once((NO_SCATTER, NONE_ALL_THE_SAME.ln()))
        .chain(some)
        .collect()
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
    let mut tried = Vec::new();
    let mut scatters = scatters_beforehand(session.expected_scatter);
    let (scatter, corner) = (fit.strengths.scatter[0], fit.strengths.corner_s[0]);
    let unlikely = -(POSSIBLE_SCATTER.len() as f64).ln();
    if scatter > POSSIBLE_SCATTER[POSSIBLE_SCATTER.len() - 1] {
        scatters.extend(AROUND.map(|part| (part * scatter, unlikely)));
    }
    let mut corners = POSSIBLE_CORNER_S.to_vec();
    if corner < POSSIBLE_CORNER_S[0] {
        corners = AROUND.map(|part| part * corner).to_vec();
    }
    for (which, (scatter, prior)) in scatters.iter().enumerate() {
        for corner in &corners {
            let mut at = fit.strengths;
            at.scatter = [*scatter, fit.likely_scatter[1]];
            at.corner_s[0] = *corner;
            tried.push((*prior, which, at));
        }
    }
    let tried: Vec<_> = tried
        .into_par_iter()
        .map(|(prior, which, at)| (evidence.at(&at) + prior, which, at))
        .collect();
    let best = tried
        .iter()
        .map(|(v, ..)| *v)
        .fold(f64::NEG_INFINITY, f64::max);
    let likely: Vec<_> = tried
        .into_iter()
        .map(|(value, which, at)| (value - best, which, at))
        .filter(|(value, ..)| *value >= LEAST_WEIGHT.ln())
        .collect();
    // Rows of the moves know the scatter, not the corner time.
    let moves = (0..scatters.len())
        .into_par_iter()
        .map(|which| {
            let first = likely.iter().find(|one| one.1 == which);
            first.map(|(_, _, at)| reweighed(fit, at)).transpose()
        })
        .collect::<Result<Vec<_>>>()?;
    let heard: Vec<_> = likely
        .par_iter()
        .filter_map(|(value, which, at)| {
            let (rows, weight) = moves[*which].as_ref()?;
            let by_moves = evidence.with(at, rows) + weight - evidence.at(at);
            Some((*value, by_moves, rows, at))
        })
        .collect();
    let without = |corner: f64| {
        heard
            .iter()
            .filter(|(_, _, _, at)| at.scatter[0] <= NO_SCATTER)
            .find(|(_, _, _, at)| at.corner_s[0].total_cmp(&corner).is_eq())
            .map(|(_, by_moves, _, _)| *by_moves)
    };
    let mut out = heard
        .par_iter()
        .map(|(value, by_moves, rows, at)| {
            // Moves that a scatter would bend, and that are not bent, speak against it; those that are bent may be so
            // by anything, and do not speak for it.
            let against = without(at.corner_s[0]).map_or(0.0, |none| (by_moves - none).min(0.0));
            ((value + against).exp(), rows, at)
        })
        .filter(|(weight, ..)| *weight >= LEAST_WEIGHT)
        .map(|(weight, rows, at)| {
            let (chain, side) = evidence.combined(at, rows);
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
