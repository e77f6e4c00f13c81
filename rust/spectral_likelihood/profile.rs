//! The likelihood inverted: profile likelihood of the amplitude of every term, with all others in the model.
//!
//! For a term `k` of amplitude `a = √p_k` the rise `Δ_k(a)` is the least deviance with `p_k` fixed and the others
//! refitted, less the least of all. `{a : Δ_k(a) ≤ rise}` is the interval; `exp(−½ Δ_k)` weights amplitudes for the
//! median. With absent terms fixed at zero, every interval would be conditional on a choice that the same data made.

use super::Bins;
use super::marginal::{Point, best, fit_from, sigma};
use crate::chi_square::normal_above;
use crate::error::Result;

/// Rise at which a profile ends: the weight beyond is a thousandth.
const REACH: f64 = 14.0;
/// Target growth of the square root of the rise from point to point.
const PACE: f64 = 0.35;
/// Most points on one side of the most likely amplitude.
const MOST_POINTS: usize = 200;
/// Parts of the integral between two points of a profile, where the square root of the rise is linear.
const PARTS: usize = 8;

/// Estimate and interval of one term; amplitudes are square roots of strengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// Most likely amplitude, all terms free.
    pub most_likely: f64,
    /// Amplitude with equal weight above and below.
    pub median: f64,
    /// Root mean square distance of the weight from the median.
    pub spread: f64,
    /// Least amplitude within the rise, zero where zero is within it.
    pub lower: f64,
    /// Largest amplitude within the rise.
    pub upper: f64,
    /// Rise of the deviance without the term.
    pub rise_without: f64,
    /// Strengths of all terms at the points of the profile next beyond the ends of the interval, the others refitted.
    pub strength_at_ends: [Vec<f64>; 2],
}

/// The slope of the line: a mixture of normals over the amplitudes of one term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineMixture {
    /// Middle of the mixture.
    pub median: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Lower end of the requested interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// Twice the weight of the other sign.
    pub tail: f64,
}

/// Estimates and intervals of all terms of a spectrum.
#[derive(Debug, Clone)]
pub struct Inversion {
    /// Most likely strengths, all terms free.
    pub strength: Vec<f64>,
    /// Most likely strengths without the pair.
    pub strength_without_pair: Vec<f64>,
    /// Rise of the deviance without the pair.
    pub rise_without_pair: f64,
    /// Estimate and interval of each term.
    pub terms: Vec<Statement>,
    /// The line.
    pub line: LineMixture,
}

/// Amplitudes in order with the point of the likelihood at each.
type Profile = Vec<(f64, Point)>;

/// Inverts the likelihood: intervals at `rise`; `pair` names two terms that may be detectable only together; the line's
/// mixture over the amplitudes of `walk` has an interval with `line_outside` of its weight outside.
///
/// # Errors
/// `BadInput` when the bins disagree.
///
/// # Panics
/// When `pair` or `walk` is no term of the bins.
pub fn invert(
    bins: &Bins,
    rise: f64,
    pair: (usize, usize),
    walk: usize,
    line_outside: f64,
) -> Result<Inversion> {
    bins.check()?;
    let free: Vec<usize> = (0..bins.basis.len()).collect();
    let mut top = best(bins, &free);
    let mut profiles: Vec<Profile> = free.iter().map(|&k| profile(bins, k, &top)).collect();
    // A profile may find a lower deviance than the search from guesses.
    for point in profiles.iter().flatten().map(|(_, point)| point) {
        if point.deviance < top.deviance - 1e-6 {
            top = fit_from(bins, &free, &point.strength);
        }
    }
    for (k, profile) in profiles.iter_mut().enumerate() {
        let at = top.strength[k].sqrt();
        let place = profile.partition_point(|(a, _)| *a < at);
        if profile.get(place).is_none_or(|(a, _)| *a > at) {
            profile.insert(place, (at, top.clone()));
        }
    }
    let terms = profiles
        .iter()
        .enumerate()
        .map(|(k, profile)| state(bins, k, profile, &top, rise))
        .collect();
    let rest: Vec<usize> = free
        .iter()
        .copied()
        .filter(|&k| k != pair.0 && k != pair.1)
        .collect();
    let without = best(bins, &rest);
    Ok(Inversion {
        strength: top.strength.clone(),
        rise_without_pair: (without.deviance - top.deviance).max(0.0),
        strength_without_pair: without.strength,
        terms,
        line: line(&profiles[walk], top.deviance, line_outside),
    })
}

fn held(bins: &Bins, k: usize, amplitude: f64, near: &Point) -> Point {
    let rest: Vec<usize> = (0..bins.basis.len()).filter(|&i| i != k).collect();
    let mut start = near.strength.clone();
    start[k] = amplitude * amplitude;
    if start.iter().all(|&p| p <= 0.0) {
        return without(bins, k);
    }
    fit_from(bins, &rest, &start)
}

fn without(bins: &Bins, k: usize) -> Point {
    let rest: Vec<usize> = (0..bins.basis.len()).filter(|&i| i != k).collect();
    best(bins, &rest)
}

/// Points along the amplitude of `k`, out to a rise of [`REACH`] on either side, or to zero.
fn profile(bins: &Bins, k: usize, top: &Point) -> Profile {
    let free: Vec<usize> = (0..bins.basis.len()).collect();
    let at = top.strength[k].sqrt();
    let error = sigma(bins, &free, k, top);
    let first = PACE * ((at * at + error).sqrt() - at).max(1e-9 * at);
    let mut out = side(bins, k, top, at, -first);
    out.reverse();
    out.push((at, top.clone()));
    out.extend(side(bins, k, top, at, first));
    out
}

fn side(bins: &Bins, k: usize, top: &Point, from: f64, first: f64) -> Profile {
    let mut out: Profile = Vec::new();
    let (mut here, mut near, mut root, mut step) = (from, top.clone(), 0.0, first);
    while out.len() < MOST_POINTS && root * root < REACH && (first > 0.0 || here > 0.0) {
        let next = (here + step).max(0.0);
        let mut point = held(bins, k, next, &near);
        if next == 0.0 {
            let other = without(bins, k);
            if other.deviance < point.deviance {
                point = other;
            }
        }
        let reached = (point.deviance - top.deviance).max(0.0).sqrt();
        let grown = (reached - root).abs();
        if grown > 3.0 * PACE && step.abs() > 1e-6 * first.abs() {
            step *= (PACE / grown).clamp(0.05, 0.5);
            continue;
        }
        step *= (PACE / grown.max(1e-3)).clamp(0.5, 2.0);
        (here, near, root) = (next, point.clone(), reached);
        out.push((next, point));
    }
    out
}

fn state(bins: &Bins, k: usize, profile: &Profile, top: &Point, rise: f64) -> Statement {
    let at = top.strength[k].sqrt();
    // The square root of the rise, with a sign, is nearly linear in the amplitude.
    let roots: Vec<(f64, f64)> = profile
        .iter()
        .map(|(a, point)| {
            let root = (point.deviance - top.deviance).max(0.0).sqrt();
            (*a, if *a < at { -root } else { root })
        })
        .collect();
    let wanted = rise.sqrt();
    let crossing = |level: f64| {
        let place = roots.partition_point(|&(_, root)| root < level);
        let (before, after) = (roots.get(place.wrapping_sub(1)), roots.get(place));
        match (before, after) {
            (Some(&(a, r)), Some(&(b, s))) if s > r => a + (b - a) * (level - r) / (s - r),
            (_, Some(&(a, _))) | (Some(&(a, _)), None) => a,
            (None, None) => at,
        }
    };
    let strength_of = |place: usize| profile[place.min(profile.len() - 1)].1.strength.clone();
    let below = roots.partition_point(|&(_, root)| root < -wanted);
    let above = roots.partition_point(|&(_, root)| root < wanted);
    let (median, spread) = middle(&roots);
    let rise_without = match profile.first() {
        Some((a, point)) if *a == 0.0 => (point.deviance - top.deviance).max(0.0),
        _ => (without(bins, k).deviance - top.deviance).max(0.0),
    };
    Statement {
        most_likely: at,
        median,
        spread,
        lower: if rise_without <= rise {
            0.0
        } else {
            crossing(-wanted)
        },
        upper: crossing(wanted),
        rise_without,
        strength_at_ends: [strength_of(below.saturating_sub(1)), strength_of(above)],
    }
}

/// Median and spread of `exp(−½ root²)` over the amplitude.
fn middle(roots: &[(f64, f64)]) -> (f64, f64) {
    let mut cells: Vec<(f64, f64)> = Vec::new();
    for pair in roots.windows(2) {
        let ((a, r), (b, s)) = (pair[0], pair[1]);
        for part in 0..PARTS {
            let share = (part as f64 + 0.5) / PARTS as f64;
            let root = r + share * (s - r);
            cells.push((
                a + share * (b - a),
                (b - a) / PARTS as f64 * (-0.5 * root * root).exp(),
            ));
        }
    }
    let total: f64 = cells.iter().map(|c| c.1).sum();
    if total.is_nan() || total <= 0.0 {
        return (roots.first().map_or(0.0, |r| r.0), 0.0);
    }
    let mut below = 0.0;
    let mut median = cells[0].0;
    for pair in cells.windows(2) {
        below += 0.5 * (pair[0].1 + pair[1].1);
        median = pair[1].0;
        if below >= 0.5 * total {
            break;
        }
    }
    let square: f64 = cells.iter().map(|c| c.1 * (c.0 - median).powi(2)).sum();
    (median, (square / total).sqrt())
}

fn line(profile: &Profile, least: f64, outside: f64) -> LineMixture {
    let n = profile.len();
    let weighed: Vec<(f64, f64, f64)> = (0..n)
        .map(|i| {
            let width = 0.5 * (profile[(i + 1).min(n - 1)].0 - profile[i.saturating_sub(1)].0);
            let point = &profile[i].1;
            let weight = width * (-0.5 * (point.deviance - least)).exp();
            (weight, point.slope(), point.sigma_slope)
        })
        .filter(|w| w.0 > 0.0 && w.2.is_finite())
        .collect();
    let total: f64 = weighed.iter().map(|w| w.0).sum();
    if total.is_nan() || total <= 0.0 {
        return LineMixture {
            median: 0.0,
            sigma: f64::INFINITY,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            tail: 1.0,
        };
    }
    let above = |x: f64| {
        let sum: f64 = weighed
            .iter()
            .map(|&(w, slope, error)| w * normal_above((x - slope) / error))
            .sum();
        sum / total
    };
    let mean = weighed.iter().map(|w| w.0 * w.1).sum::<f64>() / total;
    let square: f64 = weighed
        .iter()
        .map(|w| w.0 * (w.2 * w.2 + (w.1 - mean).powi(2)))
        .sum();
    let sigma = (square / total).sqrt();
    let widest = weighed.iter().map(|w| w.2).fold(sigma, f64::max);
    let quantile = |upper_weight: f64| {
        let (mut low, mut high) = (mean - 40.0 * widest, mean + 40.0 * widest);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if above(middle) > upper_weight {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    };
    let positive = above(0.0);
    LineMixture {
        median: quantile(0.5),
        sigma,
        lower: quantile(1.0 - 0.5 * outside),
        upper: quantile(0.5 * outside),
        tail: (2.0 * positive.min(1.0 - positive)).min(1.0),
    }
}
