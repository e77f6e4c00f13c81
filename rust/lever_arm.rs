//! The arm from the centre of rotation to an accelerometer, from the moves of hands (docs/diagnosis-method.md, 8.17a).
//!
//! The travel of the hand is an unknown, mostly slow acceleration. Its covariance in time, in the frame at each move's
//! start, is estimated from all moves, so that motion which hands do little of has most weight.

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};
use rayon::prelude::*;

use crate::chi_square::beta::f_above;
use crate::error::{Error, Result};
use crate::move_signals::derivative;
use crate::order_statistics::{median, quantile};
use crate::running::rolling_mean;

/// Polynomials of time per move. The travel of a hand is made of slow ones: of five simulated hands with arms of 2 to
/// 3 cm none is detected at 1e-5 with equal weights of the samples, one with 10 polynomials, three with 24.
const N_SHAPES: usize = 24;
/// Readings per polynomial in a short move, a fifth being shorter; a move with fewer readings is excluded, as its
/// polynomials are not independent.
const SAMPLES_PER_SHAPE: usize = 3;
const SHORT: f64 = 0.2;
const FEWEST_PER_SHAPE: usize = 2;
/// Share of the mean variance added to each polynomial's: a 24 by 24 covariance comes from as few as 18 curves. The
/// second gives nearly equal weights, better for few moves with long arms; p is doubled for the choice.
const SHRUNK: [f64; 2] = [0.02, 100.0];
/// Iterations from unit weights, and from the full fit without one group of moves.
const N_WEIGHINGS: usize = 6;
const N_AGAIN: usize = 3;
/// Largest number of jackknife groups: beyond it the relative error of the uncertainty (a ninth) hardly falls, and the
/// run time stays linear in the moves.
const MOST_GROUPS: usize = 40;
/// In medians: a move's misfit counts as at least this, so that its weight is at most twice the median one.
const QUIETEST: f64 = 0.5;
/// Condition number above which a component of the arm changes the readings a thousand times less than another.
const TOO_FLAT: f64 = 1e6;
/// Eigenvalue of the normal equations, of the largest, below which a direction keeps 0: rotations about the vertical
/// alone do not determine the delay.
const NEGLIGIBLE: f64 = 1e-12;
/// Window of the running mean of both sides of the comparison, s: angular acceleration is a difference of noisy rates.
const SMOOTHED: f64 = 0.05;
/// An arm, and a delay between the sensors beside it: turning gravity would imitate an arm.
const UNKNOWNS: usize = 4;
type Value = SVector<f64, UNKNOWNS>;

/// Samples of the moves.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// Time of each sample.
    pub time: &'a [f64],
    /// Angular rate.
    pub rate: &'a [[f64; 3]],
    /// Specific force.
    pub force: &'a [[f64; 3]],
    /// Minus gravity in the body.
    pub gravity: &'a [[f64; 3]],
    /// Rotation since the move began.
    pub attitude: &'a [Matrix3<f64>],
    /// Half-open ranges of the moves.
    pub moves: &'a [[usize; 2]],
    /// Samples per second.
    pub rate_hz: f64,
}

/// The arm, and what it explains.
#[derive(Debug, Clone, Copy)]
pub struct Arm {
    /// The arm.
    pub value: Vector3<f64>,
    /// Its jackknife covariance.
    pub covariance: Matrix3<f64>,
    /// Hotelling's p-value.
    pub p_value: f64,
    /// Weighted mean squares of the moves' curves, and of what is left of each with an arm fitted without it.
    pub mean_squares: [f64; 2],
    /// Moves used.
    pub n_moves: usize,
}

/// One move as polynomials of time, in the frame at its start: force without gravity `(shapes, 3)`, and its derivatives
/// by the arm along each axis and by the delay.
#[derive(Clone)]
struct Move {
    target: DMatrix<f64>,
    columns: [DMatrix<f64>; UNKNOWNS],
}

impl Move {
    fn left(&self, value: &Value) -> DMatrix<f64> {
        let parts = self.columns.iter().zip(value.iter());
        parts.fold(self.target.clone(), |left, (column, value)| {
            left - column * *value
        })
    }
}

/// One least-squares answer: the matrix that whitens curves, the weights of the moves.
struct Weighed {
    value: Value,
    white: DMatrix<f64>,
    weight: Vec<f64>,
}

impl Weighed {
    fn square(&self, curves: &DMatrix<f64>) -> f64 {
        (&self.white * curves).norm_squared()
    }
}

/// The arm that explains most, by the likelier of two metrics; `None` where too few moves, `fewest`, or their rotations
/// do not determine one.
///
/// # Errors
/// `BadInput` when lengths differ.
pub fn arm(motion: &Motion<'_>, fewest: usize) -> Result<Option<Arm>> {
    let n = motion.time.len();
    let lengths = [
        motion.rate.len(),
        motion.force.len(),
        motion.gravity.len(),
        motion.attitude.len(),
    ];
    if lengths.iter().any(|&one| one != n) || motion.moves.iter().any(|&[a, b]| a > b || b > n) {
        return Err(Error::bad_input("moves are ranges of the samples"));
    }
    let moves = written(motion);
    let mut flat = Matrix3::zeros();
    for one in &moves {
        flat += Matrix3::from_fn(|i, j| one.columns[i].dot(&one.columns[j]));
    }
    let size = flat.symmetric_eigenvalues();
    if moves.len() < fewest || size.max() > TOO_FLAT * size.min() {
        return Ok(None);
    }
    let fits = SHRUNK.iter().filter_map(|&shrunk| fitted(&moves, shrunk));
    let best = fits.reduce(|a, b| if b.p_value < a.p_value { b } else { a });
    Ok(best.map(|one| Arm {
        p_value: SHRUNK.len() as f64 * one.p_value,
        ..one
    }))
}

fn written(motion: &Motion<'_>) -> Vec<Move> {
    let mut lengths: Vec<f64> = motion.moves.iter().map(|[a, b]| (b - a) as f64).collect();
    let short = quantile(&mut lengths, SHORT);
    let fits = |n: usize| (n * SAMPLES_PER_SHAPE) as f64 <= short;
    let n_shapes = (1..=N_SHAPES).rev().find(|&n| fits(n)).unwrap_or(1);
    let long = motion
        .moves
        .par_iter()
        .filter(|[a, b]| b - a >= FEWEST_PER_SHAPE * n_shapes);
    long.map(|&[a, b]| written_move(motion, a..b, n_shapes))
        .collect()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of samples"
)]
fn written_move(motion: &Motion<'_>, at: std::ops::Range<usize>, n_shapes: usize) -> Move {
    let width = (SMOOTHED * motion.rate_hz).round_ties_even() as usize | 1;
    let smooth = |values: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let flat = rolling_mean(values[at.clone()].as_flattened(), 3, width);
        flat.as_chunks::<3>().0.to_vec()
    };
    let (rate, force, gravity) = (
        smooth(motion.rate),
        smooth(motion.force),
        smooth(motion.gravity),
    );
    let n = at.len();
    let turning = derivative(&motion.time[at.clone()], &rate, &[[0, n]]);
    let shapes = shapes(&motion.time[at.clone()], n_shapes);
    let mut target = DMatrix::zeros(n_shapes, 3);
    let mut columns = std::array::from_fn(|_| DMatrix::zeros(n_shapes, 3));
    for k in 0..n {
        let begun = motion.attitude[at.start + k].transpose();
        let (w, a) = (Vector3::from(rate[k]), Vector3::from(turning[k]));
        let down = Vector3::from(gravity[k]);
        // α × r + ω × (ω × r) as a matrix on r; a delay changes gravity by d/dt of -g, which is -ω × (-g).
        let spin = w.cross_matrix();
        let made = begun * (a.cross_matrix() + spin * spin);
        let late = begun * -w.cross(&down);
        let left = begun * (Vector3::from(force[k]) - down);
        for shape in 0..n_shapes {
            let weight = shapes[(k, shape)];
            for axis in 0..3 {
                target[(shape, axis)] += weight * left[axis];
                for arm in 0..3 {
                    columns[arm][(shape, axis)] += weight * made[(axis, arm)];
                }
                columns[3][(shape, axis)] += weight * late[axis];
            }
        }
    }
    Move { target, columns }
}

/// `(n, count)` Legendre polynomials over the time of a move, of mean square 1, times the weight of each sample.
fn shapes(time: &[f64], count: usize) -> DMatrix<f64> {
    let n = time.len();
    let place = |k: usize| 2.0 * (time[k] - time[0]) / (time[n - 1] - time[0]) - 1.0;
    let mut out = DMatrix::zeros(n, count);
    for k in 0..n {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(n - 1));
        let weight = 0.5 * (place(after) - place(before)) / (after - before) as f64;
        let (x, mut last, mut now) = (place(k), 0.0, 1.0);
        for degree in 0..count {
            let m = degree as f64;
            out[(k, degree)] = weight * (2.0 * m + 1.0).sqrt() * now;
            (last, now) = (now, ((2.0 * m + 1.0) * x * now - m * last) / (m + 1.0));
        }
    }
    out
}

/// `n` iterations of the weighted least squares, each with covariance and weights from the last residuals.
fn weighed(moves: &[&Move], mut by: Weighed, shrunk: f64, n: usize) -> Option<Weighed> {
    let n_shapes = by.white.nrows();
    for _ in 0..n {
        let left: Vec<DMatrix<f64>> = moves.iter().map(|one| one.left(&by.value)).collect();
        let mut covariance = DMatrix::zeros(n_shapes, n_shapes);
        for (one, weight) in left.iter().zip(&by.weight) {
            covariance += one * one.transpose() * (weight / (3 * moves.len()) as f64);
        }
        let least = shrunk * covariance.trace() / n_shapes as f64;
        let root = (covariance + DMatrix::identity(n_shapes, n_shapes) * least)
            .cholesky()?
            .unpack();
        by.white = root.try_inverse()?;
        let squares: Vec<f64> = left.iter().map(|one| by.square(one)).collect();
        let usual = QUIETEST * median(&mut squares.clone());
        by.weight = squares
            .iter()
            .map(|square| 1.0 / square.max(usual))
            .collect();
        let mean = by.weight.iter().sum::<f64>() / moves.len() as f64;
        by.weight.iter_mut().for_each(|weight| *weight /= mean);
        by.value = solved(moves, &by);
    }
    Some(by)
}

fn solved(moves: &[&Move], by: &Weighed) -> Value {
    let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    let mut side = Value::zeros();
    for (one, weight) in moves.iter().zip(&by.weight) {
        let columns: Vec<DMatrix<f64>> = one
            .columns
            .iter()
            .map(|column| &by.white * column)
            .collect();
        let target = &by.white * &one.target;
        normal += SMatrix::from_fn(|i, j| weight * columns[i].dot(&columns[j]));
        side += Value::from_fn(|i, _| weight * columns[i].dot(&target));
    }
    let eigen = normal.symmetric_eigen();
    let least = NEGLIGIBLE * eigen.eigenvalues.max();
    let inverse = eigen
        .eigenvalues
        .map(|value| if value > least { 1.0 / value } else { 0.0 });
    eigen.eigenvectors * (eigen.eigenvectors.transpose() * side).component_mul(&inverse)
}

/// The arm with its jackknife covariance: each move (or group of moves) is left out in turn, covariance and weights are
/// estimated again without it. A single move that determines the arm, or the noise in which it is significant, so widens
/// the covariance.
fn fitted(moves: &[Move], shrunk: f64) -> Option<Arm> {
    let all: Vec<&Move> = moves.iter().collect();
    let n_shapes = moves[0].target.nrows();
    let white = DMatrix::identity(n_shapes, n_shapes);
    let start = Weighed {
        value: Value::zeros(),
        white,
        weight: vec![1.0; moves.len()],
    };
    let whole = weighed(&all, start, shrunk, N_WEIGHINGS)?;
    let groups = moves.len().min(MOST_GROUPS);
    let without = |group: usize| {
        let others: Vec<usize> = (0..moves.len()).filter(|k| k % groups != group).collect();
        let few: Vec<&Move> = others.iter().map(|&k| &moves[k]).collect();
        let weight = others.iter().map(|&k| whole.weight[k]).collect();
        let start = Weighed {
            value: whole.value,
            white: whole.white.clone(),
            weight,
        };
        weighed(&few, start, shrunk, N_AGAIN).map(|one| one.value)
    };
    let values: Vec<Value> = (0..groups)
        .into_par_iter()
        .map(without)
        .collect::<Option<_>>()?;
    let g = groups as f64;
    let value: Vector3<f64> = whole.value.fixed_rows::<3>(0).into();
    let mut covariance = Matrix3::zeros();
    for one in &values {
        let away = one.fixed_rows::<3>(0) - value;
        covariance += away * away.transpose() * ((g - 1.0) / (g - 3.0));
    }
    let wald = value.dot(&(covariance.try_inverse()? * value)) / 3.0 * (g - 3.0) / (g - 1.0);
    let mut mean_squares = [0.0; 2];
    for (k, (one, weight)) in moves.iter().zip(&whole.weight).enumerate() {
        let left = one.left(&values[k % groups]);
        mean_squares[0] += weight * whole.square(&one.target);
        mean_squares[1] += weight * whole.square(&left);
    }
    // Over polynomials and moves, with the same weights before and after.
    let scale = 3.0 * whole.white.norm_squared() * whole.weight.iter().sum::<f64>();
    let mean_squares = mean_squares.map(|sum| sum / scale);
    let p_value = f_above(wald, 3.0, g - 3.0);
    Some(Arm {
        value,
        covariance,
        p_value,
        mean_squares,
        n_moves: moves.len(),
    })
}
