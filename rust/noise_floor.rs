//! The noise floor of a log: grown from its quietest windows until it includes every window that the same noise
//! explains (docs/segmentation.md, sections 1 and 2).

use crate::order_statistics::{median, quantile};
use crate::running::rolling_mean;

/// Quietest part of a log that is taken as static at the start, where it exceeds the given minimum.
const SEED_FRACTION: f64 = 0.02;
/// Quantile of a log's windows that represents static windows before these are found.
const USUALLY_STILL: f64 = 0.1;
/// Least power relative to a channel's mean square: running sums round at a tenth of its root; noise is larger.
const ROUNDING_POWER: f64 = 1e-14;
/// Least power relative to a channel's usual power: the logarithm of a window without any would be infinite.
const LEAST_POWER: f64 = 1e-12;
/// Largest variance of readings that toggle between two neighbouring codes, q²/4, over that of rounding, q²/12. Noise
/// that does not dither the ADC has it in the pose whose reading is between two codes, and none in the next one.
const BETWEEN_CODES: f64 = 3.0;
/// Variance of readings, in that of rounding, below which noise does not dither the ADC: noise of half an LSB.
const UNDITHERED: f64 = 4.0;
/// Most iterations: sets that still change then alternate between two that hardly differ.
const MOST_ROUNDS: usize = 60;

/// Blocks of a log, row by row `(m, channels)`.
#[derive(Debug, Clone, Copy)]
pub struct Blocks<'a> {
    /// Number of channels.
    pub channels: usize,
    /// Readings in a block.
    pub length: usize,
    /// Mean reading of each block and channel.
    pub mean: &'a [f64],
    /// Variance of a reading in each block and channel.
    pub variance: &'a [f64],
    /// `(m,)` false where readings are missing.
    pub is_valid: &'a [bool],
    /// Whether a channel's scatter is the sensor's own noise in the window about a block.
    pub tells: &'a [bool],
    /// `(channels,)` variance of rounding to the resolution (LSB).
    pub rounding: &'a [f64],
}

/// Options of the search.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Blocks in a window.
    pub width: usize,
    /// Least number of windows taken as static at the start.
    pub seed: usize,
    /// Tails of static windows.
    pub tails: Tails,
    /// Median of the variance of block means in a window, over the variance itself.
    pub median_ratio: f64,
}

/// Distribution of the activity of a static sensor about its median.
#[derive(Debug, Clone, Copy)]
pub struct Tails {
    /// Part of static windows that lie one deviation or more below.
    pub lower: f64,
    /// Deviations above the median up to which a window is static.
    pub deviations: f64,
}

/// The noise floor, and the level of every window above it.
#[derive(Debug, Clone, PartialEq)]
pub struct Floor {
    /// `(m,)` logarithm of the variance inside the blocks of a window over the floor's.
    pub fast: Vec<f64>,
    /// `(m,)` the same of block means.
    pub slow: Vec<f64>,
    /// Limits of the two for a static sensor.
    pub limits: [f64; 2],
    /// `(m,)` below both limits.
    pub is_quiet: Vec<bool>,
    /// `(channels,)` variance of a reading inside a quiet block.
    pub white: Vec<f64>,
    /// `(channels,)` variance of the mean of a quiet block inside its window.
    pub wander: Vec<f64>,
}

/// Power of one channel in every window, and the windows in which it counts.
struct Channel {
    inside: Vec<f64>,
    between: Vec<f64>,
    tells: Vec<bool>,
}

/// The floor of a channel is the median over the quiet windows, so that axes of different noise and a few disturbed
/// windows do not matter; the limit is [`still_limit`].
#[must_use]
pub fn noise_floor(blocks: &Blocks, search: &Search) -> Floor {
    let m = blocks.is_valid.len();
    let whole = whole_windows(blocks.is_valid, search.width);
    let found: Vec<Option<Channel>> = (0..blocks.channels)
        .map(|c| channel(blocks, search.width, &whole, c))
        .collect();
    let mut floor = Floor {
        fast: vec![0.0; m],
        slow: vec![0.0; m],
        limits: [0.0; 2],
        is_quiet: whole.clone(),
        white: blocks.rounding.to_vec(),
        wander: blocks
            .rounding
            .iter()
            .map(|v| v / blocks.length as f64)
            .collect(),
    };
    let alive: Vec<&Channel> = found.iter().flatten().collect();
    if alive.is_empty() {
        return floor;
    }
    let total = total_power(&alive, &whole);
    floor.is_quiet = seed(&total, &whole, search.seed);
    floor.fast.clone_from(&total);
    floor.slow = total;
    grow(&mut floor, &alive, &whole, blocks.length, search);
    for (c, one) in found.iter().enumerate() {
        if let Some(one) = one {
            floor.white[c] = one.median_of(&one.inside, &floor.is_quiet);
            floor.wander[c] = one.median_of(&one.between, &floor.is_quiet) / search.median_ratio;
        }
    }
    floor
}

/// Highest activity of a static sensor: the false-alarm quantile of a log-normal as wide as chi-square with `freedom`
/// degrees of freedom, or as the lower half of the values where that is wider (coloured noise).
pub fn still_limit(activity: &mut [f64], freedom: usize, tails: &Tails) -> f64 {
    let middle = median(activity);
    let lower = middle - quantile(activity, tails.lower);
    middle + tails.deviations * lower.max((2.0 / freedom as f64).sqrt())
}

fn whole_windows(is_valid: &[bool], width: usize) -> Vec<bool> {
    let missing: Vec<f64> = is_valid.iter().map(|&v| f64::from(u8::from(!v))).collect();
    let missing = rolling_mean(&missing, 1, width);
    missing.iter().map(|&part| part <= 0.0).collect()
}

/// `None` where the median window of a channel has no noise at all.
fn channel(blocks: &Blocks, width: usize, whole: &[bool], c: usize) -> Option<Channel> {
    let column = |values: &[f64]| -> Vec<f64> {
        let all = values.iter().skip(c).step_by(blocks.channels);
        let valid = all.zip(blocks.is_valid);
        valid
            .map(|(&v, &ok)| if ok { v } else { f64::NAN })
            .collect()
    };
    let (mut mean, mut variance) = (column(blocks.mean), column(blocks.variance));
    let present = blocks.is_valid.iter().filter(|&&ok| ok).count();
    let sum: f64 = mean.iter().filter(|v| !v.is_nan()).sum();
    // Running sums round: means are taken about their average, and invalid blocks count as zero.
    let centre = sum / present as f64;
    for (value, other) in mean.iter_mut().zip(&mut variance) {
        (*value, *other) = if value.is_nan() {
            (0.0, 0.0)
        } else {
            (*value - centre, *other)
        };
    }
    let square: Vec<f64> = mean.iter().map(|v| v * v).collect();
    let unbiased = width as f64 / (width.max(2) - 1) as f64;
    let mut inside = rolling_mean(&variance, 1, width);
    let still = quantile(&mut chosen(&inside, whole), USUALLY_STILL);
    let toggling = if still < UNDITHERED * blocks.rounding[c] {
        BETWEEN_CODES
    } else {
        1.0
    };
    let rounding = toggling * blocks.rounding[c];
    let floor = [rounding, rounding / blocks.length as f64];
    let mut between = rolling_mean(&square, 1, width);
    for (value, low) in between.iter_mut().zip(rolling_mean(&mean, 1, width)) {
        *value = ((*value - low * low) * unbiased).max(floor[1]);
    }
    for value in &mut inside {
        *value = value.max(floor[0]);
    }
    let usual = |values: &[f64]| median(&mut chosen(values, whole));
    let usual_inside = usual(&inside);
    if !(usual_inside > 0.0 && usual(&between) > 0.0) {
        return None;
    }
    // In a simulation without noise the rounding of sums must not be taken for noise.
    let rms = square.iter().sum::<f64>() / square.len() as f64;
    let tiny = (LEAST_POWER * usual_inside).max(ROUNDING_POWER * rms);
    let part = tiny / blocks.length as f64;
    for (inside, between) in inside.iter_mut().zip(&mut between) {
        *inside += tiny;
        *between += part;
    }
    let tells = blocks.tells.iter().skip(c).step_by(blocks.channels);
    let tells = tells.copied().collect();
    Some(Channel {
        inside,
        between,
        tells,
    })
}

fn chosen(values: &[f64], which: &[bool]) -> Vec<f64> {
    let both = values
        .iter()
        .zip(which)
        .filter(|&(_, &is_chosen)| is_chosen);
    both.map(|(&value, _)| value).collect()
}

fn both(a: &[bool], b: &[bool]) -> Vec<bool> {
    a.iter().zip(b).map(|(&a, &b)| a && b).collect()
}

impl Channel {
    /// Median over quiet windows in which the channel counts; where none is quiet, over all in which it counts.
    fn median_of(&self, values: &[f64], quiet: &[bool]) -> f64 {
        let mut seen = chosen(values, &both(quiet, &self.tells));
        if seen.is_empty() {
            seen = chosen(values, &self.tells);
        }
        median(&mut seen)
    }
}

/// `(m,)` mean over the channels that count in each window; infinite where none does.
fn mean_over(alive: &[&Channel], m: usize, values: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = vec![0.0; m];
    if alive.iter().all(|one| !one.tells.contains(&false)) {
        for values in values {
            for (sum, value) in sum.iter_mut().zip(values) {
                *sum += value;
            }
        }
        for sum in &mut sum {
            *sum /= alive.len() as f64;
        }
        return sum;
    }
    let mut count = vec![0_u32; m];
    for (one, values) in alive.iter().zip(values) {
        for i in (0..m).filter(|&i| one.tells[i]) {
            sum[i] += values[i];
            count[i] += 1;
        }
    }
    let mean = |(sum, &count): (f64, &u32)| match count {
        0 => f64::INFINITY,
        _ => sum / f64::from(count),
    };
    sum.into_iter().zip(&count).map(mean).collect()
}

/// `(m,)` logarithm of the power of a window, each channel relative to its approximate power in static windows.
fn total_power(alive: &[&Channel], whole: &[bool]) -> Vec<f64> {
    let relative = |one: &&Channel| -> Vec<f64> {
        let both_parts = one.inside.iter().zip(&one.between);
        let power: Vec<f64> = both_parts.map(|(a, b)| a + b).collect();
        let usual = quantile(&mut chosen(&power, &both(whole, &one.tells)), USUALLY_STILL).ln();
        power.iter().map(|v| v.ln() - usual).collect()
    };
    let values: Vec<Vec<f64>> = alive.iter().map(relative).collect();
    let mut total = mean_over(alive, whole.len(), &values);
    for (value, _) in total
        .iter_mut()
        .zip(whole)
        .filter(|(_, is_whole)| !**is_whole)
    {
        *value = f64::INFINITY;
    }
    total
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of a number of windows"
)]
fn seed(total: &[f64], whole: &[bool], least: usize) -> Vec<bool> {
    let n = whole.iter().filter(|&&is_whole| is_whole).count();
    let most = ((SEED_FRACTION * n as f64) as usize).max(least).min(n);
    let mut order = total.to_vec();
    let (_, &mut last, _) = order.select_nth_unstable_by(most.max(1) - 1, f64::total_cmp);
    total.iter().map(|&value| value <= last).collect()
}

/// Repeated until nothing changes: every window below both limits is quiet.
fn grow(floor: &mut Floor, alive: &[&Channel], whole: &[bool], length: usize, search: &Search) {
    let (m, n) = (whole.len(), alive.len());
    let freedom = [
        search.width * (length - 1) * n,
        (search.width.max(2) - 1) * n,
    ];
    let above = |part: fn(&Channel) -> &[f64], quiet: &[bool]| -> Vec<f64> {
        let relative = |one: &&Channel| -> Vec<f64> {
            let level = one.median_of(part(one), quiet);
            part(one).iter().map(|v| v / level).collect()
        };
        let values: Vec<Vec<f64>> = alive.iter().map(relative).collect();
        let mean = mean_over(alive, m, &values);
        mean.into_iter().map(f64::ln).collect()
    };
    for _ in 0..MOST_ROUNDS {
        floor.fast = above(|one| &one.inside, &floor.is_quiet);
        floor.slow = above(|one| &one.between, &floor.is_quiet);
        floor.limits = [
            still_limit(
                &mut chosen(&floor.fast, &floor.is_quiet),
                freedom[0],
                &search.tails,
            ),
            still_limit(
                &mut chosen(&floor.slow, &floor.is_quiet),
                freedom[1],
                &search.tails,
            ),
        ];
        let is_still = |i: usize| {
            whole[i] && floor.fast[i] <= floor.limits[0] && floor.slow[i] <= floor.limits[1]
        };
        let grown: Vec<bool> = (0..m).map(is_still).collect();
        if grown == floor.is_quiet || !grown.contains(&true) {
            break;
        }
        floor.is_quiet = grown;
    }
}
