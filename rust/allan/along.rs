//! Degrees of freedom along a curve: the slopes of the curve give the type of noise.

use super::Kind;
use super::degrees::{NoiseType, degrees_of_freedom};
use crate::error::Result;

/// Fewest clusters in a log for a slope of its curve: with fewer it bends by chance.
const FEWEST_CLUSTERS: f64 = 32.0;
/// Types by the slope of the variance, −2, −1, 0 and 1.
const TYPES: [NoiseType; 4] = [
    NoiseType::Quantisation,
    NoiseType::White,
    NoiseType::Flicker,
    NoiseType::Walk,
];

/// Degrees of freedom (docs/noise.md, eq. 6) of each variance of `n` readings, and its expectation over the Allan
/// variance, which is 1 except for the total variance. Between types of noise both are interpolated.
///
/// Of the total variance flicker and walk are those of Greenhall, Howe and Percival (1999); in quantisation every
/// reflected term contains both ends of the phase.
///
/// # Errors
/// `BadInput` when a cluster gives no term.
pub fn along(
    n: usize,
    clusters: &[usize],
    variance: &[f64],
    weight: &[f64],
    kind: Kind,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let slopes = slopes(n as f64, clusters, variance);
    let mut out = (Vec::new(), Vec::new());
    for ((&m, slope), weight) in clusters.iter().zip(slopes).zip(weight) {
        let place = (slope + 2.0).clamp(0.0, 3.0);
        let below = usize::from(place >= 1.0) + usize::from(place >= 2.0);
        let share = place - below as f64;
        let between = |first: f64, second: f64| first.powf(1.0 - share) * second.powf(share);
        let edf = between(
            degrees_of_freedom(n, m, TYPES[below], kind)?,
            degrees_of_freedom(n, m, TYPES[below + 1], kind)?,
        );
        let full = match kind {
            Kind::NonOverlapping => (n / m).saturating_sub(1),
            Kind::Hadamard => (n + 1).saturating_sub(3 * m),
            _ => (n + 1).saturating_sub(2 * m),
        };
        // Missing readings reduce the degrees of freedom in proportion.
        let lost = match kind {
            Kind::Modified | Kind::Total => 1.0,
            _ => (weight / full.max(1) as f64).min(1.0),
        };
        out.0.push((edf * lost).max(1.0));
        let (m, n) = (m as f64, n as f64);
        let bias = [
            1.0 + 4.0 / 3.0 * (m - 1.0) / (n - 1.0),
            1.0,
            1.0 - 0.481 * m / n,
            1.0 - 0.750 * m / n,
        ];
        out.1.push(if kind == Kind::Total {
            between(bias[below], bias[below + 1])
        } else {
            1.0
        });
    }
    Ok(out)
}

/// Slopes of log variance against log cluster size, non-decreasing, constant beyond `n / FEWEST_CLUSTERS` readings.
///
/// A sum of noise terms is convex in these scales; a curve that bends down at its end does so by chance. Without this
/// a low value would be taken for quantisation noise, whose values have many degrees of freedom.
fn slopes(n: f64, clusters: &[usize], variance: &[f64]) -> Vec<f64> {
    let mut points: Vec<(f64, f64)> = (clusters.iter().zip(variance))
        .filter(|(_, v)| v.is_finite() && **v > 0.0)
        .map(|(&m, v)| ((m as f64).log2(), v.log2()))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Middle, slope and weight of each step: the inverse of a slope's variance is n/m degrees of freedom times step².
    let steps: Vec<(f64, f64, f64)> = points
        .windows(2)
        .filter(|pair| pair[1].0 > pair[0].0)
        .map(|pair| {
            let (step, middle) = (pair[1].0 - pair[0].0, 0.5 * (pair[1].0 + pair[0].0));
            let slope = (pair[1].1 - pair[0].1) / step;
            (middle, slope, step * step * n / middle.exp2())
        })
        .collect();
    let Some(rising) = rising(&steps) else {
        return vec![-1.0; clusters.len()];
    };
    let reliable = (steps.iter().zip(&rising))
        .filter(|(step, _)| step.0.exp2() <= n / FEWEST_CLUSTERS)
        .map(|(_, &slope)| slope)
        .next_back()
        .unwrap_or(f64::INFINITY);
    let at = |x: f64| {
        let place = steps.partition_point(|step| step.0 <= x);
        if place == 0 || place == steps.len() {
            return rising[place.saturating_sub(1)].min(reliable);
        }
        let (left, right) = (steps[place - 1].0, steps[place].0);
        let (low, high) = (rising[place - 1].min(reliable), rising[place].min(reliable));
        low + (high - low) * (x - left) / (right - left)
    };
    clusters.iter().map(|&m| at((m as f64).log2())).collect()
}

/// Weighted isotonic regression of `(_, value, weight)` by pooling of neighbours that fall; `None` without any.
pub(super) fn rising(steps: &[(f64, f64, f64)]) -> Option<Vec<f64>> {
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    for &(_, slope, weight) in steps {
        pools.push((slope, weight, 1));
        while let [.., one, other] = pools[..] {
            if one.0 < other.0 {
                break;
            }
            let weight = one.1 + other.1;
            let mean = (one.0 * one.1 + other.0 * other.1) / weight;
            pools.truncate(pools.len() - 2);
            pools.push((mean, weight, one.2 + other.2));
        }
    }
    let each = pools.iter().flat_map(|pool| vec![pool.0; pool.2]);
    (!pools.is_empty()).then(|| each.collect())
}
