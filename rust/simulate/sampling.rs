//! Sampling and conversion: reading a finely computed signal at the instants of a real clock, and the ADC.

use super::Sample;
use crate::error::{Error, Result};
use rayon::prelude::*;

/// Values of a uniformly sampled signal at any instants, by the cubic through four neighbours.
///
/// # Errors
/// Fewer than four samples, or an instant outside the signal.
pub fn resample(signal: &[Sample], start: f64, dt: f64, times: &[f64]) -> Result<Vec<Sample>> {
    let n = signal.len();
    if n < 4 {
        return Err(Error::bad_input("resampling needs at least four samples"));
    }
    let last = (n - 1) as f64;
    times
        .par_iter()
        .with_min_len(1 << 14)
        .map(|&t| {
            let place = (t - start) / dt;
            if !(-1e-6..=last + 1e-6).contains(&place) {
                return Err(Error::bad_input(format!(
                    "a sample at {t} s lies outside the computed signal"
                )));
            }
            // Truncation is the floor: place is not negative here.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let i = (place.max(0.0) as usize).clamp(1, n - 3);
            let x = place - i as f64;
            let weights = [
                -x * (x - 1.0) * (x - 2.0) / 6.0,
                (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0,
                -(x + 1.0) * x * (x - 2.0) / 2.0,
                (x + 1.0) * x * (x - 1.0) / 6.0,
            ];
            let mut out = [0.0; 3];
            for k in 0..3 {
                for j in 0..4 {
                    out[k] += weights[j] * signal[i + j - 1][k];
                }
            }
            Ok(out)
        })
        .collect()
}

/// Analog-to-digital adc, raw units.
#[derive(Debug, Clone)]
pub struct Adc {
    /// Resolution (LSB); 0 leaves the value as it is.
    pub lsb: f64,
    /// Lowest code.
    pub low: f64,
    /// Highest code.
    pub high: f64,
    /// Half-width of the dead band around `bias`: readings inside come out as `bias`.
    pub dead_band: f64,
    /// Reading of each channel at zero input.
    pub bias: Sample,
    /// Period of the missing codes, each replaced by the one below; 0: none is missing.
    pub missing_every: u32,
}

impl Adc {
    /// Convert in place: dead band, range, rounding to the nearest code, missing codes.
    ///
    /// # Errors
    /// A negative step or dead band, or a range that is empty.
    pub fn convert(&self, signal: &mut [Sample]) -> Result<()> {
        // Written so that a NaN fails each of them: clamping to a NaN would be a panic.
        let is_sound = self.lsb >= 0.0 && self.dead_band >= 0.0 && self.low < self.high;
        if !is_sound || self.missing_every == 1 {
            return Err(Error::bad_input(format!(
                "the ADC is malformed: step {}, range {} to {}, dead band {}, one code missing in {}",
                self.lsb, self.low, self.high, self.dead_band, self.missing_every
            )));
        }
        let every = f64::from(self.missing_every);
        signal.par_iter_mut().with_min_len(1 << 14).for_each(|row| {
            for k in 0..3 {
                let mut value = row[k];
                if (value - self.bias[k]).abs() < self.dead_band {
                    value = self.bias[k];
                }
                value = value.clamp(self.low, self.high);
                if self.lsb > 0.0 {
                    let mut code = (value / self.lsb).round();
                    if self.missing_every > 0 && code.rem_euclid(every) == 0.0 {
                        code = (code - 1.0).max((self.low / self.lsb).ceil());
                    }
                    value = code * self.lsb;
                }
                row[k] = value;
            }
        });
        Ok(())
    }
}
