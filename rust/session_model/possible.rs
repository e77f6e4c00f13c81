//! Uncertainty over all ways in which biases may scatter and walk, and the accelerometer's axes be nonlinear, not only
//! the most likely one (docs/model-session.md, 11.12b, 11.12c).

use nalgebra::{Cholesky, DMatrix};
use rayon::prelude::*;

use super::factor::Factor;
use super::fit::{Fit, RIDGE};
use super::hypothesis::Hypothesis;
use super::possible_rate::rate_tried;
use super::strength_search::NO_SCATTER;
use super::{Distortion, Session, Strengths};
use crate::error::{Error, Result};
use crate::nonlinearity::{self, Beside, COLLECTED, N_COEFFICIENTS};

/// Scatters that the uncertainty allows for, in units of the reference, together as likely a priori as none, and corner
/// times of the walk beside them, s; and factors on the most likely value of either.
pub(super) const SCATTERS: [f64; 8] = [0.35, 0.55, 0.85, 1.3, 2.0, 3.2, 5.0, 10.0];
pub(super) const CORNERS_S: [f64; 4] = [20.0, 80.0, 320.0, 2560.0];
pub(super) const AROUND: [f64; 3] = [0.4, 1.0, 2.5];
/// Where flicker inside poses predicts a scatter: prior probability of none, and standard deviation of its logarithm;
/// one half of the rest lies around it, the other half is as without flicker.
const NONE_ALL_THE_SAME: f64 = 0.1;
const EXPECTED_TO: f64 = 0.4;
/// Weight relative to the best below which a possibility does not change the uncertainty.
const LEAST_WEIGHT: f64 = 1e-2;

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

impl Fit {
    /// Covariance of parameters that are linear in the unknowns by `map` `(unknowns, parameters)`, over possible
    /// scatters and walks of the biases, and nonlinear axes beside each, weighted by their evidence (11.12b, 11.12c).
    ///
    /// Some twenty lengths of gravity less nine unknowns detect a scatter as large as their noise in half of all
    /// sessions only: an uncertainty from the most likely scatter alone is too small there.
    ///
    /// # Errors
    /// When a possible scatter of the biases leaves the session undetermined.
    pub(super) fn possible_covariance(
        &self,
        session: &Session,
        map: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>> {
        if session.scatter.is_none() {
            return Ok(self.factor.inner(map));
        }
        let bends = session.nonlinear_axes(self)?;
        let hypothesis = Hypothesis::of(self, &bends, &[COLLECTED; N_COEFFICIENTS])?;
        // Nonlinear axes of the accelerometer say nothing of the gyro's bias.
        let without = Hypothesis::of(self, &[], &[])?;
        let (force, rate) = rayon::join(
            || force_tried(self, session, &hypothesis),
            || rate_tried(&self.strengths, &without),
        );
        let both = force.iter().flat_map(|(value, of_force)| {
            rate.iter().map(move |(beside, of_rate)| {
                let mut at = *of_force;
                at.corner_s[1] = of_rate.corner_s[1];
                at.between[1] = of_rate.between[1];
                at.scatter[1..].copy_from_slice(&of_rate.scatter[1..]);
                (value + beside, at)
            })
        });
        let tried: Vec<_> = both.collect();
        let values = tried.iter().map(|(value, _)| *value);
        let best = values.fold(f64::NEG_INFINITY, f64::max);
        let likely = tried
            .into_par_iter()
            .filter(|(value, _)| *value - best >= LEAST_WEIGHT.ln());
        let found = likely
            .map(|(value, at)| {
                let (chain, side) = hypothesis.system(&at)?;
                let found = beside_bends(&chain.factor(RIDGE, None)?, map, &side)?;
                Ok((value + found.0, found.1))
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(nonlinearity::by_evidence(&found))
    }
}

impl Session {
    /// Columns of nonlinear axes, whitened as the rows of a fit are (11.7, 11.12c).
    fn nonlinear_axes(&self, fit: &Fit) -> Result<Vec<DMatrix<f64>>> {
        let at_rest = fit.state.up.iter().copied();
        let moving = fit.passed.iter().flat_map(|one| &one.carried.force);
        let force = at_rest
            .chain(moving.map(|f| f / self.gravity))
            .flat_map(|x| {
                let columns = nonlinearity::columns(&x) * self.gravity;
                columns.transpose().as_slice().to_vec()
            });
        let distortion = Distortion {
            force: Some(force.collect()),
            k: N_COEFFICIENTS,
            ..Distortion::default()
        };
        self.columns(
            &fit.state,
            &fit.groups,
            &fit.weights,
            &fit.passed,
            &distortion,
        )
    }
}

/// Log-evidence of possible scatters and walks of the accelerometer's bias, nonlinear axes free.
fn force_tried(fit: &Fit, session: &Session, hypothesis: &Hypothesis) -> Vec<(f64, Strengths)> {
    let unlikely = -(SCATTERS.len() as f64).ln();
    let mut scatters = scatters_beforehand(session.expected_scatter);
    if fit.strengths.scatter[0] > SCATTERS[SCATTERS.len() - 1] {
        scatters.extend(AROUND.map(|part| (part * fit.strengths.scatter[0], unlikely)));
    }
    let mut corners = CORNERS_S.to_vec();
    if fit.strengths.corner_s[0] < CORNERS_S[0] {
        corners.extend(AROUND.map(|part| part * fit.strengths.corner_s[0]));
    }
    let mut out = Vec::new();
    for (&(scatter, prior), values) in
        scatters
            .iter()
            .zip(hypothesis.by_scatter(&fit.strengths, 0, &scatters, &corners))
    {
        for (&corner, value) in corners.iter().zip(values) {
            let mut at = fit.strengths;
            (at.scatter[0], at.corner_s[0]) = (scatter, corner);
            out.push((value + prior, at));
        }
    }
    out
}

/// Gain in log-evidence by nonlinear axes of unknown strength in place of free ones, the last unknowns of the border,
/// and the second moment of the errors of parameters `map` about those of the fit.
fn beside_bends(
    factor: &Factor,
    map: &DMatrix<f64>,
    gradient: &DMatrix<f64>,
) -> Result<(f64, DMatrix<f64>)> {
    let (n, k, border) = (map.ncols(), N_COEFFICIENTS, factor.layout.border);
    let mut side = DMatrix::zeros(gradient.nrows(), n + k + 1);
    let (before, after) = (border - k, gradient.nrows() - border);
    side.view_mut((0, 0), (before, n))
        .copy_from(&map.rows(0, before));
    side.view_mut((border, 0), (after, n))
        .copy_from(&map.rows(before, after));
    side.view_mut((before, n), (k, k)).fill_with_identity();
    side.column_mut(n + k).copy_from(&gradient.column(0));
    let found = factor.inner(&side);
    let estimate = -found.view((n, n + k), (k, 1)).column(0);
    let half = Cholesky::new(found.view((n, n), (k, k)).into_owned())
        .ok_or_else(|| Error::not_determined("a nonlinearity is not finite"))?;
    let with_prior = half.inverse();
    let slope = &with_prior * &estimate;
    let weight = COLLECTED.powi(-2);
    let shift = found.view((0, n), (n, k)) * &with_prior;
    let log_det: f64 = half
        .l_dirty()
        .diagonal()
        .map(|d| (d / COLLECTED).ln())
        .sum();
    let of_free = 0.5 * slope.dot(&estimate) + log_det;
    let covariance = found.view((0, 0), (n, n)) - &shift * found.view((n, 0), (k, n));
    let step = -found.view((0, n + k), (n, 1)) - &shift * &estimate;
    let beside = Beside {
        information: with_prior - DMatrix::identity(k, k) * weight,
        slope,
        shift,
    };
    let bends = beside.marginal()?;
    let cross = &step * bends.mean.transpose();
    let second = covariance + &step * step.transpose() + &cross + cross.transpose() + bends.second;
    Ok((bends.gain - of_free, second))
}
