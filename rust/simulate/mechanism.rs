//! The moving parts and the readout of a sensor, stage by stage, three independent channels at a time.
//!
//! Every stage is input-referred: its small-signal gain is one and its output at zero input is zero, so that the linear
//! calibration of the instrument stays valid with any stages enabled.

use super::Sample;
use crate::error::{Error, Result};
use crate::simd::{Instructions, fma, for_each_instruction_set};
use nalgebra::Matrix2;
use rayon::prelude::*;

fn positive(name: &str, values: &Sample) -> Result<()> {
    if values.iter().all(|v| v.is_finite() && *v > 0.0) {
        Ok(())
    } else {
        Err(Error::bad_input(format!(
            "{name} must be three positive numbers, got {values:?}"
        )))
    }
}

/// Three exact recursions of a second-order low-pass `ω0²/(s² + (ω0/Q) s + ω0²)` driven by straight lines between
/// samples; it starts settled. It is a proof mass on its spring, and a section of an anti-alias filter.
///
/// # Errors
/// A step, frequency or quality that is not positive.
pub fn second_order(
    signal: &mut [Sample],
    dt: f64,
    frequency_hz: &Sample,
    quality: &Sample,
) -> Result<()> {
    positive("the frequency of a second-order stage", frequency_hz)?;
    positive("the quality of a second-order stage", quality)?;
    positive("the time step", &[dt; 3])?;
    let stages = [0, 1, 2].map(|k| {
        let w = std::f64::consts::TAU * frequency_hz[k];
        // State (x, v) in units where time runs in dt: d/dt (x, v) = A (x, v) + (0, w² u).
        let a = Matrix2::new(0.0, dt, -w * w * dt, -w / quality[k] * dt);
        // For u = p + s t the settled response is x = p + s (t - c), v = s, with c = 1/(Q w).
        (exponential(&a), 1.0 / (quality[k] * w))
    });
    let phi = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|at| stages.map(|(phi, _)| phi[at]));
    let lag = stages.map(|(_, lag)| lag);
    follow_ramps(Instructions::detect(), signal, 1.0 / dt, &phi, &lag);
    Ok(())
}

for_each_instruction_set! {
    /// The three channels side by side: independent, and each step depends on the last by a product and two sums only.
    fn follow_ramps(signal: &mut [Sample], per_s: f64, phi: &[Sample; 4], lag: &Sample) = follow_ramps_body
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn follow_ramps_body<const FUSED: bool>(
    signal: &mut [Sample],
    per_s: f64,
    phi: &[Sample; 4],
    lag: &Sample,
) {
    let Some(&first) = signal.first() else { return };
    let (mut before, mut slope) = (first, [0.0; 3]);
    // Deviation of (x, v) from the settled response to the current straight line of the signal.
    let (mut x, mut v) = ([0.0; 3], [0.0; 3]);
    for row in signal {
        for k in 0..3 {
            let now = row[k];
            let next = (now - before[k]) * per_s;
            let bend = next - slope[k];
            let (from_x, from_v) = (fma::<FUSED>(bend, lag[k], x[k]), v[k] - bend);
            x[k] = fma::<FUSED>(phi[0][k], from_x, phi[1][k] * from_v);
            v[k] = fma::<FUSED>(phi[2][k], from_x, phi[3][k] * from_v);
            row[k] = fma::<FUSED>(-next, lag[k], now) + x[k];
            before[k] = now;
            slope[k] = next;
        }
    }
}

/// Exponential of a 2×2 matrix by its eigenvalues' closed form.
fn exponential(a: &Matrix2<f64>) -> Matrix2<f64> {
    let mean = 0.5 * a.trace();
    let rest = a - Matrix2::identity() * mean;
    // rest² = d I, so exp(rest) = cosh√d I + sinh√d/√d rest.
    let d = -rest.determinant();
    let (c, s) = if d.abs() < 1e-12 {
        (1.0 + 0.5 * d, 1.0 + d / 6.0)
    } else if d > 0.0 {
        // A strongly damped stage: cosh and the decay together, as exp(mean) alone may underflow.
        let root = d.sqrt();
        let (up, down) = ((mean + root).exp(), (mean - root).exp());
        return Matrix2::identity() * (0.5 * (up + down)) + rest * (0.5 * (up - down) / root);
    } else {
        let root = (-d).sqrt();
        (root.cos(), root.sin() / root)
    };
    (Matrix2::identity() * c + rest * s) * mean.exp()
}

/// First-order low-pass of time constant `tau`, exact for straight lines between samples; starts settled.
///
/// # Errors
/// A time constant that is negative; zero leaves the channel unchanged.
pub fn first_order(signal: &mut [Sample], dt: f64, tau_s: &Sample) -> Result<()> {
    for tau in tau_s {
        if !(tau.is_finite() && *tau >= 0.0) {
            return Err(Error::bad_input(format!(
                "a time constant must not be negative, got {tau} s"
            )));
        }
    }
    let Some(&first) = signal.first() else {
        return Ok(());
    };
    // The settled response to a ramp lags it by tau.
    let keep = tau_s.map(|tau| (-dt / tau).exp());
    let (mut before, mut slope, mut away) = (first, [0.0; 3], [0.0; 3]);
    for row in signal {
        for k in 0..3 {
            if tau_s[k] == 0.0 {
                continue;
            }
            let now = row[k];
            let next = (now - before[k]) / dt;
            away[k] = keep[k] * (away[k] + (next - slope[k]) * tau_s[k]);
            row[k] = now - next * tau_s[k] + away[k];
            before[k] = now;
            slope[k] = next;
        }
    }
    Ok(())
}

/// Displacement and readout of a proof mass between two capacitor plates.
#[derive(Debug, Clone, Copy)]
pub struct Bridge {
    /// Displacement over gap per unit of input, `1/(ω0² x0)` for an accelerometer.
    pub deflection: Sample,
    /// Suspension: restoring force `k x0 (ξ + second ξ² + third ξ³)`.
    pub second: Sample,
    /// Cubic stiffness of the suspension.
    pub third: Sample,
    /// Relative difference of the plates' rest capacitances: `c1 = c0 (1+ε)/(1+ξ)`, `c2 = c0 (1-ε)/(1-ξ)`.
    pub mismatch: Sample,
}

impl Bridge {
    /// Displacement over gap at which the suspension balances a linear displacement `drive`.
    fn displacement(drive: f64, second: f64, third: f64) -> Option<f64> {
        let mut x = drive;
        for _ in 0..50 {
            let residual = x * (1.0 + x * (second + x * third)) - drive;
            let slope = 1.0 + x * (2.0 * second + 3.0 * x * third);
            let step = residual / slope;
            x -= step;
            if step.abs() <= 1e-16 * (1.0 + x.abs()) {
                return Some(x);
            }
        }
        None
    }

    /// Voltage ratio `c0/(c1+c0) - c0/(c2+c0)` from the two capacitances.
    #[must_use]
    pub fn voltage(x: f64, mismatch: f64) -> f64 {
        let c1 = (1.0 + mismatch) / (1.0 + x);
        let c2 = (1.0 - mismatch) / (1.0 - x);
        1.0 / (c1 + 1.0) - 1.0 / (c2 + 1.0)
    }

    /// Input-referred response: acceleration (or rate) in, a linear readout of the voltage out.
    ///
    /// # Errors
    /// When the mass would touch a plate.
    pub fn respond(&self, signal: &mut [Sample]) -> Result<()> {
        for k in 0..3 {
            let (d, e) = (self.deflection[k], self.mismatch[k]);
            if d == 0.0 {
                continue;
            }
            let rest = Self::voltage(0.0, e);
            // dV/dξ at rest, from c1' = -(1+ε), c2' = 1-ε.
            let slope = (1.0 + e) / (2.0 + e).powi(2) + (1.0 - e) / (2.0 - e).powi(2);
            for row in signal.iter_mut() {
                let touch = || {
                    Error::bad_input(format!(
                        "channel {} hits its stop at an input of {}: lower the deflection or the motion",
                        k + 1,
                        row[k]
                    ))
                };
                let x = Self::displacement(d * row[k], self.second[k], self.third[k])
                    .filter(|x| x.abs() < 1.0)
                    .ok_or_else(touch)?;
                row[k] = (Self::voltage(x, e) - rest) / (slope * d);
            }
        }
        Ok(())
    }
}

/// Play (backlash) operator: the output differs from the input by up to `offset`, the sign by the last direction.
///
/// `y` follows the input at distance at most `width`; output `input + offset (y - input)/width`.
///
/// # Errors
/// A width that is not positive where the offset is not zero.
pub fn play(signal: &mut [Sample], width: &Sample, offset: &Sample) -> Result<()> {
    for k in 0..3 {
        if offset[k] == 0.0 {
            continue;
        }
        let w = width[k];
        if !(w.is_finite() && w > 0.0) {
            return Err(Error::bad_input(format!(
                "hysteresis needs a positive width, got {w}"
            )));
        }
        // State before the recording: the follower is at the input.
        let mut y = signal.first().map_or(0.0, |row| row[k]);
        for row in signal.iter_mut() {
            // Not `clamp`, which panics where the signal is NaN.
            y = y.max(row[k] - w).min(row[k] + w);
            row[k] += offset[k] * (y - row[k]) / w;
        }
    }
    Ok(())
}

/// Creep of the die attach: a fraction of every change is delayed, with time constant `tau`.
///
/// # Errors
/// As [`first_order`].
pub fn creep(signal: &mut [Sample], dt: f64, fraction: &Sample, tau_s: &Sample) -> Result<()> {
    let mut slow = signal.to_vec();
    first_order(&mut slow, dt, tau_s)?;
    for (row, late) in signal.iter_mut().zip(&slow) {
        for k in 0..3 {
            row[k] += fraction[k] * (late[k] - row[k]);
        }
    }
    Ok(())
}

/// Components along three directions.
#[must_use]
pub fn project(signal: &[Sample], directions: &[Sample; 3]) -> Vec<Sample> {
    signal
        .par_iter()
        .with_min_len(1 << 14)
        .map(|x| directions.map(|d| d[0] * x[0] + d[1] * x[1] + d[2] * x[2]))
        .collect()
}

/// Specific force along each sensitive direction at each element's own place: `d·(f + α×r + ω×(ω×r))`.
#[must_use]
pub fn force_at_places(
    force: &[Sample],
    rate: &[Sample],
    rate_change: &[Sample],
    places: &[Sample; 3],
    directions: &[Sample; 3],
) -> Vec<Sample> {
    let cross = |a: &Sample, b: &Sample| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let mut out = Vec::with_capacity(force.len());
    for ((f, w), a) in force.iter().zip(rate).zip(rate_change) {
        let mut row = [0.0; 3];
        for k in 0..3 {
            let swing = cross(w, &cross(w, &places[k]));
            let angular = cross(a, &places[k]);
            for j in 0..3 {
                row[k] += directions[k][j] * (f[j] + angular[j] + swing[j]);
            }
        }
        out.push(row);
    }
    out
}
