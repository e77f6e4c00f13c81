//! Statistics of every log: extreme values, readings that equal the one before, earlier ones, or leap away, missing readings.

mod copies;
mod leaps;
mod repeats;

pub use copies::copies;
pub use leaps::{Leap, leaps};
pub use repeats::{Repeats, WINDOW, repeats};

use std::ops::Range;

use rayon::prelude::*;

/// Rows that a thread takes at a time; a whole number of windows.
const SHARE: usize = 1 << 16;

/// Least and greatest reading of one axis, and how often each occurs; NaN and none where no reading is a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremes {
    /// The least.
    pub low: f64,
    /// Readings that equal it.
    pub n_low: usize,
    /// The greatest.
    pub high: f64,
    /// Readings that equal it.
    pub n_high: usize,
}

impl Extremes {
    const NONE: Self = Self {
        low: f64::NAN,
        n_low: 0,
        high: f64::NAN,
        n_high: 0,
    };

    fn joined(self, other: Self) -> Self {
        let (low, n_low) = joined((self.low, self.n_low), (other.low, other.n_low), |a, b| {
            a < b
        });
        let (high, n_high) = joined(
            (self.high, self.n_high),
            (other.high, other.n_high),
            |a, b| a > b,
        );
        Self {
            low,
            n_low,
            high,
            n_high,
        }
    }
}

fn joined(a: (f64, usize), b: (f64, usize), beats: impl Fn(f64, f64) -> bool) -> (f64, usize) {
    if a.1 == 0 || beats(b.0, a.0) {
        b
    } else if b.1 == 0 || beats(a.0, b.0) {
        a
    } else {
        (a.0, a.1 + b.1)
    }
}

/// Extremes of each axis; NaN readings are skipped.
#[must_use]
pub fn extremes(rows: &[[f64; 3]]) -> [Extremes; 3] {
    let parts: Vec<[Extremes; 3]> = rows
        .par_chunks(SHARE)
        .map(|rows| std::array::from_fn(|axis| extremes_of_axis(rows, axis)))
        .collect();
    parts.into_iter().fold([Extremes::NONE; 3], |all, part| {
        std::array::from_fn(|axis| all[axis].joined(part[axis]))
    })
}

// The extremes are readings themselves: equal is equal to the last bit.
#[allow(clippy::float_cmp)]
fn extremes_of_axis(rows: &[[f64; 3]], axis: usize) -> Extremes {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for row in rows {
        // Comparisons with NaN are false: NaN is skipped.
        low = if row[axis] < low { row[axis] } else { low };
        high = if row[axis] > high { row[axis] } else { high };
    }
    let (mut n_low, mut n_high) = (0, 0);
    for row in rows {
        n_low += usize::from(row[axis] == low);
        n_high += usize::from(row[axis] == high);
    }
    if n_low == 0 || n_high == 0 {
        return Extremes::NONE;
    }
    Extremes {
        low,
        n_low,
        high,
        n_high,
    }
}

/// The largest change of each axis from one reading to the next; missing readings are skipped.
#[must_use]
pub fn largest_steps(rows: &[[f64; 3]]) -> [f64; 3] {
    // A share begins at the last row of the one before.
    let parts: Vec<[f64; 3]> = (0..rows.len().div_ceil(SHARE))
        .into_par_iter()
        .map(|k| {
            let first = (k * SHARE).saturating_sub(1);
            largest_of_share(rows, first..((k + 1) * SHARE).min(rows.len()))
        })
        .collect();
    parts.into_iter().fold([0.0; 3], |all, part| {
        std::array::from_fn(|axis| f64::max(all[axis], part[axis]))
    })
}

fn largest_of_share(rows: &[[f64; 3]], share: Range<usize>) -> [f64; 3] {
    let (before, share) = (&rows[..share.start], &rows[share]);
    std::array::from_fn(|axis| {
        let known = |row: &&[f64; 3]| row[axis].is_finite();
        let start = share.first().filter(known);
        let start = start.or_else(|| before.iter().rev().find(known));
        let mut last = start.map_or(f64::NAN, |row| row[axis]);
        let mut largest = 0.0;
        for row in share {
            // NaN is no step, and the reading before stays the last one.
            let step = (row[axis] - last).abs();
            largest = if step > largest { step } else { largest };
            last = if row[axis].is_finite() {
                row[axis]
            } else {
                last
            };
        }
        largest
    })
}

/// Readings near an extreme value.
#[derive(Debug, Clone, PartialEq)]
pub struct Near {
    /// Readings within the depth, those at the value itself among them.
    pub count: usize,
    /// Distance of the nearest reading that differs from the value; infinite where there is none.
    pub width: f64,
    /// Rows that hold the value.
    pub at: Vec<i64>,
}

/// Readings within `depth` of a value of one axis.
///
/// # Panics
/// When `axis` is not below 3.
#[must_use]
pub fn near(rows: &[[f64; 3]], axis: usize, value: f64, depth: f64) -> Near {
    assert!(axis < 3);
    let parts: Vec<Near> = rows
        .par_chunks(SHARE)
        .enumerate()
        .map(|(k, rows)| {
            let mut out = Near {
                count: 0,
                width: f64::INFINITY,
                at: Vec::new(),
            };
            for (i, row) in rows.iter().enumerate() {
                let distance = (row[axis] - value).abs();
                out.count += usize::from(distance <= depth);
                if distance == 0.0 {
                    out.at
                        .push(i64::try_from(k * SHARE + i).unwrap_or(i64::MAX));
                } else if distance < out.width {
                    out.width = distance;
                }
            }
            out
        })
        .collect();
    Near {
        count: parts.iter().map(|p| p.count).sum(),
        width: parts.iter().map(|p| p.width).fold(f64::INFINITY, f64::min),
        at: parts.into_iter().flat_map(|p| p.at).collect(),
    }
}
