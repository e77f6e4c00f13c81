//! Order statistics of a running window.

use rayon::prelude::*;

/// Length of a thread's share, in windows: sorting its first window then costs little.
const WINDOWS_OF_A_SHARE: usize = 16;

/// Median of the `size` (odd) numbers about each; beyond the ends the last number is repeated.
#[must_use]
pub fn running_median(values: &[f64], size: usize) -> Vec<f64> {
    let half = size / 2;
    let share = (WINDOWS_OF_A_SHARE * size).max(4096);
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(share)
        .enumerate()
        .for_each(|(k, out)| medians_from(values, half, k * share, out));
    out
}

/// Running mean square, over `width` (odd) rows, of what their least-squares parabola leaves of the row in the middle;
/// beyond the ends the last row is repeated. Zero of fewer rows.
#[must_use]
pub fn roughness(rows: &[[f64; 3]], width: usize) -> Vec<[f64; 3]> {
    let (n, half) = (rows.len(), width / 2);
    if n < width {
        return vec![[0.0; 3]; n];
    }
    let m = half as f64;
    let size = (2.0 * m - 1.0) * (2.0 * m + 1.0) * (2.0 * m + 3.0) / 3.0;
    let weight = |j: usize| (3.0 * m * (m + 1.0) - 1.0 - 5.0 * (j as f64 - m).powi(2)) / size;
    let weights: Vec<f64> = (0..width).map(weight).collect();
    let beside = |k: usize, j: usize| (k + j).saturating_sub(half).min(n - 1);
    let left = |k: usize, c: usize| {
        let smooth: f64 = (0..width).map(|j| weights[j] * rows[beside(k, j)][c]).sum();
        (rows[k][c] - smooth).powi(2)
    };
    let squares: Vec<[f64; 3]> = (0..n).map(|k| [0, 1, 2].map(|c| left(k, c))).collect();
    let mean = |k: usize, c: usize| {
        let sum: f64 = (0..width).map(|j| squares[beside(k, j)][c]).sum();
        sum / width as f64
    };
    (0..n).map(|k| [0, 1, 2].map(|c| mean(k, c))).collect()
}

/// Medians of the windows from the one about number `first` on.
fn medians_from(values: &[f64], half: usize, first: usize, out: &mut [f64]) {
    let n = values.len();
    let at = |i: usize| values[i.saturating_sub(half).min(n - 1)];
    // `i` counts from half a window before the first number.
    let mut window: Vec<f64> = (first..=first + 2 * half).map(at).collect();
    window.sort_unstable_by(f64::total_cmp);
    for (k, median) in out.iter_mut().enumerate() {
        if k > 0 {
            let i = first + k;
            let (old, new) = (at(i - 1), at(i + 2 * half));
            let from = window.partition_point(|v| v.total_cmp(&old).is_lt());
            let to = window.partition_point(|v| v.total_cmp(&new).is_lt());
            if from < to {
                window.copy_within(from + 1..to, from);
                window[to - 1] = new;
            } else {
                window.copy_within(to..from, to + 1);
                window[to] = new;
            }
        }
        *median = window[half];
    }
}

/// Mean over `width` rows of `channels` numbers centred on each; at the ends the nearest whole window. By running sums.
#[must_use]
pub fn rolling_mean(rows: &[f64], channels: usize, width: usize) -> Vec<f64> {
    let n = rows.len() / channels.max(1);
    if n == 0 {
        return Vec::new();
    }
    let width = width.clamp(1, n);
    let mut total = Vec::with_capacity(rows.len() + channels);
    total.resize(channels, 0.0);
    for (at, value) in rows.iter().enumerate() {
        total.push(total[at] + value);
    }
    let whole: Vec<f64> = total[width * channels..]
        .iter()
        .zip(&total)
        .map(|(high, low)| (high - low) / width as f64)
        .collect();
    let first = whole[..channels].repeat(width / 2);
    let last = whole[whole.len() - channels..].repeat(width - 1 - width / 2);
    [first, whole, last].concat()
}
