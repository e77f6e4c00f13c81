//! Error of an integral over samples that a log lost, beyond what their neighbours determine.
//!
//! It is measured: the same interpolation is made across samples that are there, in all moves of the session. Near the
//! gap in its move the error is more its own than elsewhere: the mean square is estimated from the nearest places, with
//! that of the session as its prior.

use nalgebra::Vector3;

use super::moves::Move;
use crate::aliasing::GAP;

/// Places nearest to a gap that count: motion is quicker in the middle of a move than at its ends.
const NEAREST: usize = 24;
/// Places that the session's mean square is worth: those of one move describe it within a factor of two or so.
const PRIOR_PLACES: f64 = 4.0;

/// Squares of force and rate.
type Squares = [Vector3<f64>; 2];

/// A step over lost samples.
#[derive(Debug, Clone)]
pub struct Gap {
    /// Index of the step in the move.
    pub step: usize,
    /// Mean square error of the same interpolation where nothing was lost: integrals of force and rate,
    /// (raw unit · s)². `None` where no move is as long.
    pub square: Option<Squares>,
    /// Factor of the variance of one sample's noise in it, s².
    pub noise: f64,
}

impl Gap {
    /// Its error beyond noise of these densities (force, rate), (raw unit · s)²; `None` as in `square`.
    #[must_use]
    pub fn variance(&self, density: [&Vector3<f64>; 2], step_s: f64) -> Option<Squares> {
        let square = self.square.as_ref()?;
        let excess = |k: usize| {
            let noise = density[k].component_mul(density[k]) * (self.noise / step_s);
            (square[k] - noise).map(|v| v.max(0.0))
        };
        Some([excess(0), excess(1)])
    }
}

/// Finds the gaps of all moves of a session.
pub fn find_gaps(moves: &mut [Move]) {
    if !moves.iter().any(has_gaps) {
        return;
    }
    let longest = moves.iter().map(|one| one.steps.len()).max().unwrap_or(0);
    let crossed: Vec<Crossed> = moves.iter().map(|one| Crossed::of(one, longest)).collect();
    let mut known: Vec<(Bridge, Option<Squares>)> = Vec::new();
    let mut found: Vec<Vec<Gap>> = Vec::with_capacity(crossed.len());
    for one in &crossed {
        let at = |step: usize| {
            let bridge = Bridge::over(step, one);
            let place = known.iter().position(|(other, _)| *other == bridge);
            let place = place.unwrap_or_else(|| {
                let everywhere = mean(crossed.iter().flat_map(|other| other.errors(&bridge)));
                known.push((bridge, everywhere.map(|(squares, _)| squares)));
                known.len() - 1
            });
            let (bridge, session) = &known[place];
            let near = mean(one.errors_near(bridge, step).into_iter());
            let square = session.map(|prior| match near {
                None => prior,
                Some((near, n)) => [0, 1].map(|s| {
                    (prior[s] * PRIOR_PLACES + near[s] * n as f64) / (PRIOR_PLACES + n as f64)
                }),
            });
            Gap {
                step,
                square,
                noise: one.usual * one.usual * bridge.noise(),
            }
        };
        found.push(one.gaps().map(at).collect());
    }
    for (one, gaps) in moves.iter_mut().zip(found) {
        one.gaps = gaps;
    }
}

/// Usual step, s: the median, for timestamps of bursts are all further apart than samples.
fn usual_step(one: &Move) -> f64 {
    let mut lengths: Vec<f64> = one.steps.iter().map(|step| step.h).collect();
    let middle = lengths.len() / 2;
    match lengths.len() {
        0 => 1.0,
        _ => *lengths.select_nth_unstable_by(middle, f64::total_cmp).1,
    }
}

fn has_gaps(one: &Move) -> bool {
    let usual = usual_step(one);
    one.steps.iter().any(|step| step.h > GAP * usual)
}

/// Mean of squares and their number, of any.
fn mean(squares: impl Iterator<Item = Squares>) -> Option<(Squares, usize)> {
    let (sum, n) = squares.fold(([Vector3::zeros(); 2], 0), |(sum, n), one| {
        ([sum[0] + one[0], sum[1] + one[1]], n + 1)
    });
    (n > 0).then(|| (sum.map(|s| s / n as f64), n))
}

/// A move as its steps cross the samples.
struct Crossed<'a> {
    signals: [&'a [Vector3<f64>]; 2],
    /// Samples between the steps, one more than these.
    samples: Vec<usize>,
    /// Sums of force and rate over the samples before each.
    sums: [Vec<Vector3<f64>>; 2],
    /// Length of each step, in usual ones, and at most as long as the longest move.
    whole: Vec<usize>,
    /// Whether a step is a line.
    is_line: Vec<bool>,
    /// Number of steps over lost samples before each.
    n_lossy: Vec<usize>,
    /// Usual step, s.
    usual: f64,
}

impl<'a> Crossed<'a> {
    fn of(one: &'a Move, longest: usize) -> Self {
        let signals = [one.force.as_slice(), one.rate.as_slice()];
        let usual = usual_step(one);
        let mut samples = vec![one.steps.first().map_or(0, |step| step.from)];
        samples.extend(one.steps.iter().map(|step| step.to));
        let sums = signals.map(|signal| {
            let mut sum = Vector3::zeros();
            let before = samples.iter().map(|&k| {
                let before = sum;
                sum += signal[k];
                before
            });
            before.collect()
        });
        let mut n_lossy = vec![0];
        for step in &one.steps {
            n_lossy.push(n_lossy[n_lossy.len() - 1] + usize::from(step.h > GAP * usual));
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let whole = |h: f64| ((h / usual).round() as usize).clamp(1, longest + 1);
        Self {
            signals,
            samples,
            sums,
            whole: one.steps.iter().map(|step| whole(step.h)).collect(),
            is_line: one
                .steps
                .iter()
                .map(|step| step.sample[2] == step.from)
                .collect(),
            n_lossy,
            usual,
        }
    }

    /// Steps over lost samples.
    fn gaps(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.whole.len()).filter(|&k| self.n_lossy[k + 1] > self.n_lossy[k])
    }

    /// Squared errors of an interpolation at places a gap apart, where no samples were lost.
    fn errors<'b>(&'b self, bridge: &'b Bridge) -> impl Iterator<Item = Squares> + 'b {
        (0..self.samples.len())
            .step_by(bridge.lost().len())
            .filter_map(|first| self.error(bridge, first))
    }

    /// Those nearest to a step, from the nearest on.
    fn errors_near(&self, bridge: &Bridge, step: usize) -> Vec<Squares> {
        let apart = bridge.lost().len();
        let at = step - bridge.left;
        (1..=self.samples.len() / apart + 1)
            .flat_map(|k| [at.checked_sub(k * apart), Some(at + k * apart)])
            .flatten()
            .filter_map(|first| self.error(bridge, first))
            .take(NEAREST)
            .collect()
    }

    /// Squared error of an interpolation that begins at a sample; `None` where samples were lost.
    fn error(&self, bridge: &Bridge, first: usize) -> Option<Squares> {
        let last = first + bridge.known[bridge.known.len() - 1];
        if last >= self.samples.len() || self.n_lossy[last] > self.n_lossy[first] {
            return None;
        }
        let lost = bridge.lost();
        Some([0, 1].map(|s| {
            let bridged: Vector3<f64> = bridge
                .known
                .iter()
                .zip(&bridge.weights)
                .map(|(at, &weight)| self.signals[s][self.samples[first + at]] * weight)
                .sum();
            let sum = self.sums[s][first + lost.end] - self.sums[s][first + lost.start];
            let missed = (sum - bridged) * self.usual;
            missed.component_mul(&missed)
        }))
    }
}

/// The samples through which the rate across a gap is interpolated: two for a line, four for a cubic.
#[derive(Debug, Clone, PartialEq)]
struct Bridge {
    /// Their places, in usual steps from the first of them.
    known: Vec<usize>,
    /// Which of them the gap follows.
    left: usize,
    /// Their weights in the sum of the lost samples.
    weights: Vec<f64>,
}

impl Bridge {
    /// As the integration crosses step `k` of a move.
    fn over(k: usize, one: &Crossed) -> Self {
        let first = if one.is_line[k] {
            k
        } else {
            k.saturating_sub(1).min(one.whole.len() - 3)
        };
        let mut known = vec![0];
        for length in &one.whole[first..first + if one.is_line[k] { 1 } else { 3 }] {
            known.push(known.last().map_or(0, |last| last + length));
        }
        Self::through(known, k - first)
    }

    fn through(known: Vec<usize>, left: usize) -> Self {
        let weight = |&at: &usize| {
            let of = |lost: usize| {
                let others = known.iter().filter(|&&other| other != at);
                others
                    .map(|&other| (lost as f64 - other as f64) / (at as f64 - other as f64))
                    .product::<f64>()
            };
            (known[left] + 1..known[left + 1]).map(of).sum()
        };
        Self {
            weights: known.iter().map(weight).collect(),
            known,
            left,
        }
    }

    /// Places of the lost samples.
    fn lost(&self) -> std::ops::Range<usize> {
        self.known[self.left] + 1..self.known[self.left + 1]
    }

    /// Factor of the variance of one sample in the error of the sum.
    fn noise(&self) -> f64 {
        self.lost().len() as f64 + self.weights.iter().map(|w| w * w).sum::<f64>()
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
            let bridge = Bridge::through(known, left);
            let lost = bridge.lost();
            for power in 0..=degree {
                let value = |j: usize| (j as f64 - 1.0).powi(power);
                let bridged: f64 = bridge
                    .known
                    .iter()
                    .zip(&bridge.weights)
                    .map(|(&at, weight)| weight * value(at))
                    .sum();
                let missed = lost.clone().map(value).sum::<f64>() - bridged;
                assert!(missed.abs() < 1e-9 * 5_f64.powi(power), "{lost:?} {power}");
            }
        }
    }
}
