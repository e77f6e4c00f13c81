//! Sampling instants that scatter about their timestamps, seen by two sensors at once (docs/diagnosis-method.md, 8.3).

use nalgebra::{Matrix4, Vector4};

use crate::chi_square::MEDIAN_SQUARE;
use crate::order_statistics::median;

/// Samples on either side through which the quintic goes, and those beyond whose cubic gives the slope: apart, so that
/// an outlier among them is not both a slope and a departure from it, in both sensors at once.
const NEAR: usize = 3;
const HALF: usize = 6;
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
/// A sample's departure from the quintic through its six neighbours at their timestamps, over the local slope, is a
/// time. Windows with a gap in the timestamps tell little: across it the quintic is not the motion. Each sensor is
/// evaluated by itself: noise, curvature and vibration differ, only an error of time is common to both. The curvature of
/// the motion is common to both too, hence the high order: a step's departure from its neighbours was taken for jitter in
/// quick motion at 10 to 50 Hz.
#[must_use]
pub fn common_variance(
    (time, step): (&[f64], f64),
    sensors: [Readings<'_>; 2],
    is_clipped: &[bool],
    moves: &[[usize; 2]],
) -> (f64, f64, usize) {
    let mut seen: Vec<[(f64, f64); 2]> = Vec::new();
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
            Some(sensors.map(|readings| window.displaced(readings, k)))
        }));
    }
    seen.retain(|both| both.iter().all(|(_, sigma)| *sigma < SHARP * step));
    let n = seen.len();
    if n < FEWEST {
        return (0.0, f64::INFINITY, n);
    }
    let bound: [f64; 2] = std::array::from_fn(|s| {
        let mut squares: Vec<f64> = seen.iter().map(|both| both[s].0 * both[s].0).collect();
        FARTHEST * (median(&mut squares) / MEDIAN_SQUARE).sqrt()
    });
    seen.retain(|both| (0..2).all(|s| both[s].0.abs() <= bound[s]));
    let n = seen.len();
    let weighted = |both: &[(f64, f64); 2]| {
        let weight = 1.0 / (both[0].1 * both[1].1 + (LEAST_NOISE * step).powi(2));
        (weight * both[0].0 * both[1].0, weight)
    };
    let each: Vec<(f64, f64)> = seen.iter().map(weighted).collect();
    let sum = |part: &[(f64, f64)]| {
        part.iter()
            .fold((0.0, 0.0), |(a, b), one| (a + one.0, b + one.1))
    };
    let (products, weights) = sum(&each);
    let value = products / weights;
    // Neighbouring errors share samples (correlation over six): the error of the mean comes from blocks.
    let blocks = (n / OF_A_BLOCK).max(4);
    let of_block = |k: usize| {
        let (product, weight) = sum(&each[k * n / blocks..(k + 1) * n / blocks]);
        (product - value * weight).powi(2)
    };
    let spread = (0..blocks).map(of_block).sum::<f64>().sqrt() / weights;
    // Readings that never change tell nothing.
    let spread = if spread > 0.0 { spread } else { f64::INFINITY };
    (value, spread, n)
}

/// Weights by which the samples around one give what it should read, and the slope there.
struct Window {
    value: [f64; 2 * NEAR],
    slope: [f64; 2 * (HALF - NEAR)],
}

impl Window {
    /// The window of sample `k`; none where timestamps coincide.
    fn around(time: &[f64], k: usize, step: f64) -> Option<Self> {
        let at = |place: usize| (time[place] - time[k]) / step;
        let near = nearest(k).map(at);
        let value = std::array::from_fn(|i| {
            let others = (0..near.len()).filter(|&j| j != i);
            others.map(|j| near[j] / (near[j] - near[i])).product()
        });
        let powers = beyond(k).map(|place| {
            let x = at(place);
            Vector4::new(1.0, x, x * x, x.powi(3))
        });
        let normal: Matrix4<f64> = powers.iter().map(|row| row * row.transpose()).sum();
        let of_slope = normal.cholesky()?.solve(&Vector4::y());
        let slope = powers.map(|row| row.dot(&of_slope) / step);
        Some(Self { value, slope })
    }

    /// Time by which a sensor sees sample `k` displaced, and its noise.
    fn displaced(&self, readings: Readings<'_>, k: usize) -> (f64, f64) {
        let along = |places: &[usize], weights: &[f64], axis: usize| -> f64 {
            let each = places.iter().zip(weights);
            each.map(|(&place, weight)| weight * readings[place][axis])
                .sum()
        };
        let (mut squares, mut product) = (0.0, 0.0);
        for axis in 0..3 {
            let slope = along(&beyond(k), &self.slope, axis);
            squares += slope * slope;
            product += slope * (readings[k][axis] - along(&nearest(k), &self.value, axis));
        }
        // Variance of the departure over that of a sample.
        let factor = 1.0 + self.value.iter().map(|weight| weight * weight).sum::<f64>();
        let squares = squares.max(factor * 1e-30);
        (product / squares / factor.sqrt(), (factor / squares).sqrt())
    }
}

/// The samples around `k` without it.
fn nearest(k: usize) -> [usize; 2 * NEAR] {
    std::array::from_fn(|i| k + i + usize::from(i >= NEAR) - NEAR)
}

/// Those beyond them.
fn beyond(k: usize) -> [usize; 2 * (HALF - NEAR)] {
    std::array::from_fn(|i| k + i + if i < HALF - NEAR { 0 } else { 2 * NEAR + 1 } - HALF)
}
