//! Sampling instants that scatter about their timestamps, seen by two sensors at once (docs/diagnosis-method.md, 8.3).

use crate::chi_square::MEDIAN_SQUARE;
use crate::order_statistics::median;

/// Weights of the quintic through the six samples around one, at that one: by distance.
const NEIGHBOURS: [f64; 3] = [0.75, -0.3, 0.05];
/// Samples on either side whose cubic gives the slope, so that vibration is not taken for motion.
const HALF: usize = 6;
/// Largest noise, in sample intervals; fewest samples: four blocks of twelve give the error.
const SHARP: f64 = 0.5;
const FEWEST: usize = 50;
const OF_A_BLOCK: usize = 12;
/// Robust standard deviations at which a time error is clipped, so that single losses do not dominate.
const CLIPPED: f64 = 5.0;
/// Noise, in sample intervals, below which a sample has no more weight.
const LEAST_NOISE: f64 = 0.05;

/// Readings of a sensor in units of its noise.
type Readings<'a> = &'a [[f64; 3]];

/// Variance of the sampling instants about their timestamps [s²], its standard error, and the number of samples; the
/// error is infinite where too few tell.
///
/// A sample's departure from the quintic through its six neighbours, over the local slope, is a time. Each sensor is
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
        let whole = (a + HALF..b - HALF).filter(|&k| !is_clipped[k]);
        seen.extend(whole.map(|k| sensors.map(|readings| displaced(readings, k, own))));
    }
    seen.retain(|both| both.iter().all(|(_, sigma)| *sigma < SHARP * step));
    let n = seen.len();
    if n < FEWEST {
        return (0.0, f64::INFINITY, n);
    }
    let bound: [f64; 2] = std::array::from_fn(|s| {
        let mut squares: Vec<f64> = seen.iter().map(|both| both[s].0 * both[s].0).collect();
        CLIPPED * (median(&mut squares) / MEDIAN_SQUARE).sqrt()
    });
    let weighted = |both: &[(f64, f64); 2]| {
        let times: [f64; 2] = std::array::from_fn(|s| both[s].0.clamp(-bound[s], bound[s]));
        let weight = 1.0 / (both[0].1 * both[1].1 + (LEAST_NOISE * step).powi(2));
        (weight * times[0] * times[1], weight)
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
    (value / error_factor(), spread / error_factor(), n)
}

/// Variance of a sample's departure from the quintic over the variance of the samples.
fn error_factor() -> f64 {
    1.0 + 2.0 * NEIGHBOURS.iter().map(|weight| weight * weight).sum::<f64>()
}

/// Time by which a sensor sees a sample displaced, and its noise.
fn displaced(readings: Readings<'_>, k: usize, step: f64) -> (f64, f64) {
    let power = |n: i32| 2.0 * (1..=HALF).map(|o| (o as f64).powi(n)).sum::<f64>();
    let (second, fourth, sixth) = (power(2), power(4), power(6));
    let (mut squares, mut along) = (0.0, 0.0);
    for axis in 0..3 {
        let at = |o: usize| (readings[k - o][axis], readings[k + o][axis]);
        let slope: f64 = (1..=HALF)
            .map(|o| {
                let x = o as f64;
                let weight = (sixth * x - fourth * x.powi(3)) / (second * sixth - fourth * fourth);
                weight * (at(o).1 - at(o).0) / step
            })
            .sum();
        let around = (1..=3).map(|o| NEIGHBOURS[o - 1] * (at(o).0 + at(o).1));
        squares += slope * slope;
        along += slope * (readings[k][axis] - around.sum::<f64>());
    }
    let squares = squares.max(error_factor() * 1e-30);
    (along / squares, (error_factor() / squares).sqrt())
}
