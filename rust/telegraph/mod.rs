//! Random telegraph signals: a bias that switches between two levels at random times (docs/diagnosis-method.md, 8.7a).
//!
//! The readings inside the poses show at what height they switch, and the means of poses that do not switch which level
//! they have.

mod levels;

use std::sync::LazyLock;

use nalgebra::{DMatrix, DVector, RowDVector};
use rayon::prelude::*;

use crate::chi_square::MEDIAN_SQUARE;
use crate::log_sum::log_sum;
use crate::order_statistics::median;
pub use levels::{Means, levels};

/// Block means per pose; parts of a block in which its noise is computed.
const N_BLOCKS: usize = 16;
const N_FINE: usize = 4;
/// Readings of a pose below which its blocks are not used.
const LEAST_SAMPLES: usize = 3 * N_BLOCKS;
/// Amplitudes of 1/f noise, or of a random walk, relative to the white noise of a part of a block.
const FLICKER: [f64; 4] = [0.0, 0.5, 1.0, 2.0];
const WALK: [f64; 4] = [0.3, 0.5, 1.0, 4.0];
/// Degrees of freedom of the noise of a pose relative to the usual one: a tremble doubles it.
const FREEDOM: f64 = 8.0;
/// Heights of a switch tried, from the noise of a block to forty times that.
const N_HEIGHTS: usize = 27;
const HIGHEST: f64 = 40.0;
/// Switches per pose.
const RATES: [f64; 3] = [0.1, 0.4, 1.0];
/// Shares of poses that a jolt disturbs by any height: the alternative to equal heights.
const SHARES: [f64; 2] = [0.03, 0.1];
/// Share of the largest direction below which a direction is none.
const ROUNDING: f64 = 1e-9;

/// What the readings inside the poses show of one axis.
#[derive(Debug, Clone, Default)]
pub struct Inside {
    /// Whether the signal switches inside each pose.
    pub switches: Vec<bool>,
    /// Its mean state in each pose that switches, -1 to 1.
    pub state: Vec<f64>,
    /// Log-likelihood of equal steps up and down over noise, and over a few steps of any height.
    pub gain: f64,
}

/// Every path through a pose with two switches or fewer: none, up or down once, there and back.
struct Paths {
    /// `(paths, blocks)` levels, 0 or 1.
    levels: DMatrix<f64>,
    /// Switches of each path.
    switches: Vec<usize>,
    /// Number of paths with none, one, two switches.
    counts: [f64; 3],
}

static PATHS: LazyLock<Paths> = LazyLock::new(|| {
    let mut rows = vec![RowDVector::zeros(N_BLOCKS)];
    let mut switches = vec![0];
    for from in 1..N_BLOCKS {
        for to in from + 1..=N_BLOCKS {
            let up = RowDVector::from_fn(N_BLOCKS, |_, i| f64::from(u8::from(i >= from && i < to)));
            rows.extend([up.map(|level| 1.0 - level), up]);
            switches.extend([if to == N_BLOCKS { 1 } else { 2 }; 2]);
        }
    }
    let mut counts = [0.0; 3];
    for &n in &switches {
        counts[n] += 1.0;
    }
    let levels = DMatrix::from_rows(&rows);
    Paths {
        levels,
        switches,
        counts,
    }
});

/// Noise of one colour: its whitening `(blocks - 1, blocks)` of blocks without their mean, and the determinant.
struct Colour {
    whiten: DMatrix<f64>,
    log_det: f64,
}

static COLOURS: LazyLock<Vec<Colour>> = LazyLock::new(|| {
    let n = N_BLOCKS * N_FINE;
    // 1/f noise by Kasdin's filter (fractional integration of order one half); the walk is summed white noise.
    let mut taps = vec![1.0; n];
    for k in 1..n {
        taps[k] = taps[k - 1] * (k as f64 - 0.5) / k as f64;
    }
    let filter = |i: usize, j: usize| if i < j { 0.0 } else { taps[i - j] };
    let flicker = FLICKER.map(|size| size * DMatrix::from_fn(n, n, filter));
    let walk = WALK.map(|size| DMatrix::from_fn(n, n, |i, j| if i < j { 0.0 } else { size }));
    flicker.iter().chain(&walk).filter_map(colour).collect()
});

fn colour(filtered: &DMatrix<f64>) -> Option<Colour> {
    let n = filtered.nrows();
    let of_block = |i: usize, j: usize| f64::from(u8::from(j / N_FINE == i)) / N_FINE as f64;
    let mean = DMatrix::from_fn(N_BLOCKS, n, of_block);
    let fine = DMatrix::identity(n, n) + filtered * filtered.transpose();
    let covariance = &mean * fine * mean.transpose();
    let free = N_BLOCKS - 1;
    let step = DMatrix::from_fn(free, N_BLOCKS, |i, j| {
        f64::from(u8::from(j == i + 1)) - f64::from(u8::from(j == i))
    });
    // In units of the noise between neighbours.
    let unit = (&step * &covariance * step.transpose()).trace() / (2.0 * free as f64);
    let contrasts = orthonormal(&step.transpose()).transpose();
    let root = (&contrasts * covariance * contrasts.transpose() / unit)
        .cholesky()?
        .unpack();
    let log_det = 2.0 * root.diagonal().map(f64::ln).sum();
    let whiten = root.solve_lower_triangular(&contrasts)?;
    Some(Colour { whiten, log_det })
}

/// Orthonormal columns that span those of a matrix.
fn orthonormal(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = columns.clone().svd(true, false);
    let size = &svd.singular_values;
    let kept: Vec<usize> = (0..size.len())
        .filter(|&k| size[k] > ROUNDING * size.max())
        .collect();
    svd.u.map_or_else(
        || DMatrix::zeros(columns.nrows(), 0),
        |u| u.select_columns(&kept),
    )
}

/// Blocks of the poses whitened in one colour: the square of each `(poses)`, what a unit step of each path has in common
/// with it, and the path's own square `(poses, paths)`.
struct Whitened {
    square: DVector<f64>,
    along: DMatrix<f64>,
    norm: DMatrix<f64>,
    log_det: f64,
}

impl Whitened {
    /// `blocks` `(poses, blocks)`; a step in a pose counts by its `scale`.
    fn of(colour: &Colour, blocks: &DMatrix<f64>, scale: &DVector<f64>) -> Self {
        let y = blocks * colour.whiten.transpose();
        let shapes = &PATHS.levels * colour.whiten.transpose();
        let own = DVector::from_fn(shapes.nrows(), |k, _| shapes.row(k).norm_squared());
        Self {
            square: DVector::from_fn(y.nrows(), |k, _| y.row(k).norm_squared()),
            along: DMatrix::from_diagonal(scale) * y * shapes.transpose(),
            norm: scale.component_mul(scale) * own.transpose(),
            log_det: colour.log_det,
        }
    }

    /// Log-likelihood of a path of some height through a pose. Poses differ in noise: by Student's t.
    fn likelihood(&self, pose: usize, path: usize, height: f64) -> f64 {
        let at = (pose, path);
        let left =
            self.square[pose] - 2.0 * height * self.along[at] + height * height * self.norm[at];
        -0.5 * (self.log_det + (FREEDOM + (N_BLOCKS - 1) as f64) * (left / FREEDOM).ln_1p())
    }

    /// Log-likelihood of noise alone, or with a step of any height in some poses.
    fn without(&self) -> f64 {
        let single: Vec<usize> = (0..PATHS.switches.len())
            .filter(|&k| PATHS.switches[k] == 1)
            .collect();
        let choices = (N_HEIGHTS as f64 * PATHS.counts[1]).ln();
        let (mut plain, mut mixed) = (0.0, [0.0; 2]);
        for pose in 0..self.square.len() {
            let own = self.likelihood(pose, 0, 0.0);
            let of_height = |height| {
                single
                    .iter()
                    .map(move |&path| self.likelihood(pose, path, height))
            };
            let step = log_sum(heights().flat_map(of_height)) - choices;
            plain += own;
            for (total, share) in mixed.iter_mut().zip(SHARES) {
                *total += log_sum([(-share).ln_1p() + own, share.ln() + step]);
            }
        }
        mixed.into_iter().fold(plain, f64::max)
    }

    /// Log-likelihood of steps of one height, and the path through every pose that is likeliest.
    fn of_one_height(&self) -> (f64, Vec<usize>) {
        let mut best = (f64::NEG_INFINITY, Vec::new());
        for height in heights() {
            let each = DMatrix::from_fn(self.along.nrows(), self.along.ncols(), |pose, path| {
                self.likelihood(pose, path, height)
            });
            for rate in RATES {
                let prior = log_prior(rate);
                let with = |pose: usize| each.row(pose) + &prior;
                let total = (0..each.nrows())
                    .map(|pose| log_sum(with(pose).iter().copied()))
                    .sum();
                if total > best.0 {
                    let likeliest = |pose| with(pose).transpose().argmax().0;
                    best = (total, (0..each.nrows()).map(likeliest).collect());
                }
            }
        }
        best
    }
}

fn heights() -> impl Iterator<Item = f64> + Clone {
    (0..N_HEIGHTS).map(|k| HIGHEST.powf(k as f64 / (N_HEIGHTS - 1) as f64))
}

/// Log-probability of every path: the number of its switches is Poisson.
fn log_prior(rate: f64) -> RowDVector<f64> {
    let weight = [1.0, rate, rate * rate / 2.0];
    let all: f64 = weight.iter().sum();
    let of = |n: usize| (weight[n] / all / PATHS.counts[n]).ln();
    RowDVector::from_iterator(PATHS.switches.len(), PATHS.switches.iter().map(|&n| of(n)))
}

/// What the readings of every pose, one axis, show; a pose of too few tells nothing.
#[must_use]
pub fn inside(poses: &[&[f64]]) -> Inside {
    let which: Vec<usize> = (0..poses.len())
        .filter(|&i| poses[i].len() >= LEAST_SAMPLES)
        .collect();
    let (switches, state) = (vec![false; poses.len()], vec![0.0; poses.len()]);
    let mut out = Inside {
        switches,
        state,
        gain: 0.0,
    };
    if which.is_empty() {
        return out;
    }
    let blocks = block_means(&which.iter().map(|&i| poses[i]).collect::<Vec<_>>());
    // Means over longer blocks have less noise: a step of the same height is more of it.
    let lasts = DVector::from_fn(which.len(), |k, _| (poses[which[k]].len() as f64).sqrt());
    let scale = &lasts / median(lasts.clone().as_mut_slice());
    let noises = COLOURS.par_iter().map(|one| {
        let whitened = Whitened::of(one, &blocks, &scale);
        (whitened.without(), whitened.of_one_height())
    });
    let mut without = f64::NEG_INFINITY;
    let mut best = (f64::NEG_INFINITY, Vec::new());
    for (plain, found) in noises.collect::<Vec<_>>() {
        without = without.max(plain);
        best = if found.0 > best.0 { found } else { best };
    }
    for (&i, &path) in which.iter().zip(&best.1) {
        out.switches[i] = path > 0;
        out.state[i] = 2.0 * PATHS.levels.row(path).mean() - 1.0;
    }
    out.gain = best.0 - without;
    out
}

/// `(poses, blocks)` means of equal parts in units of the noise between neighbours, whatever their length.
fn block_means(poses: &[&[f64]]) -> DMatrix<f64> {
    let mut blocks = DMatrix::from_fn(poses.len(), N_BLOCKS, |pose, k| {
        let n = poses[pose].len();
        let part = &poses[pose][k * n / N_BLOCKS..(k + 1) * n / N_BLOCKS];
        let known: Vec<f64> = part
            .iter()
            .copied()
            .filter(|value| value.is_finite())
            .collect();
        known.iter().sum::<f64>() / known.len() as f64 * (n as f64 / N_BLOCKS as f64).sqrt()
    });
    // Robust: the median over all poses of squared differences, half of it per block.
    let steps = blocks.columns(1, N_BLOCKS - 1) - blocks.columns(0, N_BLOCKS - 1);
    let mut squares: Vec<f64> = steps
        .iter()
        .map(|step| step * step)
        .filter(|one| one.is_finite())
        .collect();
    let noise = (median(&mut squares) / MEDIAN_SQUARE / 2.0).sqrt();
    let is_known = |value: f64| noise > 0.0 && value.is_finite();
    blocks.apply(|value| {
        *value = if is_known(*value) {
            *value / noise
        } else {
            0.0
        }
    });
    blocks
}
