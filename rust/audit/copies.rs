//! Blocks of different readings that repeat earlier ones one by one: a buffer that was sent twice.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

use rayon::prelude::*;

use super::SHARE;

/// Fewest rows between them: a reading that equals the one before is held, not copied.
const NEAREST: usize = 2;
/// Copies in succession beyond which the motion itself is periodic, as in a simulation without noise.
const MOST: usize = 3;

/// Rows of which at least `least` in a run equal, at one distance, the only equal one among the last `farthest` rows,
/// with the rows beside them that repeat others at that distance, too.
#[must_use]
pub fn copies(rows: &[[f64; 3]], farthest: usize, least: usize) -> Vec<Range<usize>> {
    let starts: Vec<usize> = (0..rows.len()).step_by(SHARE).collect();
    starts
        .par_iter()
        .flat_map_iter(|&start| of_share(rows, start, farthest, least))
        .collect()
}

/// The bits of a row.
type Key = (u64, u64, u64);

/// A hash of three numbers by multiplication: a log is no adversary, and every row is looked up.
#[derive(Default)]
struct Mixed(u64);

impl Hasher for Mixed {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }

    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(u64::from(*byte));
        }
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(23) ^ value).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
}

fn of_share(rows: &[[f64; 3]], start: usize, farthest: usize, least: usize) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut seen: HashMap<Key, (usize, usize), BuildHasherDefault<Mixed>> =
        HashMap::with_capacity_and_hasher(SHARE + farthest, BuildHasherDefault::default());
    let mut run = (0, 0, 0);
    let stop = (start + SHARE).min(rows.len());
    for row in start.saturating_sub(farthest)..=stop {
        let (mut apart, mut is_single) = (0, false);
        if let Some(key) = key(rows, row).filter(|_| row < stop) {
            let far = |other: usize| other + farthest < row + 1;
            let (last, before) = seen.entry(key).or_default();
            if *last > 0 && !far(*last) {
                apart = row + 1 - *last;
                is_single = *before == 0 || far(*before);
            }
            (*before, *last) = (*last, row + 1);
        }
        if row < start {
            continue;
        }
        let (distance, first, singles) = run;
        if apart == distance && row < stop {
            run.2 += usize::from(is_single);
            continue;
        }
        if distance >= NEAREST && singles >= least {
            out.extend(whole(rows, first..row, distance));
        }
        run = (apart, row, usize::from(is_single));
    }
    out
}

/// The bits of a row; none behind the last, or where a reading is missing.
fn key(rows: &[[f64; 3]], row: usize) -> Option<Key> {
    let finite = rows
        .get(row)
        .filter(|row| row.iter().all(|x| x.is_finite()));
    finite.map(|row| row.map(|x| (x + 0.0).to_bits()).into())
}

/// The rows around `block` as well that repeat those `apart` before; none where the motion is periodic.
fn whole(rows: &[[f64; 3]], block: Range<usize>, apart: usize) -> Option<Range<usize>> {
    let repeats = |row: usize| {
        let here = key(rows, row);
        row >= apart && here.is_some() && here == key(rows, row - apart)
    };
    let most = MOST * apart;
    let (mut first, mut stop) = (block.start, block.end);
    while stop - first <= most && first > 0 && repeats(first - 1) {
        first -= 1;
    }
    while stop - first <= most && stop < rows.len() && repeats(stop) {
        stop += 1;
    }
    (stop - first <= most).then_some(first..stop)
}
