//! Events in a static log: differences of neighbouring means far outside their own scatter.

use rayon::prelude::*;

use crate::allan::prefix::write_running_sum;
use crate::allan::readings::Readings;
use crate::error::{Error, Result};
use crate::interrupt;

/// Differences from which a spread is estimated: its error is 0.8 %, far below that of the limit.
const SAMPLE: usize = 16384;
/// Differences that are tested together.
const RUN: usize = 1024;
/// Median absolute deviation to standard deviation of a Gaussian.
const MAD_TO_SIGMA: f64 = 1.4826;
/// Two-sided 1 % point of a Gaussian, in sigmas.
const TWO_SIDED_HUNDREDTH: f64 = 2.5758;

/// Number of events up to which they are not tested for a tail.
const FEW: usize = 2;
/// Differences between this part of the limit and the limit lie closely below it.
const CLOSELY: f64 = 0.7;

/// One scale at which the log is searched.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Readings per mean.
    pub size: usize,
    /// Readings between neighbouring starts.
    pub stride: usize,
    /// Difference, in sigmas, above which it is an event.
    pub limit: f64,
}

/// The largest of a run of differences above the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// Difference over limit times spread.
    pub score: f64,
    /// Reading at which the later mean begins.
    pub at: usize,
    /// Readings per mean.
    pub size: usize,
    /// Later mean minus earlier, beyond the usual change.
    pub difference: f64,
}

/// Events of one channel at every scale, with the running sum in memory of the caller, one longer than the readings;
/// readings that are not finite count as the mean.
///
/// # Errors
/// `BadInput` for a scale that does not fit into the log.
///
/// # Panics
/// When `workspace` has another length.
pub fn jumps_in(
    readings: &impl Readings,
    scales: &[Scale],
    workspace: &mut [f64],
) -> Result<Vec<Jump>> {
    if scales
        .iter()
        .any(|s| s.size == 0 || s.stride == 0 || 2 * s.size > readings.len())
    {
        return Err(Error::bad_input(
            "every scale must hold at least one reading, and the log two of them",
        ));
    }
    write_running_sum(readings, workspace);
    let sums = &*workspace;
    Ok(scales
        .par_iter()
        .flat_map_iter(|&scale| at_scale(sums, scale))
        .collect())
}

fn at_scale(sums: &[f64], scale: Scale) -> Vec<Jump> {
    let Scale {
        size,
        stride,
        limit,
    } = scale;
    let count = (sums.len() - 1 - 2 * size) / stride + 1;
    let change = |i: usize| {
        let k = i * stride;
        ((sums[k + 2 * size] - sums[k + size]) - (sums[k + size] - sums[k])) / size as f64
    };
    let sample = (0..count).step_by((count / SAMPLE).max(1)).map(change);
    let (usual, spread) = centre_and_spread(sample.collect());
    // What a log in a steady drift changes by everywhere is no event.
    let difference = |i: usize| change(i) - usual;
    let threshold = limit * spread;
    let apart = (2 * size / stride).max(1);
    let mut out: Vec<Jump> = Vec::new();
    let mut last = 0;
    // Almost every run of readings holds no event: its largest difference is found without a branch.
    let quiet = |first: usize, n: usize| {
        let room = (threshold - usual.abs()) * size as f64;
        stride == 1 && largest(&sums[first..], size, n) <= room
    };
    for i in (0..count)
        .step_by(RUN)
        .map(|first| first..(first + RUN).min(count))
        .take_while(|_| !interrupt::is_requested())
        .filter(|run| !quiet(run.start, run.len()))
        .flatten()
    {
        let d = difference(i);
        if d.abs() <= threshold {
            continue;
        }
        let jump = Jump {
            score: d.abs() / threshold,
            at: i * stride + size,
            size,
            difference: d,
        };
        match out.last_mut() {
            Some(open) if i - last <= apart => {
                if jump.score > open.score {
                    *open = jump;
                }
            }
            _ => out.push(jump),
        }
        last = i;
    }
    // Events are rare. Where every thousandth mean is one, the noise at this scale is not Gaussian, and no test.
    let is_common = out.len() > 10 + sums.len() / size / 1000;
    if is_common || (out.len() > FEW && is_a_tail((0..count).map(difference), limit, spread)) {
        Vec::new()
    } else {
        out
    }
}

/// Whether more differences, less those of a Gaussian, lie closely below the limit than above it: events have any size,
/// the density of a noise tail falls across the limit.
fn is_a_tail(differences: impl Iterator<Item = f64>, limit: f64, spread: f64) -> bool {
    let (mut below, mut above, mut all) = (0_usize, 0_usize, 0_usize);
    for d in differences {
        let z = d.abs() / spread;
        all += 1;
        above += usize::from(z > limit);
        below += usize::from(z > CLOSELY * limit && z <= limit);
    }
    let gaussian = all as f64 * (-0.5 * (CLOSELY * limit).powi(2)).exp();
    below as f64 - gaussian > above as f64
}

/// Largest absolute second difference with lag `m` over the first `n` starts.
fn largest(sums: &[f64], m: usize, n: usize) -> f64 {
    const LANES: usize = 8;
    let mut most = [0.0_f64; LANES];
    let (a, at) = sums[..n].as_chunks::<LANES>();
    let (b, bt) = sums[m..][..n].as_chunks::<LANES>();
    let (c, ct) = sums[2 * m..][..n].as_chunks::<LANES>();
    for ((a, b), c) in a.iter().zip(b).zip(c) {
        for lane in 0..LANES {
            let d = ((c[lane] - b[lane]) - (b[lane] - a[lane])).abs();
            most[lane] = if d > most[lane] { d } else { most[lane] };
        }
    }
    let rest = at
        .iter()
        .zip(bt)
        .zip(ct)
        .map(|((a, b), c)| ((c - b) - (b - a)).abs());
    most.into_iter().chain(rest).fold(0.0, f64::max)
}

/// Median and robust spread about it, at least what one difference in a hundred requires: readings with long tails are noise, not
/// events, and counts that rarely change have a median of zero.
fn centre_and_spread(mut values: Vec<f64>) -> (f64, f64) {
    let centre = median(&mut values);
    for v in &mut values {
        *v = (*v - centre).abs();
    }
    let rms = (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
    let mut spread = MAD_TO_SIGMA * median(&mut values);
    if values.len() >= 4096 {
        let rank = values.len() - values.len() / 100;
        spread = spread
            .max(*values.select_nth_unstable_by(rank, f64::total_cmp).1 / TWO_SIDED_HUNDREDTH);
    }
    if spread > 0.0 {
        (centre, spread)
    } else {
        (centre, rms.max(f64::MIN_POSITIVE))
    }
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Mean squares of the differences between neighbouring readings in blocks of `size`; NaN where a block has none.
#[must_use]
pub fn scatter<F: Fn(usize) -> f64 + Sync>(n: usize, get: F, size: usize) -> Vec<f64> {
    (0..n / size.max(1))
        .into_par_iter()
        .with_min_len(256)
        .map(|block| {
            let (mut sum, mut count) = (0.0, 0.0);
            for i in block * size..((block + 1) * size).min(n - 1) {
                let d = get(i + 1) - get(i);
                if d.is_finite() {
                    sum += d * d;
                    count += 1.0;
                }
            }
            sum / count
        })
        .collect()
}
