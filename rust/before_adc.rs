//! Means of a coarse ADC's readings before rounding, from the shares of their codes (docs/diagnosis-method.md, 8.15).

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::chi_square::normal_above;
use crate::error::{Error, Result};

/// Noise before the ADC that is tried, in steps: without bounds the shares of two codes fit any.
const SIGMAS: (f64, f64, usize) = (0.03, 2.0, 25);
/// Scatter of the means that is tried, in steps, a priori as rare as it is large: codes that do not change do not show
/// it, and moves would have to bear it. The spacing of the means that are tried.
const SCATTERS: [f64; 6] = [0.004, 0.012, 0.04, 0.12, 0.4, 1.2];
const SPACING: f64 = 0.005;
/// Means are tried up to so many steps beyond the plain ones.
const BEYOND: f64 = 0.75;
/// Readings that count as independent at the most: slow noise is in all of them, and the spacing resolves no more.
const MOST: f64 = 400.0;
/// Least probability of a code: readings far from the others are disturbances.
const LEAST: f64 = 1e-15;
/// Scatters of the means beyond which their distribution is left out.
const REACH: f64 = 4.0;

/// Readings before an ADC, in its steps.
#[derive(Debug, Clone)]
pub struct BeforeAdc {
    /// White noise of one reading.
    pub sigma: f64,
    /// Posterior mean less the plain mean of every pose.
    pub shift: Vec<f64>,
    /// Standard deviation of that mean which is its own.
    pub own: Vec<f64>,
    /// Standard deviation that all means share.
    pub common: f64,
}

/// Codes with their numbers, of the first and the second half of one pose, and their mean.
struct Pose {
    halves: [Vec<(usize, f64)>; 2],
    mean: f64,
}

/// Moments under one noise and one scatter.
struct Moments {
    sigma: f64,
    log_evidence: f64,
    mean: Vec<f64>,
    square: Vec<f64>,
    shared: (f64, f64),
}

/// Interval-censored normal readings `values` on a grid of `step`, pose after pose (`edges`): one noise for all, means
/// that scatter normally about one; noise and scatter are integrated over, flat in the logarithm of the noise, and the
/// scatter as rare as it is large. Each pose is static throughout, or in one half, the other at any rate of rotation:
/// in a pause of a slow move the next one begins inside an LSB. The three are equally likely a priori.
///
/// # Errors
/// `BadInput` when a pose has no readings, or there is no step.
pub fn before_adc(values: &[f64], edges: &[usize], step: f64) -> Result<BeforeAdc> {
    let lowest = values.iter().copied().fold(f64::INFINITY, f64::min);
    let poses: Option<Vec<Pose>> = edges
        .windows(2)
        .map(|w| Pose::of(values.get(w[0]..w[1])?, lowest, step))
        .collect();
    let Some(poses) = poses.filter(|all| !all.is_empty() && step > 0.0) else {
        return Err(Error::bad_input(
            "a pose has no readings, or the ADC no step",
        ));
    };
    let means = || poses.iter().map(|one| one.mean);
    let first = means().fold(f64::INFINITY, f64::min);
    let last = means().fold(f64::NEG_INFINITY, f64::max);
    let (low, high, n) = SIGMAS;
    let found: Vec<Moments> = (0..n)
        .into_par_iter()
        .flat_map_iter(|k| {
            let sigma = low * (high / low).powf(k as f64 / (n - 1) as f64);
            if last - first > REACH * SCATTERS[SCATTERS.len() - 1] {
                return vec![apart(&poses, sigma)];
            }
            let grid = between(first, last);
            let likelihood = likelihoods(&poses, &grid, sigma);
            let one = |&scatter: &f64| moments(&likelihood, &grid, sigma, scatter);
            SCATTERS.iter().map(one).collect()
        })
        .collect();
    Ok(averaged(&poses, &found))
}

impl Pose {
    fn of(values: &[f64], lowest: f64, step: f64) -> Option<Self> {
        let n = values.len() as f64;
        let weight = (MOST / n).min(1.0);
        let mut sum = 0.0;
        let mut codes = |part: &[f64]| {
            let mut counts: BTreeMap<usize, f64> = BTreeMap::new();
            for value in part {
                let code = whole((value - lowest) / step);
                sum += code as f64;
                *counts.entry(code).or_default() += weight;
            }
            counts.into_iter().collect()
        };
        let (before, after) = values.split_at(values.len() / 2);
        let halves = [codes(before), codes(after)];
        let mean = sum / n;
        mean.is_finite().then_some(Self { halves, mean })
    }
}

/// A number of steps or places, to the nearest.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of codes and of places on the grid: small, and not negative"
)]
fn whole(value: f64) -> usize {
    value.round().max(0.0) as usize
}

/// Means that are tried for plain ones from `first` to `last`.
fn between(first: f64, last: f64) -> Vec<f64> {
    let n = whole((last - first + 2.0 * BEYOND) / SPACING);
    (0..=n)
        .map(|k| first - BEYOND + k as f64 * SPACING)
        .collect()
}

/// Evidence and moments of means many steps apart: each may be anywhere.
fn apart(poses: &[Pose], sigma: f64) -> Moments {
    let mut out = Moments {
        sigma,
        log_evidence: 0.0,
        mean: Vec::new(),
        square: Vec::new(),
        shared: (0.0, 0.0),
    };
    for pose in poses {
        let grid = between(pose.mean, pose.mean);
        let (top, of) = &likelihoods(std::slice::from_ref(pose), &grid, sigma)[0];
        let sum: f64 = of.iter().sum();
        let moment = |n: i32| {
            of.iter()
                .zip(&grid)
                .map(|(l, m)| l * m.powi(n))
                .sum::<f64>()
                / sum
        };
        out.log_evidence += top + (sum / grid.len() as f64).ln();
        out.mean.push(moment(1));
        out.square.push(moment(2));
    }
    let shared = out.mean.iter().sum::<f64>() / poses.len() as f64;
    out.shared = (shared, shared * shared);
    out
}

/// Logarithm of a reference of every pose, and its likelihoods over the means tried relative to that.
fn likelihoods(poses: &[Pose], grid: &[f64], sigma: f64) -> Vec<(f64, Vec<f64>)> {
    let mut of_code: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for &(code, _) in poses.iter().flat_map(|one| one.halves.iter().flatten()) {
        of_code.entry(code).or_insert_with(|| {
            let one = |mean: &f64| {
                let at = |edge: f64| normal_above((mean - code as f64 - edge) / sigma);
                (at(0.5) - at(-0.5)).max(LEAST).ln()
            };
            grid.iter().map(one).collect()
        });
    }
    let half = |counts: &Vec<(usize, f64)>| {
        let mut log = vec![0.0; grid.len()];
        for (code, count) in counts {
            for (sum, of) in log.iter_mut().zip(&of_code[code]) {
                *sum += count * of;
            }
        }
        let top = log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let of: Vec<f64> = log.into_iter().map(|l| (l - top).exp()).collect();
        let at_any_rate = of.iter().sum::<f64>() / grid.len() as f64;
        (top, of, at_any_rate)
    };
    let one = |pose: &Pose| {
        let [(top, first, any_first), (above, second, any_second)] =
            pose.halves.each_ref().map(half);
        let either = |(a, b): (f64, f64)| (a * b + a * any_second + b * any_first) / 3.0;
        let of = first.into_iter().zip(second).map(either).collect();
        (top + above, of)
    };
    poses.iter().map(one).collect()
}

/// Evidence and moments of the means, of which all scatter about one that may be anywhere on the grid.
fn moments(likelihood: &[(f64, Vec<f64>)], grid: &[f64], sigma: f64, scatter: f64) -> Moments {
    let half = whole(REACH * scatter / SPACING);
    let kernel: Vec<f64> = (0..=half)
        .map(|k| (-0.5 * (k as f64 * SPACING / scatter).powi(2)).exp())
        .collect();
    let total = 2.0 * kernel.iter().sum::<f64>() - kernel[0];
    let n = grid.len();
    let mut log = vec![0.0; n];
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for (top, of) in likelihood {
        // Sums over the means near each centre: of the likelihood, and with one and two factors of the mean.
        let mut sums = vec![[0.0; 3]; n];
        for (j, l) in of.iter().enumerate().filter(|(_, l)| **l > LEAST) {
            let terms = [*l, l * grid[j], l * grid[j] * grid[j]];
            for (i, sum) in sums
                .iter_mut()
                .enumerate()
                .take((j + half + 1).min(n))
                .skip(j.saturating_sub(half))
            {
                let weight = kernel[i.abs_diff(j)];
                for (s, t) in sum.iter_mut().zip(terms) {
                    *s += weight * t;
                }
            }
        }
        for (l, s) in log.iter_mut().zip(&sums) {
            *l += top + (s[0] / total).max(f64::MIN_POSITIVE).ln();
        }
        first.push(
            sums.iter()
                .map(|s| s[1] / s[0].max(f64::MIN_POSITIVE))
                .collect::<Vec<_>>(),
        );
        second.push(
            sums.iter()
                .map(|s| s[2] / s[0].max(f64::MIN_POSITIVE))
                .collect::<Vec<_>>(),
        );
    }
    let top = log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weight: Vec<f64> = log.iter().map(|l| (l - top).exp()).collect();
    let sum: f64 = weight.iter().sum();
    let over = |of: &[f64]| weight.iter().zip(of).map(|(w, x)| w * x).sum::<f64>() / sum;
    let all: Vec<f64> = (0..n)
        .map(|i| first.iter().map(|of| of[i]).sum::<f64>() / first.len() as f64)
        .collect();
    Moments {
        sigma,
        log_evidence: top + (sum / n as f64).ln() - scatter.ln(),
        mean: first.iter().map(|of| over(of)).collect(),
        square: second.iter().map(|of| over(of)).collect(),
        shared: (
            over(&all),
            over(&all.iter().map(|x| x * x).collect::<Vec<_>>()),
        ),
    }
}

fn averaged(poses: &[Pose], found: &[Moments]) -> BeforeAdc {
    let best = found
        .iter()
        .map(|one| one.log_evidence)
        .fold(f64::NEG_INFINITY, f64::max);
    let weight: Vec<f64> = found
        .iter()
        .map(|one| (one.log_evidence - best).exp())
        .collect();
    let sum: f64 = weight.iter().sum();
    let over = |of: &dyn Fn(&Moments) -> f64| {
        found
            .iter()
            .zip(&weight)
            .map(|(one, w)| w * of(one))
            .sum::<f64>()
            / sum
    };
    let variance = |mean: f64, square: f64| (square - mean * mean).max(0.0);
    let common = variance(over(&|one| one.shared.0), over(&|one| one.shared.1));
    let each = |i: usize| (over(&|one| one.mean[i]), over(&|one| one.square[i]));
    let means: Vec<(f64, f64)> = (0..poses.len()).map(each).collect();
    BeforeAdc {
        sigma: over(&|one| one.sigma.ln()).exp(),
        shift: means
            .iter()
            .zip(poses)
            .map(|((mean, _), pose)| mean - pose.mean)
            .collect(),
        own: means
            .iter()
            .map(|&(mean, square)| (variance(mean, square) - common).max(0.0).sqrt())
            .collect(),
        common: common.sqrt(),
    }
}
