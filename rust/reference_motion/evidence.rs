//! The blocks' likelihood by a Kalman filter with the states attitude, gyro bias, and the reference's own slow errors.

use nalgebra::{DMatrix, Dim, Dyn, Matrix3, OMatrix, RawStorageMut, SMatrix, U3, U24};

use super::Block;
use crate::error::{Error, Result};

/// State at a block's end: angle, its mean over the reference's rows, bias, its integral over time, the slow error in
/// the world with its rate, and in the body.
const STATE: usize = 24;
const ANGLE: usize = 0;
const MEAN: usize = 3;
const BIAS: usize = 6;
const TOTAL: usize = 9;
const WORLD: usize = 12;
const BODY: usize = 18;
/// Variance of an undetermined attitude, rad²: for larger angles the linearisation fails.
const UNKNOWN: f64 = 1.0;
/// White error of a reference as a part of the largest angle that varies: below it the covariance is rounding error.
const ROUNDING: f64 = 1e-7;

type State = SMatrix<f64, STATE, STATE>;
type Columns = OMatrix<f64, U24, Dyn>;
type Rows = OMatrix<f64, U3, Dyn>;
type Seen = SMatrix<f64, 3, STATE>;

/// Strengths of all random processes.
#[derive(Debug, Clone, Copy)]
pub struct Strengths {
    /// Angle random walk, rad/√s.
    pub angle_walk: f64,
    /// White density of each axis' scale, √s: angle random walk that grows with the rate.
    pub scale_noise: f64,
    /// Random walk of the gyro's bias, rad/s/√s.
    pub bias_walk: f64,
    /// White error of a block of the reference with all its rows, rad.
    pub white: f64,
    /// Slow error of the reference's world, rad, and its time constant, s.
    pub world: [f64; 2],
    /// Slow error of the reference's body, rad, and its time constant, s.
    pub body: [f64; 2],
}

/// Normal equations of the columns under the strengths: `CᵀV⁻¹C` and `ln|V|` over `rows` rows.
#[derive(Debug, Clone)]
pub struct Normal {
    /// `CᵀV⁻¹C`, the observations among the columns.
    pub gram: DMatrix<f64>,
    /// `ln|V|`.
    pub log_det: f64,
    /// Observations of three rows.
    pub rows: usize,
    /// Standardised innovations of every column, 3 rows per block (zero where there is no observation).
    pub innovations: DMatrix<f64>,
    /// Mean of the bias walk over time as a combination of the columns, rad/s.
    pub mean_bias: Rows,
    /// Its covariance for known coefficients of the columns.
    pub cov_mean_bias: Matrix3<f64>,
}

/// Smoothed states over time: values as combinations of the columns, 3 rows per block.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// The bias about its value at the start, rad/s.
    pub bias: DMatrix<f64>,
    /// Its covariance for known coefficients of the columns.
    pub bias_cov: Vec<Matrix3<f64>>,
    /// The reference's slow errors, of its world and of its body, rad.
    pub slow: [DMatrix<f64>; 2],
}

/// One step of the filter, for the smoother.
struct Step {
    predicted: Columns,
    cov: State,
    gain: SMatrix<f64, STATE, 3>,
    seen: Option<(Seen, Matrix3<f64>, Rows)>,
}

/// `CᵀV⁻¹C` and `ln|V|` of columns `(3 m, p)`, three rows a block.
///
/// # Errors
/// When the columns are not three rows a block, or a variance is not positive.
pub fn normal(blocks: &[Block], columns: &DMatrix<f64>, with: &Strengths) -> Result<Normal> {
    filter(blocks, columns, with, |_| ())
}

/// Bias walk and slow errors of the reference by fixed-interval smoothing (Bryson and Frazier: no matrix is inverted).
///
/// # Errors
/// As [`normal`].
pub fn smoothed(blocks: &[Block], columns: &DMatrix<f64>, with: &Strengths) -> Result<Smoothed> {
    let mut steps = Vec::with_capacity(blocks.len());
    filter(blocks, columns, with, |step| steps.push(step()))?;
    let p = columns.ncols();
    let mut out = Smoothed {
        bias: DMatrix::zeros(3 * blocks.len(), p),
        bias_cov: vec![Matrix3::zeros(); blocks.len()],
        slow: [(); 2].map(|()| DMatrix::zeros(3 * blocks.len(), p)),
    };
    let step_s = block_length(blocks);
    let slow = Slow::both(with, step_s);
    let mut adjoint = Columns::zeros(p);
    let mut information = State::zeros();
    for (k, step) in steps.iter().enumerate().rev() {
        if let Some((seen, inverse, innovation)) = &step.seen {
            let left = State::identity() - step.gain * seen;
            let weight = seen.transpose() * inverse;
            adjoint = left.transpose() * adjoint - weight * innovation;
            information = left.transpose() * information * left + weight * seen;
        }
        let state = &step.predicted - step.cov * &adjoint;
        for (slow, first) in out.slow.iter_mut().zip([WORLD, BODY]) {
            slow.fixed_rows_mut::<3>(3 * k)
                .copy_from(&state.fixed_rows::<3>(first));
        }
        out.bias
            .fixed_rows_mut::<3>(3 * k)
            .copy_from(&state.fixed_rows::<3>(BIAS));
        out.bias_cov[k] = (step.cov - step.cov * information * step.cov)
            .fixed_view::<3, 3>(BIAS, BIAS)
            .into();
        let mut transition = State::identity();
        advance(&mut transition, &blocks[k], &slow, step_s);
        adjoint = transition.transpose() * adjoint;
        information = transition.transpose() * information * transition;
    }
    Ok(out)
}

fn filter(
    blocks: &[Block],
    columns: &DMatrix<f64>,
    with: &Strengths,
    mut keep: impl FnMut(&dyn Fn() -> Step),
) -> Result<Normal> {
    if columns.nrows() != 3 * blocks.len() || blocks.is_empty() {
        return Err(Error::bad_input(
            "a reference's columns need three rows a block",
        ));
    }
    let p = columns.ncols();
    let step_s = block_length(blocks);
    let most = blocks.iter().map(|b| b.rows[0]).max().unwrap_or(1).max(1) as f64;
    let slow = Slow::both(with, step_s);
    let rounding = ROUNDING * ROUNDING * (UNKNOWN + with.world[0].powi(2) + with.body[0].powi(2));
    let mut cov = before_all(&slow);
    let mut state = Columns::zeros(p);
    let mut out = Normal {
        gram: DMatrix::zeros(p, p),
        log_det: 0.0,
        rows: 0,
        innovations: DMatrix::zeros(3 * blocks.len(), p),
        mean_bias: Rows::zeros(p),
        cov_mean_bias: Matrix3::zeros(),
    };
    for (b, block) in blocks.iter().enumerate() {
        advance(&mut state, block, &slow, step_s);
        advance(&mut cov, block, &slow, step_s);
        cov.transpose_mut();
        advance(&mut cov, block, &slow, step_s);
        add_process(&mut cov, block, with, &slow, step_s);
        if block.is_lost {
            for k in 0..3 {
                cov[(ANGLE + k, ANGLE + k)] += UNKNOWN;
            }
        }
        if block.rows[0] == 0 {
            keep(&|| Step {
                predicted: state.clone(),
                cov,
                gain: SMatrix::zeros(),
                seen: None,
            });
            continue;
        }
        let white = (with.white * with.white + rounding) * most / block.rows[0] as f64;
        let seen_cov = seen_rows(block, &cov);
        let variance = seen_rows(block, &seen_cov.transpose()) + Matrix3::identity() * white;
        let factor = variance
            .cholesky()
            .ok_or_else(|| Error::not_determined("a reference's error has no positive variance"))?;
        let (inverse, lower) = (factor.inverse(), factor.l());
        let innovation: Rows = columns.fixed_rows::<3>(3 * b) - seen_rows(block, &state);
        let gain = seen_cov.transpose() * inverse;
        keep(&|| Step {
            predicted: state.clone(),
            cov,
            gain,
            seen: Some((
                seen_rows(block, &State::identity()),
                inverse,
                innovation.clone(),
            )),
        });
        let mut white_rows = innovation.clone();
        lower.solve_lower_triangular_mut(&mut white_rows);
        let mut narrowed = seen_cov;
        lower.solve_lower_triangular_mut(&mut narrowed);
        state += narrowed.transpose() * &white_rows;
        cov -= narrowed.transpose() * narrowed;
        out.gram.gemm_tr(1.0, &white_rows, &white_rows, 1.0);
        out.log_det += 2.0 * (0..3).map(|k| lower[(k, k)].ln()).sum::<f64>();
        out.rows += 1;
        out.innovations
            .fixed_rows_mut::<3>(3 * b)
            .copy_from(&white_rows);
    }
    let total_s = step_s * blocks.len() as f64;
    out.mean_bias = state.fixed_rows::<3>(TOTAL) / total_s;
    out.cov_mean_bias = cov.fixed_view::<3, 3>(TOTAL, TOTAL) / (total_s * total_s);
    Ok(out)
}

/// Time from block to block.
fn block_length(blocks: &[Block]) -> f64 {
    let n = blocks.len();
    if n < 2 {
        return 1.0;
    }
    (blocks[n - 1].time_s - blocks[0].time_s) / (n - 1) as f64
}

/// A Matérn-3/2 process over one step: its transition, its stationary variances, the noise that a step adds.
struct Slow {
    step: [[f64; 2]; 2],
    cov: [f64; 2],
    noise: [[f64; 2]; 2],
}

impl Slow {
    fn both(with: &Strengths, step_s: f64) -> [(usize, Self); 2] {
        [
            (WORLD, Self::of(with.world, step_s)),
            (BODY, Self::of(with.body, step_s)),
        ]
    }

    fn of([sigma, tau_s]: [f64; 2], h: f64) -> Self {
        let rate = 3f64.sqrt() / tau_s;
        let decay = (-rate * h).exp();
        let f = [
            [decay * (1.0 + rate * h), decay * h],
            [-decay * rate * rate * h, decay * (1.0 - rate * h)],
        ];
        let cov = [sigma * sigma, rate * rate * sigma * sigma];
        let noise = |i: usize, j: usize| {
            let before = if i == j { cov[i] } else { 0.0 };
            before - f[i][0] * f[j][0] * cov[0] - f[i][1] * f[j][1] * cov[1]
        };
        Self {
            step: f,
            cov,
            noise: [[noise(0, 0), noise(0, 1)], [noise(1, 0), noise(1, 1)]],
        }
    }
}

fn before_all(slow: &[(usize, Slow); 2]) -> State {
    let mut cov = State::zeros();
    for k in 0..3 {
        cov[(ANGLE + k, ANGLE + k)] = UNKNOWN;
        for (first, slow) in slow {
            cov[(first + k, first + k)] = slow.cov[0];
            cov[(first + 3 + k, first + 3 + k)] = slow.cov[1];
        }
    }
    cov
}

/// Propagates every column over one block.
fn advance<C: Dim, S: RawStorageMut<f64, U24, C>>(
    columns: &mut nalgebra::Matrix<f64, U24, C, S>,
    block: &Block,
    slow: &[(usize, Slow); 2],
    step_s: f64,
) {
    let [whole, seen] = &block.wrt_bias;
    for c in 0..columns.ncols() {
        let mut x = columns.column_mut(c);
        for k in 0..3 {
            let along = |by: &Matrix3<f64>| {
                by[(k, 0)] * x[BIAS] + by[(k, 1)] * x[BIAS + 1] + by[(k, 2)] * x[BIAS + 2]
            };
            let (mean, angle) = (x[ANGLE + k] + along(seen), x[ANGLE + k] + along(whole));
            x[MEAN + k] = mean;
            x[ANGLE + k] = angle;
        }
        for k in 0..3 {
            x[TOTAL + k] += step_s * x[BIAS + k];
            for (first, slow) in slow {
                let (e, v) = (x[first + k], x[first + 3 + k]);
                x[first + k] = slow.step[0][0] * e + slow.step[0][1] * v;
                x[first + 3 + k] = slow.step[1][0] * e + slow.step[1][1] * v;
            }
        }
    }
}

/// Process noise of a block: the mean of a walk over it has a third of the walk's variance, and half of it in common.
fn add_process(
    cov: &mut State,
    block: &Block,
    with: &Strengths,
    slow: &[(usize, Slow); 2],
    step_s: f64,
) {
    let walk = Matrix3::from_diagonal_element(with.angle_walk.powi(2) * step_s)
        + block.rotation * with.scale_noise.powi(2);
    let bias = with.bias_walk * with.bias_walk * step_s;
    for (i, j, share) in [
        (ANGLE, ANGLE, 1.0),
        (ANGLE, MEAN, 0.5),
        (MEAN, ANGLE, 0.5),
        (MEAN, MEAN, 1.0 / 3.0),
    ] {
        let mut part = cov.fixed_view_mut::<3, 3>(i, j);
        part += walk * share;
    }
    for k in 0..3 {
        cov[(BIAS + k, BIAS + k)] += bias;
        for (first, slow) in slow {
            for i in 0..2 {
                for j in 0..2 {
                    cov[(first + 3 * i + k, first + 3 * j + k)] += slow.noise[i][j];
                }
            }
        }
    }
}

/// Observation of a block: the mean angle, the world's error, and the body's error rotated to the world.
fn seen_rows<C: Dim, S: nalgebra::RawStorage<f64, U24, C>>(
    block: &Block,
    columns: &nalgebra::Matrix<f64, U24, C, S>,
) -> OMatrix<f64, U3, C>
where
    nalgebra::DefaultAllocator: nalgebra::allocator::Allocator<U3, C>,
{
    let at = &block.attitude;
    OMatrix::from_fn_generic(U3, columns.shape_generic().1, |k, c| {
        columns[(MEAN + k, c)]
            + columns[(WORLD + k, c)]
            + at[(k, 0)] * columns[(BODY, c)]
            + at[(k, 1)] * columns[(BODY + 1, c)]
            + at[(k, 2)] * columns[(BODY + 2, c)]
    })
}
