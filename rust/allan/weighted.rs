//! Logs with gaps: clusters are means of the readings they do have, and weigh accordingly.
//!
//! With `c1`, `c2` readings present in two neighbouring clusters of `m`, the squared difference of their means has the
//! weight `w = 2 c1 c2 / (m (c1 + c2))`: 1 when both are complete, 0 when either is empty, and in between the inverse of
//! the variance that white noise gives it. `variance = Σ w (mean2 − mean1)² / (2 Σ w)`. Nothing is interpolated. For a
//! random walk this is unbiased up to the position of the gap in its cluster; for white noise it is the variance of
//! means of the readings that are there.

use rayon::prelude::*;

use super::{Curve, Kind};
use crate::error::{Error, Result};

/// Variances of a channel with missing readings (`get(i)` not finite), centred on `centre`.
///
/// # Errors
/// `BadInput` for a kind that has no weighted form, or when no pair of clusters has a reading on both sides.
pub fn variances<F: Fn(usize) -> f64 + Sync>(
    n: usize,
    get: &F,
    centre: f64,
    clusters: &[usize],
    kind: Kind,
) -> Result<Curve> {
    if matches!(kind, Kind::Modified | Kind::Total) {
        return Err(Error::bad_input(format!(
            "the {} variance is not defined where readings are missing: use the overlapping, non-overlapping or \
             Hadamard variance",
            kind.name()
        )));
    }
    let (sums, counts) = running(n, get, centre);
    let results: Vec<(f64, usize, f64)> = clusters
        .par_iter()
        .with_max_len(1)
        .map(|&m| one(&sums, &counts, m, kind))
        .collect();
    let mut curve = Curve {
        variance: Vec::new(),
        terms: Vec::new(),
        weight: Vec::new(),
    };
    for (variance, terms, weight) in results {
        curve.variance.push(variance);
        curve.terms.push(terms);
        curve.weight.push(weight);
    }
    Ok(curve)
}

fn running<F: Fn(usize) -> f64>(n: usize, get: &F, centre: f64) -> (Vec<f64>, Vec<u32>) {
    let mut sums = Vec::with_capacity(n + 1);
    let mut counts = Vec::with_capacity(n + 1);
    // Counts are differences over at most n readings: they may wrap, their differences do not.
    let (mut high, mut low, mut count) = (0.0, 0.0, 0_u32);
    sums.push(0.0);
    counts.push(0);
    for i in 0..n {
        let v = get(i) - centre;
        if v.is_finite() {
            let (s, e) = super::prefix::two_sum(high, v);
            high = s;
            low += e;
            count = count.wrapping_add(1);
        }
        sums.push(high + low);
        counts.push(count);
    }
    (sums, counts)
}

/// Variance, terms and weight for one cluster size; NaN where no term has a weight.
fn one(p: &[f64], c: &[u32], m: usize, kind: Kind) -> (f64, usize, f64) {
    let n = p.len() - 1;
    let count = |k: usize| f64::from(c[k + m].wrapping_sub(c[k]));
    let mean = |k: usize, readings: f64| {
        if readings > 0.0 {
            (p[k + m] - p[k]) / readings
        } else {
            0.0
        }
    };
    let step = if kind == Kind::NonOverlapping { m } else { 1 };
    let order = if kind == Kind::Hadamard { 3 } else { 2 };
    let (mut sum, mut weight, mut terms) = (0.0, 0.0, 0);
    for k in (0..(n + 1).saturating_sub(order * m)).step_by(step) {
        let (c1, c2) = (count(k), count(k + m));
        let (mut inverse, mut difference) = (1.0 / c1 + 1.0 / c2, mean(k + m, c2) - mean(k, c1));
        if order == 3 {
            let c3 = count(k + 2 * m);
            inverse = 1.0 / c1 + 4.0 / c2 + 1.0 / c3;
            difference = (mean(k + 2 * m, c3) - mean(k + m, c2)) - difference;
        }
        // An empty cluster makes the inverse infinite and the weight zero.
        let full = if order == 3 { 6.0 } else { 2.0 };
        let w = full / (m as f64 * inverse);
        sum += w * difference * difference;
        weight += w;
        terms += usize::from(w > 0.0);
    }
    let per_term = if order == 3 { 6.0 } else { 2.0 };
    (sum / (per_term * weight), terms, weight)
}
