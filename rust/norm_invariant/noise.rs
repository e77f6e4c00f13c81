//! Predictions from the noise of the readings: standard errors, excess of a norm, systematic error of the estimate.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use nalgebra::SVector;
use rayon::prelude::*;

use super::lanes::{Eights, LANES, Row, ZERO, columns, dot, filler, force, load, mirrored, store};
use super::sums::{At, SHARE, by_share};
use super::{N_PARAMETERS, Readings};
use crate::simd::{Instructions, fma, for_each_instruction_set};

/// Noise of eight readings, row by row.
#[inline(always)]
fn load_noise(readings: &Readings<'_>, first: usize, n: usize, out: &mut [Row; 9]) {
    for l in 0..LANES {
        let noise = readings.noise_of(first + if l < n { l } else { n - 1 });
        for c in 0..9 {
            out[c][l] = noise[(c / 3, c % 3)];
        }
    }
}

/// Standard error and expected excess of the residual of each reading (see [`super::problem::FixedNoise`]).
pub(super) fn predict(readings: &Readings<'_>, at: &At, sigma: &mut [f64], excess: &mut [f64]) {
    let instructions = Instructions::detect();
    let write = |((k, sigma), excess): ((usize, &mut [f64]), &mut [f64])| {
        write_predictions(instructions, readings, k * SHARE, at, sigma, excess);
    };
    if sigma.len() <= SHARE {
        write(((0, sigma), excess));
    } else {
        sigma
            .par_chunks_mut(SHARE)
            .enumerate()
            .zip(excess.par_chunks_mut(SHARE))
            .for_each(write);
    }
}

for_each_instruction_set! {
    fn write_predictions(
        readings: &Readings<'_>,
        first: usize,
        at: &At,
        sigma: &mut [f64],
        excess: &mut [f64],
    ) = write_predictions_lanes
}

#[inline(always)]
fn write_predictions_lanes<const FUSED: bool>(
    readings: &Readings<'_>,
    first: usize,
    at: &At,
    sigma: &mut [f64],
    excess: &mut [f64],
) {
    let s = &at.model.s;
    let metric = s.transpose() * s;
    let per_two_g = 0.5 / at.settings.gravity;
    let (mut u, mut noise) = ([ZERO; 3], [ZERO; 9]);
    let (mut found_sigma, mut found_excess) = (ZERO, ZERO);
    let common = (readings.noise.len() == 1).then(|| {
        let spread = s * readings.noise_of(first) * s.transpose();
        let rows = [0, 1, 2].map(|i| [spread[(i, 0)], spread[(i, 1)], spread[(i, 2)]]);
        (rows, spread.trace())
    });
    let values = &readings.values[first..first + sigma.len()];
    let values = Eights::of(values, filler(values));
    let parts = sigma.chunks_mut(LANES).zip(excess.chunks_mut(LANES));
    for (chunk, (sigma, excess)) in parts.enumerate() {
        let (here, n) = (first + chunk * LANES, sigma.len());
        load(values.at(chunk), &at.standard, &mut u);
        if common.is_none() {
            load_noise(readings, here, n, &mut noise);
        }
        for l in 0..LANES {
            let f = force::<FUSED>(&at.model, &u, l);
            let per_square = 1.0 / dot::<FUSED>(f, f);
            // uᵀ S Σ Sᵀ u, and tr S Σ Sᵀ = Σ_jk (SᵀS)_jk Σ_jk.
            let (along, trace) = if let Some((spread, trace)) = &common {
                let seen = [0, 1, 2].map(|i| dot::<FUSED>(spread[i], f));
                (dot::<FUSED>(f, seen) * per_square, *trace)
            } else {
                // = vᵀ Σ v with v = Sᵀ u.
                let v = [0, 1, 2].map(|j| dot::<FUSED>(f, [s[(0, j)], s[(1, j)], s[(2, j)]]));
                let (mut along, mut trace) = (0.0, 0.0);
                for j in 0..3 {
                    for k in 0..3 {
                        let n = noise[3 * j + k][l];
                        along = fma::<FUSED>(v[j] * v[k], n, along);
                        trace = fma::<FUSED>(metric[(j, k)], n, trace);
                    }
                }
                (along * per_square, trace)
            };
            let across = trace - along;
            // A pose whose noisy axes all lie across gravity still has some noise along it.
            let floor = 1e-6 * trace;
            found_sigma[l] = if along > floor { along } else { floor }.sqrt();
            found_excess[l] = across * per_two_g;
        }
        store(&found_sigma, sigma);
        store(&found_excess, excess);
    }
}

/// `E[Jᵀr]` at the truth: a whitened residual and its own derivative share noise, so that their product has a mean.
///
/// With `n` the noise of a reading, `E[∂r/∂S_jk · r] = u_j (Σ Sᵀ u)_k + (P S Σ Sᵀ u)_j a_k/|g|`, `P = I - uuᵀ`, and
/// for `b` the second term without `a`.
pub(super) fn noise_in_gradient(
    readings: &Readings<'_>,
    sigma: &[f64],
    at: &At,
) -> SVector<f64, N_PARAMETERS> {
    let instructions = Instructions::detect();
    by_share(
        readings.values.len(),
        |k| {
            let mut sums = [ZERO; N_PARAMETERS];
            let stop = ((k + 1) * SHARE).min(sigma.len());
            add_noise(
                instructions,
                readings,
                k * SHARE,
                &sigma[k * SHARE..stop],
                at,
                &mut sums,
            );
            SVector::<f64, N_PARAMETERS>::from_fn(|i, _| sums[i].iter().sum())
        },
        |a, b| a + b,
    )
    .unwrap_or_else(SVector::zeros)
}

for_each_instruction_set! {
    fn add_noise(
        readings: &Readings<'_>,
        first: usize,
        sigma: &[f64],
        at: &At,
        sums: &mut [Row; N_PARAMETERS],
    ) = add_noise_lanes
}

#[inline(always)]
fn add_noise_lanes<const FUSED: bool>(
    readings: &Readings<'_>,
    first: usize,
    sigma: &[f64],
    at: &At,
    sums: &mut [Row; N_PARAMETERS],
) {
    let (s, g) = (&at.model.s, at.settings.gravity);
    let per_square = 1.0 / (at.standard.size * at.standard.size);
    let mirrored = mirrored(at.settings.frame);
    let (mut u, mut noise) = ([ZERO; 3], [ZERO; 9]);
    let is_common = readings.noise.len() == 1;
    let values = &readings.values[first..first + sigma.len()];
    let values = Eights::of(values, filler(values));
    let sigmas = Eights::of(sigma, f64::INFINITY);
    for chunk in 0..sigma.len().div_ceil(LANES) {
        let here = first + chunk * LANES;
        let n = LANES.min(first + sigma.len() - here);
        load(values.at(chunk), &at.standard, &mut u);
        let sigmas = sigmas.at(chunk);
        if chunk == 0 || !is_common {
            load_noise(readings, here, n, &mut noise);
        }
        for l in 0..LANES {
            let f = force::<FUSED>(&at.model, &u, l);
            let scale = 1.0 / dot::<FUSED>(f, f).sqrt();
            let up = f.map(|c| c * scale);
            let (mut v, mut shared, mut spread) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            for j in 0..3 {
                v[j] = dot::<FUSED>(up, [s[(0, j)], s[(1, j)], s[(2, j)]]) * per_square;
            }
            for j in 0..3 {
                let row = [noise[3 * j][l], noise[3 * j + 1][l], noise[3 * j + 2][l]];
                shared[j] = dot::<FUSED>(row, v);
            }
            for i in 0..3 {
                spread[i] = dot::<FUSED>([s[(i, 0)], s[(i, 1)], s[(i, 2)]], shared);
            }
            let along = dot::<FUSED>(up, spread);
            let mut across = [0.0; 3];
            for i in 0..3 {
                across[i] = (spread[i] - up[i] * along) / g;
            }
            let reading = [u[0][l], u[1][l], u[2][l]];
            let first = columns::<FUSED>(up, shared, mirrored);
            let second = columns::<FUSED>(across, reading, mirrored);
            let sigma = sigmas[l] * at.widening;
            let weight = 1.0 / (sigma * sigma);
            for k in 0..N_PARAMETERS {
                let mean = second[k] + if k < 6 { first[k] } else { 0.0 };
                sums[k][l] = fma::<FUSED>(mean, weight, sums[k][l]);
            }
        }
    }
}
