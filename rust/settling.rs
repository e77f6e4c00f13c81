//! Static rates caused by motion: a soft support rotates the sensor, and gravity shows it (docs/diagnosis-method.md,
//! 8.7d).

use nalgebra::{Matrix3, RowVector3, SVector, Vector3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::order_statistics::median;

/// Parts of a pose whose means separate a rate that decays from a constant one.
const N_BLOCKS: usize = 6;
/// Time constants of supports, s: foam and skin, not the hours of a glue.
const SETTLES_S: [f64; 4] = [0.7, 1.4, 2.8, 5.6];
/// Values tried for scatter and settling besides 0, in rms error of the readings: a quarter of an LSB is 10 %.
const N_SIZES: usize = 31;
const SMALLEST: f64 = 0.1;
const LARGEST: f64 = 1e4;

/// Readings of the six parts, then five contrasts of the tilt.
type Row = SVector<f64, { 2 * N_BLOCKS - 1 }>;

/// Static poses of a session: readings about their means, and the noise of the means, raw.
#[derive(Debug, Clone, Copy)]
pub struct Poses<'a> {
    /// Readings of the gyro and of the accelerometer.
    pub readings: [&'a [[f64; 3]]; 2],
    /// SI per raw unit of both.
    pub scale: [Matrix3<f64>; 2],
    /// Standard errors of the means of every pose, of both.
    pub noise: [&'a [[f64; 3]]; 2],
    /// Vertical in the body.
    pub up: &'a [[f64; 3]],
    /// Ranges of the samples.
    pub spans: &'a [[usize; 2]],
    /// Gravity, m/s².
    pub gravity: f64,
    /// Sample interval, s.
    pub step: f64,
}

/// Settling beside scatter.
#[derive(Debug, Clone, Copy)]
pub struct Settling {
    /// Twice the log-likelihood that it gains, less the cost of the time constants tried.
    pub score: f64,
    /// Standard deviation of the settling rate at the start of poses, rad/s.
    pub rate: f64,
    /// Time constant, s.
    pub tau: f64,
}

/// One direction of a pose, the vertical or a level one.
struct Direction {
    axis: Vector3<f64>,
    y: Row,
    /// Noise of a part's rate, and of a contrast of the tilt: infinite about the vertical.
    error: f64,
    tilt: f64,
    /// Duration of a part, s.
    lasts: f64,
}

/// Settling against scatter in the rates of the poses: w = z + s + k exp(-t/τ), tilt k τ (1 - exp(-t/τ)).
///
/// `s` and `k` are drawn anew in every pose, with one variance for all axes. The accelerometer shows the part of `k`
/// across the vertical, the shape in time all of it. One bias `z` for the session, restricted likelihood. `None` with
/// fewer poses than `fewest`.
///
/// # Errors
/// `BadInput` when lengths differ.
pub fn settling(poses: &Poses<'_>, fewest: usize) -> Result<Option<Settling>> {
    let n = poses.spans.len();
    if poses.up.len() != n || poses.noise.iter().any(|one| one.len() != n) {
        return Err(Error::bad_input("every pose has a vertical and noise"));
    }
    let which =
        (0..poses.spans.len()).filter(|&i| poses.spans[i][1] - poses.spans[i][0] >= 2 * N_BLOCKS);
    let all: Vec<Direction> = which.flat_map(|i| directions(poses, i)).collect();
    if all.len() < 3 * fewest {
        return Ok(None);
    }
    let mut errors: Vec<f64> = all.iter().map(|one| one.error).collect();
    let unit = median(&mut errors) / (N_BLOCKS as f64).sqrt();
    let size =
        |k: usize| SMALLEST * (LARGEST / SMALLEST).powf((k - 1) as f64 / (N_SIZES - 1) as f64);
    let variance = |k: usize| {
        if k == 0 {
            0.0
        } else {
            (unit * size(k)).powi(2)
        }
    };
    let tables: Vec<(f64, Vec<Sums>)> = SETTLES_S
        .iter()
        .map(|&tau| (tau, all.iter().map(|one| Sums::of(one, tau)).collect()))
        .collect();
    let of_scatter = |a: usize| log_likelihood(&tables[0].1, &all, variance(a), 0.0);
    let scatter = (0..=N_SIZES)
        .map(of_scatter)
        .fold(f64::NEG_INFINITY, f64::max);
    let pairs: Vec<(usize, usize, usize)> = (0..SETTLES_S.len())
        .flat_map(|t| (0..=N_SIZES).flat_map(move |a| (0..=N_SIZES).map(move |b| (t, a, b))))
        .collect();
    let found = pairs.par_iter().map(|&(t, a, b)| {
        let value = log_likelihood(&tables[t].1, &all, variance(a), variance(b));
        (value, variance(b).sqrt(), tables[t].0)
    });
    let best = found.reduce_with(|one, other| if other.0 > one.0 { other } else { one });
    Ok(best.map(|(most, rate, tau)| {
        let score = 2.0 * (most - scatter - (SETTLES_S.len() as f64).ln());
        Settling { score, rate, tau }
    }))
}

fn directions(poses: &Poses<'_>, i: usize) -> [Direction; 3] {
    let [first, last] = poses.spans[i];
    let n = (last - first) / N_BLOCKS;
    let part = |sensor: usize, block: usize| -> Vector3<f64> {
        let start = first + block * n;
        poses.scale[sensor] * mean(&poses.readings[sensor][start..start + n])
    };
    let up = Vector3::from(poses.up[i]);
    let level = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
    let axes = [up, level, up.cross(&level)];
    let middle = (0..N_BLOCKS)
        .map(|block| part(1, block))
        .sum::<Vector3<f64>>()
        / N_BLOCKS as f64;
    // Rotation of the vertical since the mean of the pose, across it.
    let turned: [Vector3<f64>; N_BLOCKS] =
        std::array::from_fn(|block| (part(1, block) - middle).cross(&up) / poses.gravity);
    let spread = |row: RowVector3<f64>, sensor: usize| {
        let of = row
            .transpose()
            .component_mul(&Vector3::from(poses.noise[sensor][i]));
        (of.norm_squared() * N_BLOCKS as f64).sqrt()
    };
    std::array::from_fn(|k| {
        let axis = axes[k];
        let error = spread(axis.transpose() * poses.scale[0], 0);
        // A tilt changes the force along the other level axis; its white noise is that of the quiet floor.
        let across = axis.cross(&up).transpose() * poses.scale[1];
        let tilt = if k == 0 {
            f64::INFINITY
        } else {
            spread(across, 1) / poses.gravity
        };
        let contrast = contrasts(std::array::from_fn(|block| turned[block].dot(&axis)));
        let y = Row::from_fn(|j, _| match j.checked_sub(N_BLOCKS) {
            None => part(0, j).dot(&axis) / error,
            Some(contrasted) => contrast[contrasted] / tilt,
        });
        let lasts = n as f64 * poses.step;
        Direction {
            axis,
            y,
            error,
            tilt,
            lasts,
        }
    })
}

/// Mean of the finite readings of every axis.
fn mean(readings: &[[f64; 3]]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let known: Vec<f64> = readings
            .iter()
            .map(|row| row[axis])
            .filter(|value| value.is_finite())
            .collect();
        known.iter().sum::<f64>() / known.len() as f64
    })
}

/// Orthonormal contrasts of the means of the parts (Helmert).
fn contrasts(of: [f64; N_BLOCKS]) -> [f64; N_BLOCKS - 1] {
    std::array::from_fn(|row| {
        let k = (row + 1) as f64;
        let before: f64 = of[..=row].iter().sum();
        (before - k * of[row + 1]) / (k * (k + 1.0)).sqrt()
    })
}

/// Products of the columns of scatter `a` and settling `b` with one another and with the readings `y`.
struct Sums {
    aa: f64,
    ab: f64,
    bb: f64,
    ay: f64,
    by: f64,
    yy: f64,
}

impl Sums {
    fn of(one: &Direction, tau: f64) -> Self {
        let fades: [f64; N_BLOCKS] = std::array::from_fn(|block| {
            let begins = block as f64 * one.lasts;
            tau * ((-begins / tau).exp() - (-(begins + one.lasts) / tau).exp()) / one.lasts
        });
        let tilted = contrasts(fades.map(|fade| tau * (1.0 - fade)));
        let a = Row::from_fn(|j, _| if j < N_BLOCKS { 1.0 / one.error } else { 0.0 });
        let b = Row::from_fn(|j, _| match j.checked_sub(N_BLOCKS) {
            None => fades[j] / one.error,
            Some(contrasted) => tilted[contrasted] / one.tilt,
        });
        let (y, by) = (&one.y, b.dot(&one.y));
        Self {
            aa: a.dot(&a),
            ab: a.dot(&b),
            bb: b.dot(&b),
            ay: a.dot(y),
            by,
            yy: y.dot(y),
        }
    }
}

/// Restricted log-likelihood of variances `p` of scatter and `q` of settling; the bias has a flat prior.
fn log_likelihood(sums: &[Sums], directions: &[Direction], p: f64, q: f64) -> f64 {
    let (mut normal, mut side) = (Matrix3::zeros(), Vector3::zeros());
    let mut total = 0.0;
    for (s, one) in sums.iter().zip(directions) {
        // (I + V G)⁻¹ V of two columns, in closed form.
        let det = (1.0 + p * s.aa) * (1.0 + q * s.bb) - p * q * s.ab * s.ab;
        let (m00, m11) = (p * (1.0 + q * s.bb) / det, q * (1.0 + p * s.aa) / det);
        let m01 = -p * q * s.ab / det;
        let aa = s.aa - (m00 * s.aa * s.aa + 2.0 * m01 * s.aa * s.ab + m11 * s.ab * s.ab);
        let ay = s.ay - (m00 * s.aa * s.ay + m01 * (s.aa * s.by + s.ab * s.ay) + m11 * s.ab * s.by);
        let yy = s.yy - (m00 * s.ay * s.ay + 2.0 * m01 * s.ay * s.by + m11 * s.by * s.by);
        normal += aa * one.axis * one.axis.transpose();
        side += ay * one.axis;
        total += det.ln() + yy;
    }
    let fitted = normal
        .try_inverse()
        .map_or(0.0, |inverse| side.dot(&(inverse * side)));
    -0.5 * (total - fitted + normal.determinant().ln())
}
