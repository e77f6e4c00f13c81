//! The zero of a sensor from pose to pose: scatter, walk and drift as one Gaussian process, whitened in one pass.
//!
//! A reading is `y_k = x_kᵀθ + s(pose) + w(t_k) + d(t_k) + ε_k`: `s` is drawn anew in every pose, `w` a random walk, `d` an
//! integrated walk whose initial slope is random too, ε the error of the mean. Of a norm, which sees the zeros of three axes
//! along the vertical only, w and d are three independent processes each, seen along a direction of every reading. A
//! sequential filter gives `V^{-1/2}` of any columns in time linear in the readings: a likelihood costs microseconds.

use crate::error::{Error, Result};

/// Hidden states of one direction: walk, drift, slope of the drift, walk at the start of the stretch averaged.
const PART: usize = 4;
const WALK: usize = 0;
const DRIFT: usize = 1;
const SLOPE: usize = 2;
const START: usize = 3;

/// Readings in the order of time, with the columns that explain their mean.
#[derive(Debug, Clone)]
pub struct Readings {
    /// `n` rows of `columns` numbers: the reading, then its design row.
    pub rows: Vec<f64>,
    /// Numbers per row.
    pub columns: usize,
    /// Variance of every reading's own error.
    pub variance: Vec<f64>,
    /// Time of the middle of every reading, non-decreasing.
    pub time: Vec<f64>,
    /// How long every reading was averaged; what would overlap the reading before is left out.
    pub length: Vec<f64>,
    /// Directions, as many numbers a reading as there are independent walks and drifts (1 of a gyro's axis).
    pub direction: Vec<f64>,
    /// Pose of every reading; neighbours of one pose share its scatter.
    pub pose: Vec<i64>,
}

/// Strengths of the process.
#[derive(Debug, Clone, Copy)]
pub struct Strengths {
    /// Variance of the zero from pose to pose.
    pub scatter: f64,
    /// Variance that a walk gains per unit of time.
    pub walk: f64,
    /// Variance that the slope of the drift gains per unit of time.
    pub drift: f64,
    /// Variance of the slope at time zero.
    pub slope: f64,
    /// Factor on the variances of the readings' own errors.
    pub noise: f64,
}

/// What one choice of strengths makes of the readings.
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
            return Err(Error::bad_input("a zero process needs readings"));
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
        if self.direction.is_empty() || !self.direction.len().is_multiple_of(n) {
            return Err(Error::bad_input(
                "every reading needs the same number of directions",
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

    /// Lets time pass: d ← d + slope·dt, then the noise of walk and integrated walk over dt.
    fn step(&self, covariance: &mut [f64], state: &mut [f64], dt: f64, strengths: Strengths) {
        let c = self.columns;
        let states = state.len() / c;
        for first in (1..states).step_by(PART) {
            let (walk, drift, slope) = (first + WALK, first + DRIFT, first + SLOPE);
            for j in 0..c {
                state[drift * c + j] += dt * state[slope * c + j];
            }
            for column in 0..states {
                covariance[drift * states + column] += dt * covariance[slope * states + column];
            }
            for row in covariance.chunks_mut(states) {
                row[drift] += dt * row[slope];
            }
            covariance[walk * states + walk] += strengths.walk * dt;
            covariance[drift * states + drift] += strengths.drift * dt * dt * dt / 3.0;
            covariance[drift * states + slope] += strengths.drift * dt * dt / 2.0;
            covariance[slope * states + drift] += strengths.drift * dt * dt / 2.0;
            covariance[slope * states + slope] += strengths.drift * dt;
        }
    }

    /// `V^{-1/2}[y X]` summed into its Gram matrix (sequential Kalman filter; every column is filtered with the same gains).
    #[must_use]
    pub fn whitened(&self, strengths: Strengths) -> Whitened {
        let (c, parts) = (self.columns, self.direction.len() / self.time.len().max(1));
        let states = 1 + PART * parts;
        let mut covariance = vec![0.0_f64; states * states];
        covariance[0] = strengths.scatter;
        for part in 0..parts {
            let slope = 1 + PART * part + SLOPE;
            covariance[slope * states + slope] = strengths.slope;
        }
        let mut state = vec![0.0_f64; states * c];
        let mut innovation = vec![0.0_f64; c];
        let mut gain = vec![0.0_f64; states];
        let mut gram = vec![0.0_f64; c * c];
        let mut log_det = 0.0;
        let mut last = 0.0;
        for k in 0..self.time.len() {
            // A mean over a stretch of a walk is the mean of its ends, and less sure by a twelfth of what it walks there.
            let half = 0.5 * self.length[k];
            let before = if k > 0 {
                self.time[k] - self.time[k - 1] - 0.5 * last
            } else {
                half
            };
            let half = half.min(before.max(0.0));
            if k > 0 {
                self.step(&mut covariance, &mut state, before - half, strengths);
                if self.pose[k] != self.pose[k - 1] {
                    forget_scatter(&mut covariance, states, strengths.scatter);
                    state[..c].fill(0.0);
                }
            }
            remember_start(&mut covariance, &mut state, states, c);
            self.step(&mut covariance, &mut state, 2.0 * half, strengths);
            last = 2.0 * half;
            let direction = &self.direction[k * parts..(k + 1) * parts];
            // The reading is the scatter and, along every direction, walk and drift.
            for (g, row) in gain.iter_mut().zip(covariance.chunks(states)) {
                *g = seen(direction, half, row);
            }
            let along: f64 = direction.iter().map(|d| d * d).sum();
            let variance = seen(direction, half, &gain)
                + strengths.noise * self.variance[k]
                + along * strengths.walk * 2.0 * half / 12.0;
            log_det += variance.ln();
            let root = variance.sqrt();
            for j in 0..c {
                let mut predicted = state[j];
                for (part, along) in direction.iter().enumerate() {
                    let at = |which: usize| state[(1 + PART * part + which) * c + j];
                    predicted +=
                        along * (0.5 * (at(WALK) + at(START)) + at(DRIFT) - half * at(SLOPE));
                }
                innovation[j] = (self.rows[k * c + j] - predicted) / root;
            }
            for (s, g) in gain.iter().enumerate() {
                for j in 0..c {
                    state[s * c + j] += g / root * innovation[j];
                }
            }
            for a in 0..states {
                for b in 0..states {
                    covariance[a * states + b] -= gain[a] * gain[b] / variance;
                }
            }
            for a in 0..c {
                for b in 0..c {
                    gram[a * c + b] += innovation[a] * innovation[b];
                }
            }
        }
        Whitened { log_det, gram }
    }
}

/// Scatter plus, along every direction, the walk's mean over the stretch and the drift in its middle.
fn seen(direction: &[f64], half: f64, states: &[f64]) -> f64 {
    states[0]
        + direction
            .iter()
            .zip(states[1..].chunks(PART))
            .map(|(along, one)| {
                along * (0.5 * (one[WALK] + one[START]) + one[DRIFT] - half * one[SLOPE])
            })
            .sum::<f64>()
}

/// The walk as it is now becomes the start of the stretch.
fn remember_start(covariance: &mut [f64], state: &mut [f64], states: usize, c: usize) {
    for first in (1..states).step_by(PART) {
        let (walk, start) = (first + WALK, first + START);
        for column in 0..states {
            covariance[start * states + column] = covariance[walk * states + column];
        }
        for row in covariance.chunks_mut(states) {
            row[start] = row[walk];
        }
        for j in 0..c {
            state[start * c + j] = state[walk * c + j];
        }
    }
}

fn forget_scatter(covariance: &mut [f64], states: usize, scatter: f64) {
    for other in 0..states {
        covariance[other] = 0.0;
        covariance[other * states] = 0.0;
    }
    covariance[0] = scatter;
}
