//! First statistics of a log: noise of short windows, and the fewest rows in which gravity turns.

use rayon::prelude::*;

use crate::order_statistics::median;

/// Mean, noise and spread of every window of a triad.
#[derive(Debug, Clone, Default)]
pub struct Windows {
    /// Mean reading.
    pub mean: Vec<[f64; 3]>,
    /// Standard deviation of the first difference over √2.
    pub noise: Vec<[f64; 3]>,
    /// Root of the sum of the three variances.
    pub spread: Vec<f64>,
}

/// Statistics of windows `[start, start + length)`; `None` where a reading in one of them is not finite, a window is
/// not inside the readings, or it is shorter than two rows.
#[must_use]
pub fn windows(rows: &[[f64; 3]], starts: &[usize], length: usize) -> Option<Windows> {
    if length < 2 {
        return None;
    }
    let of_one = |&start: &usize| {
        let block = rows.get(start..start.checked_add(length)?)?;
        let steps: Vec<[f64; 3]> = block
            .windows(2)
            .map(|pair| std::array::from_fn(|k| pair[1][k] - pair[0][k]))
            .collect();
        let (mean, variance) = moments(block);
        let (_, of_steps) = moments(&steps);
        let is_number = mean.iter().chain(&variance).all(|v| v.is_finite());
        is_number.then(|| {
            let noise = of_steps.map(|v| v.sqrt() / 2.0_f64.sqrt());
            (mean, noise, variance.iter().sum::<f64>().sqrt())
        })
    };
    let found: Option<Vec<_>> = starts.par_iter().map(of_one).collect();
    let mut out = Windows::default();
    for (mean, noise, spread) in found? {
        out.mean.push(mean);
        out.noise.push(noise);
        out.spread.push(spread);
    }
    Some(out)
}

/// Median length of the readings (vectors) in windows `[start, start + length)`, NaN excluded; NaN where there are
/// none. `None` where a window is not inside the readings.
#[must_use]
pub fn median_length(rows: &[[f64; 3]], starts: &[usize], length: usize) -> Option<f64> {
    let of_one = |&start: &usize| Some(rows.get(start..start.checked_add(length)?)?.iter());
    let blocks: Option<Vec<_>> = starts.iter().map(of_one).collect();
    let mut lengths: Vec<f64> = blocks?.into_iter().flatten().map(|r| norm(*r)).collect();
    lengths.retain(|length| !length.is_nan());
    Some(median(&mut lengths))
}

/// Means of the first `count` blocks of `length` rows; `None` where there are fewer rows, or `length` is zero.
#[must_use]
pub fn block_means(rows: &[[f64; 3]], length: usize, count: usize) -> Option<Vec<[f64; 3]>> {
    let rows = rows.get(..length.checked_mul(count)?)?;
    let of_one = |block: &[[f64; 3]]| {
        let mut sum = [0.0; 3];
        for row in block {
            for k in 0..3 {
                sum[k] += row[k];
            }
        }
        sum.map(|s| s / length as f64)
    };
    (length > 0).then(|| rows.par_chunks_exact(length).map(of_one).collect())
}

fn norm(row: [f64; 3]) -> f64 {
    (row[0] * row[0] + row[1] * row[1] + row[2] * row[2]).sqrt()
}

fn moments(rows: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    let n = rows.len() as f64;
    let mut sum = [0.0; 3];
    for row in rows {
        for k in 0..3 {
            sum[k] += row[k];
        }
    }
    let mean = sum.map(|s| s / n);
    let mut squares = [0.0; 3];
    for row in rows {
        for k in 0..3 {
            squares[k] += (row[k] - mean[k]).powi(2);
        }
    }
    (mean, squares.map(|s| s / n))
}

/// Fewest rows in which a direction turns by `turn` [rad]: between two static stretches, and between any two.
///
/// A stretch is `side` rows; a static one turns ten times slower than the direction between the two. Readings that are
/// not finite are excluded; `None` where a reading is zero or there are fewer than four stretches.
#[must_use]
pub fn quickest_turns(rows: &[[f64; 3]], side: usize, turn: f64) -> (Option<usize>, Option<usize>) {
    let mut total = vec![[0.0; 3]];
    for row in rows.iter().filter(|r| r.iter().all(|v| v.is_finite())) {
        let norm = (row[0] * row[0] + row[1] * row[1] + row[2] * row[2]).sqrt();
        if norm <= 0.0 {
            return (None, None);
        }
        let last = total[total.len() - 1];
        total.push(std::array::from_fn(|k| last[k] + row[k] / norm));
    }
    if total.len() < 4 * side + 1 || side == 0 {
        return (None, None);
    }
    let mut spread = Vec::with_capacity(total.len());
    let mut mean = Vec::with_capacity(total.len());
    for pair in total.windows(side + 1) {
        let sum: [f64; 3] = std::array::from_fn(|k| (pair[side][k] - pair[0][k]) / side as f64);
        let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
        // Unit vectors spread evenly over an angle a have a mean of length 1 − a²/24.
        spread.push((24.0 * (1.0 - length).max(0.0)).sqrt());
        mean.push(sum.map(|v| v / length.max(1e-12)));
    }
    let (mut rows, mut any_turn) = (1, None);
    while rows + side < mean.len() {
        let lag = rows + side - 1;
        let (quiet, least) = (0.1 * turn * side as f64 / (rows + 1) as f64, turn.cos());
        let turned = |i: usize| {
            let (a, b) = (&mean[i], &mean[i + lag]);
            a[0] * b[0] + a[1] * b[1] + a[2] * b[2] < least
        };
        let mut pairs = (0..mean.len() - lag).filter(|&i| turned(i));
        if let Some(first) = pairs.next() {
            any_turn = any_turn.or(Some(rows + 1));
            let at_rest = |i: usize| spread[i] <= quiet && spread[i + lag] <= quiet;
            if at_rest(first) || pairs.any(at_rest) {
                return (Some(rows + 1), any_turn);
            }
        }
        rows = (rows + 1).max(rows + rows / 2);
    }
    (None, any_turn)
}
