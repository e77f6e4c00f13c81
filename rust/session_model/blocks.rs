//! Products and solutions of the small blocks of a chain.
//!
//! A block has some ten rows: columns that short do not fill vector registers, so loops run along the longer dimension,
//! four numbers at a time.

use nalgebra::{Cholesky, DMatrix, Dyn};

use crate::simd::{Instructions, fma, for_each_instruction_set};

const LANES: usize = 4;

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn add_scaled<const FUSED: bool>(out: &mut [f64], factor: f64, values: &[f64]) {
    let (out, rest) = out.as_chunks_mut::<LANES>();
    let (values, others) = values.as_chunks::<LANES>();
    for (o, v) in out.iter_mut().zip(values) {
        for k in 0..LANES {
            o[k] = fma::<FUSED>(factor, v[k], o[k]);
        }
    }
    for (o, v) in rest.iter_mut().zip(others) {
        *o = fma::<FUSED>(factor, *v, *o);
    }
}

/// `out += factor · aᵀ b`; zeros in `b` are skipped.
pub(super) fn add_product(out: &mut DMatrix<f64>, factor: f64, a: &DMatrix<f64>, b: &DMatrix<f64>) {
    let width = a.ncols();
    if width == 0 || b.ncols() == 0 {
        return;
    }
    let (out, rows, height) = (out.as_mut_slice(), a.transpose(), b.nrows().max(1));
    let instructions = Instructions::detect();
    add_products(
        instructions,
        out,
        factor,
        rows.as_slice(),
        width,
        b.as_slice(),
        height,
    );
}

for_each_instruction_set! {
    fn add_products(
        out: &mut [f64], factor: f64, rows: &[f64], width: usize, b: &[f64], height: usize,
    ) = add_products_body
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn add_products_body<const FUSED: bool>(
    out: &mut [f64],
    factor: f64,
    rows: &[f64],
    width: usize,
    b: &[f64],
    height: usize,
) {
    for (column, values) in out.chunks_exact_mut(width).zip(b.chunks_exact(height)) {
        for (row, value) in rows.chunks_exact(width).zip(values) {
            if *value != 0.0 {
                add_scaled::<FUSED>(column, factor * value, row);
            }
        }
    }
}

/// Adds `factor · Σ rᵀr` over rows of `width` numbers to the lower triangle of `out`; zeros are skipped.
pub(super) fn add_gram(out: &mut DMatrix<f64>, factor: f64, rows: &[f64], width: usize) {
    if width == 0 {
        return;
    }
    add_grams(
        Instructions::detect(),
        out.as_mut_slice(),
        factor,
        rows,
        width,
    );
}

for_each_instruction_set! {
    fn add_grams(out: &mut [f64], factor: f64, rows: &[f64], width: usize) = add_grams_body
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn add_grams_body<const FUSED: bool>(out: &mut [f64], factor: f64, rows: &[f64], width: usize) {
    for row in rows.chunks_exact(width) {
        for (j, value) in row.iter().enumerate() {
            if *value != 0.0 {
                let column = &mut out[j * width + j..(j + 1) * width];
                add_scaled::<FUSED>(column, factor * value, &row[j..]);
            }
        }
    }
}

/// Copies the lower triangle of `out` above its diagonal.
pub(super) fn mirror(out: &mut DMatrix<f64>) {
    for j in 0..out.ncols() {
        for i in j + 1..out.nrows() {
            out[(j, i)] = out[(i, j)];
        }
    }
}

/// `L⁻¹ rhs` row by row.
pub(super) fn forward(half: &Cholesky<f64, Dyn>, rhs: &DMatrix<f64>) -> Vec<f64> {
    let mut rows = rhs.transpose();
    forward_rows(half, rows.as_mut_slice(), rhs.ncols());
    rows.as_slice().to_vec()
}

fn forward_rows(half: &Cholesky<f64, Dyn>, data: &mut [f64], m: usize) {
    if m > 0 {
        let lower = half.l_dirty();
        forward_each(
            Instructions::detect(),
            lower.as_slice(),
            lower.nrows(),
            data,
            m,
        );
    }
}

for_each_instruction_set! {
    fn forward_each(lower: &[f64], n: usize, data: &mut [f64], m: usize) = forward_body
}

for_each_instruction_set! {
    fn backward_each(lower: &[f64], n: usize, data: &mut [f64], m: usize) = backward_body
}

/// `L⁻¹` on rows of `m`, `L` column after column.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn forward_body<const FUSED: bool>(lower: &[f64], n: usize, data: &mut [f64], m: usize) {
    for i in 0..n {
        let (before, from) = data.split_at_mut(i * m);
        let own = &mut from[..m];
        for (j, other) in before.chunks_exact(m).enumerate() {
            add_scaled::<FUSED>(own, -lower[j * n + i], other);
        }
        scale(own, lower[i * n + i].recip());
    }
}

/// `L⁻ᵀ` on rows of `m`.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn backward_body<const FUSED: bool>(lower: &[f64], n: usize, data: &mut [f64], m: usize) {
    for i in (0..n).rev() {
        let (upto, after) = data.split_at_mut((i + 1) * m);
        let own = &mut upto[i * m..];
        for (j, other) in after.chunks_exact(m).enumerate() {
            add_scaled::<FUSED>(own, -lower[i * n + i + 1 + j], other);
        }
        scale(own, lower[i * n + i].recip());
    }
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn scale(values: &mut [f64], factor: f64) {
    for value in values {
        *value *= factor;
    }
}

/// `(L Lᵀ)⁻¹ rhs`.
pub(super) fn solve(half: &Cholesky<f64, Dyn>, rhs: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, m) = rhs.shape();
    if n == 0 || m == 0 {
        return rhs.clone();
    }
    let mut rows = rhs.transpose();
    forward_rows(half, rows.as_mut_slice(), m);
    let lower = half.l_dirty().as_slice();
    backward_each(Instructions::detect(), lower, n, rows.as_mut_slice(), m);
    rows.transpose()
}
