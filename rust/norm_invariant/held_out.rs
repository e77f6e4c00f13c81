//! Cross-validation: poses predicted by fits without them.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::problem::predicted;
use super::{Fit, N_PARAMETERS, Readings, fit};
use crate::error::{Error, Result};

/// One pose, predicted without it.
#[derive(Debug, Clone, Copy)]
pub struct HeldOut {
    /// `|S a' + b| - |g|` by the other poses' model, m/s²; NaN where they do not determine one.
    pub residual: f64,
    /// Its standard error: noise of this pose and uncertainty of the model, m/s².
    pub sigma: f64,
    /// χ² per degree of freedom of the other poses' fit.
    pub chi2_per_dof: f64,
}

/// Refits once per fold without its poses, from the full fit, and predicts them. `folds[i]` is the fold of pose `i`.
///
/// # Errors
/// When the folds do not match the readings.
pub fn held_out(
    readings: Readings<'_>,
    gravity: f64,
    full: &Fit,
    folds: &[usize],
) -> Result<Vec<HeldOut>> {
    if folds.len() != readings.values.len() {
        return Err(Error::bad_input(format!(
            "{} folds do not belong to {} poses",
            folds.len(),
            readings.values.len()
        )));
    }
    let n_folds = folds.iter().max().map_or(0, |last| last + 1);
    let by_fold: Vec<Vec<(usize, HeldOut)>> = (0..n_folds)
        .into_par_iter()
        .map(|fold| one_fold(readings, gravity, full, folds, fold))
        .collect();
    let blank = HeldOut {
        residual: f64::NAN,
        sigma: f64::NAN,
        chi2_per_dof: f64::NAN,
    };
    let mut out = vec![blank; folds.len()];
    for (i, prediction) in by_fold.into_iter().flatten() {
        out[i] = prediction;
    }
    Ok(out)
}

fn one_fold(
    readings: Readings<'_>,
    gravity: f64,
    full: &Fit,
    folds: &[usize],
    fold: usize,
) -> Vec<(usize, HeldOut)> {
    let kept: Vec<usize> = (0..folds.len()).filter(|&i| folds[i] != fold).collect();
    let values: Vec<Vector3<f64>> = kept.iter().map(|&i| readings.values[i]).collect();
    let noise: Vec<Matrix3<f64>> = kept.iter().map(|&i| *readings.noise_of(i)).collect();
    let rest = Readings {
        values: &values,
        noise: &noise,
    };
    let Ok(other) = fit(rest, gravity, Some(full.model)) else {
        return Vec::new();
    };
    if other.is_anchored || other.certainty.rank < N_PARAMETERS {
        return Vec::new();
    }
    let dof = values.len().saturating_sub(N_PARAMETERS);
    let chi2_per_dof = if dof == 0 {
        f64::NAN
    } else {
        other.chi2 / dof as f64
    };
    (0..folds.len())
        .filter(|&i| folds[i] == fold)
        .map(|i| {
            let reading = &readings.values[i];
            let f = other.model.correct(reading);
            let (noise, excess) = predicted(readings, gravity, &other.model, i);
            let u = f / f.norm();
            let mut slope = nalgebra::SVector::<f64, 12>::zeros();
            for row in 0..3 {
                for column in 0..3 {
                    slope[3 * row + column] = u[row] * reading[column];
                }
                slope[9 + row] = u[row];
            }
            let model_variance = slope.dot(&(other.covariance * slope)).max(0.0);
            (
                i,
                HeldOut {
                    residual: f.norm() - gravity - excess,
                    sigma: (noise * noise + model_variance).sqrt(),
                    chi2_per_dof,
                },
            )
        })
        .collect()
}
