//! A move reduced to moments of its raw readings, for repeated integration.

use nalgebra::{Matrix3, Vector3};

use super::lanes::{Rate, Step, Steps, Whole, integrate_whole};
use super::{MoveRange, RateModel, RateNoise, StepWeights, Turn};
use crate::error::{Error, Result};
use crate::simd::Instructions;

/// A move prepared for repeated integration: the moments of its raw readings.
#[derive(Debug, Clone)]
pub struct PreparedMove {
    steps: Steps,
    span_s: f64,
}

/// Reduces the samples of a move to moments; non-finite rows and repeated timestamps are bridged.
///
/// # Errors
/// When the range leaves the record, the anchors coincide or time runs backward.
pub fn prepare(
    time_s: &[f64],
    raw: &[Vector3<f64>],
    range: &MoveRange,
    model: RateModel,
) -> Result<PreparedMove> {
    let samples = Samples {
        time_s,
        raw,
        range,
        model,
    };
    let span_s = samples.span_s()?;
    let steps = if let Some(whole) = samples.whole(span_s) {
        Steps::of(&whole, model, |i| samples.step_of_whole(i, span_s))
    } else {
        samples.steps(span_s)?
    };
    Ok(PreparedMove { steps, span_s })
}

/// [`prepare`] and [`PreparedMove::integrate`] in one, for a move that is integrated once.
pub(super) fn integrate_once(
    time_s: &[f64],
    raw: &[Vector3<f64>],
    range: &MoveRange,
    model: RateModel,
    rate: impl FnOnce(f64) -> Rate,
) -> Result<Turn> {
    let samples = Samples {
        time_s,
        raw,
        range,
        model,
    };
    let span_s = samples.span_s()?;
    let (instructions, rate) = (Instructions::detect(), rate(span_s));
    Ok(if let Some(whole) = samples.whole(span_s) {
        let odd = |i| samples.step_of_whole(i, span_s);
        integrate_whole(instructions, &whole, model, &rate, odd)
    } else {
        samples.steps(span_s)?.integrate(instructions, &rate)
    })
}

/// Samples of a move to be prepared.
struct Samples<'a> {
    time_s: &'a [f64],
    raw: &'a [Vector3<f64>],
    range: &'a MoveRange,
    model: RateModel,
}

impl<'a> Samples<'a> {
    /// Time between the anchors, s, where the range can be integrated.
    fn span_s(&self) -> Result<f64> {
        let Self {
            time_s, raw, range, ..
        } = self;
        if range.start >= range.stop || range.stop > time_s.len() || time_s.len() != raw.len() {
            return Err(Error::bad_input(format!(
                "a move covers samples {}..{} of {}: it must hold at least one sample and stay inside the record",
                range.start,
                range.stop,
                time_s.len().min(raw.len())
            )));
        }
        let span_s = range.anchor_after_s - range.anchor_before_s;
        if !(span_s > 0.0 && span_s.is_finite()) {
            return Err(Error::bad_input(format!(
                "the still pose after the move at sample {} must be later than the one before it",
                range.start
            )));
        }
        Ok(span_s)
    }

    fn is_number(&self, k: usize) -> bool {
        self.raw[k].iter().all(|x| x.is_finite()) && self.time_s[k].is_finite()
    }

    /// The samples where all are finite and of increasing time, which is nearly always so.
    fn whole(&self, span_s: f64) -> Option<Whole<'a>> {
        let MoveRange { start, stop, .. } = *self.range;
        let time_s = &self.time_s[start..stop];
        let is_whole = stop - start > 1
            && time_s.windows(2).all(|pair| pair[0] < pair[1])
            && (start..stop).all(|k| self.is_number(k));
        is_whole.then(|| Whole {
            time_s,
            raw: &self.raw[start..stop],
            anchor_before_s: self.range.anchor_before_s,
            span_s,
        })
    }

    fn step_of_whole(&self, i: usize, span_s: f64) -> Step {
        let MoveRange { start, stop, .. } = *self.range;
        self.step(|k| start + k, stop - start, i, span_s)
    }

    /// The steps between those samples that are finite and of increasing time.
    fn steps(&self, span_s: f64) -> Result<Steps> {
        let range = self.range;
        let mut used: Vec<usize> = Vec::with_capacity(range.stop - range.start);
        for k in (range.start..range.stop).filter(|&k| self.is_number(k)) {
            if let Some(&last) = used.last() {
                if self.time_s[k] < self.time_s[last] {
                    return Err(Error::bad_input(format!(
                        "time runs backward at sample {k}: sort the record first"
                    )));
                }
                if self.time_s[k] <= self.time_s[last] {
                    continue;
                }
            }
            used.push(k);
        }
        let n = used.len();
        let mut steps = Steps::new(n.saturating_sub(1));
        for i in 0..n.saturating_sub(1) {
            steps.set(i, &self.step(|k| used[k], n, i, span_s));
        }
        Ok(steps)
    }

    /// Step `i` of the `n` samples `used(0), used(1), …`.
    fn step(&self, used: impl Fn(usize) -> usize, n: usize, i: usize, span_s: f64) -> Step {
        let (time_s, raw) = (self.time_s, self.raw);
        let step = StepWeights::at(time_s, used, n, i, self.model);
        let (moment0, moment1) = step.moments(|k| raw[k]);
        let (p, q) = (step.from, step.to);
        let middle_s = 0.5 * (time_s[p] + time_s[q]);
        Step {
            moment0,
            moment1,
            change: raw[q] - raw[p],
            h: step.h,
            fraction: (middle_s - self.range.anchor_before_s) / span_s,
        }
    }
}

impl PreparedMove {
    /// Number of integration steps.
    #[must_use]
    pub fn n_steps(&self) -> usize {
        self.steps.len()
    }

    /// Time between the anchors, s.
    #[must_use]
    pub fn span_s(&self) -> f64 {
        self.span_s
    }

    /// `∫ w' dt` over the move, raw unit · s: the rotation angle by the gyro where the axis of rotation is fixed.
    #[must_use]
    pub fn raw_angle(&self) -> Vector3<f64> {
        self.steps.raw_angle()
    }

    /// Integrated time, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps.duration_s()
    }

    /// Rotation and sensitivities for `ω = S w' + b`, `b` linear from `bias_before` to `bias_after`, rad/s.
    #[must_use]
    pub fn integrate(
        &self,
        scale: &Matrix3<f64>,
        bias_before: &Vector3<f64>,
        bias_after: &Vector3<f64>,
        noise: &RateNoise,
    ) -> Turn {
        self.integrate_with(
            Instructions::detect(),
            scale,
            bias_before,
            bias_after,
            noise,
        )
    }

    /// As [`integrate`](Self::integrate), with a chosen instruction set; results differ by rounding.
    #[must_use]
    pub fn integrate_with(
        &self,
        instructions: Instructions,
        scale: &Matrix3<f64>,
        bias_before: &Vector3<f64>,
        bias_after: &Vector3<f64>,
        noise: &RateNoise,
    ) -> Turn {
        let at = noise.beside(scale, bias_before, bias_after, self.span_s);
        self.steps.integrate(instructions, &at)
    }
}

impl RateNoise {
    /// The rate together with its noise.
    pub(super) fn beside(
        &self,
        scale: &Matrix3<f64>,
        bias_before: &Vector3<f64>,
        bias_after: &Vector3<f64>,
        span_s: f64,
    ) -> Rate {
        Rate {
            scale: *scale,
            bias: *bias_before,
            change: bias_after - bias_before,
            span_s,
            variance: self.density.component_mul(&self.density),
            var_time: self.sigma_time_s * self.sigma_time_s,
            gap_s: 1.5 * self.nominal_step_s,
        }
    }
}
