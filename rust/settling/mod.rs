//! Static rates caused by motion: a soft support rotates the sensor, and gravity shows it (docs/diagnosis-method.md,
//! 8.7d).

mod motion;

use nalgebra::{Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::order_statistics::median;
pub use motion::PoseMotion;
use motion::{Seen, motions, seen};

/// Parts of a pose whose means separate a rate that decays from a constant one.
const N_BLOCKS: usize = 6;
/// Time constants of supports, s: foam and skin, not the hours of a glue.
const SETTLES_S: [f64; 4] = [0.7, 1.4, 2.8, 5.6];
/// Values tried for scatter and settling besides 0, in rms error of the readings: a quarter of an LSB is 10 %.
const N_SIZES: usize = 31;
const SMALLEST: f64 = 0.1;
const LARGEST: f64 = 1e4;
/// Of these the first that exceed no error of a pose: scatter that 1/f noise explains.
const BY_NOISE: usize = 7;
/// Variance of a tilt about the vertical, of the largest, that is rounding.
const LEVEL: f64 = 1e-9;

/// Static poses of a session: readings about their means, and the noise of the means, raw.
#[derive(Debug, Clone, Copy)]
pub struct Poses<'a> {
    /// Readings of the gyro and of the accelerometer.
    pub readings: [&'a [[f64; 3]]; 2],
    /// SI per raw unit of both.
    pub scale: [Matrix3<f64>; 2],
    /// Standard errors of the means of every pose if their parts are independent, of both.
    pub noise: [&'a [[f64; 3]]; 2],
    /// Vertical in the body.
    pub up: &'a [[f64; 3]],
    /// Ranges of the samples.
    pub spans: &'a [[usize; 2]],
    /// Sample at which the move before ends, and that at which the move after begins.
    pub edges: &'a [[usize; 2]],
    /// Gravity, m/s².
    pub gravity: f64,
    /// Sample interval, s.
    pub step: f64,
}

/// Settling beside scatter.
#[derive(Debug, Clone)]
pub struct Settling {
    /// Twice the log-likelihood that it gains beside scatter, less the cost of the time constants tried; scatter is what
    /// noise explains unless more is certain.
    pub score: f64,
    /// The same score of a bias that settles, over scatter or the support, whichever is likelier; or that by which
    /// gravity prefers it to a rotation of any course, whichever is less.
    pub of_bias: f64,
    /// Motion of every pose.
    pub motion: Vec<PoseMotion>,
}

/// One pose at one time constant: information on scatter and settling, each a vector `(6)`, what the readings say of
/// them, and their square.
struct Sums {
    information: Matrix6<f64>,
    said: Vector6<f64>,
    square: f64,
}

/// Rates of the six parts of a pose, contrasts of its tilt, and the information on one of either: the inverse covariance
/// of their noise, of the tilt across the vertical only.
struct Parts {
    rates: [Vector3<f64>; N_BLOCKS],
    tilts: [Vector3<f64>; N_BLOCKS - 1],
    of_rate: Matrix3<f64>,
    of_tilt: Matrix3<f64>,
    /// Duration of a part, s.
    lasts: f64,
}

/// Settling against scatter in the rates of the poses: w = z + s + k exp(-t/τ), tilt k τ (1 - exp(-t/τ)), or none where
/// the bias settles.
///
/// `s` and `k` are drawn anew in every pose, with one variance for all axes. The accelerometer shows the part of `k`
/// across the vertical, the shape in time all of it. One bias `z` for the session, restricted likelihood. `None` with
/// fewer poses than `fewest`. Scatter beyond that by noise is certain where it gains as much as `certain`.
///
/// # Errors
/// `BadInput` when lengths differ.
pub fn settling(poses: &Poses<'_>, fewest: usize, certain: f64) -> Result<Option<Settling>> {
    let n = poses.spans.len();
    if poses.up.len() != n || poses.edges.len() != n || poses.noise.iter().any(|one| one.len() != n)
    {
        return Err(Error::bad_input("every pose has a vertical and noise"));
    }
    let all: Vec<Parts> = (0..n).filter_map(|i| parts(poses, i)).collect();
    if all.len() < fewest {
        return Ok(None);
    }
    // Of a mean over a pose.
    let error = |one: &Parts| (3.0 / one.of_rate.trace() / N_BLOCKS as f64).sqrt();
    let unit = median(&mut all.iter().map(error).collect::<Vec<f64>>());
    let variance = |k: usize| {
        let share = (k as f64 - 1.0) / (N_SIZES - 1) as f64;
        let size = SMALLEST * (LARGEST / SMALLEST).powf(share);
        if k == 0 { 0.0 } else { (unit * size).powi(2) }
    };
    let sums = |moves: [f64; 2]| {
        SETTLES_S.map(|tau| {
            all.iter()
                .map(|one| Sums::of(one, tau, moves))
                .collect::<Vec<Sums>>()
        })
    };
    let [of_support, of_bias, of_creep] = [[1.0, 1.0], [1.0, 0.0], [0.0, 1.0]].map(sums);
    // With the rate at the beginning of poses and its time constant.
    let likeliest = |tables: &[Vec<Sums>; SETTLES_S.len()], most: usize, settles: usize| {
        let tried: Vec<(usize, usize, usize)> = (0..SETTLES_S.len())
            .flat_map(|t| (0..=most).flat_map(move |a| (0..=settles).map(move |b| (t, a, b))))
            .collect();
        let found = tried.par_iter().map(|&(t, a, b)| {
            let value = log_likelihood(&tables[t], variance(a), variance(b));
            (value, variance(b).sqrt(), SETTLES_S[t])
        });
        let best = found.reduce_with(|one, other| if other.0 > one.0 { other } else { one });
        best.unwrap_or((f64::NEG_INFINITY, 0.0, SETTLES_S[0]))
    };
    let any = likeliest(&of_support, N_SIZES, N_SIZES);
    let by_noise = likeliest(&of_support, BY_NOISE, N_SIZES);
    let bias = likeliest(&of_bias, N_SIZES, N_SIZES);
    let scatter = likeliest(&of_support, N_SIZES, 0).0;
    // An accelerometer that creeps turns its vertical alone.
    let creep = likeliest(&of_creep, 0, N_SIZES).0 - likeliest(&of_creep, 0, 0).0;
    let (apart, cost) = (scatter + creep, (SETTLES_S.len() as f64).ln());
    // Biases scatter by what noise explains unless more, or such an accelerometer, is certain beside a support.
    let (support, other) = if 2.0 * (any.0.max(apart) - by_noise.0) > certain {
        (any, scatter.max(apart - cost))
    } else {
        (by_noise, likeliest(&of_support, BY_NOISE, 0).0)
    };
    let score = |most: f64, other: f64| 2.0 * (most - other - cost);
    let seen: Vec<Option<Seen>> = (0..n).map(|i| seen(poses, i)).collect();
    let of_bias: f64 = seen.iter().flatten().map(|one| one.of_bias).sum();
    Ok(Some(Settling {
        score: score(support.0, other),
        of_bias: score(bias.0, any.0).min(2.0 * of_bias),
        motion: motions(poses, seen, support.1, support.2),
    }))
}

/// `None` where readings are missing, or have no noise.
fn parts(poses: &Poses<'_>, i: usize) -> Option<Parts> {
    let [first, last] = poses.spans[i];
    if last < first + 2 * N_BLOCKS {
        return None;
    }
    let n = (last - first) / N_BLOCKS;
    let means = |sensor: usize| -> [Vector3<f64>; N_BLOCKS] {
        std::array::from_fn(|block| {
            let start = first + block * n;
            poses.scale[sensor] * mean(&poses.readings[sensor][start..start + n])
        })
    };
    // Covariance of the mean of a part.
    let spread = |sensor: usize| {
        let noise = Vector3::from(poses.noise[sensor][i]);
        let own = poses.scale[sensor] * Matrix3::from_diagonal(&noise);
        own * own.transpose() * N_BLOCKS as f64
    };
    let up = Vector3::from(poses.up[i]);
    // A change of the force turns the vertical across it.
    let turning = -up.cross_matrix() / poses.gravity;
    let of_tilt = turning * spread(1) * turning.transpose();
    let (rates, forces) = (means(0), means(1));
    let is_known = rates
        .iter()
        .chain(&forces)
        .flatten()
        .all(|value| value.is_finite());
    let tilts = contrasts(&forces).map(|force| turning * force);
    let least = LEVEL * of_tilt.norm();
    let of_tilt = of_tilt.pseudo_inverse(least).ok()?;
    let of_rate = spread(0).try_inverse()?;
    let lasts = n as f64 * poses.step;
    is_known.then_some(Parts {
        rates,
        tilts,
        of_rate,
        of_tilt,
        lasts,
    })
}

/// Mean of the finite readings of every axis.
fn mean(readings: &[[f64; 3]]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let known = readings
            .iter()
            .map(|row| row[axis])
            .filter(|value| value.is_finite());
        let (sum, n) = known.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
        sum / n
    })
}

/// Orthonormal contrasts of the parts, zero for a constant (Helmert).
fn contrasts(of: &[Vector3<f64>; N_BLOCKS]) -> [Vector3<f64>; N_BLOCKS - 1] {
    std::array::from_fn(|row| {
        let k = (row + 1) as f64;
        let before: Vector3<f64> = of[..=row].iter().sum();
        (before - k * of[row + 1]) / (k * (k + 1.0)).sqrt()
    })
}

impl Sums {
    /// Shares of the rate and of the tilt that `moves`: 1 and 1 of a support, 0 of a sensor that does not settle.
    fn of(one: &Parts, tau: f64, moves: [f64; 2]) -> Self {
        let fades: [f64; N_BLOCKS] = std::array::from_fn(|block| {
            let begins = block as f64 * one.lasts;
            tau * ((-begins / tau).exp() - (-(begins + one.lasts) / tau).exp()) / one.lasts
        });
        let tilted = contrasts(&fades.map(|fade| Vector3::repeat(tau * (1.0 - fade))));
        let mut out = Self {
            information: Matrix6::zeros(),
            said: Vector6::zeros(),
            square: 0.0,
        };
        for (rate, fade) in one.rates.iter().zip(fades) {
            out.add(rate, &one.of_rate, [1.0, moves[0] * fade]);
        }
        for (tilt, share) in one.tilts.iter().zip(tilted) {
            out.add(tilt, &one.of_tilt, [0.0, moves[1] * share.x]);
        }
        out
    }

    /// A reading that consists of `shares` of scatter and settling, with the information on it.
    fn add(&mut self, reading: &Vector3<f64>, of_reading: &Matrix3<f64>, shares: [f64; 2]) {
        let said = of_reading * reading;
        self.square += reading.dot(&said);
        for i in 0..2 {
            let mut part = self.said.fixed_rows_mut::<3>(3 * i);
            part += shares[i] * said;
            for j in 0..2 {
                let mut block = self.information.fixed_view_mut::<3, 3>(3 * i, 3 * j);
                block += shares[i] * shares[j] * of_reading;
            }
        }
    }
}

/// Restricted log-likelihood of variances `p` of scatter and `q` of settling; the bias, which acts as scatter does, has a
/// flat prior.
fn log_likelihood(sums: &[Sums], p: f64, q: f64) -> f64 {
    let root = Vector6::new(p, p, p, q, q, q).map(f64::sqrt);
    let (mut normal, mut side, mut total) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for one in sums {
        // 1 + √P J √P = L Lᵀ for the prior P; the poses draw √P L⁻ᵀ L⁻¹ √P, given the readings.
        let outer = root * root.transpose();
        let wider = Matrix6::identity() + one.information.component_mul(&outer);
        let Some(half) = wider.cholesky() else {
            return f64::NEG_INFINITY;
        };
        let mut of_bias: Matrix6x3<f64> = one.information.fixed_columns::<3>(0).into();
        let mut said = one.said.component_mul(&root);
        normal += of_bias.fixed_rows::<3>(0);
        for mut column in of_bias.column_iter_mut() {
            column.component_mul_assign(&root);
        }
        let lower = half.l_dirty();
        lower.solve_lower_triangular_unchecked_mut(&mut of_bias);
        lower.solve_lower_triangular_unchecked_mut(&mut said);
        normal -= of_bias.tr_mul(&of_bias);
        side += one.said.fixed_rows::<3>(0) - of_bias.tr_mul(&said);
        total += 2.0 * lower.diagonal().product().ln() + one.square - said.norm_squared();
    }
    let fitted = normal
        .try_inverse()
        .map_or(0.0, |inverse| side.dot(&(inverse * side)));
    -0.5 * (total - fitted + normal.determinant().ln())
}
