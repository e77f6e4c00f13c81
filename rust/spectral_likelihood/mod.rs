//! Maximum likelihood for a sum of noise terms with known spectral shapes, from independent spectral ordinates.
//!
//! An ordinate is a squared coefficient `c²` of expectation `v = Σ_k p_k basis_k` (`p_k ≥ 0`, the squared noise terms),
//! chi-square distributed; neighbouring ones are averaged in bins. A straight line in time adds `slope · t` to the
//! coefficient itself. Minimised is the deviance
//!
//! `D(p, slope) = Σ_b n_b (ln v_b + P_b / v_b)`, `P_b = mean (c − slope t)²`
//!
//! by a monotone multiplicative start, then Fisher scoring in `ln p`. `slope` is profiled out: it is linear.
//!
//! The reported estimate of a term comes from [`invert`]: all terms stay in the model and the line is integrated out.

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

mod marginal;
mod profile;

pub use profile::{Inversion, LineMixture, Statement, invert};

/// Averages of ordinates over bins, and the contribution of each noise term of unit strength to them.
#[derive(Debug, Clone)]
pub struct Bins {
    /// Ordinates (degrees of freedom) in each bin.
    pub count: Vec<f64>,
    /// Mean of `c²`.
    pub power: Vec<f64>,
    /// Mean of `c t`, `t` the coefficient of a line of unit slope.
    pub line_cross: Vec<f64>,
    /// Mean of `t²`.
    pub line_square: Vec<f64>,
    /// For each term the expectation of `c²` at unit strength.
    pub basis: Vec<Vec<f64>>,
}

/// Model whose strengths are fitted.
#[derive(Debug, Clone, Default)]
pub struct Terms {
    /// Terms in the model, as indices of `Bins::basis`.
    pub active: Vec<usize>,
    /// Whether a straight line in time is fitted.
    pub has_line: bool,
}

/// The most likely strengths.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Strength of every term of `Bins::basis`, zero for those not in the model.
    pub strength: Vec<f64>,
    /// Slope of the line, zero without one.
    pub slope: f64,
    /// Standard error of the slope.
    pub sigma_slope: f64,
    /// Minimum of the deviance.
    pub deviance: f64,
    /// Standard errors of `ln strength` of the active terms, infinite where the term vanishes.
    pub sigma_log: Vec<f64>,
    /// Whether the deviance stopped decreasing within 60 steps.
    pub is_converged: bool,
}

impl Bins {
    /// Checks that all lengths agree and all values can be expectations.
    ///
    /// # Errors
    /// `BadInput` naming what is wrong.
    pub fn check(&self) -> Result<()> {
        let n = self.count.len();
        let lengths = [
            self.power.len(),
            self.line_cross.len(),
            self.line_square.len(),
        ];
        if n == 0 || lengths.iter().any(|&l| l != n) || self.basis.iter().any(|b| b.len() != n) {
            return Err(Error::bad_input(
                "every spectral bin needs a count, a power and a value of each term",
            ));
        }
        if self
            .basis
            .iter()
            .flatten()
            .any(|&v| !(v.is_finite() && v > 0.0))
        {
            return Err(Error::bad_input(
                "every term must have a positive expectation in every bin",
            ));
        }
        if self.power.iter().any(|v| !v.is_finite()) || self.power.iter().all(|&v| v <= 0.0) {
            return Err(Error::not_determined(
                "the spectrum is zero everywhere: the channel does not change",
            ));
        }
        Ok(())
    }

    fn expectation(&self, strength: &[f64]) -> Vec<f64> {
        let mut v = vec![0.0; self.count.len()];
        for (basis, &p) in self.basis.iter().zip(strength) {
            if p > 0.0 {
                v.iter_mut().zip(basis).for_each(|(v, b)| *v += p * b);
            }
        }
        v
    }

    fn line(&self, v: &[f64]) -> (f64, f64) {
        let (mut cross, mut square) = (0.0, 0.0);
        for b in 0..v.len() {
            cross += self.count[b] * self.line_cross[b] / v[b];
            square += self.count[b] * self.line_square[b] / v[b];
        }
        if square > 0.0 {
            (cross / square, square.recip().sqrt())
        } else {
            (0.0, f64::INFINITY)
        }
    }

    fn residual(&self, b: usize, slope: f64) -> f64 {
        (self.power[b] - 2.0 * slope * self.line_cross[b] + slope * slope * self.line_square[b])
            .max(0.0)
    }

    fn deviance(&self, v: &[f64], slope: f64) -> f64 {
        (0..v.len())
            .map(|b| self.count[b] * (v[b].ln() + self.residual(b, slope) / v[b]))
            .sum()
    }
}

/// Fit the strengths of the active terms.
///
/// # Errors
/// As [`Bins::check`].
pub fn fit(bins: &Bins, terms: &Terms) -> Result<Fit> {
    bins.check()?;
    let free = terms.active.clone();
    let mut strength = vec![0.0; bins.basis.len()];
    for &k in &free {
        strength[k] = first_guess(bins, k);
    }
    for _ in 0..12 {
        multiply(bins, &free, terms.has_line, &mut strength);
    }
    let is_converged = score(bins, &free, terms.has_line, &mut strength);
    let v = bins.expectation(&strength);
    let (slope, sigma_slope) = if terms.has_line {
        bins.line(&v)
    } else {
        (0.0, 0.0)
    };
    let information = information(bins, &free, &strength, &v);
    let covariance = information.try_inverse();
    let sigma_log = terms
        .active
        .iter()
        .map(|k| match (&covariance, free.iter().position(|f| f == k)) {
            (Some(c), Some(i)) if c[(i, i)] > 0.0 => c[(i, i)].sqrt(),
            (_, None) => 0.0,
            _ => f64::INFINITY,
        })
        .collect();
    let deviance = bins.deviance(&v, slope);
    Ok(Fit {
        strength,
        slope,
        sigma_slope,
        deviance,
        sigma_log,
        is_converged,
    })
}

/// Strength of the term alone below which a tenth of the bins lie.
fn first_guess(bins: &Bins, k: usize) -> f64 {
    let mut ratio: Vec<f64> = bins
        .power
        .iter()
        .zip(&bins.basis[k])
        .map(|(p, b)| p / b)
        .filter(|r| *r > 0.0)
        .collect();
    ratio.sort_unstable_by(f64::total_cmp);
    ratio.get(ratio.len() / 10).copied().unwrap_or(1.0)
}

/// One multiplicative step: stays in the positive quadrant and never increases the deviance.
fn multiply(bins: &Bins, free: &[usize], has_line: bool, strength: &mut [f64]) {
    let v = bins.expectation(strength);
    let slope = if has_line { bins.line(&v).0 } else { 0.0 };
    for &k in free {
        let (mut up, mut down) = (0.0, 0.0);
        for b in 0..v.len() {
            let share = bins.count[b] * bins.basis[k][b] / v[b];
            up += share * bins.residual(b, slope) / v[b];
            down += share;
        }
        strength[k] *= (up / down).sqrt().max(1e-6);
    }
}

fn information(bins: &Bins, free: &[usize], strength: &[f64], v: &[f64]) -> DMatrix<f64> {
    let share = |k: usize, b: usize| strength[k] * bins.basis[k][b] / v[b];
    DMatrix::from_fn(free.len(), free.len(), |i, j| {
        (0..v.len())
            .map(|b| 0.5 * bins.count[b] * share(free[i], b) * share(free[j], b))
            .sum()
    })
}

/// Fisher scoring in `ln p` with step halving; returns whether it converged.
fn score(bins: &Bins, free: &[usize], has_line: bool, strength: &mut [f64]) -> bool {
    let mut v = bins.expectation(strength);
    let mut slope = if has_line { bins.line(&v).0 } else { 0.0 };
    let mut deviance = bins.deviance(&v, slope);
    for _ in 0..60 {
        if free.is_empty() {
            return true;
        }
        let gradient = DVector::from_fn(free.len(), |i, _| {
            (0..v.len())
                .map(|b| {
                    let share = strength[free[i]] * bins.basis[free[i]][b] / v[b];
                    0.5 * bins.count[b] * (bins.residual(b, slope) / v[b] - 1.0) * share
                })
                .sum()
        });
        let mut matrix = information(bins, free, strength, &v);
        for i in 0..free.len() {
            // A vanishing term has no information of its own: the ridge keeps its step finite.
            matrix[(i, i)] += 1e-9 + 1e-9 * matrix[(i, i)];
        }
        let Some(step) = matrix.lu().solve(&gradient) else {
            return false;
        };
        let mut scale = 1.0;
        let mut moved = false;
        for _ in 0..30 {
            let mut trial = strength.to_vec();
            for (i, &k) in free.iter().enumerate() {
                trial[k] *= (scale * step[i]).clamp(-3.0, 3.0).exp();
            }
            let trial_v = bins.expectation(&trial);
            let trial_slope = if has_line { bins.line(&trial_v).0 } else { 0.0 };
            let trial_deviance = bins.deviance(&trial_v, trial_slope);
            if trial_deviance <= deviance {
                let gain = deviance - trial_deviance;
                strength.copy_from_slice(&trial);
                (v, slope, deviance) = (trial_v, trial_slope, trial_deviance);
                moved = gain > 1e-9;
                break;
            }
            scale *= 0.5;
        }
        if !moved {
            return true;
        }
    }
    false
}
