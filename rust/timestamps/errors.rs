//! Errors of timestamps about an even clock.

use rayon::prelude::*;

use super::SHARE;

/// Writes `time - values` to `values`.
///
/// # Panics
/// When lengths differ.
pub fn less(time: &[f64], values: &mut [f64]) {
    assert_eq!(time.len(), values.len());
    values
        .par_chunks_mut(SHARE)
        .zip(time.par_chunks(SHARE))
        .for_each(|(values, time)| {
            for (value, time) in values.iter_mut().zip(time) {
                *value = time - *value;
            }
        });
}

/// Root mean square of errors about their mean.
#[must_use]
pub fn deviation(errors: &[f64]) -> f64 {
    let n = errors.len() as f64;
    let mean = total(errors, |error| error) / n;
    (total(errors, |error| (error - mean) * (error - mean)) / n).sqrt()
}

/// Number of errors that are less than the one before by more than `fall`.
#[must_use]
pub fn falls(errors: &[f64], fall: f64) -> usize {
    let shares = errors.len().div_ceil(SHARE);
    let of_share = |k: usize| {
        // With the last of the share before, so that no step is omitted.
        let part = &errors[(k * SHARE).saturating_sub(1)..errors.len().min((k + 1) * SHARE)];
        let is_fall = |pair: &[f64]| usize::from(pair[1] - pair[0] < -fall);
        part.windows(2).map(is_fall).sum::<usize>()
    };
    (0..shares).into_par_iter().map(of_share).sum()
}

/// Sum of `of` over all errors, shares joined in order.
fn total(errors: &[f64], of: impl Fn(f64) -> f64 + Sync) -> f64 {
    let shares: Vec<f64> = errors
        .par_chunks(SHARE)
        .map(|part| in_lanes(part, &of))
        .collect();
    shares.iter().sum()
}

/// Eight sums side by side: an addition need not wait for the one before.
fn in_lanes(part: &[f64], of: impl Fn(f64) -> f64) -> f64 {
    let mut sums = [0.0; 8];
    let rows = part.chunks_exact(sums.len());
    let rest: f64 = rows.remainder().iter().map(|&error| of(error)).sum();
    for row in rows {
        for (sum, &error) in sums.iter_mut().zip(row) {
            *sum += of(error);
        }
    }
    sums.iter().sum::<f64>() + rest
}
