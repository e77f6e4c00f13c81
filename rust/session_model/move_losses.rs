//! What explains the tilt error of a move: noise, samples lost behind rewritten timestamps, a disturbance
//! (docs/model-session.md, 11.17).

use std::f64::consts::{LN_2, TAU};

use nalgebra::{Matrix2, Vector2};

use super::move_rows::{DEGREES, Passed};

/// Stretches of a move in which one loss is tried, and each of two: its error hardly changes inside one.
const STRETCHES: [usize; 2] = [40, 12];
/// Logarithm of the ratio of the largest tilt error of a disturbed move to noise; sizes between are alike a priori.
const LN_SIZES: f64 = 9.2;

/// Weight or its logarithm, mean and covariance.
type Normal = (f64, Vector2<f64>, Matrix2<f64>);

/// Errors of gravity after a move by lost samples: where they were lost is unknown.
pub(super) struct Losses {
    pub n_samples: f64,
    /// Number of losses, logarithm of its weight among these, mean and covariance of the error.
    each: Vec<(usize, f64, Vector2<f64>, Matrix2<f64>)>,
    /// Mean and covariance of the error of one.
    one: (Vector2<f64>, Matrix2<f64>),
}

/// Weight, mean and covariance of each of some stretches of `values`.
fn stretches(values: &[Vector2<f64>], count: usize) -> Vec<Normal> {
    let (n, k) = (values.len(), count.min(values.len()));
    let stretch = |i: usize| {
        let own = &values[i * n / k..(i + 1) * n / k];
        let mean = own.iter().sum::<Vector2<f64>>() / own.len() as f64;
        let away = own.iter().map(|v| (v - mean) * (v - mean).transpose());
        let spread = away.sum::<Matrix2<f64>>() / own.len() as f64;
        (own.len() as f64 / n as f64, mean, spread)
    };
    (0..k).map(stretch).collect()
}

impl Losses {
    pub(super) fn of(passed: &Passed) -> Self {
        // A lost sample takes the rate at it from the sum.
        let (by_rate, rate) = (&passed.response.by_rate, &passed.carried.rate);
        let pairs = by_rate.iter().zip(rate);
        let off: Vec<Vector2<f64>> = pairs
            .map(|(by, rate)| -(by.fixed_rows::<2>(0) * rate))
            .collect();
        let single = stretches(&off, STRETCHES[0]);
        let ends = stretches(&off, STRETCHES[1]);
        let mut each: Vec<_> = single.iter().map(|s| (1, s.0.ln(), s.1, s.2)).collect();
        for (i, a) in ends.iter().enumerate() {
            for (j, b) in ends.iter().enumerate().take(i + 1) {
                let twice = if i == j { 0.0 } else { LN_2 };
                each.push((2, (a.0 * b.0).ln() + twice, a.1 + b.1, a.2 + b.2));
            }
        }
        let whole = stretches(&off, 1)[0];
        Self {
            n_samples: off.len() as f64,
            each,
            one: (whole.1, whole.2),
        }
    }

    /// All numbers of losses at a share of lost samples, more than two together; with the logarithm of none.
    pub(super) fn at(&self, share: f64) -> (f64, Vec<Normal>) {
        let rate = share * self.n_samples;
        if rate <= 0.0 {
            return (0.0, Vec::new());
        }
        let log = [-rate, rate.ln() - rate, 2.0 * rate.ln() - rate - LN_2];
        let few = self.each.iter();
        let mut out: Vec<_> = few.map(|e| (log[e.0] + e.1, e.2, e.3)).collect();
        let (more, mean, variance) = if rate < 0.1 {
            let more = rate.powi(3) / 6.0 * (1.0 - 0.75 * rate);
            (more, 3.0 + 0.25 * rate, 0.25 * rate)
        } else {
            let [none, one, two] = log.map(f64::exp);
            let more = 1.0 - none - one - two;
            let mean = (rate - one - 2.0 * two) / more;
            let square = (rate + rate * rate - one - 4.0 * two) / more;
            (more, mean, (square - mean * mean).max(0.0))
        };
        let (of_one, spread) = &self.one;
        let spread = spread * mean + of_one * of_one.transpose() * variance;
        out.push((more.ln(), of_one * mean, spread));
        (log[0], out)
    }
}

/// What explains the tilt error of one move.
pub(super) struct Explained {
    pub log_likelihood: f64,
    /// Negative gradient of the log-likelihood, and the curvature of a bound of it.
    pub gradient: Vector2<f64>,
    pub bound: Matrix2<f64>,
    /// Covariance of the error over all explanations: two that are far apart determine no more than both together.
    pub spread: Matrix2<f64>,
    pub disturbed: f64,
}

/// One explanation: logarithm of its density, distance from its mean, that times the inverse covariance, that inverse,
/// and the covariance, by the weight that heavy tails give the distance.
type Explanation = (f64, Vector2<f64>, Vector2<f64>, Matrix2<f64>, Matrix2<f64>);

/// Noise about a mean at a distance `apart`, Student t as that of the moves (11.18a), and χ² of the distance.
fn noisy(log_weight: f64, apart: Vector2<f64>, covariance: &Matrix2<f64>) -> (Explanation, f64) {
    let c = covariance;
    let det = c.determinant().max(f64::MIN_POSITIVE);
    let inverse = Matrix2::new(c.m22, -c.m12, -c.m21, c.m11) / det;
    let pulled = inverse * apart;
    let chi2 = apart.dot(&pulled);
    let tail = (DEGREES + 2.0) / (DEGREES + chi2);
    let log = -0.5 * (det.ln() + (DEGREES + 2.0) * (chi2 / DEGREES).ln_1p()) - TAU.ln();
    let weighed = (
        log_weight + log,
        apart,
        pulled * tail,
        inverse * tail,
        c / tail,
    );
    (weighed, chi2)
}

/// The mixture at a tilt error `x`: noise with heavy tails, losses, a disturbance of any size (11.17).
pub(super) fn explained(
    x: &Vector2<f64>,
    noise: &Matrix2<f64>,
    losses: &(f64, Vec<Normal>),
    disturbed: f64,
) -> Explained {
    let known = 1.0 - disturbed;
    let (plain, chi2) = noisy(known.ln() + losses.0, *x, noise);
    let (wide, narrow) = (0.5 * (1.0 + chi2), (DEGREES + chi2) / (DEGREES + 2.0));
    let flat = -0.5 * noise.determinant().max(f64::MIN_POSITIVE).ln() - TAU.ln();
    let of_any = disturbed.ln() + flat - LN_SIZES.ln() - chi2.ln_1p();
    let any = narrow / wide;
    let mut each = vec![
        plain,
        (of_any, *x, plain.2 * any, plain.3 * any, noise * wide),
    ];
    for (weight, mean, spread) in &losses.1 {
        each.push(noisy(known.ln() + weight, x - mean, &(noise + spread)).0);
    }
    let most = each.iter().fold(f64::NEG_INFINITY, |m, e| m.max(e.0));
    let total: f64 = each.iter().map(|e| (e.0 - most).exp()).sum();
    let log_likelihood = most + total.ln();
    let (mut gradient, mut bound) = (Vector2::zeros(), Matrix2::zeros());
    let (mut mean, mut square) = (Vector2::zeros(), Matrix2::zeros());
    for (log, apart, pulled, inverse, covariance) in &each {
        let p = (log - log_likelihood).exp();
        gradient += pulled * p;
        bound += inverse * p;
        mean += apart * p;
        square += (covariance + apart * apart.transpose()) * p;
    }
    Explained {
        log_likelihood,
        gradient,
        bound,
        spread: square - mean * mean.transpose(),
        disturbed: (each[1].0 - log_likelihood).exp(),
    }
}
