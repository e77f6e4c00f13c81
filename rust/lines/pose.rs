//! Mean of one pose with a spectral line, by a joint fit of constant and lines (docs/diagnosis-method.md, 8.0).

use std::f64::consts::{LN_2, TAU};

use nalgebra::DMatrix;

use super::{power, smooth, window};
use crate::chi_square::chi_square_tails;
use crate::order_statistics::median;

/// False-alarm probability of a line in noise over all frequencies of a pose. A fainter line of six cycles or more moves
/// the plain mean by less than a quarter of its standard error, and is not fitted.
const SURE: f64 = 1e-8;
/// A slower line is confounded with drift, which the session model has terms for.
const FEWEST_CYCLES: usize = 6;
/// Power of a line over that of the bins three to five below: in a bias random walk the ratio is 1/9 to 1.
const ABOVE_SLOWER: f64 = 10.0;
/// Frequencies whose median is the noise level at one: few follow its colour, many determine it well.
const FEWEST_BINS: usize = 27;
const MOST_BINS: usize = 101;
/// Error of a line's frequency in bins: its phase then errs by a thousandth at the ends of the pose.
const REFINED: f64 = 2e-4;
/// A shaker and its first harmonics; the remaining vibration widens the uncertainty.
const MOST_LINES: usize = 3;
/// Scatter beside the lines over that of quiet poses, from which vibration remains.
const STILL_SHAKES: f64 = 2.0;
/// Bins beside frequency zero that give the noise there: below the slowest line searched, with an error of a third.
const BESIDE: std::ops::Range<usize> = 3..7;
/// Parts of a pose whose means show whether slow motion remains: they detect a pose that goes on settling, not a fifth of
/// its noise.
const BLOCKS: usize = 8;

/// Mean and standard error of a pose beside its lines.
#[derive(Debug, Clone, Copy)]
pub struct Beside {
    /// The constant.
    pub mean: [f64; 3],
    /// Its standard error; amplitudes, phases and frequencies are unknowns.
    pub error: [f64; 3],
    /// Variance of the lines' integral at a random phase, (reading · samples)².
    pub swing: [f64; 3],
    /// Axes that have a line.
    pub has_line: [bool; 3],
}

/// The mean of a pose beside its significant lines; `None` without one. `sigma` is the noise of a quiet pose.
#[must_use]
pub fn beside_lines(readings: &[[f64; 3]], sigma: [f64; 3]) -> Option<Beside> {
    // Relative to a reading, an axis that never changes is exactly zero, not a rounding error with a spectrum.
    let (n, first) = (readings.len(), *readings.first()?);
    let part = DMatrix::from_fn(n, 3, |k, axis| readings[k][axis] - first[axis]);
    let mut rest = Model::of(&part, &[]).rest;
    let (mut lines, mut has_line): (Vec<f64>, _) = (Vec::new(), [false; 3]);
    while lines.len() < MOST_LINES
        && let Some((bin, axes)) = strongest(&rest)
    {
        let own: Vec<usize> = (0..3).filter(|&axis| axes[axis]).collect();
        lines.push(refined(
            &part.select_columns(&own),
            &lines,
            bin as f64 / n as f64,
        ));
        (0..3).for_each(|axis| has_line[axis] |= axes[axis]);
        rest = Model::of(&part, &lines).rest;
    }
    if lines.is_empty() {
        return None;
    }
    let model = Model::of(&part, &lines);
    let each: [(f64, f64, f64); 3] = std::array::from_fn(|axis| {
        let (mean, error) = model.constant(axis, &lines, sigma[axis]);
        (first[axis] + mean, error, model.swing(axis, &lines))
    });
    Some(Beside {
        mean: each.map(|one| one.0),
        error: each.map(|one| one.1),
        swing: each.map(|one| one.2),
        has_line,
    })
}

/// Bin of the strongest significant line of the axes together, and which of them have it.
fn strongest(rest: &DMatrix<f64>) -> Option<(usize, [bool; 3])> {
    let n = rest.nrows();
    let (taper, bins) = (window(n), n / 2);
    if bins < FEWEST_BINS {
        return None;
    }
    let width = FEWEST_BINS.max((n / 16) | 1).min(MOST_BINS);
    let relative: [Option<Vec<f64>>; 3] = std::array::from_fn(|axis| {
        let own = &power(rest.column(axis).as_slice(), &taper)[..bins];
        let usual = 0.5 * median(&mut own.to_vec());
        // The median of exponentially distributed power is ln 2 of its mean.
        let level: Vec<f64> = smooth(own, width)
            .iter()
            .map(|one| one.max(usual) / LN_2)
            .collect();
        let is_live = level.iter().all(|&one| one > 0.0);
        is_live.then(|| {
            own.iter()
                .zip(&level)
                .map(|(power, level)| power / level)
                .collect()
        })
    });
    let live: Vec<&Vec<f64>> = relative.iter().flatten().collect();
    let together = |k: usize| live.iter().map(|one| one[k]).sum::<f64>();
    let k = (FEWEST_CYCLES..bins).max_by(|&a, &b| together(a).total_cmp(&together(b)))?;
    // A bias random walk rises towards low frequencies: a line must exceed these too.
    let slower = (k - 5..k - 2).map(together).sum::<f64>() / 3.0;
    let chance = chi_square_tails(2.0 * together(k), 2.0 * live.len() as f64).1;
    if live.is_empty() || together(k) < ABOVE_SLOWER * slower || chance * n as f64 / 2.0 > SURE {
        return None;
    }
    let least = -SURE.ln() / 2.0;
    let axes = relative
        .each_ref()
        .map(|one| one.as_ref().is_some_and(|one| one[k] > least));
    axes.contains(&true).then_some((k, axes))
}

/// Least-squares frequency within the main lobe, one bin of `near`, the known lines fitted jointly.
fn refined(part: &DMatrix<f64>, lines: &[f64], near: f64) -> f64 {
    let mut scaled = part.clone();
    for mut column in scaled.column_iter_mut() {
        let size = column.variance().sqrt().max(f64::MIN_POSITIVE);
        column /= size;
    }
    let left = |f: f64| {
        let tried: Vec<f64> = lines.iter().copied().chain([f]).collect();
        Model::of(&scaled, &tried).rest.norm_squared()
    };
    // Golden section.
    let share = 0.5 * (5f64.sqrt() - 1.0);
    let bin = 1.0 / part.nrows() as f64;
    let (mut low, mut high) = (near - bin, near + bin);
    let (mut a, mut b) = (high - share * (high - low), low + share * (high - low));
    let (mut at_a, mut at_b) = (left(a), left(b));
    while high - low > REFINED * bin {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - share * (high - low);
            at_a = left(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + share * (high - low);
            at_b = left(b);
        }
    }
    0.5 * (low + high)
}

/// Least squares of constant and lines: the basis `(n, 1 + 2m)`, its coefficients, and what is left of the readings.
struct Model {
    basis: DMatrix<f64>,
    coefficients: DMatrix<f64>,
    rest: DMatrix<f64>,
}

impl Model {
    fn of(part: &DMatrix<f64>, lines: &[f64]) -> Self {
        let (n, m) = (part.nrows(), lines.len());
        let middle = 0.5 * (n as f64 - 1.0);
        let mut basis = DMatrix::from_element(n, 1 + 2 * m, 1.0);
        for (line, frequency) in lines.iter().enumerate() {
            for k in 0..n {
                let (sine, cosine) = (TAU * frequency * (k as f64 - middle)).sin_cos();
                basis[(k, 1 + line)] = cosine;
                basis[(k, 1 + m + line)] = sine;
            }
        }
        let coefficients = inverse(&basis) * basis.tr_mul(part);
        let rest = part - &basis * &coefficients;
        Self {
            basis,
            coefficients,
            rest,
        }
    }

    /// Sizes of cosine and sine of a line.
    fn pair(&self, axis: usize, line: usize) -> (f64, f64) {
        let m = self.basis.ncols() / 2;
        (
            self.coefficients[(1 + line, axis)],
            self.coefficients[(1 + m + line, axis)],
        )
    }

    fn swing(&self, axis: usize, lines: &[f64]) -> f64 {
        let of_line = |(line, frequency): (usize, &f64)| {
            let (a, b) = self.pair(axis, line);
            0.5 * (a * a + b * b) / (TAU * frequency).powi(2)
        };
        lines.iter().enumerate().map(of_line).sum()
    }

    /// The constant and its standard error.
    fn constant(&self, axis: usize, lines: &[f64], sigma: f64) -> (f64, f64) {
        let (n, m) = (self.basis.nrows(), lines.len());
        let rest: Vec<f64> = self.rest.column(axis).iter().copied().collect();
        let free = n.saturating_sub(1 + 3 * m).max(1) as f64;
        let level = (self.rest.column(axis).norm_squared() / free)
            .sqrt()
            .max(sigma);
        let mut columns = self.basis.clone().resize_horizontally(1 + 3 * m, 0.0);
        for line in 0..m {
            let (a, b) = self.pair(axis, line);
            for k in 0..n {
                let along = b * self.basis[(k, 1 + line)] - a * self.basis[(k, 1 + m + line)];
                columns[(k, 1 + 2 * m + line)] = (k as f64 - 0.5 * (n as f64 - 1.0)) * along;
            }
            let size = columns
                .column(1 + 2 * m + line)
                .norm()
                .max(f64::MIN_POSITIVE);
            columns.column_mut(1 + 2 * m + line).unscale_mut(size);
        }
        let error = level * inverse(&columns)[(0, 0)].sqrt();
        let blocks = (0..BLOCKS).map(|k| mean(&rest[k * n / BLOCKS..(k + 1) * n / BLOCKS]));
        let scatter = nalgebra::DVector::from_iterator(BLOCKS, blocks).variance() * BLOCKS as f64
            / (BLOCKS - 1) as f64;
        let scatter = (scatter / BLOCKS as f64).sqrt();
        let error = if scatter > 2.0 * error {
            scatter
        } else {
            error
        };
        let (tapered, its_error) = tapered(&rest, sigma);
        // A shaker of varying frequency remains in the residuals, away from frequency zero, where the mean is.
        if level > STILL_SHAKES * sigma && its_error < error {
            (self.coefficients[(0, axis)] + tapered, its_error)
        } else {
            (self.coefficients[(0, axis)], error)
        }
    }
}

/// Pseudo-inverse of the normal equations of some columns.
fn inverse(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let normal = columns.tr_mul(columns);
    let n = normal.nrows();
    normal
        .pseudo_inverse(1e-12)
        .unwrap_or_else(|_| DMatrix::zeros(n, n))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean by Hann's window and its standard error from the spectrum beside frequency zero.
///
/// Of motion k cycles from zero the window passes 1/k³, a plain mean 1/k. The noise of the mean is that of bins 3 to 6
/// (the window spreads frequency zero over two), and at least the sensor's white noise.
fn tapered(rest: &[f64], sigma: f64) -> (f64, f64) {
    let taper = window(rest.len());
    let whole: f64 = taper.iter().sum();
    let mean = rest
        .iter()
        .zip(&taper)
        .map(|(value, weight)| value * weight)
        .sum::<f64>()
        / whole;
    let away: Vec<f64> = rest.iter().map(|value| value - mean).collect();
    let beside = power(&away, &taper)[BESIDE].iter().sum::<f64>() / BESIDE.len() as f64;
    let white = sigma
        * taper
            .iter()
            .map(|weight| weight * weight)
            .sum::<f64>()
            .sqrt();
    (mean, (beside.sqrt() / whole).max(white / whole))
}
