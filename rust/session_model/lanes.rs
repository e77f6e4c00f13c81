//! Small matrices as rows of whole vectors, filled up with zeros.

use crate::simd::fma;

const LANES: usize = 8;
pub(super) type Lane = [f64; LANES];

/// Rows of numbers, each filled up to whole lanes.
pub(super) struct Rows {
    pub data: Vec<Lane>,
    /// Lanes of a row.
    pub n: usize,
}

impl Rows {
    pub(super) fn zeros(rows: usize, columns: usize) -> Self {
        let n = columns.div_ceil(LANES);
        Self {
            data: vec![[0.0; LANES]; rows * n],
            n,
        }
    }

    pub(super) fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.data[row * self.n + column / LANES][column % LANES]
    }
}

/// `out += factor row`.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn add_row<const FUSED: bool>(out: &mut [Lane], factor: f64, row: &[Lane]) {
    for (o, v) in out.iter_mut().zip(row) {
        for k in 0..LANES {
            o[k] = fma::<FUSED>(factor, v[k], o[k]);
        }
    }
}

/// `out -= aᵀ b`, the first `columns` of `a`; what is zero in `a` costs nothing.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
pub(super) fn take_product<const FUSED: bool>(
    out: &mut Rows,
    columns: usize,
    a: &Rows,
    b: &[Lane],
    n: usize,
) {
    for (row, values) in a.data.chunks_exact(a.n).zip(b.chunks_exact(n)) {
        for (c, own) in out.data.chunks_exact_mut(n).take(columns).enumerate() {
            let value = row[c / LANES][c % LANES];
            if value != 0.0 {
                add_row::<FUSED>(own, -value, values);
            }
        }
    }
}

/// `U` with `UᵀU` the first `n` rows and columns, of which the upper triangle counts, and `½ ln det`; rows may be longer.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
pub(super) fn cholesky<const FUSED: bool>(
    block: &mut Rows,
    inverse: &mut [f64],
    n: usize,
) -> Option<f64> {
    let lanes = block.n;
    let mut log_det = 0.0;
    for j in 0..n {
        let (upto, after) = block.data.split_at_mut((j + 1) * lanes);
        let row = &mut upto[j * lanes..];
        let pivot = row[j / LANES][j % LANES];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let length = pivot.sqrt();
        log_det += length.ln();
        inverse[j] = length.recip();
        for lane in row.iter_mut() {
            for value in lane {
                *value *= inverse[j];
            }
        }
        for (k, own) in after.chunks_exact_mut(lanes).take(n - 1 - j).enumerate() {
            let i = j + 1 + k;
            let value = row[i / LANES][i % LANES];
            add_row::<FUSED>(own, -value, row);
        }
    }
    Some(log_det)
}

/// `U⁻ᵀ rows`.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
pub(super) fn forward<const FUSED: bool>(half: &Rows, inverse: &[f64], rows: &mut Rows, n: usize) {
    let lanes = rows.n;
    for i in 0..n {
        let (before, from) = rows.data.split_at_mut(i * lanes);
        let own = &mut from[..lanes];
        for (j, other) in before.chunks_exact(lanes).enumerate() {
            let value = half.data[j * half.n + i / LANES][i % LANES];
            add_row::<FUSED>(own, -value, other);
        }
        for lane in own {
            for value in lane {
                *value *= inverse[i];
            }
        }
    }
}
