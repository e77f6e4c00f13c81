//! Fixed-interval smoother: every state estimated from all readings.
//!
//! The Rauch-Tung-Striebel estimate in the modified Bryson-Frazier form, which carries the adjoint `λ`, `Λ` backward
//! and inverts nothing but the scalar innovation variances; the textbook form inverts predicted covariances, which are
//! singular here (the walk starts at zero, a constant has no process noise). Source: Bierman, IEEE CDC 1973.

use nalgebra::{DMatrix, DVector};

use super::axis::{AxisFilter, N_CONSTANTS, Pose, Prior};
use super::shaping::ShapingModel;
use crate::error::Result;

/// Smoothed noise and constants at each pose.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// Slow noise at the end of each pose, and its standard error.
    pub drift: Vec<(f64, f64)>,
    /// Constants at each pose (all alike unless they walk).
    pub constants: Vec<[f64; N_CONSTANTS]>,
    /// Their standard errors.
    pub sigma: Vec<[f64; N_CONSTANTS]>,
}

struct Passed {
    x: DVector<f64>,
    p: DMatrix<f64>,
    phi: DMatrix<f64>,
    row: DVector<f64>,
    gain: DVector<f64>,
    innovation: f64,
    variance: f64,
}

/// A prior that is this many final standard errors wide has no influence on the estimate (1e-8 of its information).
const DIFFUSE: f64 = 1e4;

/// The prior, its diffuse constants replaced by the narrowest diffuse ones about the final estimate.
///
/// Smoothing subtracts from the filtered covariance: at the first poses that of a diffuse prior is so large that the
/// difference would have no digits.
fn tamed(model: &ShapingModel, prior: &Prior, poses: &[Pose]) -> Result<Prior> {
    let mut filter = AxisFilter::new(model.clone(), prior)?;
    for pose in poses {
        filter.add(pose)?;
    }
    let (mean, sigma) = (filter.constants(), filter.sigma());
    let mut out = prior.clone();
    for i in 0..N_CONSTANTS {
        if prior.sigma[i] > DIFFUSE * sigma[i] {
            out.mean[i] = mean[i];
            out.sigma[i] = DIFFUSE * sigma[i];
        }
    }
    Ok(out)
}

/// Filter forward, then smooth backward.
///
/// # Errors
/// As [`super::track`].
pub fn smooth(model: &ShapingModel, prior: &Prior, poses: &[Pose]) -> Result<Smoothed> {
    let mut filter = AxisFilter::new(model.clone(), &tamed(model, prior, poses)?)?;
    let n = filter.filter.n();
    let mut passed = Vec::with_capacity(poses.len());
    for pose in poses {
        let seen = filter.add(pose)?;
        passed.push(Passed {
            x: filter.filter.estimate(),
            p: filter.filter.factors.covariance_from(0),
            phi: filter.last_phi(),
            row: DVector::from_column_slice(&filter.row),
            gain: DVector::from_column_slice(filter.filter.gain()),
            innovation: seen.innovation,
            variance: seen.innovation_variance,
        });
    }
    let slow = filter.slow_row();
    let first_constant = filter.n_noise();
    let mut lambda = DVector::zeros(n);
    let mut big = DMatrix::zeros(n, n);
    let mut drift = Vec::with_capacity(poses.len());
    let mut constants = Vec::with_capacity(poses.len());
    let mut sigma = Vec::with_capacity(poses.len());
    for at in passed.iter().rev() {
        let x = &at.x - &at.p * &lambda;
        let p = &at.p - &at.p * &big * &at.p;
        let variance = (slow.transpose() * &p * &slow)[(0, 0)];
        drift.push((slow.dot(&x), variance.max(0.0).sqrt()));
        constants.push(std::array::from_fn(|i| x[first_constant + i]));
        sigma.push(std::array::from_fn(|i| {
            let j = first_constant + i;
            p[(j, j)].max(0.0).sqrt()
        }));
        let rest = DMatrix::identity(n, n) - &at.gain * at.row.transpose();
        lambda = rest.transpose() * &lambda - &at.row * (at.innovation / at.variance);
        big = rest.transpose() * &big * &rest + &at.row * at.row.transpose() / at.variance;
        lambda = at.phi.transpose() * &lambda;
        big = at.phi.transpose() * &big * &at.phi;
    }
    drift.reverse();
    constants.reverse();
    sigma.reverse();
    Ok(Smoothed {
        drift,
        constants,
        sigma,
    })
}
