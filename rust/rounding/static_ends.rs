//! Samples at the ends of a move at which an axis of a coarse ADC is static still, or already.

use super::{Coarse, between, samples};
use crate::running::running_median;

/// For a rate that settles as exp(-t/τ), then for rates that start as t⁴, t² and t: ratio of the time for the second LSB
/// to that for the first; time before the first code change in which the bias's position inside the LSB acts as a rate,
/// in times of the first LSB. With rate r reached at t(r), codes give Σ t'(k - ½) of the time in which it acts (first
/// order, mean of both directions): τ(2 ln 2 + γ + ln k), √k + ζ(½, ½)/2 of √k; before it the axis is static.
const BEGINS: [(f64, f64); 4] = [(0.465, 1.156), (0.567, 0.957), (0.689, 0.782), (1.0, 0.500)];

impl Coarse<'_> {
    /// Marks the samples at the ends of the moves `edges` at which an axis is static: in the LSB of its static reading,
    /// and not rotating yet, or no longer.
    ///
    /// Before its code changes an axis rotates undetected, further in the direction in which the bias is farther from
    /// the edge of the LSB: on the mean of both directions as if the position inside the LSB, as a rate, acted for a
    /// while; that time is not static. It is taken from the axis' own code changes; an axis without any is as static as
    /// the body, and a body without any is static throughout.
    pub(super) fn add_static_ends(&self, edges: &[[usize; 2]], out: &mut [[bool; 3]]) {
        for &[first, last] in edges {
            let part = &self.readings[first..last];
            if part.iter().flatten().any(|value| !value.is_finite()) {
                continue;
            }
            for is_end in [false, true] {
                let still = |axis: usize| {
                    let mut away = self.away(part, axis);
                    if is_end {
                        away.reverse();
                    }
                    (axis, self.still(&away))
                };
                let own: Vec<(usize, Option<usize>)> = self.listed().map(still).collect();
                let of_body = own.iter().filter_map(|(_, n)| *n).min();
                for (axis, n) in own {
                    let n = n.or(of_body).unwrap_or(part.len());
                    let begin = if is_end { last - n } else { first };
                    out[begin..begin + n]
                        .iter_mut()
                        .for_each(|row| row[axis] = true);
                }
            }
        }
    }

    /// Distance from the static reading in LSB, without toggling between neighbouring codes.
    fn away(&self, part: &[[f64; 3]], axis: usize) -> Vec<f64> {
        let (rest, quantum) = (self.rest[axis], self.quantum[axis]);
        let codes: Vec<f64> = part.iter().map(|row| row[axis]).collect();
        let steady = running_median(&codes, self.chatter);
        let away = |(code, middle): (&f64, &f64)| {
            ((code - rest).abs() - quantum).max((middle - rest).abs()) / quantum
        };
        codes.iter().zip(&steady).map(away).collect()
    }

    /// Number of static samples before a rotation, from the distance `away` of rest; `None` without a code change.
    fn still(&self, away: &[f64]) -> Option<usize> {
        let left = |steps: f64| away.iter().position(|&one| one >= steps + self.in_step);
        let begin = left(0.0)?;
        let (Some(second), Some(third)) = (left(1.0), left(2.0)) else {
            return Some(begin);
        };
        let took = (second - begin).max(1) as f64;
        let ratio = (third - second) as f64 / took;
        let k = BEGINS
            .partition_point(|(x, _)| *x <= ratio)
            .clamp(1, BEGINS.len() - 1);
        let hidden = took * between(BEGINS[k - 1], BEGINS[k], ratio);
        Some(begin.saturating_sub(samples(hidden.round_ties_even())))
    }
}
