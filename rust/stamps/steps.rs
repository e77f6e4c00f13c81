//! Steps from stamp to stamp, in one pass.

use rayon::prelude::*;

use super::SHARE;

/// Kinds of steps and of stamps, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Steps {
    /// Steps back.
    pub back: usize,
    /// Stamps as the one before.
    pub same: usize,
    /// Steps forward.
    pub forward: usize,
    /// Stamps that are no finite numbers.
    pub missing: usize,
}

/// What steps there are; those at a missing stamp are of no kind.
#[must_use]
#[allow(clippy::float_cmp)] // the same stamp is the same to the last bit
pub fn steps(time: &[f64]) -> Steps {
    shares(time)
        .map(|(first, stamps)| {
            let mut out = Steps::default();
            // Counted without branches, so that a whole vector of steps is looked at together.
            for pair in stamps.windows(2) {
                out.back += usize::from(pair[1] < pair[0]);
                out.same += usize::from(pair[1] == pair[0]);
                out.forward += usize::from(pair[1] > pair[0]);
            }
            let own = &stamps[usize::from(first > 0)..];
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

/// Rows behind which the step is longer than `limit`.
#[must_use]
pub fn steps_above(time: &[f64], limit: f64) -> Vec<usize> {
    shares(time)
        .map(|(first, stamps)| {
            let start = first.saturating_sub(1);
            let longer = |pair: &[f64]| pair[1] - pair[0] > limit;
            if !stamps
                .windows(2)
                .fold(false, |any, pair| any | longer(pair))
            {
                return Vec::new();
            }
            stamps
                .windows(2)
                .enumerate()
                .filter(|(_, pair)| longer(pair))
                .map(|(i, _)| start + i)
                .collect()
        })
        .collect::<Vec<_>>()
        .concat()
}

/// Steps of usual length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inside {
    /// How many.
    pub count: usize,
    /// All together.
    pub sum: f64,
    /// About their mean, over their number.
    pub deviation: f64,
    /// The shortest.
    pub least: f64,
    /// The longest.
    pub most: f64,
}

/// Steps above `above` and not above `limit`.
#[must_use]
pub fn inside(time: &[f64], above: f64, limit: f64) -> Inside {
    let kept = |pair: &[f64]| Some(pair[1] - pair[0]).filter(|&s| s > above && s <= limit);
    let parts: Vec<(usize, f64, f64, f64)> = shares(time)
        .map(|(_, stamps)| {
            let mut out = (0, 0.0, f64::INFINITY, f64::NEG_INFINITY);
            for step in stamps.windows(2).filter_map(kept) {
                out = (out.0 + 1, out.1 + step, out.2.min(step), out.3.max(step));
            }
            out
        })
        .collect();
    let count: usize = parts.iter().map(|p| p.0).sum();
    let sum: f64 = parts.iter().map(|p| p.1).sum();
    let mean = sum / count as f64;
    let squares: Vec<f64> = shares(time)
        .map(|(_, stamps)| {
            stamps
                .windows(2)
                .filter_map(kept)
                .map(|step| (step - mean) * (step - mean))
                .sum()
        })
        .collect();
    Inside {
        count,
        sum,
        deviation: (squares.iter().sum::<f64>() / count as f64).sqrt(),
        least: parts.iter().map(|p| p.2).fold(f64::INFINITY, f64::min),
        most: parts.iter().map(|p| p.3).fold(f64::NEG_INFINITY, f64::max),
    }
}

/// Shares of stamps, each with the stamp before it, and where its own begin.
fn shares(time: &[f64]) -> impl IndexedParallelIterator<Item = (usize, &[f64])> {
    (0..time.len().div_ceil(SHARE))
        .into_par_iter()
        .map(move |k| {
            let first = k * SHARE;
            let stop = (first + SHARE).min(time.len());
            (first, &time[first.saturating_sub(1)..stop])
        })
}

/// What `visit` makes of the steps of each share that are longer than zero, in the order of their size as integers.
pub(super) fn of_each_share<R: Send>(
    time: &[f64],
    visit: impl Fn(&mut dyn Iterator<Item = u64>) -> R + Sync + Send,
) -> Vec<R> {
    shares(time)
        .map(|(_, stamps)| {
            let mut forward = stamps
                .windows(2)
                .map(|pair| pair[1] - pair[0])
                .filter(|&step| step > 0.0)
                .map(f64::to_bits);
            visit(&mut forward)
        })
        .collect()
}
