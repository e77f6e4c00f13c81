//! The fit itself: a start, steps with σ frozen, σ renewed, and what is known of the answer.

use std::cell::RefCell;

use nalgebra::{DMatrix, DVector, SMatrix, Vector3};

use super::descent::{Direct, Equations};
use super::lanes::{LANES, ZERO};
use super::near::Near;
use super::parameters::{in_frame, map_to_entries, pack, unpack, unpack_standardised};
use super::problem::{self, Frozen, PoseProblem};
use super::start::{self, Starts};
use super::sums::{At, SHARE, by_share};
use super::{Fit, Model, N_PARAMETERS, Parameters, ROWS_KEPT, Readings, Settings};
use crate::ellipsoid::Standardisation;
use crate::error::{Error, Result};
use crate::gauss_newton::{self, Certainty, Loss, Options, Stop};

/// Times that σ is renewed at most; it depends on the answer only through directions and settles in two.
const RENEWALS: usize = 8;

/// Fits from an ellipsoid start, or from `start`.
///
/// Poses that leave a parameter unknown to 2 % of |g| (six faces leave three altogether) would let it run away into any
/// accident of the readings: all are then held near a sphere through the readings, and `is_anchored` tells.
///
/// A given start that leads nowhere (no convergence, or a triad a hundred times smaller than the sphere through the
/// readings: the way to `S = 0`) is given up for the ellipsoid.
///
/// # Errors
/// When readings are malformed or all the same, or the fit collapses to `S = 0`.
pub fn fit(readings: Readings<'_>, settings: &Settings, start: Option<Model>) -> Result<Fit> {
    let Some(given) = start else {
        return fit_from(readings, settings, None);
    };
    match fit_from(readings, settings, Some(given)) {
        Ok(found)
            if found.stop.is_converged() && !is_shrunken(&found.model, readings, settings) =>
        {
            Ok(found)
        }
        // A malformed start is a mistake to be told of, not to be worked around.
        Err(error @ Error::BadInput(_)) => Err(error),
        first => fit_from(readings, settings, None).or(first),
    }
}

/// Whether a triad is far smaller than the sphere through the readings.
fn is_shrunken(model: &Model, readings: Readings<'_>, settings: &Settings) -> bool {
    let stride = readings.values.len().div_ceil(ROWS_KEPT);
    let few: Vec<Vector3<f64>> = readings.values.iter().step_by(stride).copied().collect();
    Starts::of(&few)
        .and_then(|starts| starts.sphere(settings))
        .is_ok_and(|sphere| model.s.determinant().abs() < 1e-2 * sphere.s.determinant().abs())
}

pub(super) fn fit_from(
    readings: Readings<'_>,
    settings: &Settings,
    start: Option<Model>,
) -> Result<Fit> {
    readings.check()?;
    if !settings.gravity.is_finite() || settings.gravity <= 0.0 {
        return Err(Error::bad_input(format!(
            "gravity must be a positive number in m/s², got {}",
            settings.gravity
        )));
    }
    let few = start::even_share(readings, ROWS_KEPT);
    // Of very many readings, a share shows nearly the same answer: all are then passed over a few times only.
    let shown = few.fitted(settings);
    let starts = Starts::of(few.values())?;
    let standard = match few {
        start::Share::All(_) => starts.standard,
        start::Share::Some { .. } => Standardisation::of(readings.values)?,
    };
    let nominal = match start.or(shown) {
        Some(model) => in_frame(&model, settings.frame)?,
        None => starts.sphere(settings)?,
    };
    let mut frozen = Frozen::at(readings, settings, &nominal);
    // What a share of the readings determines, all of them do.
    let is_anchored =
        shown.is_none() && problem::is_weak(&frozen.charge(readings), settings, &nominal);
    let begin = if is_anchored || start.is_some() || shown.is_some() {
        nominal
    } else {
        starts.best(settings)?
    };
    if spread(&begin, &standard) < SMALLEST_SPREAD * settings.gravity {
        return Err(Error::not_determined(WORTHLESS));
    }
    let first = pack(&begin, &standard);
    let mut theta = first;
    let volume = (begin.s * standard.size).determinant().abs();
    let anchor = is_anchored.then(|| DVector::from_column_slice(first.as_slice()));
    if shown.is_some() && start.is_none() {
        let near = Near {
            readings,
            settings,
            standard,
            volume,
        };
        if let Some(fit) = near.finished(&mut frozen, theta)? {
            return Ok(fit);
        }
    }
    let mut iterations = 0;
    let mut widening = 1.0;
    for renewal in 0.. {
        let model = unpack(&theta, settings.frame, &standard);
        if renewal > 0 || begin != nominal {
            frozen.renew(readings, settings, &model);
        }
        frozen.widening = widening;
        let problem = PoseProblem {
            readings,
            settings,
            standard,
            frozen: &frozen,
            volume,
            anchor: anchor.clone(),
        };
        let settled = settle(&problem, &theta)?;
        iterations += settled.iterations;
        let change = (settled.theta - theta).norm() / theta.norm();
        theta = settled.theta;
        if is_anchored {
            // Scatter beyond the noise must not buy itself an angle of ten degrees where nothing else contradicts it.
            let spare = readings.values.len().saturating_sub(N_PARAMETERS).max(1);
            let scatter =
                problem.chi2(&DVector::from_column_slice(theta.as_slice())) / spare as f64;
            widening *= scatter.max(widening.powi(-2)).sqrt();
        }
        // σ moves with the parameters at first order only through S: 1e-7 in S is 1e-7 in σ, far below its own error.
        if change < 1e-7 || renewal >= RENEWALS {
            let mut fit = finish(&problem, &settled, iterations)?;
            fit.sigmas = frozen.sigma;
            return Ok(fit);
        }
    }
    unreachable!("the loop returns at its last renewal")
}

pub(super) fn direct<'a>(problem: &'a PoseProblem<'_>, theta: &Parameters) -> Direct<'a> {
    Direct {
        charged: problem.charged(),
        at: At {
            model: unpack_standardised(theta.as_slice(), problem.settings.frame),
            standard: problem.standard,
            settings: *problem.settings,
            widening: problem.frozen.widening,
        },
        volume: problem.volume,
        tried: RefCell::new(None),
    }
}

/// Where the solver ended for one set of σ.
pub(super) struct Settled {
    pub theta: Parameters,
    pub stop: Stop,
    pub iterations: usize,
    pub found: Found,
}

/// What the solution is known by.
pub(super) enum Found {
    /// Normal equations.
    Direct(Box<Equations>),
    /// Rows, or normal equations too weak to be solved as they are.
    Dense(Certainty),
}

fn settle(problem: &PoseProblem<'_>, theta: &Parameters) -> Result<Settled> {
    let settings = problem.settings;
    let options = Options {
        loss: settings.loss,
        ..Options::default()
    };
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

/// Poses whose specific forces differ by less than this fraction of |g|, half a degree, are one pose, or `S` is nothing.
const SMALLEST_SPREAD: f64 = 1e-2;

const WORTHLESS: &str = "the fit runs into the worthless minimum S = 0, |b| = |g|: the poses hardly differ, or are not \
                         still; hold the sensor still in clearly different orientations";

/// Root mean square size of `S (a' - mean)`, m/s².
fn spread(model: &Model, standard: &Standardisation) -> f64 {
    (model.s * standard.size).norm() / 3.0_f64.sqrt()
}

pub(super) fn finish(
    problem: &PoseProblem<'_>,
    settled: &Settled,
    iterations: usize,
) -> Result<Fit> {
    let settings = problem.settings;
    let factor = settings.loss.covariance_factor(1);
    let held = match &settled.found {
        Found::Direct(equations) => equations.certainty(factor),
        Found::Dense(certainty) => certainty.clone(),
    };
    // Noise in a reading enters residual and derivative alike and draws S towards zero, by (σ/g)² of itself.
    let pull = problem.noise_in_gradient(settled.theta.as_slice());
    let theta = settled.theta + fixed(&held.covariance) * pull;
    let certainty = match problem.anchor {
        None => held,
        Some(_) => gauss_newton::certainty(
            &problem.data_jacobian(&DVector::from_column_slice(settled.theta.as_slice())),
            factor,
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
    let sigmas = &problem.frozen.sigma;
    let squares = || residuals.iter().zip(sigmas).map(|(r, s)| (r / s).powi(2));
    let chi2 = sum_of_squares(&residuals, sigmas);
    let (weights, robust_chi2) = if settings.loss == Loss::Linear {
        (Vec::new(), chi2)
    } else {
        let weights: Vec<f64> = squares().map(|z2| settings.loss.weight(z2)).collect();
        let influence: f64 = squares().zip(&weights).map(|(z2, w)| w * w * z2).sum();
        (weights, influence / settings.loss.expected_influence(1))
    };
    Ok(Fit {
        model,
        covariance,
        chi2,
        robust_chi2,
        residuals,
        sigmas: Vec::new(),
        weights,
        certainty,
        is_anchored: problem.anchor.is_some(),
        stop: settled.stop,
        iterations,
    })
}

/// `Σ (r/σ)²`, eight at a time: one sum would wait for itself at every reading.
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

/// The same numbers without a heap.
fn fixed(square: &DMatrix<f64>) -> SMatrix<f64, N_PARAMETERS, N_PARAMETERS> {
    SMatrix::from_column_slice(square.as_slice())
}
