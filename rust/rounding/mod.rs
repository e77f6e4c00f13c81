//! Rate hidden inside one LSB of a coarse ADC, in poses and in moves (docs/model-session.md).

mod static_ends;

use std::cmp::Ordering;

use crate::running::running_median;

/// Variance of an error that is uniform over one step, in squares of the step.
const UNIFORM: f64 = 1.0 / 12.0;
/// For a body that settles as exp(-t/τ), then for one that starts as t²: duration of the second step beside the bias's
/// over that of the first, and samples per sample of the first step. Over these the rotation hidden in the bias's step
/// is, rms over the place of the bias, as large as a uniform error of one step.
const SETTLING: [(f64, f64); 2] = [(0.50, 2.5), (0.68, 1.25)];
/// Mean square of the common error of the readings of a turn within one step over that of a constant rate:
/// `(2h/3 - 1/2)²` of a step for a turn at height `h` in it, averaged over `h` with the number of readings, which grows
/// as `√h`.
const TURNED: f64 = 1.0 / 3.0;

/// Errors of rounding in moves: variance of every reading, whether an axis is in the LSB of its bias there, and errors
/// that all moves share, with the axis that has each.
pub type InMoves = (Vec<[f64; 3]>, Vec<[bool; 3]>, Vec<(usize, Vec<f64>)>);

/// Readings of an ADC whose noise does not dither its LSB on some axes.
#[derive(Debug, Clone, Copy)]
pub struct Coarse<'a> {
    /// Readings of the three axes.
    pub readings: &'a [[f64; 3]],
    /// Their LSB.
    pub quantum: [f64; 3],
    /// Reading of the bias; NaN where there is none.
    pub rest: [f64; 3],
    /// Axes that are not dithered.
    pub axes: [bool; 3],
    /// Distance from the bias, in LSB, within which a code is one of the two between which it toggles.
    pub in_step: f64,
    /// Length of the running median that removes toggling between neighbouring codes.
    pub chatter: usize,
}

/// A stay of one axis in the LSB of its bias, and the samples at either end in which it may rotate undetected.
#[derive(Debug, Clone, Copy)]
struct Rest {
    begin: usize,
    end: usize,
    left: usize,
    right: usize,
}

impl Coarse<'_> {
    /// Rounding variance of readings for sums that treat them as independent.
    ///
    /// While the rate passes through a step from one side to the other, the errors of the `n` readings inside take all
    /// values of the step and cancel except for one: `q²/12` for the run, `q²/12n` per reading. Where the rate turns
    /// back inside the step, the readings share one error: their sum has the variance `n² q²/12`, that is `n q²/12` per
    /// reading, and a third of it where the rate turns at once. In the step of the bias the error is that of the bias,
    /// which is not included here, except at the start and the end of a move that are still inside that step.
    #[must_use]
    pub fn variance(&self) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; self.readings.len()];
        for axis in self.listed() {
            let unit = UNIFORM * self.quantum[axis].powi(2);
            for (row, value) in out.iter_mut().zip(self.of_runs(axis)) {
                row[axis] = value * unit;
            }
            // The part of the others' rotation along a resting axis stays inside its step all the time.
            for [begin, end] in self.standing(axis) {
                for row in &mut out[begin..end] {
                    row[axis] = row[axis].max((end - begin) as f64 * unit);
                }
            }
        }
        out
    }

    /// Rounding in the moves `edges` (half-open).
    #[must_use]
    pub fn in_moves(&self, edges: &[[usize; 2]]) -> InMoves {
        let (mut variance, mut is_static) = (self.variance(), self.resting());
        self.add_static_ends(edges, &mut is_static);
        for &[first, last] in edges {
            for axis in self.listed() {
                // An axis that is static throughout may rotate at any rate inside its LSB: one error of all readings.
                if is_static[first..last].iter().all(|row| row[axis]) {
                    let whole = (last - first) as f64 * UNIFORM * self.quantum[axis].powi(2);
                    for row in &mut variance[first..last] {
                        row[axis] = row[axis].max(whole);
                    }
                }
            }
        }
        (variance, is_static, self.shared())
    }

    /// Whether an axis rests: it is in the LSB of its bias for longer than it takes to leave it, while others rotate, or
    /// while the body stops inside a move.
    fn resting(&self) -> Vec<[bool; 3]> {
        let mut out = vec![[false; 3]; self.readings.len()];
        for axis in self.listed() {
            for one in self.rests(axis) {
                let (first, last) = (one.begin + one.left, one.end.saturating_sub(one.right));
                if last.saturating_sub(first) > one.left.max(one.right) {
                    out[first..last].iter_mut().for_each(|row| row[axis] = true);
                }
            }
        }
        out
    }

    /// Errors of one standard deviation that all moves share, with the axis that has each: its rotation inside the LSB of
    /// its bias while another axis leads. It is due to their misalignment and changes sign with the rotation: it does not
    /// scatter from move to move.
    fn shared(&self) -> Vec<(usize, Vec<f64>)> {
        let mut out = Vec::new();
        for axis in self.listed() {
            let size = self.quantum[axis] * UNIFORM.sqrt();
            for other in (0..3).filter(|&other| other != axis) {
                let of = |row: &[f64; 3]| size * self.led(row, axis, other);
                let error: Vec<f64> = self.readings.iter().map(of).collect();
                if error.iter().any(|&one| one != 0.0) {
                    out.push((axis, error));
                }
            }
        }
        out
    }

    /// Sense in which `other` leads a rotation that `axis` does not show; 0 where it does not.
    fn led(&self, row: &[f64; 3], axis: usize, other: usize) -> f64 {
        let away: [f64; 3] = std::array::from_fn(|k| {
            if self.quantum[k] > 0.0 {
                (row[k] - self.rest[k]) / self.quantum[k]
            } else {
                0.0
            }
        });
        let largest = away.iter().fold(0.0, |most: f64, one| most.max(one.abs()));
        let leads = largest > 1.0 + self.in_step
            && away[other].abs() >= largest
            && away[axis].abs() < self.in_step
            && away.iter().all(|one| one.is_finite());
        if leads { away[other].signum() } else { 0.0 }
    }

    fn listed(&self) -> impl Iterator<Item = usize> + use<> {
        let axes = self.axes;
        (0..3).filter(move |&axis| axes[axis])
    }

    /// Codes of an axis, missing ones infinite.
    fn codes(&self, axis: usize) -> Vec<f64> {
        let code = |row: &[f64; 3]| {
            if row[axis].is_finite() {
                row[axis]
            } else {
                f64::INFINITY
            }
        };
        self.readings.iter().map(code).collect()
    }

    /// Variance of every reading of an axis, of that of rounding, by the runs of one code.
    fn of_runs(&self, axis: usize) -> Vec<f64> {
        let codes = self.codes(axis);
        let runs: Vec<&[f64]> = codes
            .chunk_by(|a, b| a.partial_cmp(b).is_some_and(Ordering::is_eq))
            .collect();
        let mut out = Vec::with_capacity(codes.len());
        for k in 0..runs.len() {
            let n = runs[k].len() as f64;
            let beside = (k > 0 && k + 1 < runs.len()).then(|| (runs[k - 1], runs[k + 1]));
            let is_passed = beside.is_some_and(|(before, after)| {
                (runs[k][0] - before[0]) * (after[0] - runs[k][0]) > 0.0
            });
            let turns =
                beside.is_some_and(|(before, after)| self.turns_at_once(before, runs[k], after));
            let share = if is_passed {
                1.0 / n
            } else if turns {
                TURNED * n
            } else {
                n
            };
            out.resize(out.len() + runs[k].len(), share);
        }
        for one in self.rests(axis) {
            let part = &mut out[one.begin..one.end];
            part.fill(0.0);
            part[..one.left].fill(one.left as f64);
            let first = part.len() - one.right;
            part[first..]
                .iter_mut()
                .for_each(|value| *value = value.max(one.right as f64));
        }
        out
    }

    /// Whether a run, too long for toggling, is as short beside its neighbours as in a turn: a rate that turns back as t²
    /// stays in a step 2/(√2 - 1) mean durations of the steps beside it at most.
    fn turns_at_once(&self, before: &[f64], run: &[f64], after: &[f64]) -> bool {
        let shortest = before.len().min(run.len()).min(after.len());
        let beside = (before.len() + after.len()) as f64;
        shortest > self.chatter / 2 && (run.len() as f64) < beside / (2f64.sqrt() - 1.0)
    }

    /// Ranges in which an axis stays in the LSB of its bias while others rotate, for longer than it takes to leave it:
    /// where all axes rotate, each passes that step or leaves it with the others.
    fn standing(&self, axis: usize) -> Vec<[usize; 2]> {
        let turns = |row: &[f64; 3], k: usize| {
            (row[k] - self.rest[k]).abs() > (1.0 + self.in_step) * self.quantum[k]
        };
        let others: Vec<bool> = self
            .readings
            .iter()
            .map(|row| (0..3).any(|k| k != axis && turns(row, k)))
            .collect();
        let mut out = Vec::new();
        for one in self.rests(axis) {
            let (first, last) = (one.begin + one.left, one.end.saturating_sub(one.right));
            let inside = others.get(first..last).unwrap_or_default();
            let long = ranges_of(inside)
                .into_iter()
                .filter(|[a, b]| b - a > one.left.max(one.right));
            out.extend(long.map(|[a, b]| [first + a, first + b]));
        }
        out
    }

    /// Stays of an axis in the LSB of its bias.
    fn rests(&self, axis: usize) -> Vec<Rest> {
        // Small noise makes readings toggle between codes where they pass: such runs say nothing of how long a step takes.
        let steady = running_median(&self.codes(axis), self.chatter);
        let near = |steps: f64| -> Vec<[usize; 2]> {
            let limit = (steps + self.in_step) * self.quantum[axis];
            let inside = steady
                .iter()
                .map(|code| (code - self.rest[axis]).abs() < limit);
            ranges_of(&inside.collect::<Vec<bool>>())
        };
        let (at_rest, next, beyond) = (near(0.0), near(1.0), near(2.0));
        let mut out = Vec::new();
        for [first, last] in next {
            // Each range lies within one of the next kind; the longest stay of each is the rest.
            let inside = at_rest.iter().filter(|[a, _]| (first..last).contains(a));
            let Some(&[begin, end]) = inside.max_by_key(|[a, b]| (b - a, *a)) else {
                continue;
            };
            let Some(&[outer, until]) = beyond.iter().rfind(|[a, _]| *a <= first) else {
                continue;
            };
            // The signs of the moves before and after do not matter.
            let left = if first > 0 {
                hidden(begin - first, first - outer)
            } else {
                0
            };
            let right = if last < steady.len() {
                hidden(last - end, until - last)
            } else {
                0
            };
            let n = end - begin;
            // Otherwise passed through, or turned back inside.
            if n > left.min(right) {
                out.push(Rest {
                    begin,
                    end,
                    left: left.min(n),
                    right: right.min(n),
                });
            }
        }
        out
    }
}

/// Samples with rounding variance next to the LSB of the bias, from the durations of the two steps beside it.
fn hidden(first_step: usize, second_step: usize) -> usize {
    let ratio = second_step as f64 / first_step.max(1) as f64;
    samples((first_step as f64 * between(SETTLING[0], SETTLING[1], ratio)).ceil())
}

/// Value at `x` on the line between two points, that of the nearer one beyond them.
fn between((x0, y0): (f64, f64), (x1, y1): (f64, f64), x: f64) -> f64 {
    y0 + ((x - x0) / (x1 - x0)).clamp(0.0, 1.0) * (y1 - y0)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of samples"
)]
fn samples(whole: f64) -> usize {
    whole as usize
}

/// Half-open ranges in which a flag is set.
fn ranges_of(flags: &[bool]) -> Vec<[usize; 2]> {
    let mut out: Vec<[usize; 2]> = Vec::new();
    for (k, _) in flags.iter().enumerate().filter(|(_, is_set)| **is_set) {
        match out.last_mut() {
            Some(last) if last[1] == k => last[1] = k + 1,
            _ => out.push([k, k + 1]),
        }
    }
    out
}
