//! A move reduced to moments of its raw readings, and integrated as often as wanted.

use nalgebra::{Matrix3, Vector3};

use super::lanes::{LANES, REACH, Rate, Step, Steps};
use super::{MoveRange, RateModel, RateNoise, StepWeights, Turn};
use crate::error::{Error, Result};
use crate::simd::Instructions;

/// A move prepared for repeated integration: the moments of its raw readings.
#[derive(Debug, Clone, Default)]
pub struct PreparedMove {
    steps: Steps,
    span_s: f64,
}

/// Reduces the samples of a move to moments; non-finite rows and repeated stamps are bridged.
///
/// `var_extra`, as long as `raw` where given, is the variance of single readings beyond the rate noise: readings that
/// were reconstructed where the gyro met its limit.
///
/// # Errors
/// When the range leaves the record, the anchors coincide or time runs backward.
pub fn prepare(
    time_s: &[f64],
    raw: &[Vector3<f64>],
    var_extra: Option<&[Vector3<f64>]>,
    range: &MoveRange,
    model: RateModel,
) -> Result<PreparedMove> {
    let mut out = PreparedMove::default();
    out.prepare(time_s, raw, var_extra, range, model)?;
    Ok(out)
}

/// Samples of a move that are numbers, of rising time: all of them, nearly always.
enum Used {
    All { first: usize, n: usize },
    Some(Vec<usize>),
}

impl Used {
    /// # Errors
    /// When time runs backward.
    fn of(time_s: &[f64], raw: &[Vector3<f64>], range: &MoveRange) -> Result<Self> {
        let is_number = |k: usize| raw[k].iter().all(|x| x.is_finite()) && time_s[k].is_finite();
        let mut stamps = time_s[range.start..range.stop].windows(2);
        if stamps.all(|pair| pair[0] < pair[1]) && (range.start..range.stop).all(is_number) {
            return Ok(Self::All {
                first: range.start,
                n: range.stop - range.start,
            });
        }
        let mut used: Vec<usize> = Vec::with_capacity(range.stop - range.start);
        for k in (range.start..range.stop).filter(|&k| is_number(k)) {
            if let Some(&last) = used.last() {
                if time_s[k] < time_s[last] {
                    return Err(Error::bad_input(format!(
                        "time runs backward at sample {k}: sort the record first"
                    )));
                }
                if time_s[k] <= time_s[last] {
                    continue;
                }
            }
            used.push(k);
        }
        Ok(Self::Some(used))
    }

    fn len(&self) -> usize {
        match self {
            Self::All { n, .. } => *n,
            Self::Some(used) => used.len(),
        }
    }

    fn at(&self, i: usize) -> usize {
        match self {
            Self::All { first, .. } => first + i,
            Self::Some(used) => used[i],
        }
    }
}

impl PreparedMove {
    /// As [`prepare`], in the memory of a move that is done with.
    pub(super) fn prepare(
        &mut self,
        time_s: &[f64],
        raw: &[Vector3<f64>],
        var_extra: Option<&[Vector3<f64>]>,
        range: &MoveRange,
        model: RateModel,
    ) -> Result<()> {
        if var_extra.is_some_and(|var| var.len() != raw.len()) {
            return Err(Error::bad_input(
                "the extra variance must have one row per reading",
            ));
        }
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
        self.span_s = span_s;
        let used = Used::of(time_s, raw, range)?;
        let n = used.len();
        self.steps.reset(n.saturating_sub(1));
        let mut i = 0;
        while i + 1 < n {
            let mut stop = i + 1;
            // Steps with a neighbour on both sides, nearly always as even as a cubic wants them.
            if let Used::All { first, .. } = used
                && model == RateModel::Coning
                && i > 0
                && i + REACH <= n + 1
            {
                let p = first + i;
                if let (Some(time_s), Some(raw)) =
                    (time_s[p - 1..].first_chunk(), raw[p - 1..].first_chunk())
                {
                    let var = var_extra.map(|var| &var[p..]);
                    let anchors = (range.anchor_before_s, span_s);
                    if self.steps.set_cubics(i, time_s, raw, var, anchors) {
                        i += LANES;
                        continue;
                    }
                }
                stop = i + LANES;
            }
            while i < stop {
                let step = StepWeights::at(time_s, |k| used.at(k), n, i, model);
                let (moment0, moment1) = step.moments(|k| raw[k]);
                let (p, q) = (step.from, step.to);
                let middle_s = 0.5 * (time_s[p] + time_s[q]);
                let step = Step {
                    moment0,
                    moment1,
                    change: raw[q] - raw[p],
                    h: step.h,
                    fraction: (middle_s - range.anchor_before_s) / span_s,
                    var_extra: var_extra.map_or_else(Vector3::zeros, |var| var[p]),
                };
                self.steps.set(i, &step);
                i += 1;
            }
        }
        Ok(())
    }

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

    /// `∫ w' dt` over the move, raw unit · s: the turn as the gyro saw it when its axis stays fixed.
    #[must_use]
    pub fn raw_angle(&self) -> Vector3<f64> {
        self.steps.raw_angle()
    }

    /// Integrated time, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps.duration_s()
    }

    /// Rotation and sensitivities for `ω = S w' + b`, `b` from `bias_before` to `bias_after` (rad/s) between the anchors.
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

    /// As [`integrate`](Self::integrate), by instructions of the caller's choice; the results differ by rounding.
    #[must_use]
    pub fn integrate_with(
        &self,
        instructions: Instructions,
        scale: &Matrix3<f64>,
        bias_before: &Vector3<f64>,
        bias_after: &Vector3<f64>,
        noise: &RateNoise,
    ) -> Turn {
        let at = Rate {
            scale: *scale,
            bias: *bias_before,
            change: bias_after - bias_before,
            span_s: self.span_s,
            variance: noise.density.component_mul(&noise.density),
            var_time: noise.sigma_time_s * noise.sigma_time_s,
            gap_s: 1.5 * noise.nominal_step_s,
        };
        self.steps.integrate(instructions, &at)
    }
}
