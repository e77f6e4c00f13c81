//! Sample intervals of a move across which one sample is lost or too many, by how the curves on either side join.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::running::{running_maximum, running_median};

/// Samples on either side of an interval that one curve is fitted to.
pub const HALF: usize = 4;
/// Contrasts per channel that the fit of one curve to both sides leaves.
pub const FREE: usize = 2;
/// Weights of the contrasts, which are zero where the samples on both sides of an interval lie on one curve.
pub type Contrasts = [[f64; 2 * HALF]; FREE];

/// Limits for the detection of an interval that is one sample too long or too short.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Window, in intervals, of the median that is the ordinary misfit.
    pub nearby: usize,
    /// Misfit expected of one lost sample, in ordinary misfits, from which an interval is tested.
    pub sharp: f64,
    /// Least and greatest part of the expected misfit that a sample inserted or removed must explain.
    pub part: (f64, f64),
    /// Least and greatest shortfall of an interval that is too short, in intervals.
    pub whole: (f64, f64),
    /// Largest misfit that may remain, in ordinary misfits.
    pub left: f64,
    /// Largest misfit that may remain at a short interval, as a part of the misfit before.
    pub mirrored: f64,
}

/// The inner intervals of one move: where a lost sample is detectable, which are one sample too long, which too short.
#[derive(Debug, Clone, Default)]
pub struct Joints {
    /// A lost sample is detectable.
    pub is_sharp: Vec<bool>,
    /// One sample too long.
    pub is_long: Vec<bool>,
    /// One sample too short.
    pub is_short: Vec<bool>,
}

/// Joints of the readings `(n, channels)` of a move in units of their noise, row by row; `contrasts` are for the
/// samples unchanged, with one inserted and with one removed. `n - 2 HALF - 1` intervals.
///
/// # Errors
/// `BadInput` when the numbers do not make rows.
pub fn joints(
    readings: &[f64],
    channels: usize,
    contrasts: &[Contrasts; 3],
    limits: &Limits,
) -> Result<Joints> {
    if channels == 0 || !readings.len().is_multiple_of(channels) || limits.nearby == 0 {
        return Err(Error::bad_input(
            "readings of a move are rows of equal length",
        ));
    }
    let n = readings.len() / channels;
    let k = n.saturating_sub(2 * HALF + 1);
    if k == 0 {
        return Ok(Joints::default());
    }
    let jump: [f64; FREE] = std::array::from_fn(|i| contrasts[0][i][HALF..].iter().sum());
    let jump2: f64 = jump.iter().map(|j| j * j).sum();
    let seen: Vec<Seen> = (0..k)
        .map(|at| {
            Seen::at(
                &readings[at * channels..(at + 2 * HALF + 2) * channels],
                channels,
                contrasts,
                jump,
            )
        })
        .collect();
    let dof = (FREE * channels) as f64;
    let column = |value: fn(&Seen) -> f64| seen.iter().map(value).collect::<Vec<f64>>();
    let ordinary: Vec<f64> = running_median(&column(|s| s.zero), limits.nearby)
        .iter()
        .map(|m| (m / dof).max(1.0))
        .collect();
    let best = running_maximum(&column(|s| s.gain[0].max(s.gain[1])), HALF);
    let explained = running_maximum(&column(Seen::explained), HALF);
    let mut out = Joints::default();
    for (at, s) in seen.iter().enumerate() {
        let expected = jump2 * s.across2;
        let is_sharp = expected > limits.sharp * ordinary[at];
        let most = s.gain[0].max(s.gain[1]);
        let is_off = |gain: f64| {
            is_sharp
                && most >= best[at]
                && gain >= most
                && gain > limits.part.0 * expected
                && gain < limits.part.1 * expected
                && s.zero - gain < limits.left * dof * ordinary[at]
        };
        // An interval is too short also where its jump is less than the slope beside it, the mirror image of a long
        // one: a bend resembles either equally often.
        let short_by = -s.extra();
        let is_mirrored = s.power() > limits.sharp * ordinary[at]
            && s.explained() >= explained[at]
            && short_by > limits.whole.0
            && short_by < limits.whole.1
            && s.with_jump < limits.mirrored * s.zero + limits.left * dof * ordinary[at];
        out.is_sharp.push(is_sharp);
        out.is_long.push(is_off(s.gain[0]));
        out.is_short.push(is_off(s.gain[1]) || is_mirrored);
    }
    Ok(out)
}

/// Joints of all intervals of the moves `[first, last)`, one after the other; readings `(n, channels)` with noise
/// `(channels,)`; a reading that is not finite counts as zero.
///
/// # Errors
/// `BadInput` when the numbers do not make rows, or samples on either side of a move are missing.
pub fn joints_of_moves(
    readings: &[f64],
    noise: &[f64],
    moves: &[[usize; 2]],
    contrasts: &[Contrasts; 3],
    limits: &Limits,
) -> Result<Joints> {
    let channels = noise.len();
    let of_move = |&[first, last]: &[usize; 2]| {
        let from = first.checked_sub(HALF).map(|row| row * channels);
        let rows = from.and_then(|from| readings.get(from..(last + HALF + 1) * channels));
        let Some(rows) = rows else {
            return Err(Error::bad_input(format!(
                "a move needs {HALF} samples before it and {} behind",
                HALF + 1
            )));
        };
        let scaled = rows.iter().zip(noise.iter().cycle()).map(|(v, s)| v / s);
        let whole = scaled.map(|v| if v.is_finite() { v } else { 0.0 });
        joints(&whole.collect::<Vec<f64>>(), channels, contrasts, limits)
    };
    let found: Vec<Joints> = moves.par_iter().map(of_move).collect::<Result<_>>()?;
    let mut out = Joints::default();
    for one in found {
        out.is_sharp.extend(one.is_sharp);
        out.is_long.extend(one.is_long);
        out.is_short.extend(one.is_short);
    }
    Ok(out)
}

/// Sums over the channels at one interval.
#[derive(Clone, Copy, Default)]
struct Seen {
    /// Squared misfit of the readings unchanged.
    zero: f64,
    /// Decrease of that misfit by one sample inserted, and by one removed.
    gain: [f64; 2],
    /// Squared slope across the interval.
    across2: f64,
    /// Squares of a jump by the slope beside the interval, its product with the misfit, and the misfit with it.
    shape2: f64,
    product: f64,
    with_jump: f64,
}

impl Seen {
    fn at(rows: &[f64], channels: usize, contrasts: &[Contrasts; 3], jump: [f64; FREE]) -> Self {
        let mut out = Self::default();
        for c in 0..channels {
            let value = |row: usize| rows[row * channels + c];
            let misfit = |of: &Contrasts, i: usize| -> f64 {
                (0..2 * HALF).fold(0.0, |sum, j| sum + of[i][j] * value(1 + j))
            };
            let across = (value(HALF + 2) - value(HALF - 1)) / 3.0;
            let beside = (value(HALF) - value(HALF - 2) + value(HALF + 3) - value(HALF + 1)) / 4.0;
            out.across2 += across * across;
            for i in 0..FREE {
                let left = misfit(&contrasts[0], i);
                let shape = jump[i] * beside;
                out.zero += left * left;
                for (gain, of) in out.gain.iter_mut().zip(&contrasts[1..]) {
                    *gain -= misfit(of, i).powi(2);
                }
                out.shape2 += shape * shape;
                out.product += left * shape;
                out.with_jump += (left + shape).powi(2);
            }
        }
        out.gain = out.gain.map(|g| out.zero + g);
        out
    }

    fn power(&self) -> f64 {
        self.shape2.max(1e-300)
    }

    fn extra(&self) -> f64 {
        self.product / self.power()
    }

    fn explained(&self) -> f64 {
        self.extra().powi(2) * self.power()
    }
}
