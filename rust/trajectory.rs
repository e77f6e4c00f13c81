//! Attitude through moves: the rotation since the move began, at every sample.
//!
//! One exact exponential per interval of a rate that is linear between its two samples; the second Magnus term
//! `dt²/12 ω₀×ω₁` is the coning correction of that model.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::rotation::exp;

/// A half-open range of samples.
pub type Range = (usize, usize);

/// `C(t)` of `C' = −[ω]× C`, `C(start) = I`, at every sample of every range, one after another.
///
/// # Errors
/// When a range is empty or leaves the recording.
pub fn attitude_in_moves(
    time_s: &[f64],
    rate: &[Vector3<f64>],
    moves: &[Range],
) -> Result<Vec<Matrix3<f64>>> {
    if time_s.len() != rate.len() {
        return Err(Error::bad_input(format!(
            "time has {} samples and rate has {}: they must be equally long",
            time_s.len(),
            rate.len()
        )));
    }
    if let Some(&(start, stop)) = moves
        .iter()
        .find(|&&(start, stop)| start >= stop || stop > rate.len())
    {
        return Err(Error::bad_input(format!(
            "move {start}..{stop} is not a range inside a recording of {} samples",
            rate.len()
        )));
    }
    let per_move: Vec<Vec<Matrix3<f64>>> = moves
        .par_iter()
        .map(|&(start, stop)| {
            let mut attitude = Matrix3::identity();
            let mut out = Vec::with_capacity(stop - start);
            out.push(attitude);
            for k in start..stop - 1 {
                let dt = time_s[k + 1] - time_s[k];
                let turn = (rate[k] + rate[k + 1]) * (0.5 * dt)
                    + rate[k].cross(&rate[k + 1]) * (dt * dt / 12.0);
                attitude = exp(&-turn) * attitude;
                out.push(attitude);
            }
            out
        })
        .collect();
    Ok(per_move.concat())
}
