//! Maximum likelihood for a sum of noise terms with known spectral shapes, from independent spectral ordinates.
//!
//! An ordinate is a squared coefficient `c²` of expectation `v = Σ_k p_k basis_k` (`p_k ≥ 0`, the squared noise terms),
//! chi-square distributed; neighbouring ones are averaged in bins. A straight line in time adds `slope · t` to the
//! coefficient itself. Minimised is the deviance
//!
//! `D(p, slope) = Σ_b n_b (ln v_b + P_b / v_b)`, `P_b = mean (c − slope t)²`
//!
//! by a monotone multiplicative start, then Fisher scoring in `ln p`. `slope` is profiled out: it is linear.

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

/// Averages of ordinates over bins, and what each noise term of unit strength contributes to them.
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

/// What the likelihood is asked.
#[derive(Debug, Clone, Default)]
pub struct Question {
    /// Terms in the model, as indices of `Bins::basis`.
    pub active: Vec<usize>,
    /// Whether a straight line in time is fitted.
    pub has_line: bool,
    /// A term whose strength is given instead of fitted (it need not be active).
    pub held: Option<(usize, f64)>,
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
    /// Whether the last step was below 1e-7 of every strength that matters.
    pub is_converged: bool,
}

impl Bins {
    /// Check that all lengths agree and all values can be expectations.
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
/// `BadInput` when the bins disagree or no term is asked for.
pub fn fit(bins: &Bins, question: &Question) -> Result<Fit> {
    bins.check()?;
    Ok(fit_checked(bins, question, None))
}

fn fit_checked(bins: &Bins, question: &Question, start: Option<&[f64]>) -> Fit {
    let free: Vec<usize> = question
        .active
        .iter()
        .copied()
        .filter(|&k| question.held.is_none_or(|(held, _)| held != k))
        .collect();
    let mut strength = vec![0.0; bins.basis.len()];
    for &k in &free {
        strength[k] = start.map_or(0.0, |s| s[k]);
        if strength[k] <= 0.0 {
            strength[k] = first_guess(bins, k);
        }
    }
    if let Some((held, value)) = question.held {
        strength[held] = value;
    }
    let rounds = if start.is_some() { 2 } else { 12 };
    for _ in 0..rounds {
        multiply(bins, &free, question.has_line, &mut strength);
    }
    let is_converged = score(bins, &free, question.has_line, &mut strength);
    let v = bins.expectation(&strength);
    let (slope, sigma_slope) = if question.has_line {
        bins.line(&v)
    } else {
        (0.0, 0.0)
    };
    let information = information(bins, &free, &strength, &v);
    let covariance = information.try_inverse();
    let sigma_log = question
        .active
        .iter()
        .map(|k| match (&covariance, free.iter().position(|f| f == k)) {
            (Some(c), Some(i)) if c[(i, i)] > 0.0 => c[(i, i)].sqrt(),
            (_, None) => 0.0,
            _ => f64::INFINITY,
        })
        .collect();
    let deviance = bins.deviance(&v, slope);
    Fit {
        strength,
        slope,
        sigma_slope,
        deviance,
        sigma_log,
        is_converged,
    }
}

/// A tenth of the bins lie below this strength of the term alone.
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

/// One multiplicative step: never leaves the positive quadrant, never raises the deviance.
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

/// Fisher scoring in `ln p` with step halving; says whether it converged.
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
            // A vanishing term has no information of its own: hold its step rather than divide by nothing.
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

/// Strengths of term `k` at which the deviance exceeds its minimum by `rise`: below and above the most likely one.
///
/// The lower is zero when the deviance at zero strength does not exceed the minimum by `rise`.
///
/// # Errors
/// `BadInput` when the bins disagree.
pub fn profile_interval(
    bins: &Bins,
    question: &Question,
    k: usize,
    rise: f64,
) -> Result<(f64, f64)> {
    bins.check()?;
    let mut active = question.active.clone();
    if !active.contains(&k) {
        active.push(k);
    }
    let free = Question {
        active,
        has_line: question.has_line,
        held: None,
    };
    let best = fit_checked(bins, &free, None);
    let held_at = |value: f64, near: &[f64]| {
        fit_checked(
            bins,
            &Question {
                held: Some((k, value)),
                ..free.clone()
            },
            Some(near),
        )
    };
    let excess = |value: f64| held_at(value, &best.strength).deviance - best.deviance - rise;
    let peak = best.strength[k];
    let others: f64 = first_guess(bins, k);
    let seed = if peak > 1e-12 * others {
        peak
    } else {
        1e-6 * others
    };
    let mut above = seed * 1.3;
    let mut inside = seed;
    while excess(above) < 0.0 && above < 1e12 * others.max(seed) {
        inside = above;
        above *= 1.6;
    }
    let upper = bisect(inside, above, &excess);
    if peak <= 0.0 || excess(0.0) <= 0.0 {
        return Ok((0.0, upper));
    }
    let mut below = peak / 1.3;
    let mut inside = peak;
    while excess(below) < 0.0 && below > 1e-12 * peak {
        inside = below;
        below /= 1.6;
    }
    Ok((bisect(inside, below, &excess), upper))
}

/// Where `f` changes sign between `inside` (negative) and `outside` (positive), to 1e-4, on a logarithmic scale.
fn bisect(mut inside: f64, mut outside: f64, f: &impl Fn(f64) -> f64) -> f64 {
    for _ in 0..40 {
        if (outside / inside - 1.0).abs() < 1e-4 {
            break;
        }
        let middle = (inside * outside).sqrt();
        if f(middle) < 0.0 {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    (inside * outside).sqrt()
}
