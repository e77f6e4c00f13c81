//! What missing readings add to an Allan variance, subtracted.
//!
//! The mean of `c` of `m` readings scatters about that of all `m` by `(1/c − 1/m) s²`, `s²` the variance of readings inside
//! clusters (sampling from a finite population). The share of slow noise, which missing readings do not change, never
//! falls along the clusters.

use super::along::rising;
use super::{Curve, Kind};

/// Most clusters from which the correction is estimated: it is then accurate to 1 %.
const MOST_LOOKS: usize = 8192;

/// Running sums of a channel, one longer than the readings: numbers of readings present, their values, their squares.
pub(super) struct Sums {
    pub(super) counts: Vec<f64>,
    pub(super) values: Vec<f64>,
    pub(super) squares: Vec<f64>,
}

/// The variances of `curve` become those without missing readings.
pub(super) fn subtract(curve: &mut Curve, sums: &Sums, clusters: &[usize], kind: Kind) {
    let n = (sums.counts.len() - 1) as f64;
    let mut shares = Vec::new();
    for (i, &m) in clusters.iter().enumerate() {
        let found = white_share(sums, m, kind).filter(|_| curve.variance[i].is_finite());
        if let Some((least, excess)) = found {
            let slow = (1.0 - excess / curve.variance[i] - least) / (1.0 - least);
            shares.push((i, least, slow.clamp(0.0, 1.0), n / m as f64));
        }
    }
    let steps: Vec<(f64, f64, f64)> = shares.iter().map(|s| (0.0, s.2, s.3)).collect();
    for (&(i, least, ..), slow) in shares.iter().zip(rising(&steps).unwrap_or_default()) {
        curve.variance[i] *= least + (1.0 - least) * slow;
    }
}

/// Share of the variance of white noise that clusters of `m` complete readings have, and what missing ones add to the
/// variance by the scatter inside clusters; `None` where none are missing.
fn white_share(sums: &Sums, m: usize, kind: Kind) -> Option<(f64, f64)> {
    let factors: &[f64] = if kind == Kind::Hadamard {
        &[1.0, 4.0, 1.0]
    } else {
        &[1.0, 1.0]
    };
    let last = (sums.counts.len() - 1).checked_sub(factors.len() * m)?;
    let looks = (last + 1).min(MOST_LOOKS);
    let (mut squares, mut degrees, mut weight, mut used) = (0.0, 0.0, 0.0, 0.0);
    for look in 0..looks {
        let start = look * last / (looks - 1).max(1);
        let inside = |of: &[f64], k: usize| of[start + (k + 1) * m] - of[start + k * m];
        let counts: Vec<f64> = (0..factors.len())
            .map(|k| inside(&sums.counts, k))
            .collect();
        if counts.contains(&0.0) {
            continue;
        }
        for (k, count) in counts.iter().enumerate() {
            squares += inside(&sums.squares, k) - inside(&sums.values, k).powi(2) / count;
            degrees += count - 1.0;
        }
        // Weights as in the variance: the inverse of each term's variance by white noise.
        weight += (factors.iter().zip(&counts).map(|(f, c)| f / c))
            .sum::<f64>()
            .recip();
        used += 1.0;
    }
    let all: f64 = factors.iter().sum();
    let (inverse, full) = (used / weight, all / m as f64);
    let least = full / inverse;
    (degrees > 0.0 && least < 1.0 - 1e-9)
        .then(|| (least, squares / degrees * (inverse - full) / all))
}
