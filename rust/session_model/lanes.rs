//! Small matrices as rows of whole vectors, padded with zeros.

use std::ops::{Index, IndexMut, Range};

use crate::simd::fma;

const LANES: usize = 8;
pub(super) type Lane = [f64; LANES];

/// Rows of numbers, each padded to whole lanes.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    pub data: Vec<Lane>,
    /// Lanes per row.
    pub n: usize,
    columns: usize,
}

/// Some rows.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub data: &'a [Lane],
    n: usize,
    columns: usize,
}

impl Rows {
    pub(super) fn zeros(rows: usize, columns: usize) -> Self {
        let n = columns.div_ceil(LANES);
        Self {
            data: vec![[0.0; LANES]; rows * n],
            n,
            columns,
        }
    }

    /// Rows from their numbers by row and column.
    pub(super) fn from_fn(
        rows: usize,
        columns: usize,
        number: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let mut out = Self::zeros(rows, columns);
        for r in 0..rows {
            for (c, own) in out.row(r)[..columns].iter_mut().enumerate() {
                *own = number(r, c);
            }
        }
        out
    }

    /// One row, with its padding.
    pub(super) fn row(&mut self, row: usize) -> &mut [f64] {
        self.data[row * self.n..][..self.n].as_flattened_mut()
    }

    pub(super) fn part(&self, first: usize, rows: usize) -> Part<'_> {
        Part {
            data: &self.data[first * self.n..][..rows * self.n],
            n: self.n,
            columns: self.columns,
        }
    }

    pub(super) fn part_mut(&mut self, first: usize, rows: usize) -> &mut [Lane] {
        &mut self.data[first * self.n..][..rows * self.n]
    }

    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    pub(super) fn whole(&self) -> Part<'_> {
        Part {
            data: &self.data,
            n: self.n,
            columns: self.columns,
        }
    }
}

impl Index<(usize, usize)> for Rows {
    type Output = f64;

    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.data[row * self.n + column / LANES][column % LANES]
    }
}

impl IndexMut<(usize, usize)> for Rows {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut f64 {
        &mut self.data[row * self.n + column / LANES][column % LANES]
    }
}

/// Lanes that a loop keeps in registers.
const WIDEST: usize = 4;

/// Calls `name::<FUSED, W>(arguments, from)` for strips of `W` lanes, together those of a row from the first to `n`.
macro_rules! strip_by_strip {
    ($name:ident::<$fused:ident>($($arg:expr),*), $first:expr, $n:expr) => {
        let mut from = $first;
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

/// `out += factor · aᵀ b`; `out` has the lanes of `b`.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
pub(super) fn add_product<const FUSED: bool>(
    out: &mut [Lane],
    factor: f64,
    a: Part<'_>,
    b: Part<'_>,
) {
    strip_by_strip!(add_strip::<FUSED>(out, factor, a, b, 0..a.columns), 0, b.n);
}

/// `out += factor · aᵀ a`, at and right of the diagonal by whole lanes.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
pub(super) fn add_gram<const FUSED: bool>(out: &mut [Lane], factor: f64, a: Part<'_>) {
    for lane in 0..a.n {
        let own = lane * LANES..((lane + 1) * LANES).min(a.columns);
        strip_by_strip!(
            add_strip::<FUSED>(out, factor, a, a, own.clone()),
            lane,
            a.n
        );
    }
}

/// [`add_product`] of `W` lanes of some rows of `out`, two at a time, which stay in registers.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn add_strip<const FUSED: bool, const W: usize>(
    out: &mut [Lane],
    factor: f64,
    a: Part<'_>,
    b: Part<'_>,
    which: Range<usize>,
    from: usize,
) {
    let mut c = which.start;
    while c < which.end {
        let n = (which.end - c).min(2);
        let next = c + n - 1;
        let mut sums = [[[0.0; LANES]; W]; 2];
        for (row, values) in a.data.chunks_exact(a.n).zip(b.data.chunks_exact(b.n)) {
            let values = &values[from..];
            add_row::<FUSED, W>(&mut sums[0], row[c / LANES][c % LANES], values);
            add_row::<FUSED, W>(&mut sums[1], row[next / LANES][next % LANES], values);
        }
        for (k, sum) in sums.iter().enumerate().take(n) {
            let own = &mut out[(c + k) * b.n + from..][..W];
            for (own, sum) in own.iter_mut().zip(sum) {
                for (own, sum) in own.iter_mut().zip(sum) {
                    *own = fma::<FUSED>(factor, *sum, *own);
                }
            }
        }
        c += 2;
    }
}

/// `out += factor · values`.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
pub(super) fn add_scaled<const FUSED: bool>(out: &mut [Lane], factor: f64, values: &[Lane]) {
    for (out, values) in out.iter_mut().zip(values) {
        for (out, value) in out.iter_mut().zip(values) {
            *out = fma::<FUSED>(factor, *value, *out);
        }
    }
}

/// Multiplies every row by its factor, and every column by its.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
pub(super) fn stretch(data: &mut [Lane], of_rows: &[f64], of_columns: &[Lane]) {
    for (row, factor) in data.chunks_exact_mut(of_columns.len()).zip(of_rows) {
        for (own, by) in row.iter_mut().zip(of_columns) {
            for (own, by) in own.iter_mut().zip(by) {
                *own *= factor * by;
            }
        }
    }
}

/// Numbers in whole lanes.
pub(super) fn padded(values: &[f64], last: Option<f64>) -> Vec<Lane> {
    let mut out = vec![[0.0; LANES]; (values.len() + usize::from(last.is_some())).div_ceil(LANES)];
    for (own, value) in out
        .as_flattened_mut()
        .iter_mut()
        .zip(values.iter().copied().chain(last))
    {
        *own = value;
    }
    out
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
    strip_by_strip!(
        reduce_strip::<FUSED>(row, before, half, half_lanes, i),
        0,
        n
    );
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
