//! Joints of a motion: whether samples are missing between two neighbouring ones, by the likelihood of an
//! autoregression of the motion above the noise of the sensor (docs/diagnosis-method.md, 8.16).

use std::iter::successors;
use std::ops::Range;

use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

use crate::autoregression::Autoregression;
use crate::error::{Error, Result};

/// Samples on either side of a joint that are compared.
pub const HALF: usize = 6;
const WINDOW: usize = 2 * HALF;
/// Contrasts of a window that do not depend on its mean.
const FREE: usize = WINDOW - 1;
/// Least variance of a contrast, of the largest: a smooth motion has none that rounding does not exceed.
const SMOOTHEST: f64 = 1e-9;
/// Powers of the motion tried in a window, of that of all moves: 10⁻⁵ to 250, in steps of four.
const POWERS: [i32; 13] = [-8, -7, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4];
/// Variances of the shocks of a motion, of that of its own.
const SIZES: [f64; 6] = [1e1, 1e2, 1e3, 1e4, 1e5, 1e6];
/// Samples of a window that have them: those beside the joint (a jolt), or all from one beside it on, where another
/// motion begins (a mount that rings when a move stops).
const SHOCKED: [Range<usize>; 3] = [HALF - 1..HALF + 2, HALF - 1..WINDOW, HALF..WINDOW];

/// Samples that are missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loss {
    /// The sample behind which they are missing.
    pub sample: usize,
    /// Their number, the likeliest.
    pub count: usize,
    /// Log-likelihood that they gain over none missing, with or without shocks.
    pub gain: f64,
    /// The same over motions before and after that have nothing to do with one another.
    pub over_unrelated: f64,
}

/// What the joints of a motion show.
#[derive(Debug, Clone, Default)]
pub struct Joints {
    /// Losses, clearest first, none within a window of another.
    pub losses: Vec<Loss>,
    /// Number of joints at which as many missing samples as the median loss has would be one.
    pub telling: usize,
}

/// Logarithms: the gain that is asked of a loss, and the prior odds against shocks at a joint.
#[derive(Clone, Copy)]
struct Odds {
    least: f64,
    rarity: f64,
}

/// Three axes of a sensor in units of the noise of one sample: `(n, 3)`, row by row.
pub type Readings<'a> = &'a [[f64; 3]];
type Window = [[f64; 3]; WINDOW];

/// A covariance of windows, apart from their mean: eigenvectors, and the inverse variances with the logarithm of their
/// determinant at every power of the motion.
struct Likelihood {
    vectors: [[f64; WINDOW]; FREE],
    at: Vec<([f64; FREE], f64)>,
}

impl Likelihood {
    fn of(covariance: &DMatrix<f64>, power: f64) -> Self {
        let contrasts = contrasts();
        let eigen = SymmetricEigen::new(contrasts.transpose() * covariance * &contrasts);
        let vectors = contrasts * eigen.eigenvectors;
        let least = SMOOTHEST * eigen.eigenvalues.max();
        let at = POWERS.iter().map(|&n| {
            let variance: [f64; FREE] = std::array::from_fn(|i| {
                1.0 + power * 4f64.powi(n) * eigen.eigenvalues[i].max(least)
            });
            let log_det = variance.iter().map(|v| v.ln()).sum();
            (variance.map(|v| 1.0 / v), log_det)
        });
        Self {
            at: at.collect(),
            vectors: std::array::from_fn(|i| std::array::from_fn(|j| vectors[(j, i)])),
        }
    }

    /// Log-likelihood of a window, its motion as large as fits best.
    fn of_window(&self, window: &Window) -> f64 {
        let squares: [f64; FREE] = std::array::from_fn(|i| {
            let mut sum = [0.0; 3];
            for (weight, row) in self.vectors[i].iter().zip(window) {
                for (total, value) in sum.iter_mut().zip(row) {
                    *total += weight * value;
                }
            }
            sum.iter().map(|s| s * s).sum()
        });
        let each = self.at.iter().map(|(inverse, log_det)| {
            let chi2: f64 = squares.iter().zip(inverse).map(|(s, i)| s * i).sum();
            -0.5 * (chi2 + 3.0 * log_det)
        });
        each.fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Orthonormal contrasts `(WINDOW, FREE)` that vanish for a constant (Helmert).
fn contrasts() -> DMatrix<f64> {
    DMatrix::from_fn(WINDOW, FREE, |row, column| {
        let k = (column + 1) as f64;
        let size = (k * (k + 1.0)).sqrt();
        match row.cmp(&(column + 1)) {
            std::cmp::Ordering::Less => 1.0 / size,
            std::cmp::Ordering::Equal => -k / size,
            std::cmp::Ordering::Greater => 0.0,
        }
    })
}

/// Likelihoods of a sensor's windows: with 0, 1, ... samples missing, with shocks of each size, and with sides that
/// have nothing to do with one another.
struct Sensor<'a> {
    readings: Readings<'a>,
    each: Vec<Likelihood>,
}

impl<'a> Sensor<'a> {
    fn of(readings: Readings<'a>, moves: &[[usize; 2]], most: usize) -> Self {
        let own: Vec<&[[f64; 3]]> = moves
            .iter()
            .map(|&[a, b]| &readings[a..b])
            .filter(|one| one.len() > WINDOW && one.iter().flatten().all(|v| v.is_finite()))
            .collect();
        let motion = Autoregression::of(&own);
        let covariance = motion.covariance(WINDOW + most);
        let power = own.iter().map(|one| variance(one)).sum::<f64>() / own.len().max(1) as f64;
        let lag = |i: usize, j: usize| covariance[i.abs_diff(j)] / covariance[0];
        let missing = (0..=most).map(|n| {
            let at = |i: usize| if i < HALF { i } else { i + n };
            let between = DMatrix::from_fn(WINDOW, WINDOW, |i, j| lag(at(i), at(j)));
            Likelihood::of(&between, power)
        });
        let response = motion.response(WINDOW);
        let shocked = |samples: &Range<usize>, size: f64| {
            DMatrix::from_fn(WINDOW, WINDOW, |i, j| {
                let both = samples.clone().take_while(|&shock| shock <= i.min(j));
                let sum: f64 = both
                    .map(|shock| response[i - shock] * response[j - shock])
                    .sum();
                lag(i, j) + size * sum / covariance[0]
            })
        };
        let shocks = SHOCKED
            .iter()
            .flat_map(|samples| SIZES.map(|size| Likelihood::of(&shocked(samples, size), power)));
        let aside = DMatrix::from_fn(WINDOW, WINDOW, |i, j| {
            f64::from(u8::from((i < HALF) == (j < HALF))) * lag(i, j)
        });
        let unrelated = Likelihood::of(&aside, power);
        Self {
            readings,
            each: missing.chain(shocks).chain([unrelated]).collect(),
        }
    }

    /// Samples up to `after` and those behind it, without the first `skipped` of these.
    fn window(&self, after: usize, skipped: usize) -> Window {
        std::array::from_fn(|i| {
            let at = after + 1 + i - HALF;
            self.readings[if i < HALF { at } else { at + skipped }]
        })
    }
}

/// The joints inside the moves `[first, last)`, with fewer than `most` samples missing; `least` is the gain that is
/// asked. Shocks come once a move, at any of its joints alike. No window has a sample behind a gap or at a limit
/// (`is_broken`), or a reading that is not finite.
///
/// # Errors
/// `BadInput` when the moves are not within the readings, or lengths differ.
pub fn joints(
    sensors: &[Readings<'_>],
    moves: &[[usize; 2]],
    is_broken: &[bool],
    most: usize,
    least: f64,
) -> Result<Joints> {
    let n = is_broken.len();
    if moves.iter().any(|&[a, b]| a > b || b > n) || sensors.iter().any(|one| one.len() != n) {
        return Err(Error::bad_input("moves are ranges of the readings"));
    }
    let known: Vec<Sensor<'_>> = sensors
        .par_iter()
        .map(|one| Sensor::of(one, moves, most))
        .collect();
    let n_joints: usize = moves.iter().map(|&[a, b]| b - a).sum();
    let rarity = (n_joints.max(1) as f64 / moves.len().max(1) as f64).ln();
    let odds = Odds { least, rarity };
    // Counts tried at every joint; all are tried where one of these gains half of what is asked.
    let coarse: Vec<usize> = successors(Some(1), |n| Some(2 * n))
        .take_while(|&n| n <= most)
        .collect();
    let places: Vec<usize> = moves
        .iter()
        .flat_map(|&[a, b]| a + HALF - 1..b.saturating_sub(HALF + 1).max(a + HALF - 1))
        .filter(|&k| !is_broken[k + 1 - HALF..=k + HALF + 1].contains(&true))
        .collect();
    let at = |sample: usize, skipped: usize| -> Option<Vec<Window>> {
        let windows: Vec<Window> = known.iter().map(|s| s.window(sample, skipped)).collect();
        let is_whole = windows.iter().flatten().flatten().all(|v| v.is_finite());
        is_whole.then_some(windows)
    };
    let seen = |&sample: &usize| {
        at(sample, 0).map(|whole| likeliest(&known, (sample, &whole), (&coarse, most), odds))
    };
    let losses = apart(
        places
            .par_iter()
            .filter_map(seen)
            .filter(|loss| loss.gain > least && loss.count < most)
            .collect(),
    );
    // More samples show at more joints than one does.
    let lost = median_count(&losses, least);
    let tells = |&&sample: &&usize| {
        let last = sample + HALF + lost;
        let cut = (last < n && !is_broken[sample + HALF + 1..=last].contains(&true))
            .then(|| at(sample, lost))
            .flatten();
        cut.is_some_and(|cut| {
            likeliest(&known, (sample, &cut), (&[lost], lost), odds).over_unrelated > least
        })
    };
    let telling = places.par_iter().filter(tells).count();
    Ok(Joints { losses, telling })
}

/// The median number of samples missing at losses that nothing else explains; one where there are none.
fn median_count(losses: &[Loss], least: f64) -> usize {
    let certain = losses.iter().filter(|one| one.over_unrelated > least);
    let mut counts: Vec<usize> = certain.map(|one| one.count).collect();
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or(1)
}

/// The clearest losses, none within a window of another.
fn apart(mut all: Vec<Loss>) -> Vec<Loss> {
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut out: Vec<Loss> = Vec::new();
    for one in all {
        if out
            .iter()
            .all(|other| one.sample.abs_diff(other.sample) > WINDOW)
        {
            out.push(one);
        }
    }
    out
}

/// The likeliest number of missing samples behind `sample`; its gains, which are over none alone where that is less
/// than half of `least`.
fn likeliest(
    known: &[Sensor<'_>],
    (sample, windows): (usize, &[Window]),
    (coarse, most): (&[usize], usize),
    Odds { least, rarity }: Odds,
) -> Loss {
    let of = |hypothesis: usize| -> f64 {
        let each = known.iter().zip(windows);
        each.map(|(one, window)| one.each[hypothesis].of_window(window))
            .sum()
    };
    let best = |counts: &mut dyn Iterator<Item = usize>| {
        counts
            .map(|n| (n, of(n)))
            .fold((0, f64::NEG_INFINITY), |a, b| if b.1 > a.1 { b } else { a })
    };
    let mut rival = of(0);
    let mut found = best(&mut coarse.iter().copied());
    let mut unrelated = rival;
    if found.1 - rival > 0.5 * least {
        found = best(&mut (1..=most));
        let last = known.first().map_or(0, |one| one.each.len() - 1);
        let shocks = last - SHOCKED.len() * SIZES.len()..last;
        rival = shocks.map(|k| of(k) - rarity).fold(rival, f64::max);
        unrelated = of(last).max(rival);
    }
    Loss {
        sample,
        count: found.0,
        gain: found.1 - rival,
        over_unrelated: found.1 - unrelated,
    }
}

/// Mean variance of the axes.
fn variance(readings: &[[f64; 3]]) -> f64 {
    let n = readings.len() as f64;
    let of_axis = |c: usize| {
        let mean = readings.iter().map(|row| row[c]).sum::<f64>() / n;
        readings
            .iter()
            .map(|row| (row[c] - mean).powi(2))
            .sum::<f64>()
            / n
    };
    (0..3).map(of_axis).sum::<f64>() / 3.0
}
