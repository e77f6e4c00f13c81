//! Small matrices as rows of whole vectors, padded with zeros.

use crate::simd::fma;

const LANES: usize = 8;
pub(super) type Lane = [f64; LANES];

/// Rows of numbers, each padded to whole lanes.
pub(super) struct Rows {
    pub data: Vec<Lane>,
    /// Lanes per row.
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

    /// One row, with its padding.
    pub(super) fn row(&mut self, row: usize) -> &mut [f64] {
        self.data[row * self.n..][..self.n].as_flattened_mut()
    }
}

/// Lanes that a loop keeps in registers.
const WIDEST: usize = 4;

/// Calls `name::<FUSED, W>(arguments, from)` for every strip of `W` lanes from `from` on, together all `n` of a row.
macro_rules! strip_by_strip {
    ($name:ident::<$fused:ident>($($arg:expr),*), $n:expr) => {
        let mut from = 0;
        while from < $n {
            match $n - from {
                1 => $name::<$fused, 1>($($arg,)* from),
                2 => $name::<$fused, 2>($($arg,)* from),
                3 => $name::<$fused, 3>($($arg,)* from),
                _ => $name::<$fused, WIDEST>($($arg,)* from),
            }
            from += WIDEST;
        }
    };
}

/// `sum += factor row`, of `W` lanes.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn add_row<const FUSED: bool, const W: usize>(sum: &mut [Lane; W], factor: f64, row: &[Lane]) {
    let row = &row[..W];
    for w in 0..W {
        for k in 0..LANES {
            sum[w][k] = fma::<FUSED>(factor, row[w][k], sum[w][k]);
        }
    }
}

/// `out -= aᵀ b`, for the first `columns` columns of `a`.
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
    strip_by_strip!(take_strip::<FUSED>(out, columns, a, b, n), n);
}

/// [`take_product`] of `W` lanes of every row, two rows of `out` at a time, which stay in registers.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn take_strip<const FUSED: bool, const W: usize>(
    out: &mut Rows,
    columns: usize,
    a: &Rows,
    b: &[Lane],
    n: usize,
    from: usize,
) {
    let mut c = 0;
    while c < columns {
        let is_pair = c + 1 < columns;
        let next = if is_pair { c + 1 } else { c };
        let mut sums = [[[0.0; LANES]; W]; 2];
        for (row, values) in a.data.chunks_exact(a.n).zip(b.chunks_exact(n)) {
            let values = &values[from..];
            add_row::<FUSED, W>(&mut sums[0], row[c / LANES][c % LANES], values);
            add_row::<FUSED, W>(&mut sums[1], row[next / LANES][next % LANES], values);
        }
        for (k, sum) in sums.iter().enumerate().take(if is_pair { 2 } else { 1 }) {
            let own = &mut out.data[(c + k) * n + from..][..W];
            for (own, sum) in own.iter_mut().zip(sum) {
                for (own, sum) in own.iter_mut().zip(sum) {
                    *own -= sum;
                }
            }
        }
        c += 2;
    }
}

/// `row -= Σ_j U_ji row_j` over the rows before it.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn reduce<const FUSED: bool>(
    row: &mut [Lane],
    before: &[Lane],
    half: &[Lane],
    half_lanes: usize,
    i: usize,
) {
    let n = row.len();
    strip_by_strip!(reduce_strip::<FUSED>(row, before, half, half_lanes, i), n);
}

/// [`reduce`] of `W` lanes, in two sums over alternate rows: an addition need not wait for the one before.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn reduce_strip<const FUSED: bool, const W: usize>(
    row: &mut [Lane],
    before: &[Lane],
    half: &[Lane],
    half_lanes: usize,
    i: usize,
    from: usize,
) {
    let n = row.len();
    let mut sums = [[[0.0; LANES]; W]; 2];
    for j in 0..i {
        let factor = half[j * half_lanes + i / LANES][i % LANES];
        add_row::<FUSED, W>(&mut sums[j % 2], factor, &before[j * n + from..]);
    }
    for (w, own) in row[from..from + W].iter_mut().enumerate() {
        for k in 0..LANES {
            own[k] -= sums[0][w][k] + sums[1][w][k];
        }
    }
}

/// `U` with `UᵀU` the first `n` rows and columns, whose upper triangle is read, and `½ ln det`; rows may be longer.
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
        let (before, from) = block.data.split_at_mut(j * lanes);
        let row = &mut from[..lanes];
        reduce::<FUSED>(row, before, before, lanes, j);
        let pivot = row[j / LANES][j % LANES];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let length = pivot.sqrt();
        log_det += length.ln();
        inverse[j] = length.recip();
        scale(row, inverse[j]);
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
        reduce::<FUSED>(own, before, &half.data, half.n, i);
        scale(own, inverse[i]);
    }
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn scale(row: &mut [Lane], factor: f64) {
    for value in row.as_flattened_mut() {
        *value *= factor;
    }
}
