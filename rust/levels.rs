//! Which different values readings take: a converter's codes, however they were scaled.

use rayon::prelude::*;

/// Different values up to which a table finds them; more are no converter's codes, and sorting is as fast.
const MOST_IN_TABLE: usize = 1 << 16;

/// Different values that are numbers, in ascending order, and how many readings are numbers.
#[must_use]
pub fn levels(readings: impl Iterator<Item = f64>) -> (Vec<f64>, usize) {
    let mut table = Table::new();
    let mut finite = 0;
    let mut numbers = readings.filter(|v| v.is_finite());
    for value in &mut numbers {
        finite += 1;
        // Minus zero equals zero.
        table.add((value + 0.0).to_bits());
        if table.held > MOST_IN_TABLE {
            break;
        }
    }
    let mut found = table.values();
    let before = found.len();
    found.extend(numbers.map(|v| v + 0.0));
    finite += found.len() - before;
    found.par_sort_unstable_by(f64::total_cmp);
    found.dedup_by_key(|v| v.to_bits());
    (found, finite)
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
