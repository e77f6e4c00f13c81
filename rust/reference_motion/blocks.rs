//! Blocks of a log beside a reference, each reduced to one observation and its sensitivities.

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::error::{Error, Result};
use crate::order_statistics::median;
use crate::rotation::{exp, log};

/// A row this many robust standard deviations from its block's median is an outlier.
const OUTLIER: f64 = 7.0;
/// Standard deviation over median absolute deviation of a normal variable.
const NORMAL: f64 = 1.4826;

/// A log at even times: its rate as corrected so far, and the signals to be integrated.
#[derive(Debug, Clone, Copy)]
pub struct Log<'a> {
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Time between samples, s.
    pub step_s: f64,
    /// Corrected angular rate of every sample, rad/s.
    pub rate: &'a [Vector3<f64>],
    /// Whether a sample is valid; the attitude is lost over a step with an invalid one.
    pub is_valid: &'a [bool],
    /// `n_signals` values of every sample.
    pub signals: &'a [f64],
    /// Signals per sample.
    pub n_signals: usize,
    /// Directions of the gyro's axes in the body, unit vectors in columns.
    pub axes: Matrix3<f64>,
}

/// The reference's attitudes, body → world, at times of the log's clock (ascending), s.
#[derive(Debug, Clone, Copy)]
pub struct Truth<'a> {
    /// Times, s.
    pub time_s: &'a [f64],
    /// Attitudes.
    pub attitude: &'a [Matrix3<f64>],
}

/// One block of the log.
#[derive(Debug, Clone)]
pub struct Block {
    /// Middle of the reference's rows in it (of the block, where there are none), s.
    pub time_s: f64,
    /// Rows of the reference that are used, and rows excluded as outliers.
    pub rows: [usize; 2],
    /// Whether the attitude was lost within it: a gap of the log.
    pub is_lost: bool,
    /// Rotation of the world from the gyro's attitude to the reference's, summed since the last loss, rad.
    pub angle: Vector3<f64>,
    /// Mean attitude over the reference's rows.
    pub attitude: Matrix3<f64>,
    /// `∫ C dt` over the block, s, and its mean from the block's start to the reference's rows.
    pub wrt_bias: [Matrix3<f64>; 2],
    /// Columns of the clock: mean rate in the world over the rows, and mean of it times the time from the log's middle.
    pub wrt_clock: [Vector3<f64>; 2],
    /// Mean over the rows of `∫ C_ai s_j dt` since the beginning: row 3 a + i, column j.
    pub moments: DMatrix<f64>,
    /// `∫ Σ_i ω_i² c_i c_iᵀ dt` over the block with the gyro's axes `c_i` in the world, rad²/s.
    pub rotation: Matrix3<f64>,
}

/// Motion by the gyro from the block's start to one row of the reference.
struct Row {
    time_s: f64,
    turned: Matrix3<f64>,
    moments: DMatrix<f64>,
    bias: Matrix3<f64>,
    rate: Vector3<f64>,
    attitude: Matrix3<f64>,
}

/// Motion by the gyro over a block: at the rows of the reference in it, and at its end.
struct Path {
    rows: Vec<Row>,
    turned: Matrix3<f64>,
    moments: DMatrix<f64>,
    bias: Matrix3<f64>,
    rotation: Matrix3<f64>,
    is_lost: bool,
}

/// Blocks of `block` samples.
///
/// # Errors
/// When the arrays do not belong together, or a block is shorter than two samples.
pub fn blocks(of: &Log<'_>, truth: &Truth<'_>, block: usize) -> Result<Vec<Block>> {
    let n = of.rate.len();
    if of.is_valid.len() != n || of.signals.len() != n * of.n_signals {
        return Err(Error::bad_input(
            "a log's rates, flags and signals must be as many",
        ));
    }
    if truth.time_s.len() != truth.attitude.len() || block < 2 || of.step_s <= 0.0 {
        return Err(Error::bad_input(
            "a reference needs an attitude for each time, and a block two samples or more",
        ));
    }
    let middle_s = of.start_s + 0.5 * of.step_s * n as f64;
    let mut out = Vec::with_capacity(n / block);
    let mut carried: Option<Matrix3<f64>> = None;
    let mut angle = Vector3::zeros();
    let mut moments = DMatrix::zeros(9, of.n_signals);
    let mut next = truth.time_s.partition_point(|&t| t < of.start_s);
    for first in (0..n.saturating_sub(block)).step_by(block) {
        let path = path(of, truth, first, block, &mut next);
        // Without an attitude carried to here, the reference's first row gives the attitude at the block's start.
        let start =
            carried.or_else(|| path.rows.first().map(|r| r.attitude * r.turned.transpose()));
        let Some(start) = start else {
            out.push(unseen(of, first, block, angle, moments.clone()));
            continue;
        };
        let seen = seen(&path, &start, &moments, angle, middle_s);
        let (is_seen, mean, one) = if let Some((mean, one)) = seen {
            (true, mean, one)
        } else {
            let mut one = unseen(of, first, block, angle, moments.clone());
            one.wrt_bias = [start * path.bias, 0.5 * start * path.bias];
            one.is_lost = path.is_lost;
            one.rotation = start * path.rotation * start.transpose();
            (false, Vector3::zeros(), one)
        };
        if is_seen {
            angle = one.angle;
        }
        moments += turned(&start, &path.moments);
        carried = (!path.is_lost).then(|| exp(&mean) * start * path.turned);
        out.push(one);
    }
    Ok(out)
}

/// A block without rows of the reference.
fn unseen(
    of: &Log<'_>,
    first: usize,
    block: usize,
    angle: Vector3<f64>,
    moments: DMatrix<f64>,
) -> Block {
    Block {
        time_s: of.start_s + of.step_s * (first as f64 + 0.5 * block as f64),
        rows: [0, 0],
        is_lost: true,
        angle,
        attitude: Matrix3::zeros(),
        wrt_bias: [Matrix3::zeros(); 2],
        wrt_clock: [Vector3::zeros(); 2],
        moments,
        rotation: Matrix3::zeros(),
    }
}

/// `Σ_b start_ab M_bi,j` of moments whose row is `3 b + i`.
fn turned(start: &Matrix3<f64>, moments: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(9, moments.ncols(), |row, j| {
        (0..3)
            .map(|b| start[(row / 3, b)] * moments[(3 * b + row % 3, j)])
            .sum()
    })
}

/// Change of the rate over a step, from its valid neighbours.
fn slope(of: &Log<'_>, i: usize) -> Vector3<f64> {
    let before = if i > 0 && of.is_valid[i - 1] {
        i - 1
    } else {
        i
    };
    let after = if i + 1 < of.rate.len() && of.is_valid[i + 1] {
        i + 1
    } else {
        i
    };
    (of.rate[after] - of.rate[before]) / (after - before).max(1) as f64
}

fn path(of: &Log<'_>, truth: &Truth<'_>, first: usize, block: usize, next: &mut usize) -> Path {
    let (h, q) = (of.step_s, of.n_signals);
    let mut at = Path {
        rows: Vec::new(),
        turned: Matrix3::identity(),
        moments: DMatrix::zeros(9, q),
        bias: Matrix3::zeros(),
        rotation: Matrix3::zeros(),
        is_lost: false,
    };
    let own = of.axes.try_inverse().unwrap_or_else(Matrix3::identity);
    for i in first..first + block {
        let (w0, w1) = (of.rate[i], of.rate[i + 1]);
        let is_valid = of.is_valid[i] && of.is_valid[i + 1];
        let from_s = of.start_s + h * i as f64;
        let (d0, d1) = (slope(of, i), slope(of, i + 1));
        // The cubic between samples (a straight line is off by (ωh)²/12), and the commutator of the straight line.
        let part = |x: f64| {
            let (x2, x3, x4) = (x * x, x * x * x, x * x * x * x);
            let sum = w0 * (0.5 * x4 - x3 + x)
                + w1 * (x3 - 0.5 * x4)
                + d0 * (0.25 * x4 - x3 / 1.5 + 0.5 * x2)
                + d1 * (0.25 * x4 - x3 / 3.0);
            let change = w0.cross(&w1);
            exp(&(sum * h + change * (h * h * x * x * x / 12.0)))
        };
        let middle = at.turned * part(0.5);
        let add = |moments: &mut DMatrix<f64>, x: f64| {
            let (s0, s1) = (&of.signals[i * q..][..q], &of.signals[(i + 1) * q..][..q]);
            for ((mut column, from), to) in moments.column_iter_mut().zip(s0).zip(s1) {
                let s = x * h * (from + 0.5 * x * (to - from));
                for b in 0..3 {
                    for k in 0..3 {
                        column[3 * b + k] += middle[(b, k)] * s;
                    }
                }
            }
        };
        while *next < truth.time_s.len() && truth.time_s[*next] < from_s + h {
            let x = (truth.time_s[*next] - from_s) / h;
            if is_valid && !at.is_lost && x >= 0.0 {
                let turned = at.turned * part(x);
                let mut moments = at.moments.clone();
                add(&mut moments, x);
                at.rows.push(Row {
                    time_s: truth.time_s[*next],
                    turned,
                    moments,
                    bias: at.bias + middle * (x * h),
                    rate: turned * (w0 + (w1 - w0) * x),
                    attitude: truth.attitude[*next],
                });
            }
            *next += 1;
        }
        if is_valid {
            add(&mut at.moments, 1.0);
            at.bias += middle * h;
            let scaled = middle * of.axes * Matrix3::from_diagonal(&(own * (0.5 * (w0 + w1))));
            at.rotation += scaled * scaled.transpose() * h;
            at.turned *= part(1.0);
        } else {
            at.is_lost = true;
        }
    }
    at
}

/// The block from its rows, and their mean rotation from the carried attitude; `None` without rows.
fn seen(
    path: &Path,
    start: &Matrix3<f64>,
    before: &DMatrix<f64>,
    angle: Vector3<f64>,
    middle_s: f64,
) -> Option<(Vector3<f64>, Block)> {
    let off: Vec<Vector3<f64>> = path
        .rows
        .iter()
        .map(|row| log(&(row.attitude * (start * row.turned).transpose())))
        .collect();
    let keep = within(&off);
    let n = keep.iter().filter(|k| **k).count();
    if n == 0 {
        return None;
    }
    let share = 1.0 / n as f64;
    let mut mean = Vector3::zeros();
    let mut moments = DMatrix::zeros(9, before.ncols());
    let mut one = Block {
        time_s: 0.0,
        rows: [n, off.len() - n],
        is_lost: path.is_lost,
        angle,
        attitude: Matrix3::zeros(),
        wrt_bias: [start * path.bias, Matrix3::zeros()],
        wrt_clock: [Vector3::zeros(); 2],
        moments: DMatrix::zeros(0, 0),
        rotation: start * path.rotation * start.transpose(),
    };
    for ((row, d), _) in path.rows.iter().zip(&off).zip(&keep).filter(|(_, k)| **k) {
        let rate = start * row.rate;
        mean += d * share;
        moments += &row.moments * share;
        one.time_s += row.time_s * share;
        one.attitude += row.attitude * share;
        one.wrt_bias[1] += start * row.bias * share;
        one.wrt_clock[0] += rate * share;
        one.wrt_clock[1] += rate * ((row.time_s - middle_s) * share);
    }
    one.angle += mean;
    one.moments = before + turned(start, &moments);
    Some((mean, one))
}

/// Whether each rotation is no outlier among those of its block.
fn within(off: &[Vector3<f64>]) -> Vec<bool> {
    let of = |mut values: Vec<f64>| median(&mut values);
    let centre = Vector3::from_fn(|k, _| of(off.iter().map(|d| d[k]).collect()));
    let far: Vec<f64> = off.iter().map(|d| (d - centre).amax()).collect();
    let scale = OUTLIER * NORMAL * of(far.clone());
    far.iter().map(|x| *x <= scale).collect()
}
