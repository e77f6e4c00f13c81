//! Moments of the raw readings over the steps of a move, a row of them at a time.
//!
//! Written row by row, eight stretches of the move read side by side: stretch by stretch, every cache line would be
//! fetched eight times.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use nalgebra::Vector3;

use super::{LANES, Row, StepRow, ZERO};
use crate::poisson::RateModel;
use crate::poisson::steps::UNEVEN_STEPS;
use crate::simd::{Instructions, fma, for_each_instruction_set};

/// A move all of whose samples are finite, with increasing timestamps.
#[derive(Clone, Copy)]
pub(in crate::poisson) struct Whole<'a> {
    pub time_s: &'a [f64],
    pub raw: &'a [Vector3<f64>],
    pub anchor_before_s: f64,
    pub span_s: f64,
}

impl Whole<'_> {
    pub(super) fn n_steps(&self) -> usize {
        self.time_s.len() - 1
    }
}

/// Writes rows from `first` on of a move of `n_rows`; `odd` collects the steps without a cubic through four evenly
/// spaced samples, which the caller sets.
pub(super) fn fill(
    rows: &mut [StepRow],
    first: usize,
    n_rows: usize,
    of: &Whole<'_>,
    model: RateModel,
    odd: &mut Vec<usize>,
) {
    let instructions = Instructions::detect();
    match model {
        RateModel::Constant => fill_constant(instructions, rows, first, n_rows, of),
        RateModel::Linear => fill_lines(instructions, rows, first, n_rows, of),
        RateModel::Coning => fill_cubics(instructions, rows, first, n_rows, of, odd),
    }
}

for_each_instruction_set! {
    fn fill_constant(rows: &mut [StepRow], first: usize, n_rows: usize, of: &Whole<'_>) = fill_constant_body
}

for_each_instruction_set! {
    fn fill_lines(rows: &mut [StepRow], first: usize, n_rows: usize, of: &Whole<'_>) = fill_lines_body
}

for_each_instruction_set! {
    fn fill_cubics(
        rows: &mut [StepRow], first: usize, n_rows: usize, of: &Whole<'_>, odd: &mut Vec<usize>,
    ) = fill_cubics_body
}

/// Timestamps and readings of one sample of every stretch.
struct Samples {
    time_s: Row,
    raw: [Row; 3],
}

/// Samples `l n_rows + at` of the move in lane `l`, or its last one.
#[inline(always)]
fn samples(of: &Whole<'_>, n_rows: usize, at: usize) -> Samples {
    let last = of.time_s.len() - 1;
    let raw = &of.raw[..=last];
    let mut out = Samples {
        time_s: ZERO,
        raw: [ZERO; 3],
    };
    for l in 0..LANES {
        let k = (l * n_rows + at).min(last);
        out.time_s[l] = of.time_s[k];
        for c in 0..3 {
            out.raw[c][l] = raw[k][c];
        }
    }
    out
}

/// All of a row except the moments; beyond the end of the move steps have no duration.
#[inline(always)]
fn ends(out: &mut StepRow, of: &Whole<'_>, from: &Samples, to: &Samples) {
    for l in 0..LANES {
        out.h[l] = to.time_s[l] - from.time_s[l];
        let middle = 0.5 * (from.time_s[l] + to.time_s[l]);
        out.fraction[l] = (middle - of.anchor_before_s) / of.span_s;
        for c in 0..3 {
            out.change[c][l] = to.raw[c][l] - from.raw[c][l];
        }
    }
}

#[inline(always)]
fn fill_constant_body<const FUSED: bool>(
    rows: &mut [StepRow],
    first: usize,
    n_rows: usize,
    of: &Whole<'_>,
) {
    for (k, out) in rows.iter_mut().enumerate() {
        let (from, to) = (
            samples(of, n_rows, first + k),
            samples(of, n_rows, first + k + 1),
        );
        ends(out, of, &from, &to);
        for c in 0..3 {
            for l in 0..LANES {
                out.moment0[c][l] = from.raw[c][l] * out.h[l];
            }
        }
        out.moment1 = [ZERO; 3];
    }
}

#[inline(always)]
fn fill_lines_body<const FUSED: bool>(
    rows: &mut [StepRow],
    first: usize,
    n_rows: usize,
    of: &Whole<'_>,
) {
    for (k, out) in rows.iter_mut().enumerate() {
        let (from, to) = (
            samples(of, n_rows, first + k),
            samples(of, n_rows, first + k + 1),
        );
        ends(out, of, &from, &to);
        for c in 0..3 {
            for l in 0..LANES {
                out.moment0[c][l] = 0.5 * out.h[l] * (from.raw[c][l] + to.raw[c][l]);
                out.moment1[c][l] = out.h[l] * (1.0 / 12.0) * out.change[c][l];
            }
        }
    }
}

#[inline(always)]
fn fill_cubics_body<const FUSED: bool>(
    rows: &mut [StepRow],
    first: usize,
    n_rows: usize,
    of: &Whole<'_>,
    odd: &mut Vec<usize>,
) {
    let n = of.time_s.len();
    for (k, out) in rows.iter_mut().enumerate() {
        let row = first + k;
        // The first step of all has no sample before it, and is odd below: its first two samples are equal.
        let seen = [row.saturating_sub(1), row, row + 1, row + 2].map(|at| samples(of, n_rows, at));
        ends(out, of, &seen[1], &seen[2]);
        let mut tau = [ZERO; 4];
        for l in 0..LANES {
            let middle = 0.5 * (seen[1].time_s[l] + seen[2].time_s[l]);
            for j in 0..4 {
                tau[j][l] = seen[j].time_s[l] - middle;
            }
        }
        let (mut zeroth, mut linear) = ([ZERO; 3], [ZERO; 3]);
        for j in 0..4 {
            for l in 0..LANES {
                let [at, a, b, c] = [0, 1, 2, 3].map(|m| tau[(j + m) % 4][l]);
                let h = out.h[l];
                let h2 = h * h;
                let (ab, sum) = (a * b, a + b);
                let scale = 1.0 / ((at - a) * (at - b) * (at - c));
                let cubed = fma::<FUSED>(sum + c, h2 * (1.0 / 12.0), ab * c);
                let squared = fma::<FUSED>(sum, c, ab);
                let w0 = -h * cubed * scale;
                let w1 = h2 * fma::<FUSED>(squared, 1.0 / 12.0, h2 * (1.0 / 80.0)) * scale;
                for c in 0..3 {
                    let x = seen[j].raw[c][l];
                    zeroth[c][l] = fma::<FUSED>(w0, x, zeroth[c][l]);
                    linear[c][l] = fma::<FUSED>(w1, x, linear[c][l]);
                }
            }
        }
        (out.moment0, out.moment1) = (zeroth, linear);
        let mut is_even = [true; LANES];
        for l in 0..LANES {
            let t = [0, 1, 2, 3].map(|j| seen[j].time_s[l]);
            let gaps = [t[1] - t[0], t[2] - t[1], t[3] - t[2]];
            let widest = gaps[0].max(gaps[1]).max(gaps[2]);
            let narrowest = gaps[0].min(gaps[1]).min(gaps[2]);
            let i = l * n_rows + row;
            is_even[l] = widest <= UNEVEN_STEPS * narrowest && i > 0 && i + 2 < n;
        }
        if is_even != [true; LANES] {
            odd.extend(
                (0..LANES)
                    .filter(|&l| !is_even[l])
                    .map(|l| l * n_rows + row),
            );
        }
    }
}
