//! Products and solutions of the small blocks of a chain.
//!
//! A block has some ten rows: columns that short keep no vector unit busy, so both run along what is long.

use nalgebra::{Cholesky, DMatrix, Dyn};

fn add_scaled(out: &mut [f64], factor: f64, values: &[f64]) {
    for (o, v) in out.iter_mut().zip(values) {
        *o += factor * v;
    }
}

/// `out += factor · aᵀ b`; what is zero in `b` costs nothing.
pub(super) fn add_product(out: &mut DMatrix<f64>, factor: f64, a: &DMatrix<f64>, b: &DMatrix<f64>) {
    let width = a.ncols();
    if width == 0 || b.ncols() == 0 {
        return;
    }
    let rows = a.transpose();
    let rows = rows.as_slice();
    for (column, values) in out
        .as_mut_slice()
        .chunks_exact_mut(width)
        .zip(b.as_slice().chunks_exact(b.nrows().max(1)))
    {
        for (r, value) in values.iter().enumerate() {
            if *value != 0.0 {
                add_scaled(column, factor * value, &rows[r * width..(r + 1) * width]);
            }
        }
    }
}

/// Adds `factor · Σ rᵀr` over rows of `width` numbers to the lower triangle of `out`; what is zero costs nothing.
pub(super) fn add_gram(out: &mut DMatrix<f64>, factor: f64, rows: &[f64], width: usize) {
    if width == 0 {
        return;
    }
    for row in rows.chunks_exact(width) {
        for (j, value) in row.iter().enumerate() {
            if *value != 0.0 {
                let column = &mut out.as_mut_slice()[j * width + j..(j + 1) * width];
                add_scaled(column, factor * value, &row[j..]);
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
    if m == 0 {
        return;
    }
    let lower = half.l_dirty();
    for i in 0..lower.nrows() {
        let (before, from) = data.split_at_mut(i * m);
        let own = &mut from[..m];
        for (j, other) in before.chunks_exact(m).enumerate() {
            add_scaled(own, -lower[(i, j)], other);
        }
        let inverse = lower[(i, i)].recip();
        for value in own.iter_mut() {
            *value *= inverse;
        }
    }
}

/// `(L Lᵀ)⁻¹ rhs`.
pub(super) fn solve(half: &Cholesky<f64, Dyn>, rhs: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, m) = rhs.shape();
    if n == 0 || m == 0 {
        return rhs.clone();
    }
    let lower = half.l_dirty();
    let mut rows = rhs.transpose();
    let data = rows.as_mut_slice();
    forward_rows(half, data, m);
    for i in (0..n).rev() {
        let (upto, after) = data.split_at_mut((i + 1) * m);
        let own = &mut upto[i * m..];
        for (j, other) in after.chunks_exact(m).enumerate() {
            add_scaled(own, -lower[(i + 1 + j, i)], other);
        }
        let inverse = lower[(i, i)].recip();
        for value in own.iter_mut() {
            *value *= inverse;
        }
    }
    rows.transpose()
}
