//! One pass over a log: mean and scatter of short blocks, all that stillness is judged by.

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

/// Mean and variance of consecutive blocks of `length` rows of an `(n, 3)` row-major array.
///
/// Rows that are not finite are skipped; a rest shorter than a block is left out. Two passes over each block keep
/// the variance exact under a large offset.
///
/// # Errors
/// `length` below two, or an array that is not made of rows of three.
pub fn block_statistics(readings: &[f64], length: usize) -> Result<Blocks> {
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
    let blocks = readings.len() / 3 / length;
    let mut out = Blocks {
        mean: Vec::with_capacity(blocks),
        variance: Vec::with_capacity(blocks),
        count: Vec::with_capacity(blocks),
    };
    for block in readings.chunks_exact(3 * length) {
        let mut count = 0_u32;
        let mut sum = [0.0; 3];
        for row in finite_rows(block) {
            count += 1;
            for axis in 0..3 {
                sum[axis] += row[axis];
            }
        }
        let mean = sum.map(|s| s / f64::from(count));
        let mut square = [0.0; 3];
        for row in finite_rows(block) {
            for axis in 0..3 {
                square[axis] += (row[axis] - mean[axis]).powi(2);
            }
        }
        let freedom = if count > 1 {
            f64::from(count - 1)
        } else {
            f64::NAN
        };
        out.mean.push(mean);
        out.variance.push(square.map(|s| s / freedom));
        out.count.push(count);
    }
    Ok(out)
}

fn finite_rows(block: &[f64]) -> impl Iterator<Item = &[f64]> {
    block
        .chunks_exact(3)
        .filter(|row| row.iter().all(|x| x.is_finite()))
}
