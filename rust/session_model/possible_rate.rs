//! Ways in which the gyro's bias may scatter and walk, and their evidence (docs/model-session.md, 11.12b).

use rayon::prelude::*;

use super::Strengths;
use super::hypothesis::Hypothesis;
use super::possible::{AROUND, CORNERS_S, SCATTERS};
use super::strength_search::NO_SCATTER;

/// Step of the logarithm of scatters, and departures between poses beside the most likely: next to none, and the
/// largest.
const STEP: f64 = 0.3;
const BETWEENS: [f64; 2] = [0.05, 1.2];
/// Logarithm up to which a departure is the fitted one.
const SAME: f64 = 0.1;
/// Log-evidence below the largest at which a scatter, and those further from the likely ones, have no weight.
const NO_WEIGHT: f64 = 14.0;

/// Log-evidence of possible walks of the gyro's bias, each at its likeliest departure between poses and beside the mean
/// square of every axis' possible scatters: variances are linear in that.
pub(super) fn rate_tried(fitted: &Strengths, hypothesis: &Hypothesis) -> Vec<(f64, Strengths)> {
    if hypothesis.process[1].n == 0 {
        return vec![(0.0, *fitted)];
    }
    let [strong, weak, .., none] = CORNERS_S;
    let mut corners = vec![strong, weak, none];
    if fitted.corner_s[1] < strong {
        corners.extend(AROUND.map(|part| part * fitted.corner_s[1]));
    }
    let scatters = scatters_beforehand(&fitted.scatter[1..]);
    let others = BETWEENS.map(|between| (between, (between / fitted.between[1]).ln().abs()));
    let others = others.iter().filter(|(_, apart)| *apart > SAME);
    let mut at_betweens = vec![*fitted];
    at_betweens.extend(others.map(|(between, _)| {
        let mut at = *fitted;
        at.between[1] = *between;
        at
    }));
    let asked = |at: &Strengths| {
        let axes = [1, 2, 3].into_par_iter();
        let found = axes.map(|axis| hypothesis.by_scatter(at, axis, &scatters, &corners));
        let found: Vec<Vec<Vec<f64>>> = found.collect();
        (*at, found, hypothesis.by_corner(at, 1, &corners))
    };
    let each: Vec<_> = at_betweens.par_iter().map(asked).collect();
    let mut out = vec![(f64::NEG_INFINITY, *fitted); corners.len()];
    for (mut at, found, beside) in each {
        for (c, (known, fitted)) in out.iter_mut().zip(beside).enumerate() {
            let gains =
                std::array::from_fn(|axis| found[axis].iter().map(|one| one[c] - fitted).collect());
            let (gain, squares) = averaged(&scatters, &gains);
            if fitted + gain > known.0 {
                at.corner_s[1] = corners[c];
                at.scatter[1..].copy_from_slice(&squares.map(f64::sqrt));
                *known = (fitted + gain, at);
            }
        }
    }
    out
}

/// Scatters and the logarithm of their prior probabilities: none, and steps that contain the usual one of the axes.
fn scatters_beforehand(axes: &[f64]) -> Vec<(f64, f64)> {
    let [least, .., most] = SCATTERS;
    let square = axes.iter().map(|s| s * s).sum::<f64>() / axes.len() as f64;
    let usual = square.sqrt().max(1.0);
    let most = axes.iter().fold(most, |most, s| most.max(3.0 * s));
    let first = usual * (-STEP * ((usual / least).ln() / STEP).floor()).exp();
    let some: Vec<f64> = std::iter::successors(Some(first), |s| Some(s * STEP.exp()))
        .take_while(|s| *s < most)
        .collect();
    let unlikely = -(some.len() as f64).ln();
    let some = some.into_iter().map(|scatter| (scatter, unlikely));
    std::iter::once((NO_SCATTER, 0.0)).chain(some).collect()
}

/// Gain in log-evidence by possible scatters in place of the fitted ones, from that by each scatter of each axis, and
/// the mean square of every axis. Axes scatter alike or independently of one another, each with a probability of one
/// half.
fn averaged(scatters: &[(f64, f64)], gains: &[Vec<f64>; 3]) -> (f64, [f64; 3]) {
    let most = gains
        .each_ref()
        .map(|axis| axis.iter().copied().fold(f64::NEG_INFINITY, f64::max));
    let one = |axis: usize, k: usize| (gains[axis][k] - most[axis]).exp();
    let all = |k: usize| one(0, k) * one(1, k) * one(2, k);
    let over = |of: &dyn Fn(usize) -> f64| -> f64 {
        let each = scatters.iter().enumerate();
        each.map(|(k, (_, prior))| prior.exp() * of(k)).sum()
    };
    let total = [0, 1, 2].map(|axis| over(&|k| one(axis, k)));
    let (apart, alike) = (total.iter().product::<f64>(), over(&all));
    let squares = [0, 1, 2].map(|axis| {
        let likely = |k: usize| apart / total[axis] * one(axis, k) + all(k);
        over(&|k| scatters[k].0.powi(2) * likely(k)) / (apart + alike)
    });
    let gain = most.iter().sum::<f64>() + (0.5 * (apart + alike)).ln();
    (gain, squares)
}

impl Hypothesis {
    /// Log-evidence of each of some scatters, by its index, and each corner time of that sensor's walk; the other
    /// strengths are those `at` some point. From the scatter there on, either way to the first without weight.
    pub(super) fn by_scatter(
        &self,
        at: &Strengths,
        index: usize,
        scatters: &[(f64, f64)],
        corners: &[f64],
    ) -> Vec<Vec<f64>> {
        let apart = |&(scatter, _): &(f64, f64)| (scatter / at.scatter[index]).ln().abs();
        let nearest = scatters.iter().map(apart).enumerate();
        let first = nearest
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |(k, _)| k);
        let mut out = vec![vec![f64::NEG_INFINITY; corners.len()]; scatters.len()];
        let mut best = out[first].clone();
        let (up, down): (Vec<usize>, Vec<usize>) = (0..scatters.len()).partition(|k| *k >= first);
        for way in [up, down.into_iter().rev().collect()] {
            for k in way {
                let mut at = *at;
                at.scatter[index] = scatters[k].0;
                out[k] = self.by_corner(&at, index.min(1), corners);
                let mut is_likely = false;
                for (best, value) in best.iter_mut().zip(&out[k]) {
                    *best = best.max(*value);
                    is_likely |= *value > *best - NO_WEIGHT;
                }
                if !is_likely {
                    break;
                }
            }
        }
        out
    }

    /// Log-evidence of each corner time of a sensor's walk.
    fn by_corner(&self, at: &Strengths, sensor: usize, corners: &[f64]) -> Vec<f64> {
        let Some(rows) = self.weighted_rows(at) else {
            return vec![f64::NEG_INFINITY; corners.len()];
        };
        let each = corners.iter().map(|corner| {
            let mut at = *at;
            at.corner_s[sensor] = *corner;
            self.beside(&at, &rows)
        });
        each.collect()
    }
}
