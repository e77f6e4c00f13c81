//! Distinct values of readings: the codes of an ADC, in any scaling.

use rayon::prelude::*;

/// Number of distinct values up to which a hash table finds them; more are no ADC codes, and sorting is as fast.
const MOST_IN_TABLE: usize = 1 << 16;

/// Span of integers up to which a bit field finds them: the codes of 24-bit ADCs in two megabytes.
const MOST_CODES: f64 = (1 << 24) as f64;

/// Distinct finite values in ascending order, and the number of finite readings.
#[must_use]
#[allow(clippy::float_cmp)] // a code is a whole number to the last bit
pub fn levels(readings: &[f64]) -> (Vec<f64>, usize) {
    let (mut low, mut high, mut finite, mut is_whole) = (f64::INFINITY, f64::NEG_INFINITY, 0, true);
    for &v in readings {
        let is_finite = v.is_finite();
        finite += usize::from(is_finite);
        low = if is_finite && v < low { v } else { low };
        high = if is_finite && v > high { v } else { high };
        is_whole &= !is_finite || v.trunc() == v;
    }
    if finite == 0 {
        return (Vec::new(), 0);
    }
    let numbers = readings.iter().copied().filter(|v| v.is_finite());
    if is_whole && high - low < MOST_CODES {
        return (codes(numbers, low, high), finite);
    }
    (different(numbers), finite)
}

/// Integers from `low` to `high` that occur.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers from 0 to MOST_CODES"
)]
fn codes(numbers: impl Iterator<Item = f64>, low: f64, high: f64) -> Vec<f64> {
    let mut seen = vec![0_u64; (high - low) as usize / 64 + 1];
    for v in numbers {
        let code = (v - low) as usize;
        seen[code / 64] |= 1 << (code % 64);
    }
    let mut found = Vec::new();
    for (word, mut bits) in (0_u32..).zip(seen) {
        while bits != 0 {
            found.push(low + f64::from(word * 64 + bits.trailing_zeros()));
            bits &= bits - 1;
        }
    }
    found
}

fn different(mut numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut table = Table::new();
    for value in &mut numbers {
        // Minus zero equals zero.
        table.add((value + 0.0).to_bits());
        if table.held > MOST_IN_TABLE {
            break;
        }
    }
    let mut found = table.values();
    found.extend(numbers.map(|v| v + 0.0));
    found.par_sort_unstable_by(f64::total_cmp);
    found.dedup_by_key(|v| v.to_bits());
    found
}

/// A set of bit patterns by open addressing; never more than half full.
struct Table {
    slots: Vec<u64>,
    held: usize,
}

/// The bits of a NaN, which no number has.
const FREE: u64 = u64::MAX;

impl Table {
    fn new() -> Self {
        Self {
            slots: vec![FREE; 1 << 10],
            held: 0,
        }
    }

    fn add(&mut self, bits: u64) {
        if 2 * (self.held + 1) > self.slots.len() {
            let wider = vec![FREE; 4 * self.slots.len()];
            let old = std::mem::replace(&mut self.slots, wider);
            self.held = 0;
            for bits in old.into_iter().filter(|&b| b != FREE) {
                self.add(bits);
            }
        }
        let mask = self.slots.len() - 1;
        // Multiplied by 2^64 over the golden ratio: low bits of doubles are often all zero, the upper ones are mixed.
        let mixed = bits.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut at = usize::try_from(mixed >> 32).unwrap_or(0) & mask;
        while self.slots[at] != FREE {
            if self.slots[at] == bits {
                return;
            }
            at = (at + 1) & mask;
        }
        self.slots[at] = bits;
        self.held += 1;
    }

    fn values(&self) -> Vec<f64> {
        let held = self.slots.iter().filter(|&&b| b != FREE);
        held.map(|&b| f64::from_bits(b)).collect()
    }
}
