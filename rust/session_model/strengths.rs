//! A session at its most likely noise strengths (docs/model-session.md, 11.18).

use super::fit::{Extent, Fit, fit_from};
use super::hypothesis::Hypothesis;
use super::strength_search::Within;
use super::{Distortion, Session, State, Strengths};
use crate::error::Result;

/// Most rounds of fit and search: after the first, either hardly changes the other.
const MOST_ROUNDS: usize = 4;
/// Change of the logarithm of every strength below which another round changes no parameter by a tenth of its error,
/// and gain in log-evidence below which other strengths do not justify another fit.
const SETTLED: f64 = 0.25;
const WORTH_A_FIT: f64 = 0.1;

/// Fits a session and its noise strengths in turns, once if it is rough; the search for strengths integrates out all
/// unknowns.
///
/// # Errors
/// As [`fit`].
pub fn tune(
    session: &Session,
    start: State,
    strengths: Strengths,
    distortion: &Distortion,
    within: &Within,
    extent: Extent,
) -> Result<Fit> {
    let rough = Extent {
        is_rough: true,
        ..extent
    };
    let mut found = fit_from(session, start, None, strengths, distortion, rough)?;
    for round in 0..MOST_ROUNDS {
        let hypothesis = Hypothesis::of(&found, &[], &[])?;
        let (best, gain) = hypothesis.likeliest(&[found.strengths], within, true)?;
        let moved = best.changed_from(&found.strengths);
        if round > 0 && gain < WORTH_A_FIT {
            break;
        }
        let passed = Some(found.passed);
        found = fit_from(session, found.state, passed, best, distortion, extent)?;
        if extent.is_rough || (round > 0 && moved < SETTLED) {
            break;
        }
    }
    Ok(found)
}
