//! The fit: a start, steps with σ fixed, σ renewed, and the uncertainty of the result.

use nalgebra::{DMatrix, DVector, SMatrix};

use super::parameters::{lower, map_to_entries, pack, unpack};
use super::problem::{self, FixedNoise, PoseProblem};
use super::start::Starts;
use super::{Fit, Model, N_PARAMETERS, Readings};
use crate::ellipsoid::Standardisation;
use crate::error::{Error, Result};
use crate::gauss_newton::{self, Options, Solution};

/// Largest number of renewals of σ, which depends on the result only through directions and converges in two.
const RENEWALS: usize = 8;

/// Spread of the specific forces in |g| (half a degree) below which all poses are one, or `S` has collapsed.
const SMALLEST_SPREAD: f64 = 1e-2;

/// The minimum S = 0, |b| = |g|, which any readings have.
const WORTHLESS: &str = "the poses do not determine the scales: they are too few, hardly differ, or are not still; \
                         hold the sensor still in nine or more clearly different orientations";

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
pub fn fit(readings: Readings<'_>, gravity: f64, start: Option<Model>) -> Result<Fit> {
    let Some(given) = start else {
        return fit_from(readings, gravity, None);
    };
    match fit_from(readings, gravity, Some(given)) {
        Ok(found) if found.stop.is_converged() && !is_shrunken(&found.model, readings, gravity) => {
            Ok(found)
        }
        // A malformed start is an error to report; it is not replaced.
        Err(error @ Error::BadInput(_)) => Err(error),
        first => fit_from(readings, gravity, None).or(first),
    }
}

/// Whether a triad is far smaller than the sphere through the readings.
fn is_shrunken(model: &Model, readings: Readings<'_>, gravity: f64) -> bool {
    Starts::of(readings.values)
        .and_then(|starts| starts.sphere(gravity))
        .is_ok_and(|sphere| model.s.determinant().abs() < 1e-2 * sphere.s.determinant().abs())
}

fn fit_from(readings: Readings<'_>, gravity: f64, start: Option<Model>) -> Result<Fit> {
    readings.check()?;
    if !gravity.is_finite() || gravity <= 0.0 {
        return Err(Error::bad_input(format!(
            "gravity must be a positive number in m/s², got {gravity}"
        )));
    }
    let starts = Starts::of(readings.values)?;
    let standard = starts.standard;
    let nominal = match start {
        Some(model) => lower(&model)?,
        None => starts.sphere(gravity)?,
    };
    let mut fixed = FixedNoise::at(readings, gravity, &nominal, 1.0);
    let is_anchored = problem::is_weak(readings, &fixed, gravity, &nominal);
    let begin = if is_anchored || start.is_some() {
        nominal
    } else {
        starts.best(gravity)?
    };
    if spread(&begin, &standard) < SMALLEST_SPREAD * gravity {
        return Err(Error::not_determined(WORTHLESS));
    }
    let first = pack(&begin, &standard);
    let mut theta = DVector::from_column_slice(first.as_slice());
    let mut iterations = 0;
    for renewal in 0.. {
        let model = unpack(theta.as_slice(), &standard);
        fixed = FixedNoise::at(readings, gravity, &model, fixed.widening);
        let problem = PoseProblem {
            readings,
            gravity,
            standard,
            fixed: &fixed,
            volume: (begin.s * standard.size).determinant().abs(),
            anchor: is_anchored.then_some(first),
        };
        let mut solution = gauss_newton::minimise(
            |x| Ok((problem.residuals(x), problem.jacobian(x))),
            |x| Ok(problem.residuals(x)),
            theta.clone(),
            &Options::default(),
        )?;
        iterations += solution.iterations;
        let change = (&solution.parameters - &theta).norm() / theta.norm();
        // σ moves with the parameters at first order only through S: 1e-7 in S is 1e-7 in σ, far below its own error.
        if change < 1e-7 || renewal >= RENEWALS {
            solution.iterations = iterations;
            return finish(&problem, &solution);
        }
        let scatter = problem.chi2(&solution.parameters);
        theta = solution.parameters;
        if is_anchored {
            // Scatter beyond the noise must not allow an angle of ten degrees where no other reading contradicts it.
            let spare = readings.values.len().saturating_sub(N_PARAMETERS).max(1);
            let least = fixed.widening.powi(-2);
            fixed.widening *= (scatter / spare as f64).max(least).sqrt();
        }
    }
    unreachable!("the loop returns at its last renewal")
}

/// Root mean square size of `S (a' - mean)`, m/s².
fn spread(model: &Model, standard: &Standardisation) -> f64 {
    (model.s * standard.size).norm() / 3.0_f64.sqrt()
}

fn finish(problem: &PoseProblem<'_>, solution: &Solution) -> Result<Fit> {
    let standard = &problem.standard;
    let held = &solution.certainty;
    // Noise in a reading enters residual and derivative alike: it biases S towards zero, by (σ/g)² of itself.
    let pull = problem.noise_in_gradient(&solution.parameters);
    let theta = &solution.parameters + square(&held.covariance) * pull;
    let certainty = match problem.anchor {
        None => held.clone(),
        Some(_) => gauss_newton::certainty(
            &problem.data_jacobian(&solution.parameters),
            Options::default().rank_tolerance,
        ),
    };
    let model = unpack(theta.as_slice(), standard);
    let shrink = (model.s * standard.size).determinant().abs() / problem.volume;
    if shrink < 2.0 * problem::SMALLEST_VOLUME
        || spread(&model, standard) < SMALLEST_SPREAD * problem.gravity
    {
        return Err(Error::not_determined(WORTHLESS));
    }
    let map = map_to_entries(standard);
    let residuals = problem.in_m_s2(&model);
    let sigmas = problem.fixed.sigma.clone();
    let whitened = residuals.iter().zip(&sigmas).map(|(r, s)| (r / s).powi(2));
    Ok(Fit {
        model,
        covariance: map * square(&certainty.covariance) * map.transpose(),
        chi2: whitened.sum(),
        residuals,
        sigmas,
        certainty,
        is_anchored: problem.anchor.is_some(),
        stop: solution.stop,
        iterations: solution.iterations,
    })
}

/// The same matrix on the stack.
fn square(matrix: &DMatrix<f64>) -> SMatrix<f64, N_PARAMETERS, N_PARAMETERS> {
    SMatrix::from_column_slice(matrix.as_slice())
}
