//! Running sums that keep their digits: centred on the mean, exact at block starts.

use rayon::prelude::*;

/// Readings per block; block starts are summed in twice the working precision, so that no error grows along the log.
const BLOCK: usize = 4096;

/// Running sum of one channel without its mean.
#[derive(Debug, Clone)]
pub struct Prefix {
    /// `n + 1` values, the first zero. Readings that are missing count as the mean.
    pub sums: Vec<f64>,
    /// What was subtracted from every reading.
    pub centre: f64,
    /// Number of finite readings when some are missing, `None` when all are present.
    pub present: Option<usize>,
}

/// `a + b` as a rounded sum and what the rounding lost (Knuth's two-sum).
#[inline]
#[must_use]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let bb = s - a;
    (s, (a - (s - bb)) + (b - bb))
}

/// Sum in twice the working precision.
#[must_use]
pub fn compensated_sum(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut high, mut low) = (0.0, 0.0);
    for value in values {
        let (s, e) = two_sum(high, value);
        high = s;
        low += e;
    }
    high + low
}

impl Prefix {
    /// Running sum of `get(0..n)`.
    pub fn new<F: Fn(usize) -> f64 + Sync>(n: usize, get: &F) -> Self {
        let blocks = n.div_ceil(BLOCK);
        let range = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(n);
        // Around a first reading rather than zero: a bias of 1e4 times the noise would cost its digits.
        let pivot = (0..n).map(get).find(|v| v.is_finite()).unwrap_or(0.0);
        let partial: Vec<(f64, usize)> = (0..blocks)
            .into_par_iter()
            .with_min_len(64)
            .map(|b| block_sum(range(b), get, pivot))
            .collect();
        let present: usize = partial.iter().map(|p| p.1).sum();
        let total = compensated_sum(partial.iter().map(|p| p.0));
        let shift = if present == 0 {
            0.0
        } else {
            total / present as f64
        };
        let centre = pivot + shift;

        let mut sums = vec![0.0; n + 1];
        let mut local: Vec<f64> = Vec::with_capacity(blocks);
        sums[1..]
            .par_chunks_mut(BLOCK)
            .with_min_len(64)
            .enumerate()
            .map(|(b, out)| running(b * BLOCK, out, get, centre))
            .collect_into_vec(&mut local);
        let (mut high, mut low) = (0.0, 0.0);
        let starts: Vec<f64> = local
            .iter()
            .map(|sum| {
                let start = high + low;
                let (s, e) = two_sum(high, *sum);
                high = s;
                low += e;
                start
            })
            .collect();
        sums[1..]
            .par_chunks_mut(BLOCK)
            .with_min_len(64)
            .zip(&starts)
            .for_each(|(out, start)| out.iter_mut().for_each(|v| *v += start));
        Self {
            sums,
            centre,
            present: (present < n).then_some(present),
        }
    }
}

fn block_sum<F: Fn(usize) -> f64>(
    range: std::ops::Range<usize>,
    get: &F,
    pivot: f64,
) -> (f64, usize) {
    let mut sum = [0.0; 4];
    let mut count = [0_usize; 4];
    for (lane, i) in range.enumerate() {
        let v = get(i) - pivot;
        let present = v.is_finite();
        sum[lane & 3] += if present { v } else { 0.0 };
        count[lane & 3] += usize::from(present);
    }
    (sum.iter().sum(), count.iter().sum())
}

/// Running sum of one block from zero, four stretches at a time so that additions overlap; returns the block's sum.
fn running<F: Fn(usize) -> f64>(first: usize, out: &mut [f64], get: &F, centre: f64) -> f64 {
    let value = |i: usize| {
        let v = get(first + i) - centre;
        if v.is_finite() { v } else { 0.0 }
    };
    let quarter = out.len() / 4;
    let mut acc = [0.0; 4];
    {
        let (a, rest) = out.split_at_mut(quarter);
        let (b, rest) = rest.split_at_mut(quarter);
        let (c, rest) = rest.split_at_mut(quarter);
        let d = &mut rest[..quarter];
        for i in 0..quarter {
            acc[0] += value(i);
            acc[1] += value(quarter + i);
            acc[2] += value(2 * quarter + i);
            acc[3] += value(3 * quarter + i);
            a[i] = acc[0];
            b[i] = acc[1];
            c[i] = acc[2];
            d[i] = acc[3];
        }
    }
    let mut start = acc[0];
    for (part, own) in acc.iter().enumerate().skip(1) {
        for v in &mut out[part * quarter..(part + 1) * quarter] {
            *v += start;
        }
        start += own;
    }
    for i in 4 * quarter..out.len() {
        start += value(i);
        out[i] = start;
    }
    start
}
