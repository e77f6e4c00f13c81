//! The median of the steps of a log, which are never all stored.

use super::steps::{forward, of_each_share};

/// Bits of a step by which one pass narrows down the position of the median.
const DIGIT: u32 = 11;
/// Number of steps sampled for the approximate position of the median.
const ASKED: usize = 4096;
/// Ranks about the middle, in parts of all, between which the median lies: 3.8 standard deviations of the sample's.
const MARGIN: f64 = 0.03;

/// Median of the steps forward of timestamps; NaN where there is none.
#[must_use]
pub fn usual_step(time: &[f64]) -> f64 {
    // Positive doubles are ordered as their bits are.
    asked(time)
        .and_then(|(low, high)| between(time, low, high))
        .unwrap_or_else(|| by_digits(time))
}

/// Range of steps that almost certainly contains the median of all, from a sample; `None` where there are few.
fn asked(time: &[f64]) -> Option<(f64, f64)> {
    if time.len() <= ASKED {
        return None;
    }
    let pairs = time.len() as u64 - 1;
    // Multiples of the golden section: the sample shares no period with a pattern of the steps.
    let place = |k: u64| {
        let part = u128::from(k.wrapping_mul(0x9E37_79B9_7F4A_7C15)) * u128::from(pairs);
        usize::try_from(part >> 64).ok()
    };
    let mut steps: Vec<u64> = (0..ASKED as u64)
        .filter_map(place)
        .map(|i| time[i + 1] - time[i])
        .filter(|&step| step > 0.0)
        .map(f64::to_bits)
        .collect();
    if steps.len() < ASKED / 8 {
        return None;
    }
    steps.sort_unstable();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a rank among the steps"
    )]
    let at = |part: f64| f64::from_bits(steps[((steps.len() - 1) as f64 * part) as usize]);
    Some((at(0.5 - MARGIN), at(0.5 + MARGIN)))
}

/// Counts of steps below, at, between and of all, for a range of two steps.
struct About {
    below: usize,
    at_low: usize,
    inside: Vec<u64>,
    at_high: usize,
    all: usize,
}

/// The median in one pass; `None` if it does not lie between the two steps.
#[allow(clippy::float_cmp)] // the same step is the same to the last bit
fn between(time: &[f64], low: f64, high: f64) -> Option<f64> {
    let parts = of_each_share(time, |timestamps| {
        // Counted without branches, so that a whole vector of steps is processed together.
        let (mut below, mut at_low, mut at_high, mut above, mut all) = (0, 0, 0, 0, 0);
        for pair in timestamps.windows(2) {
            let step = pair[1] - pair[0];
            all += usize::from(step > 0.0);
            below += usize::from(step > 0.0 && step < low);
            at_low += usize::from(step == low);
            at_high += usize::from(step == high);
            above += usize::from(step > high);
        }
        if high <= low {
            at_high = 0;
        }
        let mut inside = Vec::new();
        if below + at_low + at_high + above < all {
            let between = |&bits: &u64| bits > low.to_bits() && bits < high.to_bits();
            inside.extend(forward(timestamps).filter(between));
        }
        About {
            below,
            at_low,
            inside,
            at_high,
            all,
        }
    });
    let count = |of: fn(&About) -> usize| parts.iter().map(of).sum::<usize>();
    let (n, below, at_low) = (count(|p| p.all), count(|p| p.below), count(|p| p.at_low));
    let at_high = count(|p| p.at_high);
    let mut inside: Vec<u64> = parts.into_iter().flat_map(|p| p.inside).collect();
    let mut ranked = |rank: usize| {
        let rank = rank.checked_sub(below)?;
        if rank < at_low {
            return Some(low.to_bits());
        }
        let rank = rank - at_low;
        if rank < inside.len() {
            return Some(*inside.select_nth_unstable(rank).1);
        }
        (rank - inside.len() < at_high).then_some(high.to_bits())
    };
    let upper = f64::from_bits(ranked(n / 2)?);
    if n % 2 == 1 {
        return Some(upper);
    }
    let lower = ranked((n / 2).checked_sub(1)?)?;
    Some(f64::midpoint(f64::from_bits(lower), upper))
}

/// The median without a known range, digit by digit, as in a radix sort.
fn by_digits(time: &[f64]) -> f64 {
    let ranges = of_each_share(time, |timestamps| {
        let mut out = (u64::MAX, 0, 0_usize);
        for bits in forward(timestamps) {
            out = (out.0.min(bits), out.1.max(bits), out.2 + 1);
        }
        out
    });
    let n: usize = ranges.iter().map(|r| r.2).sum();
    if n == 0 {
        return f64::NAN;
    }
    let least = ranges.iter().map(|r| r.0).min().unwrap_or(0);
    let most = ranges.iter().map(|r| r.1).max().unwrap_or(0);
    let upper = at_rank(time, n / 2, least, most);
    if n % 2 == 1 {
        return f64::from_bits(upper.bits);
    }
    let lower = if upper.below < n / 2 {
        upper.bits
    } else {
        let below = of_each_share(time, |timestamps| {
            forward(timestamps)
                .filter(|&bits| bits < upper.bits)
                .max()
                .unwrap_or(0)
        });
        below.into_iter().max().unwrap_or(upper.bits)
    };
    f64::midpoint(f64::from_bits(lower), f64::from_bits(upper.bits))
}

struct Found {
    bits: u64,
    /// Number of shorter steps.
    below: usize,
}

/// The step of a rank (from 0) among those between `least` and `most`.
fn at_rank(time: &[f64], rank: usize, least: u64, most: u64) -> Found {
    let (mut from, mut width, mut below) = (least, most - least, 0);
    loop {
        let shift = (u64::BITS - width.leading_zeros()).saturating_sub(DIGIT);
        let counts = of_each_share(time, |timestamps| {
            let mut counts = vec![0_u32; 1 << DIGIT];
            for bits in forward(timestamps) {
                let place = bits.wrapping_sub(from);
                if place <= width {
                    // Shifted to DIGIT bits.
                    #[allow(clippy::cast_possible_truncation)]
                    let digit = (place >> shift) as usize;
                    counts[digit] += 1;
                }
            }
            counts
        });
        for digit in 0..1_usize << DIGIT {
            let here: usize = counts.iter().map(|c| c[digit] as usize).sum();
            if below + here > rank {
                from += (digit as u64) << shift;
                break;
            }
            below += here;
        }
        if shift == 0 {
            return Found { bits: from, below };
        }
        width = width.min((1 << shift) - 1);
    }
}
