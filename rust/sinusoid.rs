//! Power of a series explained by a sinusoid, over a grid of frequencies.

use std::f64::consts::TAU;

use rayon::prelude::*;

/// Samples processed at all frequencies while they are in the cache.
const CHUNK: usize = 512;

/// Sums over the samples at one frequency: `Σ x cos`, `Σ x sin`, `Σ cos 2φ`, `Σ sin 2φ`.
type Sums = [f64; 4];

/// Power `‖A (AᵀA)⁻¹ Aᵀ x‖²` that a sinusoid explains, `A = (cos 2πft, sin 2πft)`, at `count` frequencies
/// `start_hz + k step_hz`.
///
/// The phases at one frequency become those at the next by a rotation of every sample: two sines and cosines per sample
/// in all. Sums are added in the order of time, for any number of threads.
#[must_use]
pub fn explained(
    time_s: &[f64],
    readings: &[f64],
    start_hz: f64,
    step_hz: f64,
    count: usize,
) -> Vec<f64> {
    let parts: Vec<Vec<Sums>> = time_s
        .par_chunks(CHUNK)
        .zip(readings.par_chunks(CHUNK))
        .map(|(t, x)| chunk_sums(t, x, start_hz, step_hz, count))
        .collect();
    let n = time_s.len() as f64;
    (0..count)
        .map(|k| {
            let mut sums = [0.0; 4];
            for part in &parts {
                for (sum, value) in sums.iter_mut().zip(part[k]) {
                    *sum += value;
                }
            }
            let [x_cos, x_sin, twice_cos, twice_sin] = sums;
            let (cc, ss, cs) = (
                0.5 * (n + twice_cos),
                0.5 * (n - twice_cos),
                0.5 * twice_sin,
            );
            let det = cc * ss - cs * cs;
            // At frequency zero, and at half a sampling rate, there is no sine.
            if det > f64::EPSILON * n * n {
                (ss * x_cos * x_cos - 2.0 * cs * x_cos * x_sin + cc * x_sin * x_sin) / det
            } else {
                (x_cos * x_cos + x_sin * x_sin) / n
            }
        })
        .collect()
}

fn chunk_sums(t: &[f64], x: &[f64], start_hz: f64, step_hz: f64, count: usize) -> Vec<Sums> {
    let phase = |f: f64| move |t: &f64| (TAU * f * t).sin_cos();
    let (mut sine, mut cosine): (Vec<f64>, Vec<f64>) = t.iter().map(phase(start_hz)).unzip();
    let (by_sine, by_cosine): (Vec<f64>, Vec<f64>) = t.iter().map(phase(step_hz)).unzip();
    let n = t.len();
    let (x, by_sine, by_cosine) = (&x[..n], &by_sine[..n], &by_cosine[..n]);
    (0..count)
        .map(|_| {
            let (sine, cosine) = (&mut sine[..n], &mut cosine[..n]);
            // Four sums side by side keep the vector unit busy.
            let mut lanes = [[0.0; LANES]; 4];
            for k in 0..n {
                let (s, c) = (sine[k], cosine[k]);
                let lane = k % LANES;
                lanes[0][lane] += x[k] * c;
                lanes[1][lane] += x[k] * s;
                lanes[2][lane] += c * c - s * s;
                lanes[3][lane] += 2.0 * s * c;
                sine[k] = s * by_cosine[k] + c * by_sine[k];
                cosine[k] = c * by_cosine[k] - s * by_sine[k];
            }
            lanes.map(|lane| lane.iter().sum())
        })
        .collect()
}

/// Sums kept side by side.
const LANES: usize = 4;
