//! Error of an integral over samples that a log lost, beyond what their neighbours determine.

use nalgebra::Vector3;

use crate::poisson::StepWeights;

/// A step longer than this many usual ones has lost samples.
pub const GAP: f64 = 1.5;
/// Number of samples lost together above which a straight line bridges the gap, not a cubic (`poisson::UNEVEN_STEPS`).
const CROSSED_BY_CUBIC: usize = 2;
/// Fewest places in the move with as many complete samples: fewer do not determine the curvature of its motion.
const FEWEST: usize = 12;

/// A step over lost samples.
#[derive(Debug, Clone)]
pub struct Gap {
    /// Index of the step in the move.
    pub step: usize,
    /// Mean square error of the same interpolation elsewhere in the move, where nothing was lost: integrals of force
    /// and rate, (raw unit · s)². `None` where the move is too short.
    pub square: Option<[Vector3<f64>; 2]>,
    /// Factor of the variance of one sample's noise in it, s².
    pub noise: f64,
}

impl Gap {
    /// Its error beyond noise of these densities (force, rate), (raw unit · s)²; `None` as in `square`.
    #[must_use]
    pub fn variance(&self, density: [&Vector3<f64>; 2], step_s: f64) -> Option<[Vector3<f64>; 2]> {
        let square = self.square.as_ref()?;
        let excess = |k: usize| {
            let noise = density[k].component_mul(density[k]) * (self.noise / step_s);
            (square[k] - noise).map(|v| v.max(0.0))
        };
        Some([excess(0), excess(1)])
    }
}

/// The gaps of a move, relative to its own median step (timestamps of bursts are all further apart than samples).
#[must_use]
pub fn gaps(steps: &[StepWeights], force: &[Vector3<f64>], rate: &[Vector3<f64>]) -> Vec<Gap> {
    let mut lengths: Vec<f64> = steps.iter().map(|step| step.h).collect();
    if lengths.is_empty() {
        return Vec::new();
    }
    let middle = lengths.len() / 2;
    let usual = *lengths.select_nth_unstable_by(middle, f64::total_cmp).1;
    let is_gap = |step: &StepWeights| step.h > GAP * usual;
    let mut known: Vec<(usize, Gap)> = Vec::new();
    let mut out = Vec::new();
    for (k, step) in steps.iter().enumerate().filter(|(_, step)| is_gap(step)) {
        // A gap longer than the move itself cannot be measured.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let lost = ((step.h / usual).round() as usize).min(steps.len()).max(2) - 1;
        let seen = known
            .iter()
            .find(|(n, _)| *n == lost)
            .map(|(_, one)| one.clone());
        let one = seen.unwrap_or_else(|| {
            let one = measured(steps, &is_gap, lost, usual, [force, rate]);
            known.push((lost, one.clone()));
            one
        });
        out.push(Gap { step: k, ..one });
    }
    out
}

/// Weights, in steps, of the samples around a gap (two before, those lost, two after) in the error of the integral: a
/// lost sample has weight one, and its interpolation is subtracted.
fn contrast(lost: usize) -> Vec<f64> {
    let mut weights = vec![1.0; lost + 4];
    let end = lost as f64 + 1.0;
    let known = [-1.0, 0.0, end, end + 1.0];
    let places = [0, 1, lost + 2, lost + 3];
    for (j, (&at, place)) in known.iter().zip(places).enumerate() {
        let share = |x: f64| -> f64 {
            if lost > CROSSED_BY_CUBIC {
                return match j {
                    1 => 1.0 - x / end,
                    2 => x / end,
                    _ => 0.0,
                };
            }
            (0..4)
                .filter(|&i| i != j)
                .map(|i| (x - known[i]) / (at - known[i]))
                .product()
        };
        weights[place] = -(1..=lost).map(|i| share(i as f64)).sum::<f64>();
    }
    weights
}

/// Error of a step over `lost` samples, where none were lost.
fn measured(
    steps: &[StepWeights],
    is_gap: &impl Fn(&StepWeights) -> bool,
    lost: usize,
    usual: f64,
    signals: [&[Vector3<f64>]; 2],
) -> Gap {
    let weights = contrast(lost);
    let mut sum = [Vector3::zeros(); 2];
    let mut n = 0;
    for window in steps.windows(lost + 3) {
        if window.iter().any(is_gap) {
            continue;
        }
        n += 1;
        let at = |j: usize| {
            if j == 0 {
                window[0].from
            } else {
                window[j - 1].to
            }
        };
        for (sum, signal) in sum.iter_mut().zip(signals) {
            let mut missed = Vector3::zeros();
            for (j, weight) in weights.iter().enumerate() {
                missed += signal[at(j)] * (*weight * usual);
            }
            *sum += missed.component_mul(&missed);
        }
    }
    Gap {
        step: 0,
        square: (n >= FEWEST).then(|| sum.map(|s| s / n as f64)),
        noise: usual * usual * weights.iter().map(|w| w * w).sum::<f64>(),
    }
}

#[cfg(test)]
mod tests {
    use super::contrast;

    #[test]
    fn a_cubic_hides_nothing_in_one_or_two_lost_samples_and_a_line_nothing_in_more() {
        for (lost, degree) in [(1, 3), (2, 3), (3, 1), (7, 1)] {
            let weights = contrast(lost);
            assert!(weights[2..lost + 2].iter().all(|w| (w - 1.0).abs() < 1e-12));
            for power in 0..=degree {
                let missed: f64 = weights
                    .iter()
                    .enumerate()
                    .map(|(j, w)| w * (j as f64 - 1.0).powi(power))
                    .sum();
                assert!(
                    missed.abs() < 1e-9 * (lost as f64 + 3.0).powi(power),
                    "{lost} {power}"
                );
            }
        }
    }
}
