//! Sums computed without tiles: disjoint clusters, the modified variance, the reflected ends of the total variance.

use rayon::prelude::*;

use super::prefix::compensated_sum;
use crate::interrupt;

/// `Σ D2²` over disjoint clusters of `m`.
#[must_use]
pub fn non_overlapping(p: &[f64], m: usize) -> f64 {
    let pairs = ((p.len() - 1) / m).saturating_sub(1);
    compensated_sum((0..pairs).map(|k| {
        let k = k * m;
        ((p[k + 2 * m] - p[k + m]) - (p[k + m] - p[k])).powi(2)
    }))
}

/// `Σ_k (Σ_{i=k}^{k+m−1} D2[i])²` for each cluster size: the inner sum slides, and starts afresh every `max(m, 65536)`.
#[must_use]
pub fn modified(p: &[f64], clusters: &[usize]) -> Vec<f64> {
    clusters.par_iter().map(|&m| modified_one(p, m)).collect()
}

fn modified_one(p: &[f64], m: usize) -> f64 {
    let terms = (p.len() + 1).saturating_sub(3 * m);
    let stretch = m.max(65536);
    let second = |i: usize| (p[i + 2 * m] - p[i + m]) - (p[i + m] - p[i]);
    compensated_sum((0..terms.div_ceil(stretch)).map(|s| {
        if interrupt::is_requested() {
            return f64::NAN;
        }
        let first = s * stretch;
        let stop = (first + stretch).min(terms);
        let mut inner = compensated_sum((first..first + m).map(second));
        let mut sum = inner * inner;
        for k in first..stop - 1 {
            inner += second(k + m) - second(k);
            sum += inner * inner;
        }
        sum
    }))
}

/// `Σ D2²` over the terms of the total variance with reflected readings: `P[-j] = 2 P[0] − P[j]`, likewise at the end.
#[must_use]
pub fn reflected(p: &[f64], m: usize) -> f64 {
    let last = p.len() - 1;
    let before = (1..m.min(last)).map(|i| {
        let left = 2.0 * p[0] - p[m - i];
        ((p[i + m] - p[i]) - (p[i] - left)).powi(2)
    });
    let behind = (last.saturating_sub(m) + 1..last).map(|i| {
        let right = 2.0 * p[last] - p[2 * last - i - m];
        ((right - p[i]) - (p[i] - p[i - m])).powi(2)
    });
    compensated_sum(before) + compensated_sum(behind)
}
