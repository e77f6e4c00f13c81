//! A session at the strengths of its noise that make it likeliest (docs/model-session.md, 11.18).

use super::fit::{Fit, fit, fit_from};
use super::hypothesis::Hypothesis;
use super::strength_search::Within;
use super::{Distortion, Session, State, Strengths};
use crate::error::Result;

/// Rounds of fit and strengths: each finds the other almost where it left it.
const MOST_ROUNDS: usize = 4;
/// Change of the logarithm of every strength below which another round changes no number by a tenth of its error.
const SETTLED: f64 = 0.25;

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
    let mut found = fit(session, start, strengths, distortion)?;
    for round in 0..MOST_ROUNDS {
        let best =
            Hypothesis::of(&found, &[], &[])?.likeliest(&[found.strengths], within, round > 0)?;
        let moved = best.changed_from(&found.strengths);
        if moved == 0.0 {
            break;
        }
        found = fit_from(session, found.state, Some(found.passed), best, distortion)?;
        if moved < SETTLED {
            break;
        }
    }
    Ok(found)
}
