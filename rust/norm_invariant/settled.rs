//! The solver for one set of σ, and the uncertainty of its result.

use std::cell::RefCell;

use nalgebra::{DMatrix, DVector, SMatrix};

use super::descent::{Direct, Equations};
use super::lanes::{LANES, ZERO};
use super::parameters::{map_to_entries, unpack, unpack_standardised};
use super::problem::{self, PoseProblem};
use super::sums::{At, SHARE, by_share};
use super::{Fit, Model, N_PARAMETERS, Parameters, ROWS_KEPT};
use crate::ellipsoid::Standardisation;
use crate::error::{Error, Result};
use crate::gauss_newton::{self, Certainty, Options, Stop};

pub(super) fn direct<'a>(problem: &'a PoseProblem<'_>, theta: &Parameters) -> Direct<'a> {
    Direct {
        with_noise: problem.with_noise(),
        at: At {
            model: unpack_standardised(theta.as_slice(), problem.settings.frame),
            standard: problem.standard,
            settings: *problem.settings,
            widening: problem.fixed.widening,
        },
        volume: problem.volume,
        tried: RefCell::new(None),
    }
}

/// Result of the solver for one set of σ.
pub(super) struct Settled {
    pub theta: Parameters,
    pub stop: Stop,
    pub iterations: usize,
    pub found: Found,
}

/// Source of the solution's covariance.
pub(super) enum Found {
    /// Normal equations.
    Direct(Box<Equations>),
    /// Rows, or normal equations too weak to be solved as they are.
    Dense(Certainty),
}

pub(super) fn settle(problem: &PoseProblem<'_>, theta: &Parameters) -> Result<Settled> {
    let options = Options::default();
    let direct = direct(problem, theta);
    let has_anchor = problem.anchor.is_some();
    if !has_anchor && let Ok(ended) = gauss_newton::descend(&direct, *theta, &options) {
        return Ok(Settled {
            theta: ended.point,
            stop: ended.stop,
            iterations: ended.iterations,
            found: Found::Direct(Box::new(ended.local)),
        });
    }
    let start = DVector::from_column_slice(theta.as_slice());
    let solution = if problem.readings.values.len() > ROWS_KEPT && !has_anchor {
        gauss_newton::minimise_problem(&direct, start, &options)?
    } else {
        gauss_newton::minimise(
            |x| Ok(problem.linearise(x)),
            |x| Ok(problem.residuals(x)),
            start,
            &options,
        )?
    };
    Ok(Settled {
        theta: Parameters::from_column_slice(solution.parameters.as_slice()),
        stop: solution.stop,
        iterations: solution.iterations,
        found: Found::Dense(solution.certainty),
    })
}

/// Spread of the specific forces in |g| (half a degree) below which all poses are one, or `S` has collapsed.
pub(super) const SMALLEST_SPREAD: f64 = 1e-2;

/// The minimum S = 0, |b| = |g|, which any readings have.
pub(super) const WORTHLESS: &str = "the poses do not determine the scales: they are too few, hardly differ, or are not still; \
                         hold the sensor still in nine or more clearly different orientations";

/// Root mean square size of `S (a' - mean)`, m/s².
pub(super) fn spread(model: &Model, standard: &Standardisation) -> f64 {
    (model.s * standard.size).norm() / 3.0_f64.sqrt()
}

pub(super) fn finish(
    problem: &PoseProblem<'_>,
    settled: &Settled,
    iterations: usize,
) -> Result<Fit> {
    let settings = problem.settings;
    let held = match &settled.found {
        Found::Direct(equations) => equations.certainty(),
        Found::Dense(certainty) => certainty.clone(),
    };
    // Noise in a reading enters residual and derivative alike: it biases S towards zero, by (σ/g)² of itself.
    let pull = problem.noise_in_gradient(settled.theta.as_slice());
    let theta = settled.theta + fixed(&held.covariance) * pull;
    let certainty = match problem.anchor {
        None => held,
        Some(_) => gauss_newton::certainty(
            &problem.data_jacobian(&DVector::from_column_slice(settled.theta.as_slice())),
            Options::default().rank_tolerance,
        ),
    };
    let model = unpack(&theta, settings.frame, &problem.standard);
    let shrink = (model.s * problem.standard.size).determinant().abs() / problem.volume;
    if shrink < 2.0 * problem::SMALLEST_VOLUME
        || spread(&model, &problem.standard) < SMALLEST_SPREAD * settings.gravity
    {
        return Err(Error::not_determined(WORTHLESS));
    }
    let map = map_to_entries(settings.frame, &problem.standard);
    let covariance = map * fixed(&certainty.covariance) * map.transpose();
    let residuals = problem.in_m_s2(&model);
    let sigmas = &problem.fixed.sigma;
    let chi2 = sum_of_squares(&residuals, sigmas);
    Ok(Fit {
        model,
        covariance,
        chi2,
        residuals,
        sigmas: Vec::new(),
        certainty,
        is_anchored: problem.anchor.is_some(),
        stop: settled.stop,
        iterations,
    })
}

/// `Σ (r/σ)²`, eight at a time: a single sum would depend on its last addition at every reading.
fn sum_of_squares(residuals: &[f64], sigmas: &[f64]) -> f64 {
    let share = |k: usize| {
        let range = k * SHARE..((k + 1) * SHARE).min(residuals.len());
        let (r, r_rest) = residuals[range.clone()].as_chunks::<LANES>();
        let (s, s_rest) = sigmas[range].as_chunks::<LANES>();
        let mut sums = ZERO;
        for (r, s) in r.iter().zip(s) {
            for l in 0..LANES {
                sums[l] += (r[l] / s[l]).powi(2);
            }
        }
        let rest = r_rest.iter().zip(s_rest).map(|(r, s)| (r / s).powi(2));
        sums.iter().sum::<f64>() + rest.sum::<f64>()
    };
    by_share(residuals.len(), share, |a, b| a + b).unwrap_or(0.0)
}

/// The same matrix on the stack.
fn fixed(square: &DMatrix<f64>) -> SMatrix<f64, N_PARAMETERS, N_PARAMETERS> {
    SMatrix::from_column_slice(square.as_slice())
}
