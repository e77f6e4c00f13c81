//! The five noise terms of one axis with exact discrete statistics.
//!
//! `Q/dt` times the first difference of white noise; `N/√dt` white; a walk of increments `K√dt` from zero; a ramp
//! `R t`; and `B` with a true 1/f spectrum, as a sum of Gauss-Markov processes whose poles are spread evenly over the
//! logarithm of frequency from far below one over the record to the sampling frequency.

use super::random::Stream;
use crate::error::{Error, Result};
use crate::interrupt;
use rayon::prelude::*;

/// Coefficients of one axis \[unit·s, unit·√s, unit, unit/√s, unit/s\].
#[derive(Debug, Clone, Copy, Default)]
pub struct Terms {
    /// Quantisation.
    pub quantisation: f64,
    /// White noise (random walk of the integral).
    pub white: f64,
    /// Bias instability: two-sided PSD `B²/(2πf)`.
    pub flicker: f64,
    /// Rate random walk.
    pub walk: f64,
    /// Ramp.
    pub ramp: f64,
}

/// Random-number keys of the four random terms of one axis.
#[derive(Debug, Clone, Copy)]
pub struct Keys {
    /// Of the quantisation term.
    pub quantisation: u64,
    /// Of the white term.
    pub white: u64,
    /// Of the flicker term.
    pub flicker: u64,
    /// Of the walk.
    pub walk: u64,
}

/// Ratio of neighbouring poles. The ripple of the spectrum is 4 exp(-π²/ln r): 0.3 % for r = 4.
const POLE_RATIO: f64 = 4.0;
/// The lowest pole lies this far below one cycle over the whole record.
const BELOW_RECORD: f64 = 16.0;
/// Highest pole \[rad per sample\].
const TOP_POLE: f64 = 3.0;
/// Weights of the highest three poles: they compensate the poles missing above them and aliasing, by least squares on
/// the exact Allan variance of B²/ω at 1 to 32 samples, which they keep to 2 % at two samples and 1 % elsewhere.
const TOP_WEIGHTS: [f64; 3] = [0.336, 1.243, 0.945];

/// Poles \[rad/s\], highest first, and the variance of each process for a unit `B`.
#[must_use]
pub fn flicker_poles(n: usize, dt: f64) -> Vec<(f64, f64)> {
    let lowest = std::f64::consts::TAU / (n as f64 * dt * BELOW_RECORD);
    // Σ_j 2 s² ω_j/(ω_j² + ω²) → π s²/(ω ln r), which must equal B²/ω.
    let variance = POLE_RATIO.ln() / std::f64::consts::PI;
    let mut poles = Vec::new();
    let mut pole = TOP_POLE / dt;
    loop {
        let weight = TOP_WEIGHTS.get(poles.len()).copied().unwrap_or(1.0);
        poles.push((pole, weight * variance));
        if pole <= lowest && poles.len() >= TOP_WEIGHTS.len() {
            return poles;
        }
        pole /= POLE_RATIO;
    }
}

/// One Gauss-Markov process, stationary from its first sample.
///
/// A process much slower than the sampling is drawn exactly at every `hold`-th sample and interpolated linearly: the
/// error lies where it contributes less than 0.6 % of the sum's spectrum.
struct GaussMarkov {
    stream: Stream,
    keep: f64,
    kick: f64,
    hold: u32,
    left: u32,
    value: f64,
    next: f64,
    slope: f64,
}

impl GaussMarkov {
    /// `pole` in rad per sample.
    fn new(pole: f64, size: f64, key: u64) -> Self {
        let mut hold = 1_u32;
        while f64::from(hold) * pole < 1.0 / 128.0 && hold < 1 << 24 {
            hold *= 2;
        }
        let mut stream = Stream::new(key);
        let step = pole * f64::from(hold);
        Self {
            next: size * stream.normal(),
            stream,
            keep: (-step).exp(),
            kick: size * (-(-2.0 * step).exp_m1()).sqrt(),
            hold,
            left: 0,
            value: 0.0,
            slope: 0.0,
        }
    }

    fn add(&mut self, out: &mut [f64]) {
        if self.hold == 1 {
            for x in out {
                *x += self.next;
                self.next = self.keep * self.next + self.kick * self.stream.normal();
            }
            return;
        }
        for x in out {
            if self.left == 0 {
                self.left = self.hold;
                self.value = self.next;
                self.next = self.keep * self.value + self.kick * self.stream.normal();
                self.slope = (self.next - self.value) / f64::from(self.hold);
            }
            *x += self.value;
            self.value += self.slope;
            self.left -= 1;
        }
    }
}

/// Noise of one axis added to `out`, at step `dt`.
pub fn add(out: &mut [f64], dt: f64, terms: &Terms, keys: &Keys) {
    let n = out.len();
    if terms.white > 0.0 {
        let mut stream = Stream::new(keys.white);
        let size = terms.white / dt.sqrt();
        for block in blocks(out) {
            for x in block {
                *x += size * stream.normal();
            }
        }
    }
    if terms.quantisation > 0.0 {
        let mut stream = Stream::new(keys.quantisation);
        let size = terms.quantisation / dt;
        let mut last = stream.normal();
        for block in blocks(out) {
            for x in block {
                let next = stream.normal();
                *x += size * (next - last);
                last = next;
            }
        }
    }
    if terms.walk > 0.0 {
        let mut stream = Stream::new(keys.walk);
        let size = terms.walk * dt.sqrt();
        let mut sum = 0.0;
        for block in blocks(out) {
            for x in block {
                *x += sum;
                sum += size * stream.normal();
            }
        }
    }
    if terms.flicker > 0.0 {
        let mut stream = Stream::new(keys.flicker);
        let mut processes: Vec<GaussMarkov> = flicker_poles(n, dt)
            .into_iter()
            .map(|(pole, variance)| {
                GaussMarkov::new(pole * dt, terms.flicker * variance.sqrt(), stream.bits())
            })
            .collect();
        // A chunk stays in the nearest cache while every process passes over it.
        for chunk in out.chunks_mut(2048) {
            if interrupt::is_requested() {
                return;
            }
            for process in &mut processes {
                process.add(chunk);
            }
        }
    }
    if terms.ramp != 0.0 {
        for (i, x) in out.iter_mut().enumerate() {
            *x += terms.ramp * dt * i as f64;
        }
    }
}

/// Blocks of work, until an interrupt is requested.
fn blocks(out: &mut [f64]) -> impl Iterator<Item = &mut [f64]> {
    out.chunks_mut(1 << 16)
        .take_while(|_| !interrupt::is_requested())
}

/// Time steps that a recording can have [s]: outside, the number of flicker processes would be unbounded.
const STEPS_S: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// Noise of three axes, `n` samples, interleaved.
///
/// # Errors
/// `BadInput` for a step outside these bounds, or a term that is not finite.
pub fn three_axes(n: usize, dt: f64, terms: &[Terms; 3], keys: &[Keys; 3]) -> Result<Vec<f64>> {
    if !STEPS_S.contains(&dt) {
        return Err(Error::bad_input(format!(
            "the step of time must lie between 1e-9 s and 1e9 s, got {dt} s"
        )));
    }
    for t in terms {
        let sizes = [t.white, t.quantisation, t.walk, t.flicker, t.ramp];
        if let Some(bad) = sizes.iter().find(|v| !v.is_finite()) {
            return Err(Error::bad_input(format!(
                "the size of a noise term must be a finite number, got {bad}"
            )));
        }
    }
    let axes: Vec<Vec<f64>> = (0..3usize)
        .into_par_iter()
        .map(|k| {
            let mut axis = vec![0.0; n];
            add(&mut axis, dt, &terms[k], &keys[k]);
            axis
        })
        .collect();
    let mut out = vec![0.0; 3 * n];
    out.par_chunks_exact_mut(3)
        .enumerate()
        .with_min_len(1 << 14)
        .for_each(|(i, row)| {
            for k in 0..3 {
                row[k] = axes[k][i];
            }
        });
    Ok(out)
}
