//! The loops over the lanes of a tile.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use super::{LANES, ROWS, Row, matrix, multiply};
use crate::rotation::{SERIES_LIMIT, short_series};
use crate::simd::{fma, for_each_instruction_set};

for_each_instruction_set! {
    /// Whether no step goes back in time.
    pub(super) fn is_forward(time: &[Row; ROWS + 1]) -> bool = is_forward_lanes
}

#[inline(always)]
fn is_forward_lanes<const FUSED: bool>(time: &[Row; ROWS + 1]) -> bool {
    let mut bad = [0.0; LANES];
    for m in 0..ROWS {
        for l in 0..LANES {
            let h = time[m + 1][l] - time[m][l];
            bad[l] = if h >= 0.0 { bad[l] } else { 1.0 };
        }
    }
    bad.iter().all(|&b| b == 0.0)
}

for_each_instruction_set! {
    /// Half rotation vectors of rates that are constant or linear over each step; whether time never decreases.
    pub(super) fn half_vectors(
        time: &[Row; ROWS + 1],
        rate: &[[Row; 3]; ROWS + 1],
        is_linear: bool,
        turn: &mut [[Row; 4]; ROWS],
    ) -> bool = half_vectors_lanes
}

#[inline(always)]
fn half_vectors_lanes<const FUSED: bool>(
    time: &[Row; ROWS + 1],
    rate: &[[Row; 3]; ROWS + 1],
    is_linear: bool,
    turn: &mut [[Row; 4]; ROWS],
) -> bool {
    let mut bad = [0.0; LANES];
    for m in 0..ROWS {
        let (ta, tb) = (&time[m], &time[m + 1]);
        let (a, b) = (&rate[m], &rate[m + 1]);
        let out = &mut turn[m];
        if is_linear {
            for l in 0..LANES {
                let h = tb[l] - ta[l];
                bad[l] = if h >= 0.0 { bad[l] } else { 1.0 };
                let (g, k) = (0.25 * h, h * h * (1.0 / 24.0));
                let [x0, y0, z0] = [a[0][l], a[1][l], a[2][l]];
                let [x1, y1, z1] = [b[0][l], b[1][l], b[2][l]];
                out[1][l] = fma::<FUSED>(g, x0 + x1, k * fma::<FUSED>(y0, z1, -(z0 * y1)));
                out[2][l] = fma::<FUSED>(g, y0 + y1, k * fma::<FUSED>(z0, x1, -(x0 * z1)));
                out[3][l] = fma::<FUSED>(g, z0 + z1, k * fma::<FUSED>(x0, y1, -(y0 * x1)));
            }
        } else {
            for l in 0..LANES {
                let h = tb[l] - ta[l];
                bad[l] = if h >= 0.0 { bad[l] } else { 1.0 };
                let g = 0.5 * h;
                out[1][l] = g * a[0][l];
                out[2][l] = g * a[1][l];
                out[3][l] = g * a[2][l];
            }
        }
    }
    bad.iter().all(|&b| b == 0.0)
}

for_each_instruction_set! {
    /// Quaternions from half rotation vectors; whether all are finite and short enough for the series.
    pub(super) fn step_quaternions(turn: &mut [[Row; 4]; ROWS]) -> bool = step_quaternions_lanes
}

#[inline(always)]
fn step_quaternions_lanes<const FUSED: bool>(turn: &mut [[Row; 4]; ROWS]) -> bool {
    let mut bad = [0.0; LANES];
    for q in turn {
        for l in 0..LANES {
            let (x, y, z) = (q[1][l], q[2][l], q[3][l]);
            let s2 = fma::<FUSED>(x, x, fma::<FUSED>(y, y, z * z));
            bad[l] = if s2 <= SERIES_LIMIT { bad[l] } else { 1.0 };
            let (sine, cosine, _) = short_series::<FUSED>(s2);
            q[0][l] = fma::<FUSED>(-s2, cosine, 1.0);
            q[1][l] = sine * x;
            q[2][l] = sine * y;
            q[3][l] = sine * z;
        }
    }
    bad.iter().all(|&b| b == 0.0)
}

for_each_instruction_set! {
    /// Product of all steps of every lane.
    pub(super) fn last_products(turn: &[[Row; 4]; ROWS], ends: &mut [Row; 4]) = last_products_lanes
}

#[inline(always)]
fn last_products_lanes<const FUSED: bool>(turn: &[[Row; 4]; ROWS], ends: &mut [Row; 4]) {
    *ends = turn[0];
    for q in &turn[1..] {
        for l in 0..LANES {
            let next = multiply::<FUSED>(
                [ends[0][l], ends[1][l], ends[2][l], ends[3][l]],
                [q[0][l], q[1][l], q[2][l], q[3][l]],
            );
            for c in 0..4 {
                ends[c][l] = next[c];
            }
        }
    }
}

for_each_instruction_set! {
    /// Running products of the steps of every lane, in place.
    pub(super) fn products(turn: &mut [[Row; 4]; ROWS]) = products_lanes
}

#[inline(always)]
fn products_lanes<const FUSED: bool>(turn: &mut [[Row; 4]; ROWS]) {
    let mut p = turn[0];
    for q in &mut turn[1..] {
        for l in 0..LANES {
            let next = multiply::<FUSED>(
                [p[0][l], p[1][l], p[2][l], p[3][l]],
                [q[0][l], q[1][l], q[2][l], q[3][l]],
            );
            for c in 0..4 {
                q[c][l] = next[c];
                p[c][l] = next[c];
            }
        }
    }
}

for_each_instruction_set! {
    /// Attitudes as matrices, or `x y z w` in the first four.
    pub(super) fn attitudes(
        turn: &[[Row; 4]; ROWS],
        starts: &[Row; 4],
        are_matrices: bool,
        written: &mut [[Row; 9]; ROWS],
    ) = attitudes_lanes
}

#[inline(always)]
fn attitudes_lanes<const FUSED: bool>(
    turn: &[[Row; 4]; ROWS],
    starts: &[Row; 4],
    are_matrices: bool,
    written: &mut [[Row; 9]; ROWS],
) {
    for (p, out) in turn.iter().zip(written) {
        for l in 0..LANES {
            let q = multiply::<FUSED>(
                [starts[0][l], starts[1][l], starts[2][l], starts[3][l]],
                [p[0][l], p[1][l], p[2][l], p[3][l]],
            );
            if are_matrices {
                let matrix = matrix::<FUSED>(q);
                for c in 0..9 {
                    out[c][l] = matrix[c];
                }
            } else {
                out[3][l] = q[0];
                for c in 0..3 {
                    out[c][l] = q[c + 1];
                }
            }
        }
    }
}
