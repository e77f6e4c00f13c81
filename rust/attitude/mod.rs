//! Attitude from rates in rad/s: `R' = R [ω]×`, a chain of exact rotations, at memory bandwidth.
//!
//! `R` takes a vector from the body frame at a sample to the body frame at the first one (or to the frame of the
//! attitude given for it); it is the transpose of the `B` of [`crate::poisson`], and each step is the same: the
//! rotation vector `φ = φ₀ + φ₀ × φ₁` from the moments of the rate over the step (equation 5.4 of
//! docs/model-gyroscope.md). Unit quaternions `w x y z` are multiplied, a stretch of the log in every lane of a vector;
//! long logs are cut into pieces of fixed size for the threads, so that the result does not depend on their number.

mod tile;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::poisson::RateModel;
use crate::simd::Instructions;
use tile::{Start, Tile};

/// `w x y z`, of unit length.
pub type Quaternion = [f64; 4];

/// The identity rotation.
pub const IDENTITY: Quaternion = [1.0, 0.0, 0.0, 0.0];

/// Representation of an attitude in the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Nine numbers, row by row.
    Matrix,
    /// `x y z w`.
    Quaternion,
    /// Three numbers: axis times angle, up to π.
    Vector,
}

impl Form {
    /// Numbers per attitude.
    #[must_use]
    pub fn width(self) -> usize {
        match self {
            Self::Matrix => 9,
            Self::Quaternion => 4,
            Self::Vector => 3,
        }
    }
}

/// Steps per piece: long enough for a thread, short enough for its share of the caches.
const PIECE: usize = 1 << 15;

/// Samples to be integrated.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    time_s: &'a [f64],
    rate: &'a [[f64; 3]],
    model: RateModel,
    instructions: Instructions,
}

impl<'a> Samples<'a> {
    /// Rates in rad/s at instants in s; timestamps may repeat (no rotation in between), not run backward.
    ///
    /// # Errors
    /// When there are none, or not as many rates as instants.
    pub fn new(time_s: &'a [f64], rate: &'a [[f64; 3]], model: RateModel) -> Result<Self> {
        if time_s.len() != rate.len() || time_s.is_empty() {
            return Err(Error::bad_input(format!(
                "time has {} samples and rate has {}: they must be equally long, one sample at least",
                time_s.len(),
                rate.len()
            )));
        }
        Ok(Self {
            time_s,
            rate,
            model,
            instructions: Instructions::detect(),
        })
    }

    fn n_steps(&self) -> usize {
        self.time_s.len() - 1
    }

    /// The rotation from the first sample to the last.
    ///
    /// # Errors
    /// Naming the first sample that is not finite or goes back in time.
    pub fn last(&self) -> Result<Quaternion> {
        let parts: Vec<Quaternion> = self
            .pieces()
            .into_par_iter()
            .map(|(first, stop)| self.rotation_over(first, stop))
            .collect::<Result<_>>()?;
        Ok(parts.into_iter().fold(IDENTITY, tile::product))
    }

    /// The attitude at the last sample, the first being `initial`.
    ///
    /// # Errors
    /// As [`last`](Self::last).
    pub fn last_from(&self, initial: Quaternion, form: Form) -> Result<Vec<f64>> {
        let mut out = vec![0.0; form.width()];
        tile::write_one(form, tile::product(initial, self.last()?), &mut out);
        Ok(out)
    }

    /// The attitude at every sample, `width` numbers each, the first being `initial`.
    ///
    /// # Errors
    /// As [`last`](Self::last), and when `out` is not as long as all attitudes together.
    pub fn all(&self, initial: Quaternion, form: Form, out: &mut [f64]) -> Result<()> {
        let width = form.width();
        if out.len() != width * self.time_s.len() {
            return Err(Error::bad_input(format!(
                "{} numbers cannot hold {} attitudes of {width}",
                out.len(),
                self.time_s.len()
            )));
        }
        let (first, out) = out.split_at_mut(width);
        tile::write_one(form, initial, first);
        let pieces = self.pieces();
        if pieces.len() < 4 || rayon::current_num_threads() < 2 {
            let mut start = initial;
            for (&(first, stop), out) in pieces.iter().zip(out.chunks_mut(width * PIECE)) {
                start = tile::product(start, self.write(first, stop, start, form, out)?);
            }
            return Ok(());
        }
        // Two passes over the steps: the attitude where a piece starts needs the rotations over all pieces before it.
        let turns: Vec<Quaternion> = pieces
            .par_iter()
            .map(|&(first, stop)| self.rotation_over(first, stop))
            .collect::<Result<_>>()?;
        let starts: Vec<Quaternion> = turns
            .iter()
            .scan(initial, |start, &turn| {
                let here = *start;
                *start = tile::product(here, turn);
                Some(here)
            })
            .collect();
        pieces
            .par_iter()
            .zip(starts)
            .zip(out.par_chunks_mut(width * PIECE))
            .try_for_each(|((&(first, stop), start), out)| {
                self.write(first, stop, start, form, out).map(|_| ())
            })
    }

    fn pieces(&self) -> Vec<(usize, usize)> {
        let n = self.n_steps();
        (0..n)
            .step_by(PIECE)
            .map(|first| (first, (first + PIECE).min(n)))
            .collect()
    }

    fn rotation_over(&self, first: usize, stop: usize) -> Result<Quaternion> {
        let mut tile = Tile::boxed();
        let mut turned = IDENTITY;
        for at in (first..stop).step_by(Tile::STEPS) {
            turned = tile
                .turn(self, at, stop, turned)
                .map_err(|step| self.blame(step))?;
        }
        Ok(turned)
    }

    fn write(
        &self,
        first: usize,
        stop: usize,
        start: Quaternion,
        form: Form,
        out: &mut [f64],
    ) -> Result<Quaternion> {
        let mut tile = Tile::boxed();
        let mut turned = IDENTITY;
        for at in (first..stop).step_by(Tile::STEPS) {
            let out = &mut out[form.width() * (at - first)..];
            turned = tile
                .write(self, at, stop, Start { turned, start }, form, out)
                .map_err(|step| self.blame(step))?;
        }
        Ok(turned)
    }

    /// Error that names the invalid sample near a step.
    fn blame(&self, step: usize) -> Error {
        let reach = step.saturating_sub(2)..(step + 4).min(self.time_s.len());
        for k in reach {
            if !self.time_s[k].is_finite() {
                return Error::bad_input(format!("the time of sample {k} is not a number"));
            }
            if self.rate[k].iter().any(|w| !w.is_finite()) {
                return Error::bad_input(format!(
                    "the rate of sample {k} is not finite: leave the sample out, or fill the gap"
                ));
            }
            if k > 0 && self.time_s[k] < self.time_s[k - 1] {
                return Error::bad_input(format!(
                    "time runs backward at sample {k}: sort the samples first"
                ));
            }
        }
        Error::bad_input(format!(
            "the rotation from sample {step} to the next is too large to be a number"
        ))
    }
}
