//! Sums over readings, eight at a time: normal equations, information, cost, residuals.
//!
//! Shares of fixed size are summed separately and joined in order, so that a result does not depend on the number of
//! threads.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use nalgebra::{SMatrix, SVector, Vector3};
use rayon::prelude::*;

use super::lanes::{
    Eights, LANES, Row, ZERO, columns, dot, filler, force, load, mirrored, misfit, store,
};
use super::{Model, N_PARAMETERS, Settings};
use crate::ellipsoid::Standardisation;
use crate::simd::{Instructions, fma, for_each_instruction_set};

/// Entries of the lower triangle of the normal equations.
const GRAM: usize = N_PARAMETERS * (N_PARAMETERS + 1) / 2;

/// Readings per share.
pub(super) const SHARE: usize = 16_384;

/// Model and settings at which a sum is taken.
#[derive(Clone, Copy)]
pub(super) struct At {
    /// `f = S u + b` of the readings as they are loaded.
    pub model: Model,
    pub standard: Standardisation,
    pub settings: Settings,
    /// Factor on every sigma.
    pub widening: f64,
}

impl At {
    /// For raw readings in raw units.
    pub(super) fn raw(model: Model, settings: Settings) -> Self {
        Self {
            model,
            standard: Standardisation {
                centre: Vector3::zeros(),
                size: 1.0,
            },
            settings,
            widening: 1.0,
        }
    }
}

/// Readings with the predicted noise of each.
#[derive(Clone, Copy)]
pub(super) struct WithNoise<'a> {
    pub values: &'a [Vector3<f64>],
    pub sigma: &'a [f64],
    pub excess: &'a [f64],
}

impl WithNoise<'_> {
    fn share(&self, k: usize) -> Self {
        let range = k * SHARE..((k + 1) * SHARE).min(self.values.len());
        Self {
            values: &self.values[range.clone()],
            sigma: &self.sigma[range.clone()],
            excess: &self.excess[range],
        }
    }
}

/// `JᵀJ`, `Jᵀr`, F and Σ r².
#[derive(Clone, Copy)]
pub(super) struct Normal {
    pub gram: SMatrix<f64, N_PARAMETERS, N_PARAMETERS>,
    pub slope: SVector<f64, N_PARAMETERS>,
    pub cost: f64,
    pub chi2: f64,
}

#[repr(align(64))]
struct Lanes {
    gram: [Row; GRAM],
    slope: [Row; N_PARAMETERS],
    cost: Row,
    chi2: Row,
}

impl Lanes {
    fn zero() -> Self {
        Self {
            gram: [ZERO; GRAM],
            slope: [ZERO; N_PARAMETERS],
            cost: ZERO,
            chi2: ZERO,
        }
    }

    fn total(&self) -> Normal {
        let mut gram = SMatrix::zeros();
        let mut entry = 0;
        for i in 0..N_PARAMETERS {
            for j in 0..=i {
                gram[(i, j)] = self.gram[entry].iter().sum();
                gram[(j, i)] = gram[(i, j)];
                entry += 1;
            }
        }
        Normal {
            gram,
            slope: SVector::from_fn(|i, _| self.slope[i].iter().sum()),
            cost: self.cost.iter().sum(),
            chi2: self.chi2.iter().sum(),
        }
    }
}

/// Joins the results of `sum` for each share, in order.
pub(super) fn by_share<T: Send>(
    n: usize,
    sum: impl Fn(usize) -> T + Sync + Send,
    join: impl Fn(T, T) -> T,
) -> Option<T> {
    let shares = n.div_ceil(SHARE);
    if shares == 1 {
        return Some(sum(0));
    }
    let parts: Vec<T> = (0..shares).into_par_iter().map(sum).collect();
    parts.into_iter().reduce(join)
}

/// The normal equations at a point; `None` without readings.
pub(super) fn normal(with_noise: &WithNoise<'_>, at: &At) -> Option<Normal> {
    let instructions = Instructions::detect();
    by_share(
        with_noise.values.len(),
        |k| {
            let mut lanes = Lanes::zero();
            add_rows(instructions, &with_noise.share(k), at, &mut lanes);
            lanes.total()
        },
        |a, b| Normal {
            gram: a.gram + b.gram,
            slope: a.slope + b.slope,
            cost: a.cost + b.cost,
            chi2: a.chi2 + b.chi2,
        },
    )
}

/// Information of the directions of gravity on the nine parameters: in true coordinates `δf = M f + z`, a pose measures
/// `uᵀδf = |g| Σ M_jk u_j u_k + zᵀu`.
pub(super) fn information(
    with_noise: &WithNoise<'_>,
    at: &At,
) -> SMatrix<f64, N_PARAMETERS, N_PARAMETERS> {
    let instructions = Instructions::detect();
    by_share(
        with_noise.values.len(),
        |k| {
            let mut lanes = Lanes::zero();
            add_directions(instructions, &with_noise.share(k), at, &mut lanes);
            lanes.total().gram
        },
        |a, b| a + b,
    )
    .unwrap_or_else(SMatrix::zeros)
}

/// F of the readings at a point.
pub(super) fn cost(with_noise: &WithNoise<'_>, at: &At) -> f64 {
    let instructions = Instructions::detect();
    by_share(
        with_noise.values.len(),
        |k| {
            let mut sum = ZERO;
            add_costs(instructions, &with_noise.share(k), at, &mut sum);
            sum.iter().sum::<f64>()
        },
        |a, b| a + b,
    )
    .unwrap_or(0.0)
}

/// `|S a' + b| - |g|` of each reading, less its expected excess.
pub(super) fn misfits(with_noise: &WithNoise<'_>, at: &At) -> Vec<f64> {
    let mut out = vec![0.0; with_noise.values.len()];
    let instructions = Instructions::detect();
    let write = |(k, out): (usize, &mut [f64])| {
        write_misfits(instructions, &with_noise.share(k), at, out);
    };
    if out.len() <= SHARE {
        write((0, &mut out));
    } else {
        out.par_chunks_mut(SHARE).enumerate().for_each(write);
    }
    out
}

for_each_instruction_set! {
    fn add_rows(with_noise: &WithNoise<'_>, at: &At, sums: &mut Lanes) = add_rows_lanes
}

#[inline(always)]
fn add_rows_lanes<const FUSED: bool>(with_noise: &WithNoise<'_>, at: &At, sums: &mut Lanes) {
    let settings = &at.settings;
    let mirrored = mirrored(settings.frame);
    let mut u = [ZERO; 3];
    let (mut rows, mut residual) = ([ZERO; N_PARAMETERS], ZERO);
    let values = Eights::of(with_noise.values, filler(with_noise.values));
    let sigmas = Eights::of(with_noise.sigma, f64::INFINITY);
    let excesses = Eights::of(with_noise.excess, 0.0);
    for i in 0..with_noise.values.len().div_ceil(LANES) {
        load(values.at(i), &at.standard, &mut u);
        let (sigma, excess) = (sigmas.at(i), excesses.at(i));
        for l in 0..LANES {
            let f = force::<FUSED>(&at.model, &u, l);
            let (value, length) = misfit::<FUSED>(f, excess[l], settings);
            // One division for both: divisions cost more than all the products.
            let weight = 1.0 / (length * sigma[l] * at.widening);
            let row =
                columns::<FUSED>(f.map(|c| c * weight), [u[0][l], u[1][l], u[2][l]], mirrored);
            for k in 0..N_PARAMETERS {
                rows[k][l] = row[k];
            }
            residual[l] = value * (length * weight);
            let square = residual[l] * residual[l];
            sums.chi2[l] += square;
            sums.cost[l] = fma::<FUSED>(0.5, square, sums.cost[l]);
        }
        add_products::<FUSED>(&rows, &residual, sums);
    }
}

/// Lanes innermost: the triangle has too many entries for the compiler to unroll.
#[inline(always)]
fn add_products<const FUSED: bool>(rows: &[Row; N_PARAMETERS], residual: &Row, sums: &mut Lanes) {
    let mut entry = 0;
    for i in 0..N_PARAMETERS {
        let a = rows[i];
        for l in 0..LANES {
            sums.slope[i][l] = fma::<FUSED>(a[l], residual[l], sums.slope[i][l]);
        }
        for b in &rows[..=i] {
            let sum = &mut sums.gram[entry];
            for l in 0..LANES {
                sum[l] = fma::<FUSED>(a[l], b[l], sum[l]);
            }
            entry += 1;
        }
    }
}

for_each_instruction_set! {
    fn add_directions(with_noise: &WithNoise<'_>, at: &At, sums: &mut Lanes) = add_directions_lanes
}

#[inline(always)]
fn add_directions_lanes<const FUSED: bool>(with_noise: &WithNoise<'_>, at: &At, sums: &mut Lanes) {
    let mut u = [ZERO; 3];
    let mut rows = [ZERO; N_PARAMETERS];
    let values = Eights::of(with_noise.values, filler(with_noise.values));
    let sigmas = Eights::of(with_noise.sigma, f64::INFINITY);
    for i in 0..with_noise.values.len().div_ceil(LANES) {
        load(values.at(i), &at.standard, &mut u);
        let sigma = sigmas.at(i);
        for l in 0..LANES {
            let f = force::<FUSED>(&at.model, &u, l);
            let scale = 1.0 / dot::<FUSED>(f, f).sqrt();
            let up = f.map(|c| c * scale);
            let row = columns::<FUSED>(up, up, 0.0);
            for k in 0..N_PARAMETERS {
                rows[k][l] = row[k] * (at.settings.gravity / sigma[l]);
            }
        }
        add_products::<FUSED>(&rows, &ZERO, sums);
    }
}

for_each_instruction_set! {
    fn add_costs(with_noise: &WithNoise<'_>, at: &At, sum: &mut Row) = add_costs_lanes
}

#[inline(always)]
fn add_costs_lanes<const FUSED: bool>(with_noise: &WithNoise<'_>, at: &At, sum: &mut Row) {
    let (mut u, mut square) = ([ZERO; 3], ZERO);
    let values = Eights::of(with_noise.values, filler(with_noise.values));
    let sigmas = Eights::of(with_noise.sigma, f64::INFINITY);
    let excesses = Eights::of(with_noise.excess, 0.0);
    for i in 0..with_noise.values.len().div_ceil(LANES) {
        load(values.at(i), &at.standard, &mut u);
        let (sigma, excess) = (sigmas.at(i), excesses.at(i));
        for l in 0..LANES {
            let f = force::<FUSED>(&at.model, &u, l);
            let residual =
                misfit::<FUSED>(f, excess[l], &at.settings).0 * (1.0 / (sigma[l] * at.widening));
            square[l] = residual * residual;
        }
        for l in 0..LANES {
            sum[l] = fma::<FUSED>(0.5, square[l], sum[l]);
        }
    }
}

for_each_instruction_set! {
    fn write_misfits(with_noise: &WithNoise<'_>, at: &At, out: &mut [f64]) = write_misfits_lanes
}

#[inline(always)]
fn write_misfits_lanes<const FUSED: bool>(with_noise: &WithNoise<'_>, at: &At, out: &mut [f64]) {
    let (mut u, mut found) = ([ZERO; 3], ZERO);
    let values = Eights::of(with_noise.values, filler(with_noise.values));
    let excesses = Eights::of(with_noise.excess, 0.0);
    for (i, out) in out.chunks_mut(LANES).enumerate() {
        load(values.at(i), &at.standard, &mut u);
        let excess = excesses.at(i);
        for l in 0..LANES {
            let f = force::<FUSED>(&at.model, &u, l);
            found[l] = misfit::<FUSED>(f, excess[l], &at.settings).0;
        }
        store(&found, out);
    }
}
