//! Equivalent degrees of freedom of the variances by type of noise.
//!
//! `edf = 2 E(V)² / var(V)`. Source: C. A. Greenhall, W. J. Riley, "Uncertainty of stability variances based on finite
//! differences", Proc. 35th PTTI Meeting, 2003, pp. 267-280; total variance: C. A. Greenhall, D. A. Howe, D. B.
//! Percival, "Total variance, an estimator of long-term frequency stability", IEEE Trans. UFFC 46 (1999), Table I.
//!
//! The source assumes a phase that was averaged over one reading. The phase of a rate sensor is the sum of its
//! readings: white noise and a random walk of the readings then have exact autocovariances, which are used instead
//! (docs/noise.md, section 2). The difference is 15 % of edf at clusters of one reading and nothing beyond ten.

use super::Kind;
use crate::error::{Error, Result};

/// Exponents α of the density `f^α` of the rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoiseType {
    /// α = 2, white phase: quantisation.
    Quantisation,
    /// α = 0.
    White,
    /// α = −1.
    Flicker,
    /// α = −2.
    Walk,
}

/// Starts per cluster at which the autocovariance is summed: 48 give the sum over every start to within 0.2 %.
const STEPS: usize = 48;
/// Readings per cluster from which the limit of infinitely many is used: exact differences would lose their digits.
const MANY: usize = 100;

impl NoiseType {
    fn alpha(self) -> i32 {
        match self {
            Self::Quantisation => 2,
            Self::White => 0,
            Self::Flicker => -1,
            Self::Walk => -2,
        }
    }
}

/// Degrees of freedom of the variance of `n` readings in clusters of `m`.
///
/// # Errors
/// `BadInput` when `n` readings give no term.
pub fn degrees_of_freedom(n: usize, m: usize, noise: NoiseType, kind: Kind) -> Result<f64> {
    if kind.terms(n, m) == 0 {
        return Err(Error::bad_input(format!(
            "{n} readings hold no pair of clusters of {m} readings for the {} variance",
            kind.name()
        )));
    }
    let difference = if kind == Kind::Hadamard { 3 } else { 2 };
    let steps = if kind == Kind::NonOverlapping { 1 } else { m };
    let summed = summed(n, m, noise, difference, kind == Kind::Modified, steps);
    if kind != Kind::Total {
        return Ok(summed);
    }
    let (slope, offset) = match noise {
        NoiseType::Quantisation => return Ok(reflected_white_phase(n, m, summed)),
        NoiseType::White => (1.5, 0.0),
        NoiseType::Flicker => (1.168, 0.222),
        NoiseType::Walk => (0.927, 0.358),
    };
    // The table is for m >> 1; at the smallest clusters hardly anything is reflected.
    let table = slope * n as f64 / m as f64 - offset;
    Ok(if m < 8 { table.min(summed) } else { table }.max(1.0))
}

/// Total variance of white phase noise: every term reflected at an end contains the phase at that end, with factor 2.
///
/// A term that is reflected at one end is `2 e_0 − e_{m−k} − 2 e_k + e_{k+m}`: variance 10 instead of 6. Its part
/// `4 e_0²` is common to all `m − 1` of them and adds `32 (m − 1)²` to the variance of the sum at each end.
fn reflected_white_phase(n: usize, m: usize, summed: f64) -> f64 {
    let (terms, reflected) = ((n - 1) as f64, m.min(n - m).saturating_sub(1) as f64);
    let plain = 6.0 * terms;
    let mean = plain + 8.0 * reflected;
    let variance = 2.0 * plain * plain / summed + 64.0 * reflected * reflected + 320.0 * reflected;
    (2.0 * mean * mean / variance).max(1.0)
}

fn summed(
    n: usize,
    m: usize,
    noise: NoiseType,
    difference: usize,
    is_modified: bool,
    steps: usize,
) -> f64 {
    let reach = m * difference + if is_modified { m } else { 1 };
    let terms = |steps: usize| (1 + steps * (n + 1 - reach) / m).max(1);
    if noise == NoiseType::Quantisation && !is_modified {
        return white_phase(terms(steps), steps, difference);
    }
    let steps = steps.min(STEPS);
    let count = terms(steps);
    let phase = |t: f64| match noise {
        _ if is_modified => filtered(t, Some(1.0), noise.alpha()),
        NoiseType::White => -t.abs(),
        // The sum of a random walk that steps once per reading.
        NoiseType::Walk => t.abs().powi(3) - t.abs() / (m as f64).powi(2),
        _ => filtered(t, (m < MANY).then_some(m as f64), noise.alpha()),
    };
    let covariance = |lag: usize| {
        let t = lag as f64 / steps as f64;
        signed_binomials(difference)
            .map(|(shift, weight)| weight * phase(t + shift))
            .sum::<f64>()
    };
    let own = covariance(0);
    let inverse: f64 = (1..count.min((difference + 1) * steps))
        .map(|lag| 2.0 * (1.0 - lag as f64 / count as f64) * (covariance(lag) / own).powi(2))
        .sum();
    (count as f64 / (1.0 + inverse)).max(1.0)
}

/// `(−1)^s C(2d, d+s)` for `s` from `−d` to `d`.
fn signed_binomials(difference: usize) -> impl Iterator<Item = (f64, f64)> {
    const SECOND: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];
    const THIRD: [f64; 7] = [-1.0, 6.0, -15.0, 20.0, -15.0, 6.0, -1.0];
    let row: &'static [f64] = if difference == 3 { &THIRD } else { &SECOND };
    row.iter()
        .enumerate()
        .map(move |(i, &weight)| (i as f64 - difference as f64, weight))
}

/// Phase readings are independent: terms correlate only where their readings coincide, whole clusters apart.
fn white_phase(count: usize, steps: usize, difference: usize) -> f64 {
    let own = if difference == 3 { 20.0 } else { 6.0 };
    let inverse: f64 = signed_binomials(difference)
        .skip(difference + 1)
        .enumerate()
        .map(|(i, (_, weight))| {
            let lag = (i + 1) * steps;
            if lag < count {
                2.0 * (1.0 - lag as f64 / count as f64) * (weight / own).powi(2)
            } else {
                0.0
            }
        })
        .sum();
    (count as f64 / (1.0 + inverse)).max(1.0)
}

/// Generalised autocovariance of phase noise of density `f^(α−2)`, up to a factor.
fn generalised(t: f64, alpha: i32) -> f64 {
    let a = t.abs();
    let power = a.powi(3 - alpha);
    let with_log = |sign: f64| if a > 0.0 { sign * power * a.ln() } else { 0.0 };
    match alpha {
        1 => with_log(1.0),
        0 => power,
        -1 => with_log(-1.0),
        _ => -power,
    }
}

/// Generalised autocovariance averaged over a reading; `None` is the limit of many readings per cluster.
fn filtered(t: f64, filtering: Option<f64>, alpha: i32) -> f64 {
    match filtering {
        None => generalised(t, alpha + 2),
        Some(f) => {
            let h = 1.0 / f;
            f * f
                * (2.0 * generalised(t, alpha)
                    - generalised(t - h, alpha)
                    - generalised(t + h, alpha))
        }
    }
}
