//! The fit: a start, steps with σ fixed, σ renewed, and the uncertainty of the result.

use nalgebra::{DVector, Vector3};

use super::near::Near;
use super::parameters::{in_frame, pack, unpack};
use super::problem::{self, FixedNoise, PoseProblem};
use super::settled::{SMALLEST_SPREAD, WORTHLESS, finish, settle, spread};
use super::start::{self, Share, Starts};
use super::{Fit, Model, N_PARAMETERS, ROWS_KEPT, Readings, Settings};
use crate::ellipsoid::Standardisation;
use crate::error::{Error, Result};

/// Largest number of renewals of σ, which depends on the result only through directions and converges in two.
const RENEWALS: usize = 8;

/// Fits from an ellipsoid start, or from `start`.
///
/// Poses that leave a parameter uncertain by 2 % of |g| (six faces leave three undetermined) would let it follow any
/// error of the readings: all are then kept near a sphere through the readings, and `is_anchored` is set.
///
/// A given start that fails (no convergence, or a triad a hundred times smaller than the sphere through the readings:
/// the path to `S = 0`) is replaced by the ellipsoid.
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
        // A malformed start is an error to report; it is not replaced.
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

fn fit_from(readings: Readings<'_>, settings: &Settings, start: Option<Model>) -> Result<Fit> {
    readings.check()?;
    if !settings.gravity.is_finite() || settings.gravity <= 0.0 {
        return Err(Error::bad_input(format!(
            "gravity must be a positive number in m/s², got {}",
            settings.gravity
        )));
    }
    let few = start::even_share(readings, ROWS_KEPT);
    // A share of very many readings gives nearly the same result: all of them then need a few passes only.
    let shown = of_share(&few, settings);
    let starts = Starts::of(few.values())?;
    let standard = match few {
        Share::All(_) => starts.standard,
        Share::Some { .. } => Standardisation::of(readings.values)?,
    };
    let nominal = match start.or(shown) {
        Some(model) => in_frame(&model, settings.frame)?,
        None => starts.sphere(settings)?,
    };
    let mut fixed = FixedNoise::at(readings, settings, &nominal);
    // What a share of the readings determines, all of them do.
    let is_anchored =
        shown.is_none() && problem::is_weak(&fixed.with_noise(readings), settings, &nominal);
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
        if let Some(fit) = near.finished(&mut fixed, theta)? {
            return Ok(fit);
        }
    }
    let mut iterations = 0;
    let mut widening = 1.0;
    for renewal in 0.. {
        let model = unpack(&theta, settings.frame, &standard);
        if renewal > 0 || begin != nominal {
            fixed.renew(readings, settings, &model);
        }
        fixed.widening = widening;
        let problem = PoseProblem {
            readings,
            settings,
            standard,
            fixed: &fixed,
            volume,
            anchor: anchor.clone(),
        };
        let settled = settle(&problem, &theta)?;
        iterations += settled.iterations;
        let change = (settled.theta - theta).norm() / theta.norm();
        theta = settled.theta;
        if is_anchored {
            // Scatter beyond the noise must not allow an angle of ten degrees where no other reading contradicts it.
            let spare = readings.values.len().saturating_sub(N_PARAMETERS).max(1);
            let scatter =
                problem.chi2(&DVector::from_column_slice(theta.as_slice())) / spare as f64;
            widening *= scatter.max(widening.powi(-2)).sqrt();
        }
        // σ moves with the parameters at first order only through S: 1e-7 in S is 1e-7 in σ, far below its own error.
        if change < 1e-7 || renewal >= RENEWALS {
            let mut fit = finish(&problem, &settled, iterations)?;
            fit.sigmas = fixed.sigma;
            return Ok(fit);
        }
    }
    unreachable!("the loop returns at its last renewal")
}

/// The model that fits a share; `None` where that is all readings, or where it does not determine one.
fn of_share(share: &Share<'_>, settings: &Settings) -> Option<Model> {
    let Share::Some {
        values,
        noise,
        pose,
    } = share
    else {
        return None;
    };
    let readings = Readings {
        values,
        noise,
        pose,
    };
    let is_good = |found: &Fit| found.stop.is_converged() && !found.is_anchored;
    fit_from(readings, settings, None)
        .ok()
        .filter(is_good)
        .map(|found| found.model)
}
