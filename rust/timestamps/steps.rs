//! Steps between timestamps, in one pass.

use rayon::prelude::*;

use super::SHARE;

/// Numbers of steps and of timestamps by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Steps {
    /// Steps back.
    pub back: usize,
    /// Timestamps equal to the one before.
    pub same: usize,
    /// Steps forward.
    pub forward: usize,
    /// Timestamps that are not finite.
    pub missing: usize,
}

/// Numbers of steps by kind; those at a missing timestamp are of no kind.
#[must_use]
#[allow(clippy::float_cmp)] // equal timestamps are equal to the last bit
pub fn steps(time: &[f64]) -> Steps {
    shares(time)
        .map(|(first, timestamps)| {
            let mut out = Steps::default();
            // Counted without branches, so that a whole vector of steps is processed together.
            for pair in timestamps.windows(2) {
                out.back += usize::from(pair[1] < pair[0]);
                out.same += usize::from(pair[1] == pair[0]);
                out.forward += usize::from(pair[1] > pair[0]);
            }
            let own = &timestamps[usize::from(first > 0)..];
            out.missing = own.iter().map(|t| usize::from(!t.is_finite())).sum();
            out
        })
        .reduce(Steps::default, |a, b| Steps {
            back: a.back + b.back,
            same: a.same + b.same,
            forward: a.forward + b.forward,
            missing: a.missing + b.missing,
        })
}

/// Rows after which the step is longer than `limit`.
#[must_use]
pub fn steps_above(time: &[f64], limit: f64) -> Vec<usize> {
    shares(time)
        .map(|(first, timestamps)| {
            let start = first.saturating_sub(1);
            let longer = |pair: &[f64]| pair[1] - pair[0] > limit;
            if !timestamps
                .windows(2)
                .fold(false, |any, pair| any | longer(pair))
            {
                return Vec::new();
            }
            timestamps
                .windows(2)
                .enumerate()
                .filter(|(_, pair)| longer(pair))
                .map(|(i, _)| start + i)
                .collect()
        })
        .collect::<Vec<_>>()
        .concat()
}

/// Statistics of steps of usual length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inside {
    /// Number of steps.
    pub count: usize,
    /// Sum of the steps.
    pub sum: f64,
    /// Standard deviation about their mean, over their number.
    pub deviation: f64,
    /// The shortest.
    pub least: f64,
    /// The longest.
    pub most: f64,
}

/// Statistics of the steps above `above` and not above `limit`.
#[must_use]
pub fn inside(time: &[f64], above: f64, limit: f64) -> Inside {
    let kept = |step: f64| step > above && step <= limit;
    // About each share's own mean while the share is in the cache: the log is read once.
    let parts: Vec<(Inside, f64)> = shares(time)
        .map(|(_, timestamps)| {
            let (mut count, mut sum) = (0, 0.0);
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for pair in timestamps.windows(2) {
                let step = pair[1] - pair[0];
                let is_kept = kept(step);
                count += usize::from(is_kept);
                sum += if is_kept { step } else { 0.0 };
                least = if is_kept && step < least { step } else { least };
                most = if is_kept && step > most { step } else { most };
            }
            let mean = sum / count as f64;
            let squares = in_lanes(timestamps, |step| {
                let far = if kept(step) { step - mean } else { 0.0 };
                far * far
            });
            let out = Inside {
                count,
                sum,
                deviation: 0.0,
                least,
                most,
            };
            (out, squares)
        })
        .filter(|(part, _)| part.count > 0)
        .collect();
    let count: usize = parts.iter().map(|(p, _)| p.count).sum();
    let sum: f64 = parts.iter().map(|(p, _)| p.sum).sum();
    let mean = sum / count as f64;
    let squares = parts.iter().map(|(part, squares)| {
        let n = part.count as f64;
        squares + n * (part.sum / n - mean).powi(2)
    });
    Inside {
        count,
        sum,
        deviation: (squares.sum::<f64>() / count as f64).sqrt(),
        least: parts
            .iter()
            .map(|(p, _)| p.least)
            .fold(f64::INFINITY, f64::min),
        most: parts
            .iter()
            .map(|(p, _)| p.most)
            .fold(f64::NEG_INFINITY, f64::max),
    }
}

/// Shares of timestamps, each with the timestamp before it, and the row where its own begin.
fn shares(time: &[f64]) -> impl IndexedParallelIterator<Item = (usize, &[f64])> {
    (0..time.len().div_ceil(SHARE))
        .into_par_iter()
        .map(move |k| {
            let first = k * SHARE;
            let stop = (first + SHARE).min(time.len());
            (first, &time[first.saturating_sub(1)..stop])
        })
}

/// Sum of `of` over the steps, eight sums side by side: an addition need not wait for the one before.
fn in_lanes(timestamps: &[f64], of: impl Fn(f64) -> f64) -> f64 {
    let mut sums = [0.0; 8];
    let n = timestamps.len().saturating_sub(1);
    let whole = n / sums.len() * sums.len();
    for first in (0..whole).step_by(sums.len()) {
        let row: &[f64] = &timestamps[first..=first + sums.len()];
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += of(row[k + 1] - row[k]);
        }
    }
    let rest = timestamps[whole..]
        .windows(2)
        .map(|pair| of(pair[1] - pair[0]));
    sums.iter().sum::<f64>() + rest.sum::<f64>()
}

/// Results of `visit` for the timestamps of each share, with the one before.
pub(super) fn of_each_share<R: Send>(
    time: &[f64],
    visit: impl Fn(&[f64]) -> R + Sync + Send,
) -> Vec<R> {
    shares(time)
        .map(|(_, timestamps)| visit(timestamps))
        .collect()
}

/// Steps longer than zero as integers, which have the same order.
pub(super) fn forward(timestamps: &[f64]) -> impl Iterator<Item = u64> {
    let steps = timestamps.windows(2).map(|pair| pair[1] - pair[0]);
    steps.filter(|&step| step > 0.0).map(f64::to_bits)
}
