//! A session at the strengths of its noise that make it likeliest (docs/model-session.md, 11.18).

use super::fit::{Fit, fit_from};
use super::hypothesis::Hypothesis;
use super::strength_search::Within;
use super::{Distortion, Session, State, Strengths};
use crate::error::Result;

/// Rounds of fit and strengths: each finds the other almost where it left it.
const MOST_ROUNDS: usize = 4;
/// Change of the logarithm of every strength below which another round changes no number by a tenth of its error, and gain
/// in log-evidence below which other strengths are not worth another fit.
const SETTLED: f64 = 0.25;
const WORTH_A_FIT: f64 = 0.1;

/// Fits a session and the strengths of its noise in turns, all unknowns integrated out where the strengths are judged.
///
/// # Errors
/// As [`fit`].
pub fn tune(
    session: &Session,
    start: State,
    strengths: Strengths,
    distortion: &Distortion,
    within: &Within,
) -> Result<Fit> {
    let mut found = fit_from(session, start, None, strengths, distortion, true)?;
    for round in 0..MOST_ROUNDS {
        let (best, gain) =
            Hypothesis::of(&found, &[], &[])?.likeliest(&[found.strengths], within)?;
        let moved = best.changed_from(&found.strengths);
        if round > 0 && gain < WORTH_A_FIT {
            break;
        }
        let passed = Some(found.passed);
        found = fit_from(session, found.state, passed, best, distortion, false)?;
        if round > 0 && moved < SETTLED {
            break;
        }
    }
    Ok(found)
}
