//! Error of an integral over samples that a log lost, beyond what their neighbours determine.

use nalgebra::Vector3;

use crate::poisson::StepWeights;

/// A step longer than this many usual ones has lost samples.
pub const GAP: f64 = 1.5;
/// Fewest places in the move with as many complete samples: fewer do not determine the curvature of its motion.
const FEWEST: usize = 12;

/// Places nearest to a gap that count: motion is quicker in the middle of a move than at its ends.
const NEAREST: usize = 24;

/// A step over lost samples.
#[derive(Debug, Clone)]
pub struct Gap {
    /// Index of the step in the move.
    pub step: usize,
    /// Mean square error of the same interpolation near it in the move, where nothing was lost: integrals of force
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
    // A gap longer than the move itself cannot be measured.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let whole: Vec<usize> = steps
        .iter()
        .map(|step| ((step.h / usual).round() as usize).clamp(1, steps.len()))
        .collect();
    let is_gap = |k: usize| steps[k].h > GAP * usual;
    let mut known: Vec<(Bridge, Missed)> = Vec::new();
    let mut out = Vec::new();
    for k in (0..steps.len()).filter(|&k| is_gap(k)) {
        let bridge = Bridge::over(k, steps, &whole);
        let place = known.iter().position(|(other, _)| *other == bridge);
        let place = place.unwrap_or_else(|| {
            let missed = bridge.measured(steps, &is_gap, usual, [force, rate]);
            known.push((bridge, missed));
            known.len() - 1
        });
        out.push(known[place].1.at(k));
    }
    out
}

/// Errors of the integral that the interpolation across a gap makes where no samples were lost.
struct Missed {
    /// Middle of each place, in steps, and its squared error of force and rate.
    squares: Vec<(usize, [Vector3<f64>; 2])>,
    /// Factor of the variance of one sample's noise, s².
    noise: f64,
}

impl Missed {
    /// At the gap that is step `k`: the mean square of the nearest places.
    fn at(&self, k: usize) -> Gap {
        let mut order: Vec<&(usize, [Vector3<f64>; 2])> = self.squares.iter().collect();
        order.sort_by_key(|(middle, _)| middle.abs_diff(k));
        order.truncate(NEAREST);
        let n = order.len();
        let mean = |s: usize| {
            order
                .iter()
                .map(|(_, square)| square[s])
                .sum::<Vector3<f64>>()
                / n as f64
        };
        Gap {
            step: k,
            square: (n >= FEWEST).then(|| [mean(0), mean(1)]),
            noise: self.noise,
        }
    }
}

/// The samples through which the rate across a gap is interpolated: two for a line, four for a cubic.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Bridge {
    /// Their places, in usual steps from the first of them.
    known: Vec<usize>,
    /// Which of them the gap follows.
    left: usize,
}

impl Bridge {
    /// As the integration crosses step `k`; `whole` are the lengths of all steps, in usual ones.
    fn over(k: usize, steps: &[StepWeights], whole: &[usize]) -> Self {
        let is_line = steps[k].sample[2] == steps[k].from;
        let first = if is_line {
            k
        } else {
            k.saturating_sub(1).min(steps.len() - 3)
        };
        let mut known = vec![0];
        for length in &whole[first..first + if is_line { 1 } else { 3 }] {
            known.push(known.last().map_or(0, |last| last + length));
        }
        Self {
            known,
            left: k - first,
        }
    }

    /// Weights, in steps, of all samples from the first to the last of them in the error of the integral: a lost sample
    /// has weight one, and its interpolation is subtracted.
    fn contrast(&self) -> Vec<f64> {
        let n = self.known.len();
        let mut weights = vec![0.0; self.known[n - 1] + 1];
        for lost in self.known[self.left] + 1..self.known[self.left + 1] {
            weights[lost] += 1.0;
            for &at in &self.known {
                let others = self.known.iter().filter(|&&other| other != at);
                weights[at] -= others
                    .map(|&other| (lost as f64 - other as f64) / (at as f64 - other as f64))
                    .product::<f64>();
            }
        }
        weights
    }

    /// Its errors where no samples were lost.
    fn measured(
        &self,
        steps: &[StepWeights],
        is_gap: &impl Fn(usize) -> bool,
        usual: f64,
        signals: [&[Vector3<f64>]; 2],
    ) -> Missed {
        let weights = self.contrast();
        let mut squares = Vec::new();
        for (first, window) in steps.windows(weights.len() - 1).enumerate() {
            if (first..first + window.len()).any(is_gap) {
                continue;
            }
            let samples = std::iter::once(window[0].from).chain(window.iter().map(|step| step.to));
            let weighted: Vec<(f64, usize)> =
                weights.iter().map(|w| w * usual).zip(samples).collect();
            let missed = signals.map(|signal| {
                let each = weighted.iter().map(|&(weight, k)| signal[k] * weight);
                let sum: Vector3<f64> = each.sum();
                sum.component_mul(&sum)
            });
            squares.push((first + window.len() / 2, missed));
        }
        Missed {
            squares,
            noise: usual * usual * weights.iter().map(|w| w * w).sum::<f64>(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Bridge;

    #[test]
    fn a_cubic_hides_nothing_in_lost_samples_and_a_line_nothing_of_a_line() {
        for (known, left, degree) in [
            (vec![0, 1, 3, 4], 1, 3),
            (vec![0, 1, 4, 5], 1, 3),
            (vec![0, 2, 4, 5], 0, 3),
            (vec![0, 3, 4, 5], 0, 3),
            (vec![0, 4], 0, 1),
        ] {
            let lost = known[left + 1] - known[left] - 1;
            let weights = Bridge { known, left }.contrast();
            let ones = weights.iter().filter(|w| (**w - 1.0).abs() < 1e-12);
            assert!(ones.count() >= lost);
            for power in 0..=degree {
                let missed: f64 = weights
                    .iter()
                    .enumerate()
                    .map(|(j, w)| w * (j as f64 - 1.0).powi(power))
                    .sum();
                assert!(missed.abs() < 1e-9 * 5_f64.powi(power), "{lost} {power}");
            }
        }
    }
}
