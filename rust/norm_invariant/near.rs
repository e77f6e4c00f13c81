//! The last steps of a fit to very many readings, from the result for a share of them.

use super::parameters::unpack;
use super::problem::{FixedNoise, PoseProblem};
use super::settled::{Found, Settled, direct, finish};
use super::{Fit, Parameters, Readings, Settings};
use crate::ellipsoid::Standardisation;
use crate::error::Result;
use crate::gauss_newton::{Local, Stop};

/// A fit to very many readings that starts from a share's result: so near that full steps suffice.
pub(super) struct Near<'a> {
    pub readings: Readings<'a>,
    pub settings: &'a Settings,
    pub standard: Standardisation,
    pub volume: f64,
}

/// Largest number of steps.
const NEAR_STEPS: usize = 6;
/// Relative length of a step after which the next would be rounding error: each is some hundred times shorter than the
/// one before.
const NEAR_STEP: f64 = 1e-7;
/// Largest length of a step relative to the one before.
const NEAR_SHRINKS: f64 = 0.1;

impl Near<'_> {
    /// The fit, σ renewed at every step; `None` where steps do not shrink and the damped solver is needed.
    pub(super) fn finished(
        &self,
        fixed: &mut FixedNoise,
        start: Parameters,
    ) -> Result<Option<Fit>> {
        let mut theta = start;
        let (mut before, mut equations) = (f64::INFINITY, None);
        for iterations in 1..=NEAR_STEPS {
            let problem = self.problem(fixed);
            let direct = direct(&problem, &theta);
            let Ok(found) = direct.equations(&theta, equations.as_ref()) else {
                return Ok(None);
            };
            let step = found.step(0.0)?;
            let length = found.length(&step);
            // NaN is no step either.
            if !(length < NEAR_SHRINKS * before || length < NEAR_STEP) {
                return Ok(None);
            }
            theta += Parameters::from_column_slice(step.as_slice());
            if length < NEAR_STEP {
                let settled = Settled {
                    theta,
                    stop: Stop::SmallStep,
                    iterations,
                    found: Found::Direct(Box::new(found)),
                };
                let mut fit = finish(&problem, &settled, iterations)?;
                fit.sigmas = std::mem::take(&mut fixed.sigma);
                return Ok(Some(fit));
            }
            (before, equations) = (length, Some(found));
            let model = unpack(&theta, self.settings.frame, &self.standard);
            fixed.renew(self.readings, self.settings, &model);
        }
        Ok(None)
    }

    fn problem<'b>(&'b self, fixed: &'b FixedNoise) -> PoseProblem<'b> {
        PoseProblem {
            readings: self.readings,
            settings: self.settings,
            standard: self.standard,
            fixed,
            volume: self.volume,
            anchor: None,
        }
    }
}
