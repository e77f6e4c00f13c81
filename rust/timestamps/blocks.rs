//! One number per block of timestamps: the earliest, the median, the mean of their ticks.

use rayon::prelude::*;

use super::Tick;
use crate::order_statistics::median;

/// Blocks that a thread takes at a time.
const BLOCKS: usize = 1024;

/// Row of the first of the least values in every block of `width` rows; the last block includes the remainder.
///
/// Where more than a block follows the last row found, that of the last half block is added. `late` must not be empty.
#[must_use]
pub fn earliest(late: &[f64], width: usize) -> Vec<i64> {
    let n = late.len();
    let width = width.max(1);
    let blocks = n / width;
    if blocks == 0 {
        return vec![least(late, 0)];
    }
    let mut at: Vec<i64> = (0..blocks)
        .into_par_iter()
        .with_min_len(BLOCKS)
        .map(|k| least(&late[k * width..(k + 1) * width], k * width))
        .collect();
    let body = blocks * width;
    let mut last = at[blocks - 1];
    if body < n {
        let rest = least(&late[body..], body);
        if late[place(rest)] < late[place(last)] {
            last = rest;
            at[blocks - 1] = rest;
        }
    }
    if n - place(last) > width {
        let tail = n - width / 2;
        at.push(least(&late[tail..], tail));
    }
    at
}

fn least(late: &[f64], first: usize) -> i64 {
    let mut at = 0;
    for (i, value) in late.iter().enumerate() {
        if *value < late[at] {
            at = i;
        }
    }
    i64::try_from(first + at).unwrap_or(i64::MAX)
}

fn place(at: i64) -> usize {
    usize::try_from(at).unwrap_or(0)
}

/// Median of every whole block of `width` rows.
#[must_use]
pub fn block_medians(late: &[f64], width: usize) -> Vec<f64> {
    late.par_chunks_exact(width.max(1))
        .with_min_len(BLOCKS)
        .map_init(Vec::new, |scratch, block| {
            scratch.clear();
            scratch.extend_from_slice(block);
            median(scratch)
        })
        .collect()
}

/// Mean tick of every whole block of `width` rows.
#[must_use]
pub fn block_means<T: Tick>(ticks: &[T], width: usize) -> Vec<f64> {
    let width = width.max(1);
    ticks
        .par_chunks_exact(width)
        .with_min_len(BLOCKS)
        .map(|block| block.iter().map(|t| t.number()).sum::<f64>() / width as f64)
        .collect()
}
