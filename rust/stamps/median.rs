//! The median of the steps of a log, which are never written down.

use super::steps::of_each_share;

/// Bits of a step by which one pass narrows down where the median lies.
const DIGIT: u32 = 11;

/// Median of the steps forward of stamps; NaN where there is none.
#[must_use]
pub fn usual_step(time: &[f64]) -> f64 {
    // Positive doubles are ordered as their bits are: a place is found digit by digit, as in a radix sort.
    let ranges = of_each_share(time, |steps| {
        let mut out = (u64::MAX, 0, 0_usize);
        for bits in steps {
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
        let below = of_each_share(time, |steps| {
            steps.filter(|&bits| bits < upper.bits).max().unwrap_or(0)
        });
        below.into_iter().max().unwrap_or(upper.bits)
    };
    f64::midpoint(f64::from_bits(lower), f64::from_bits(upper.bits))
}

struct Found {
    bits: u64,
    /// Steps shorter than it.
    below: usize,
}

/// The step of a rank (from 0) among those between `least` and `most`.
fn at_rank(time: &[f64], rank: usize, least: u64, most: u64) -> Found {
    let (mut from, mut width, mut below) = (least, most - least, 0);
    loop {
        let shift = (u64::BITS - width.leading_zeros()).saturating_sub(DIGIT);
        let counts = of_each_share(time, |steps| {
            let mut counts = vec![0_u32; 1 << DIGIT];
            for bits in steps {
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
