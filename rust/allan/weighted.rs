//! Allan variance of logs with gaps: a cluster is the mean of the readings present, weighted by their number.
//!
//! With `c1`, `c2` readings present in two neighbouring clusters of `m`, the squared difference of their means has the
//! weight `w = 2 c1 c2 / (m (c1 + c2))`: 1 when both are complete, 0 when either is empty, and in between the inverse
//! of the variance that white noise gives it. `variance = Σ w (mean2 − mean1)² / (2 Σ w)`. Nothing is interpolated. For
//! a random walk this is unbiased up to the position of the gap in its cluster; for white noise it is the variance of
//! means of the readings present, less what the missing ones add to it ([`super::losses`]).

use rayon::prelude::*;

use super::losses::{self, Sums};
use super::prefix::compensated_sum;
use super::readings::Readings;
use super::{Curve, Kind};
use crate::error::{Error, Result};
use crate::interrupt;

/// Variances of a channel with missing readings (not finite), centred on `centre`.
///
/// # Errors
/// `BadInput` for a kind that has no weighted form, or when no pair of clusters has a reading on both sides.
pub fn variances(
    readings: &impl Readings,
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
    let of = running(readings, centre);
    let (sums, counts) = (&of.values, &of.counts);
    let results: Vec<(f64, usize, f64)> = clusters
        .par_iter()
        .with_max_len(1)
        .map(|&m| match kind {
            _ if interrupt::is_requested() => (f64::NAN, 0, 0.0),
            Kind::Overlapping => every_start(sums, counts, m),
            _ => one(sums, counts, m, kind),
        })
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
    losses::subtract(&mut curve, &of, clusters, kind);
    Ok(curve)
}

fn running(readings: &impl Readings, centre: f64) -> Sums {
    let n = readings.len();
    let [mut counts, mut values, mut squares] = [(); 3].map(|()| Vec::with_capacity(n + 1));
    let (mut high, mut low, mut square, mut count) = (0.0, 0.0, 0.0, 0.0);
    counts.push(0.0);
    values.push(0.0);
    squares.push(0.0);
    for i in 0..n {
        let v = readings.get(i) - centre;
        if v.is_finite() {
            let (s, e) = super::prefix::two_sum(high, v);
            high = s;
            low += e;
            square += v * v;
            count += 1.0;
        }
        counts.push(count);
        values.push(high + low);
        squares.push(square);
    }
    Sums {
        counts,
        values,
        squares,
    }
}

/// Variance, terms and weight for one cluster size; NaN where no term has a weight.
fn one(p: &[f64], c: &[f64], m: usize, kind: Kind) -> (f64, usize, f64) {
    let n = p.len() - 1;
    let count = |k: usize| c[k + m] - c[k];
    let mean = |k: usize, readings: f64| {
        if readings > 0.0 {
            (p[k + m] - p[k]) / readings
        } else {
            0.0
        }
    };
    let step = if kind == Kind::NonOverlapping { m } else { 1 };
    let (order, full) = if kind == Kind::Hadamard {
        (3, 6.0)
    } else {
        (2, 2.0)
    };
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
        let w = full / (m as f64 * inverse);
        sum += w * difference * difference;
        weight += w;
        terms += usize::from(w > 0.0);
    }
    (sum / (full * weight), terms, weight)
}

/// The overlapping variance by these weights: `w d² = 2 (S2 c1 − S1 c2)² / (m c1 c2 (c1 + c2))`, one division per term.
fn every_start(p: &[f64], c: &[f64], m: usize) -> (f64, usize, f64) {
    const STRETCH: usize = 4096;
    let terms = p.len() - 2 * m;
    let (mut sums, mut weights, mut used) = (Vec::new(), Vec::new(), 0);
    for first in (0..terms).step_by(STRETCH) {
        let n = STRETCH.min(terms - first);
        let (sum, weight, count) = stretch(
            [
                &p[first..][..n],
                &p[first + m..][..n],
                &p[first + 2 * m..][..n],
            ],
            [
                &c[first..][..n],
                &c[first + m..][..n],
                &c[first + 2 * m..][..n],
            ],
        );
        sums.push(sum);
        weights.push(weight);
        used += count;
    }
    let m = m as f64;
    let weight = 2.0 * compensated_sum(weights) / m;
    (
        2.0 * compensated_sum(sums) / m / (2.0 * weight),
        used,
        weight,
    )
}

fn stretch(p: [&[f64]; 3], c: [&[f64]; 3]) -> (f64, f64, usize) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: the instructions were just seen on this processor.
        return unsafe { stretch_avx2(p, c) };
    }
    stretch_portable(p, c)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn stretch_avx2(p: [&[f64]; 3], c: [&[f64]; 3]) -> (f64, f64, usize) {
    stretch_portable(p, c)
}

#[inline(always)]
fn stretch_portable(p: [&[f64]; 3], c: [&[f64]; 3]) -> (f64, f64, usize) {
    const LANES: usize = 8;
    let n = p[0].len();
    let (mut sum, mut weight, mut used) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let mut term = |lane: usize, i: usize| {
        let (c1, c2) = (c[1][i] - c[0][i], c[2][i] - c[1][i]);
        let (s1, s2) = (p[1][i] - p[0][i], p[2][i] - p[1][i]);
        let product = c1 * c2;
        // Where either cluster is empty the product is zero, and so is everything multiplied by the inverse.
        let inverse = 1.0 / (product * (c1 + c2)).max(0.5);
        let cross = s2 * c1 - s1 * c2;
        let present = if product > 0.0 { 1.0 } else { 0.0 };
        sum[lane] += present * cross * cross * inverse;
        weight[lane] += product * product * inverse;
        used[lane] += present;
    };
    for first in (0..n - n % LANES).step_by(LANES) {
        for lane in 0..LANES {
            term(lane, first + lane);
        }
    }
    for i in n - n % LANES..n {
        term(0, i);
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count of at most 4096"
    )]
    (
        sum.iter().sum(),
        weight.iter().sum(),
        used.iter().sum::<f64>() as usize,
    )
}
