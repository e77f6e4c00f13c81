//! Running sums without loss of precision: centred on the mean, block starts summed in twice the working precision.

use rayon::prelude::*;

use super::readings::Readings;

/// Readings per block; block starts are summed in twice the working precision, so that no error grows along it.
const BLOCK: usize = 4096;

/// `a + b` as a rounded sum and its rounding error (Knuth's two-sum).
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

/// Writes the running sum of one channel without its mean into `sums`, one longer than the readings, the first 0;
/// readings that are missing count as the mean. Returns the constant subtracted from every reading, and the number of
/// finite readings where some are missing.
///
/// # Panics
/// When `sums` has another length.
pub fn write_running_sum(readings: &impl Readings, sums: &mut [f64]) -> (f64, Option<usize>) {
    let n = readings.len();
    assert_eq!(
        sums.len(),
        n + 1,
        "a running sum is one longer than its readings"
    );
    let blocks = n.div_ceil(BLOCK);
    let range = |b: usize| b * BLOCK..((b + 1) * BLOCK).min(n);
    // About a first reading rather than zero: a bias of 1e4 times the noise would cost four digits of the noise.
    let pivot = (0..n)
        .map(|i| readings.get(i))
        .find(|v| v.is_finite())
        .unwrap_or(0.0);
    let partial: Vec<(f64, usize)> = (0..blocks)
        .into_par_iter()
        .with_min_len(16)
        .map_init(
            || vec![0.0; BLOCK],
            |buffer, b| {
                let buffer = &mut buffer[..range(b).len()];
                readings.fill(b * BLOCK, buffer);
                block_sum(buffer, pivot)
            },
        )
        .collect();
    let present: usize = partial.iter().map(|p| p.1).sum();
    let total = compensated_sum(partial.iter().map(|p| p.0));
    let shift = if present == 0 {
        0.0
    } else {
        total / present as f64
    };
    let centre = pivot + shift;
    // The rounded centre is subtracted from the readings; block starts must use it too, at a level of 1e9.
    let shift = centre - pivot;
    let (mut high, mut low) = (0.0, 0.0);
    let starts: Vec<f64> = partial
        .iter()
        .map(|&(sum, count)| {
            let start = high + low;
            let (s, e) = two_sum(high, sum - shift * count as f64);
            high = s;
            low += e;
            start
        })
        .collect();
    sums[0] = 0.0;
    sums[1..]
        .par_chunks_mut(BLOCK)
        .with_min_len(16)
        .enumerate()
        .for_each(|(b, out)| {
            readings.fill(b * BLOCK, out);
            running(out, centre, starts[b], partial[b].1 < out.len());
        });
    (centre, (present < n).then_some(present))
}

/// Sum about `pivot` of the readings present, and their number.
fn block_sum(values: &[f64], pivot: f64) -> (f64, usize) {
    const LANES: usize = 16;
    let mut lanes = [0.0; LANES];
    let (whole, rest) = values.as_chunks::<LANES>();
    for chunk in whole {
        for lane in 0..LANES {
            lanes[lane] += chunk[lane] - pivot;
        }
    }
    let sum = lanes.iter().sum::<f64>() + rest.iter().map(|v| v - pivot).sum::<f64>();
    if sum.is_finite() {
        return (sum, values.len());
    }
    let present = values.iter().filter(|v| v.is_finite());
    (present.clone().map(|v| v - pivot).sum(), present.count())
}

/// Readings to running sum, in place; four stretches at a time so that additions overlap.
fn running(values: &mut [f64], centre: f64, start: f64, has_gaps: bool) {
    if has_gaps {
        for v in values.iter_mut() {
            *v = if v.is_finite() { *v } else { centre };
        }
    }
    let quarter = values.len() / 4;
    let (a, rest) = values.split_at_mut(quarter);
    let (b, rest) = rest.split_at_mut(quarter);
    let (c, d) = rest.split_at_mut(quarter);
    let mut sums = [0.0; 4];
    for (((a, b), c), d) in a
        .iter_mut()
        .zip(b.iter_mut())
        .zip(c.iter_mut())
        .zip(d.iter_mut())
    {
        sums[0] += *a - centre;
        sums[1] += *b - centre;
        sums[2] += *c - centre;
        sums[3] += *d - centre;
        (*a, *b, *c, *d) = (sums[0], sums[1], sums[2], sums[3]);
    }
    for v in &mut d[quarter..] {
        sums[3] += *v - centre;
        *v = sums[3];
    }
    // Local sums are small and exact; the level is added once, so that every value is rounded once.
    let mut level = start;
    for (part, sum) in [a, b, c, d].into_iter().zip(sums) {
        for v in part {
            *v += level;
        }
        level += sum;
    }
}
