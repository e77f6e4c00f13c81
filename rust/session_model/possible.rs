//! Uncertainty over all ways in which the accelerometer's bias may scatter and walk, not only the most likely one
//! (docs/model-session.md, 11.12b).

use nalgebra::DVector;
use rayon::prelude::*;

use super::factor::Factor;
use super::fit::{Fit, RIDGE};
use super::hypothesis::Hypothesis;
use super::strength_search::NO_SCATTER;
use super::{Session, Strengths};
use crate::error::Result;

/// Scatters that the uncertainty allows for, in units of the reference, together as likely a priori as none, and corner
/// times of the walk beside them, s; and factors on the most likely value of either.
const SCATTERS: [f64; 8] = [0.35, 0.55, 0.85, 1.3, 2.0, 3.2, 5.0, 10.0];
const CORNERS_S: [f64; 4] = [20.0, 80.0, 320.0, 2560.0];
const AROUND: [f64; 3] = [0.4, 1.0, 2.5];
/// Where flicker inside poses predicts a scatter: prior probability of none, and standard deviation of its logarithm;
/// one half of the rest lies around it, the other half is as without flicker.
const NONE_ALL_THE_SAME: f64 = 0.1;
const EXPECTED_TO: f64 = 0.4;
/// Weight relative to the best below which a possibility does not change the uncertainty.
const LEAST_WEIGHT: f64 = 1e-2;

/// One possible scatter of the bias: its weight, the step that the fit would make, its normal equations.
pub(super) struct Possible {
    pub weight: f64,
    pub step: DVector<f64>,
    pub factor: Factor,
}

/// Scatters and the logarithm of their prior probabilities (11.12b, 11.12d).
fn scatters_beforehand(expected: f64) -> Vec<(f64, f64)> {
    let n_some = SCATTERS.len() as f64;
    if expected < SCATTERS[0] {
        let some = SCATTERS.map(|scatter| (scatter, -n_some.ln()));
        return std::iter::once((NO_SCATTER, 0.0)).chain(some).collect();
    }
    let near = SCATTERS.map(|s| (-0.5 * ((s / expected).ln() / EXPECTED_TO).powi(2)).exp());
    let total: f64 = near.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let some = SCATTERS.iter().zip(near).map(|(&scatter, near)| {
        let part = 0.5 * (near / total + 1.0 / n_some);
        (scatter, ((1.0 - NONE_ALL_THE_SAME) * part).ln())
    });
    std::iter::once((NO_SCATTER, NONE_ALL_THE_SAME.ln()))
        .chain(some)
        .collect()
}

/// Possible scatters and walks of the accelerometer's bias, weighted by their evidence (11.12b); empty where the model
/// has no scatter.
///
/// Some twenty lengths of gravity less nine unknowns detect a scatter as large as their noise in half of all sessions
/// only: an uncertainty from the most likely scatter alone is too small there.
pub(super) fn possible_scatters(fit: &Fit, session: &Session) -> Result<Vec<Possible>> {
    if session.scatter.is_none() {
        return Ok(Vec::new());
    }
    let hypothesis = Hypothesis::of(fit, &[], &[])?;
    let unlikely = -(SCATTERS.len() as f64).ln();
    let mut scatters = scatters_beforehand(session.expected_scatter);
    if fit.strengths.scatter[0] > SCATTERS[SCATTERS.len() - 1] {
        scatters.extend(AROUND.map(|part| (part * fit.strengths.scatter[0], unlikely)));
    }
    let mut corners = CORNERS_S.to_vec();
    if fit.strengths.corner_s[0] < CORNERS_S[0] {
        corners.extend(AROUND.map(|part| part * fit.strengths.corner_s[0]));
    }
    let tried: Vec<Vec<(f64, Strengths)>> = scatters
        .par_iter()
        .map(|&(scatter, prior)| {
            let mut at = fit.strengths;
            at.scatter[0] = scatter;
            let Some(weighted_rows) = hypothesis.weighted_rows(&at) else {
                return Vec::new();
            };
            let each = corners.iter().map(|corner| {
                at.corner_s[0] = *corner;
                (hypothesis.beside(&at, &weighted_rows) + prior, at)
            });
            each.collect()
        })
        .collect();
    let tried = tried.concat();
    let values = tried.iter().map(|(value, _)| *value);
    let best = values.fold(f64::NEG_INFINITY, f64::max);
    let likely = tried
        .into_par_iter()
        .map(|(value, at)| ((value - best).exp(), at))
        .filter(|(weight, _)| *weight >= LEAST_WEIGHT);
    let mut out = likely
        .map(|(weight, at)| {
            let (chain, side) = hypothesis.system(&at)?;
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
