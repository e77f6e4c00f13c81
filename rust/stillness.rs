//! One pass over a log: mean and scatter of short blocks, from which static intervals are detected.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use rayon::prelude::*;

use crate::simd::{Instructions, fma, for_each_instruction_set};
use crate::{Error, Result};

/// Blocks of one triad: `[block][axis]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Blocks {
    /// Mean reading of each block, raw unit. NaN in a block that holds no reading.
    pub mean: Vec<[f64; 3]>,
    /// Unbiased variance about the block's own mean, raw unit squared. NaN below two readings.
    pub variance: Vec<[f64; 3]>,
    /// Finite rows of each block.
    pub count: Vec<u32>,
}

/// Numbers summed side by side: eight rows of three.
const WIDE: usize = 24;
/// Blocks handed to a thread at a time.
const SHARE: usize = 4096;

/// Mean and variance of consecutive blocks of `length` rows of an `(n, 3)` row-major array.
///
/// Rows that are not finite are skipped; a remainder shorter than a block is excluded. Two passes over each block keep
/// the variance exact under a large offset.
///
/// # Errors
/// `length` below two, or an array that is not made of rows of three.
pub fn block_statistics(readings: &[f64], length: usize) -> Result<Blocks> {
    block_statistics_with(Instructions::detect(), readings, length)
}

/// As [`block_statistics`], with a chosen instruction set; results differ by rounding.
///
/// # Errors
/// As [`block_statistics`].
pub fn block_statistics_with(
    instructions: Instructions,
    readings: &[f64],
    length: usize,
) -> Result<Blocks> {
    if length < 2 {
        return Err(Error::bad_input(format!(
            "a block needs at least two samples to have a variance, got {length}"
        )));
    }
    if !readings.len().is_multiple_of(3) {
        return Err(Error::bad_input(format!(
            "readings must come in rows of three, got {} numbers",
            readings.len()
        )));
    }
    let n = readings.len() / 3 / length;
    let mut out = Blocks {
        mean: vec![[0.0; 3]; n],
        variance: vec![[0.0; 3]; n],
        count: vec![0; n],
    };
    let size = 3 * length;
    readings[..n * size]
        .par_chunks(SHARE * size)
        .zip(out.mean.par_chunks_mut(SHARE))
        .zip(out.variance.par_chunks_mut(SHARE))
        .zip(out.count.par_chunks_mut(SHARE))
        .for_each(|(((readings, mean), variance), count)| {
            blocks(instructions, readings, size, mean, variance, count);
        });
    Ok(out)
}

for_each_instruction_set! {
    fn blocks(
        readings: &[f64],
        size: usize,
        mean: &mut [[f64; 3]],
        variance: &mut [[f64; 3]],
        count: &mut [u32],
    ) = blocks_lanes
}

#[inline(always)]
fn blocks_lanes<const FUSED: bool>(
    readings: &[f64],
    size: usize,
    mean: &mut [[f64; 3]],
    variance: &mut [[f64; 3]],
    count: &mut [u32],
) {
    let rows = u32::try_from(size / 3).unwrap_or(u32::MAX);
    let per_row = 1.0 / f64::from(rows);
    let per_freedom = 1.0 / f64::from(rows - 1);
    for (((block, mean), variance), count) in readings
        .chunks_exact(size)
        .zip(mean)
        .zip(variance)
        .zip(count)
    {
        *mean = sums(block).map(|s| s * per_row);
        // A reading that is not finite leaves a sum that is not.
        if mean.iter().all(|m| m.is_finite()) {
            *variance = squares::<FUSED>(block, *mean).map(|s| s * per_freedom);
            *count = rows;
        } else {
            (*mean, *variance, *count) = of_finite_rows(block);
        }
    }
}

#[inline(always)]
fn sums(block: &[f64]) -> [f64; 3] {
    let (wide, rest) = block.as_chunks::<WIDE>();
    let mut sum = [0.0; WIDE];
    for chunk in wide {
        for k in 0..WIDE {
            sum[k] += chunk[k];
        }
    }
    folded(sum, rest, |x, _| x)
}

#[inline(always)]
fn squares<const FUSED: bool>(block: &[f64], mean: [f64; 3]) -> [f64; 3] {
    let (wide, rest) = block.as_chunks::<WIDE>();
    let mut repeated = [0.0; WIDE];
    for k in 0..WIDE {
        repeated[k] = mean[k % 3];
    }
    let mut sum = [0.0; WIDE];
    for chunk in wide {
        for k in 0..WIDE {
            let d = chunk[k] - repeated[k];
            sum[k] = fma::<FUSED>(d, d, sum[k]);
        }
    }
    folded(sum, rest, |x, axis| (x - mean[axis]) * (x - mean[axis]))
}

/// Sums of the axes of a wide sum, the remaining rows added one by one.
#[inline(always)]
fn folded(wide: [f64; WIDE], rest: &[f64], term: impl Fn(f64, usize) -> f64) -> [f64; 3] {
    let mut half = [0.0; WIDE / 2];
    for k in 0..WIDE / 2 {
        half[k] = wide[k] + wide[k + WIDE / 2];
    }
    let mut sum = [0.0; 3];
    for axis in 0..3 {
        sum[axis] = (half[axis] + half[axis + 6]) + (half[axis + 3] + half[axis + 9]);
    }
    for row in rest.as_chunks::<3>().0 {
        for axis in 0..3 {
            sum[axis] += term(row[axis], axis);
        }
    }
    sum
}

/// A block in which readings are missing.
fn of_finite_rows(block: &[f64]) -> ([f64; 3], [f64; 3], u32) {
    let finite = || {
        block
            .chunks_exact(3)
            .filter(|row| row.iter().all(|x| x.is_finite()))
    };
    let mut count = 0_u32;
    let mut sum = [0.0; 3];
    for row in finite() {
        count += 1;
        for axis in 0..3 {
            sum[axis] += row[axis];
        }
    }
    let mean = sum.map(|s| s / f64::from(count));
    let mut square = [0.0; 3];
    for row in finite() {
        for axis in 0..3 {
            square[axis] += (row[axis] - mean[axis]).powi(2);
        }
    }
    let freedom = if count > 1 {
        f64::from(count - 1)
    } else {
        f64::NAN
    };
    (mean, square.map(|s| s / freedom), count)
}
