//! Bias from pose to pose: scatter, random walk and drift as one Gaussian process, whitened in one pass.
//!
//! A reading is `y_k = x_kᵀθ + s(pose) + w(t_k) + d(t_k) + ε_k`: `s` (bias repeatability) is drawn anew per pose, `w`
//! is a random walk, `d` an integrated walk with a random initial slope, ε the error of the mean. A norm contains only
//! the biases along the vertical: w and d are then three independent processes each, along a direction given per
//! reading. A sequential filter applies `V^{-1/2}` in time linear in the readings: a likelihood costs microseconds.

use crate::error::{Error, Result};
use crate::simd::{Instructions, for_each_instruction_set};

/// States per direction: walk, drift, slope of the drift, walk at the start of the averaging interval.
const PART: usize = 4;
const WALK: usize = 0;
const DRIFT: usize = 1;
const SLOPE: usize = 2;
const START: usize = 3;

/// Readings in time order, with the regressors of their mean.
#[derive(Debug, Clone)]
pub struct Readings {
    /// `n` rows of `columns` numbers: the reading, then its design row.
    pub rows: Vec<f64>,
    /// Numbers per row.
    pub columns: usize,
    /// Variance of the error of every reading.
    pub variance: Vec<f64>,
    /// Time of the middle of every reading, non-decreasing.
    pub time: Vec<f64>,
    /// Averaging time of every reading; the part that would overlap the reading before is not counted.
    pub length: Vec<f64>,
    /// Directions: one number per reading and independent walk and drift (1 for one axis of a gyro).
    pub direction: Vec<f64>,
    /// Pose of every reading; consecutive readings of one pose share its scatter.
    pub pose: Vec<i64>,
}

/// Noise strengths of the process.
#[derive(Debug, Clone, Copy)]
pub struct Strengths {
    /// Variance of the bias from pose to pose.
    pub scatter: f64,
    /// Variance that the random walk gains per unit of time.
    pub walk: f64,
    /// Variance that the slope of the drift gains per unit of time.
    pub drift: f64,
    /// Variance of the slope at time zero.
    pub slope: f64,
    /// Factor on the error variances of the readings.
    pub noise: f64,
}

/// Terms of the likelihood at given strengths.
#[derive(Debug, Clone)]
pub struct Whitened {
    /// Log-determinant of the covariance V.
    pub log_det: f64,
    /// `[y X]ᵀ V⁻¹ [y X]`, row by row.
    pub gram: Vec<f64>,
}

impl Readings {
    /// Checks lengths, order and signs.
    ///
    /// # Errors
    /// When lengths disagree, times run backwards, a variance is not positive, or a number is not finite.
    pub fn check(&self) -> Result<()> {
        let n = self.time.len();
        if n == 0 || self.columns == 0 {
            return Err(Error::bad_input("a bias process needs readings"));
        }
        if self.rows.len() != n * self.columns
            || self.variance.len() != n
            || self.pose.len() != n
            || self.length.len() != n
        {
            return Err(Error::bad_input(format!(
                "{n} times, but {} variances, {} poses and {} numbers in {} columns",
                self.variance.len(),
                self.pose.len(),
                self.rows.len(),
                self.columns
            )));
        }
        let directions = self.direction.len() / n;
        if !(1..=3).contains(&directions) || !self.direction.len().is_multiple_of(n) {
            return Err(Error::bad_input(
                "every reading needs the same number of directions, one to three",
            ));
        }
        if self
            .rows
            .iter()
            .chain(&self.time)
            .chain(&self.direction)
            .any(|value| !value.is_finite())
        {
            return Err(Error::bad_input(
                "readings, design and times must be finite",
            ));
        }
        if self.length.iter().any(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(Error::bad_input("lengths of averages must not be negative"));
        }
        if self.variance.iter().any(|v| !(v.is_finite() && *v > 0.0)) {
            return Err(Error::bad_input(
                "variances of the readings must be positive",
            ));
        }
        if self.time.windows(2).any(|pair| pair[1] < pair[0]) {
            return Err(Error::bad_input("readings must be in the order of time"));
        }
        Ok(())
    }

    /// Gram matrix of `V^{-1/2}[y X]` by a sequential Kalman filter; every column is filtered with the same gains.
    #[must_use]
    pub fn whitened(&self, strengths: Strengths) -> Whitened {
        let instructions = Instructions::detect();
        // Sizes known to the compiler: most of the cost is in the loops over states.
        match self.direction.len() / self.time.len().max(1) {
            1 => along_one(instructions, self, strengths),
            2 => along_two(instructions, self, strengths),
            _ => along_three(instructions, self, strengths),
        }
    }

    #[inline(always)]
    #[expect(
        clippy::inline_always,
        reason = "it takes the instructions of its caller"
    )]
    fn filtered<const S: usize>(&self, strengths: Strengths) -> Whitened {
        let (c, parts) = (self.columns, (S - 1) / PART);
        let mut covariance = [[0.0_f64; S]; S];
        covariance[0][0] = strengths.scatter;
        for part in 0..parts {
            let slope = 1 + PART * part + SLOPE;
            covariance[slope][slope] = strengths.slope;
        }
        let mut state = vec![0.0_f64; S * c];
        let mut innovation = vec![0.0_f64; c];
        let mut gram = vec![0.0_f64; c * c];
        let mut log_det = 0.0;
        let mut last = 0.0;
        for k in 0..self.time.len() {
            // The mean of a walk over an interval: the mean of its ends, plus a twelfth of the variance gained there.
            let half = 0.5 * self.length[k];
            let before = if k > 0 {
                self.time[k] - self.time[k - 1] - 0.5 * last
            } else {
                half
            };
            let half = half.min(before.max(0.0));
            if k > 0 {
                step(&mut covariance, &mut state, c, before - half, strengths);
                if self.pose[k] != self.pose[k - 1] {
                    forget_scatter(&mut covariance, strengths.scatter);
                    state[..c].fill(0.0);
                }
            }
            remember_start(&mut covariance, &mut state, c);
            step(&mut covariance, &mut state, c, 2.0 * half, strengths);
            last = 2.0 * half;
            let direction = &self.direction[k * parts..(k + 1) * parts];
            // The reading is the scatter plus walk and drift along every direction.
            let gain: [f64; S] = std::array::from_fn(|s| seen(direction, half, &covariance[s]));
            let along: f64 = direction.iter().map(|d| d * d).sum();
            let variance = seen(direction, half, &gain)
                + strengths.noise * self.variance[k]
                + along * strengths.walk * 2.0 * half / 12.0;
            log_det += variance.ln();
            let inverse_root = variance.sqrt().recip();
            innovation.copy_from_slice(&self.rows[k * c..(k + 1) * c]);
            let mut take = |row: usize, factor: f64| {
                let values = &state[row * c..(row + 1) * c];
                for (left, value) in innovation.iter_mut().zip(values) {
                    *left -= factor * value;
                }
            };
            take(0, 1.0);
            for (part, along) in direction.iter().enumerate() {
                let first = 1 + PART * part;
                take(first + WALK, 0.5 * along);
                take(first + START, 0.5 * along);
                take(first + DRIFT, *along);
                take(first + SLOPE, -half * along);
            }
            for value in &mut innovation {
                *value *= inverse_root;
            }
            for (row, g) in state.chunks_exact_mut(c).zip(&gain) {
                let factor = g * inverse_root;
                for (value, seen) in row.iter_mut().zip(&innovation) {
                    *value += factor * seen;
                }
            }
            let inverse = variance.recip();
            for (row, a) in covariance.iter_mut().zip(&gain) {
                for (value, b) in row.iter_mut().zip(&gain) {
                    *value -= a * b * inverse;
                }
            }
            for (row, a) in gram.chunks_exact_mut(c).zip(&innovation) {
                for (value, b) in row.iter_mut().zip(&innovation) {
                    *value += a * b;
                }
            }
        }
        Whitened { log_det, gram }
    }
}

for_each_instruction_set! {
    fn along_one(readings: &Readings, strengths: Strengths) -> Whitened = filtered_along_one
}

for_each_instruction_set! {
    fn along_two(readings: &Readings, strengths: Strengths) -> Whitened = filtered_along_two
}

for_each_instruction_set! {
    fn along_three(readings: &Readings, strengths: Strengths) -> Whitened = filtered_along_three
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn filtered_along_one<const FUSED: bool>(readings: &Readings, strengths: Strengths) -> Whitened {
    readings.filtered::<{ 1 + PART }>(strengths)
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn filtered_along_two<const FUSED: bool>(readings: &Readings, strengths: Strengths) -> Whitened {
    readings.filtered::<{ 1 + 2 * PART }>(strengths)
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn filtered_along_three<const FUSED: bool>(readings: &Readings, strengths: Strengths) -> Whitened {
    readings.filtered::<{ 1 + 3 * PART }>(strengths)
}

/// Propagates by dt: d ← d + slope·dt, then the noise of walk and integrated walk over dt.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn step<const S: usize>(
    covariance: &mut [[f64; S]; S],
    state: &mut [f64],
    c: usize,
    dt: f64,
    strengths: Strengths,
) {
    for first in (1..S).step_by(PART) {
        let (walk, drift, slope) = (first + WALK, first + DRIFT, first + SLOPE);
        for j in 0..c {
            state[drift * c + j] += dt * state[slope * c + j];
        }
        for column in 0..S {
            covariance[drift][column] += dt * covariance[slope][column];
        }
        for row in covariance.iter_mut() {
            row[drift] += dt * row[slope];
        }
        covariance[walk][walk] += strengths.walk * dt;
        covariance[drift][drift] += strengths.drift * dt * dt * dt / 3.0;
        covariance[drift][slope] += strengths.drift * dt * dt / 2.0;
        covariance[slope][drift] += strengths.drift * dt * dt / 2.0;
        covariance[slope][slope] += strengths.drift * dt;
    }
}

/// Scatter plus, along every direction, the walk's mean over the averaging interval and the drift at its middle.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn seen<const S: usize>(direction: &[f64], half: f64, states: &[f64; S]) -> f64 {
    states[0]
        + direction
            .iter()
            .zip(states[1..].as_chunks::<PART>().0)
            .map(|(along, one)| {
                along * (0.5 * (one[WALK] + one[START]) + one[DRIFT] - half * one[SLOPE])
            })
            .sum::<f64>()
}

/// Copies the walk to the state that holds it at the start of the averaging interval.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn remember_start<const S: usize>(covariance: &mut [[f64; S]; S], state: &mut [f64], c: usize) {
    for first in (1..S).step_by(PART) {
        let (walk, start) = (first + WALK, first + START);
        covariance[start] = covariance[walk];
        for row in covariance.iter_mut() {
            row[start] = row[walk];
        }
        state.copy_within(walk * c..(walk + 1) * c, start * c);
    }
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn forget_scatter<const S: usize>(covariance: &mut [[f64; S]; S], scatter: f64) {
    covariance[0] = [0.0; S];
    for row in covariance.iter_mut() {
        row[0] = 0.0;
    }
    covariance[0][0] = scatter;
}
