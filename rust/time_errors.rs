//! Sampling instants that scatter about their timestamps, seen by two sensors at once (docs/diagnosis-method.md, 8.3).

use nalgebra::{Matrix4, Vector4};

use crate::chi_square::MEDIAN_SQUARE;
use crate::order_statistics::median;

/// Samples on either side through which the two polynomials go, and those beyond whose cubic gives the slope: apart, so
/// that an outlier among them is not both a slope and a departure from it, in both sensors at once.
const FEWER: usize = 3;
const NEAR: usize = 4;
const HALF: usize = 7;
/// Squared departure from the higher polynomial over that from the lower, of a motion at a quarter of the sampling
/// frequency: `(2 sin π/4)^2n / C(2n, n)` for n neighbours a side, squared, over the variance of noise. Slower motion has
/// less of it, a time error 1.
const OF_MOTION: f64 = 0.287;
/// Half the variance of the difference of neighbouring departures of independent time errors, from eight and from six
/// neighbours: `1 - ρ`, ρ = -8/9 and -6/7 because they share samples.
const OF_NEIGHBOURS: [f64; 2] = [17.0 / 9.0, 13.0 / 7.0];
/// Intervals of the window by which it may be longer: one more is a lost sample.
const LONGER: f64 = 0.5;
/// Largest noise, in sample intervals; fewest samples: four blocks of twelve give the error.
const SHARP: f64 = 0.5;
const FEWEST: usize = 50;
const OF_A_BLOCK: usize = 12;
/// Robust standard deviations beyond which a departure is no jitter: an outlier or a single loss.
const FARTHEST: f64 = 5.0;
/// Noise, in sample intervals, below which a sample has no more weight.
const LEAST_NOISE: f64 = 0.05;

/// Readings of a sensor in units of its noise.
type Readings<'a> = &'a [[f64; 3]];

/// Variance of the sampling instants about their timestamps [s²], its standard error, and the number of samples; the
/// error is infinite where too few tell.
///
/// A sample's departure from the polynomial through its eight neighbours at their timestamps, over the local slope, is
/// a time. Windows with a gap in the timestamps tell little: across it the polynomial is not the motion. Each sensor is
/// evaluated by itself: noise and vibration differ, only an error of time is common to both, and what a polynomial leaves
/// of the motion. That falls with its order, a time error does not: of the product of both sensors' departures that from
/// six neighbours, times `OF_MOTION`, is subtracted, so that a tremor below a quarter of the sampling frequency is no
/// jitter; where both sensors see it in opposite directions nothing is, which is then less. The departures of a faster
/// one are alike in neighbouring samples, those of time errors have opposite signs: the products are those of the
/// differences of neighbours.
#[must_use]
pub fn common_variance(
    (time, step): (&[f64], f64),
    sensors: [Readings<'_>; 2],
    is_clipped: &[bool],
    moves: &[[usize; 2]],
) -> (f64, f64, usize) {
    let mut seen: Vec<(usize, [Displaced; 2])> = Vec::new();
    for &[a, b] in moves.iter().filter(|[a, b]| b - a >= 3 * HALF) {
        let mut steps: Vec<f64> = time[a..b]
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect();
        let own = median(&mut steps);
        let longest = (2.0 * HALF as f64 + LONGER) * own;
        let whole = (a + HALF..b - HALF)
            .filter(|&k| !is_clipped[k] && time[k + HALF] - time[k - HALF] < longest);
        seen.extend(whole.filter_map(|k| {
            let window = Window::around(time, k, own)?;
            Some((k, sensors.map(|readings| window.displaced(readings, k))))
        }));
    }
    seen.retain(|(_, both)| both.iter().all(|one| one.sigma < SHARP * step));
    let n = seen.len();
    if n < FEWEST {
        return (0.0, f64::INFINITY, n);
    }
    let bound: [f64; 2] = std::array::from_fn(|s| {
        let mut squares: Vec<f64> = seen.iter().map(|(_, both)| both[s].time.powi(2)).collect();
        FARTHEST * (median(&mut squares) / MEDIAN_SQUARE).sqrt()
    });
    seen.retain(|(_, both)| (0..2).all(|s| both[s].time.abs() <= bound[s]));
    let weight = |both: &[Displaced; 2]| {
        1.0 / (both[0].sigma * both[1].sigma + (LEAST_NOISE * step).powi(2))
    };
    let common = |[one, other]: [&[Displaced; 2]; 2]| {
        let weight = (weight(one) * weight(other)).sqrt();
        let product = |of: fn(&Displaced) -> f64| -> f64 {
            (0..2).map(|s| of(&one[s]) - of(&other[s])).product()
        };
        ([product(|at| at.time), product(|at| at.by_fewer)], weight)
    };
    let pairs: Vec<([f64; 2], f64)> = seen
        .windows(2)
        .filter(|pair| pair[1].0 == pair[0].0 + 1)
        .map(|pair| common([&pair[0].1, &pair[1].1]))
        .collect();
    let n = pairs.len();
    if n < FEWEST {
        return (0.0, f64::INFINITY, n);
    }
    let less = |of_motion: f64| {
        let unit = 2.0 * (OF_NEIGHBOURS[0] - of_motion * OF_NEIGHBOURS[1]);
        let each = pairs.iter().map(|&([product, by_fewer], weight)| {
            (weight * (product - of_motion * by_fewer) / unit, weight)
        });
        mean(&each.collect::<Vec<_>>())
    };
    let (all, beyond_motion) = (less(0.0), less(OF_MOTION));
    let (value, spread) = if all.0 < beyond_motion.0 {
        all
    } else {
        beyond_motion
    };
    (value, spread, n)
}

/// Weighted mean of products, given with their weights, and its error. Neighbouring errors share samples (correlation
/// over eight): it comes from blocks.
fn mean(each: &[(f64, f64)]) -> (f64, f64) {
    let n = each.len();
    let sum = |part: &[(f64, f64)]| {
        part.iter()
            .fold((0.0, 0.0), |(a, b), one| (a + one.0, b + one.1))
    };
    let (products, weights) = sum(each);
    let value = products / weights;
    let blocks = (n / OF_A_BLOCK).max(4);
    let of_block = |k: usize| {
        let (product, weight) = sum(&each[k * n / blocks..(k + 1) * n / blocks]);
        (product - value * weight).powi(2)
    };
    let spread = (0..blocks).map(of_block).sum::<f64>().sqrt() / weights;
    // Readings that never change tell nothing.
    let spread = if spread > 0.0 { spread } else { f64::INFINITY };
    (value, spread)
}

/// Time by which a sensor sees a sample displaced, by the polynomial through its eight and through its six neighbours, in
/// units in which noise has one variance, and that noise.
#[derive(Clone, Copy)]
struct Displaced {
    time: f64,
    by_fewer: f64,
    sigma: f64,
}

/// Weights by which the samples around one give what it should read, and the slope there.
struct Window {
    value: [f64; 2 * NEAR],
    by_fewer: [f64; 2 * FEWER],
    slope: [f64; 2 * (HALF - NEAR)],
}

impl Window {
    /// The window of sample `k`; none where timestamps coincide.
    fn around(time: &[f64], k: usize, step: f64) -> Option<Self> {
        let at = |place: usize| (time[place] - time[k]) / step;
        let powers = beyond(k).map(|place| {
            let x = at(place);
            Vector4::new(1.0, x, x * x, x.powi(3))
        });
        let normal: Matrix4<f64> = powers.iter().map(|row| row * row.transpose()).sum();
        let of_slope = normal.cholesky()?.solve(&Vector4::y());
        let slope = powers.map(|row| row.dot(&of_slope) / step);
        Some(Self {
            value: through(nearest(k).map(at)),
            by_fewer: through(nearest(k).map(at)),
            slope,
        })
    }

    /// Time by which a sensor sees sample `k` displaced.
    fn displaced(&self, readings: Readings<'_>, k: usize) -> Displaced {
        let along = |places: &[usize], weights: &[f64], axis: usize| -> f64 {
            let each = places.iter().zip(weights);
            each.map(|(&place, weight)| weight * readings[place][axis])
                .sum()
        };
        let slope: [f64; 3] = std::array::from_fn(|axis| along(&beyond(k), &self.slope, axis));
        let squares: f64 = slope.iter().map(|one| one * one).sum();
        // Variance of the departure over that of a sample.
        let factor = |weights: &[f64]| 1.0 + weights.iter().map(|w| w * w).sum::<f64>();
        let squares = squares.max(factor(&self.value) * 1e-30);
        let time = |places: &[usize], weights: &[f64]| -> f64 {
            let departure = |axis: usize| readings[k][axis] - along(places, weights, axis);
            let product: f64 = (0..3).map(|axis| slope[axis] * departure(axis)).sum();
            product / squares / factor(weights).sqrt()
        };
        Displaced {
            time: time(&nearest::<{ 2 * NEAR }>(k), &self.value),
            by_fewer: time(&nearest::<{ 2 * FEWER }>(k), &self.by_fewer),
            sigma: (factor(&self.value) / squares).sqrt(),
        }
    }
}

/// Weights of samples at these places in the polynomial through them, at zero.
fn through<const N: usize>(places: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| {
        let others = (0..N).filter(|&j| j != i);
        others
            .map(|j| places[j] / (places[j] - places[i]))
            .product()
    })
}

/// The `N` samples around `k` without it.
fn nearest<const N: usize>(k: usize) -> [usize; N] {
    std::array::from_fn(|i| k + i + usize::from(i >= N / 2) - N / 2)
}

/// Those beyond the nearest.
fn beyond(k: usize) -> [usize; 2 * (HALF - NEAR)] {
    std::array::from_fn(|i| k + i + if i < HALF - NEAR { 0 } else { 2 * NEAR + 1 } - HALF)
}
