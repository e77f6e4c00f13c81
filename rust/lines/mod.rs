//! Spectral lines inside static poses: of one pose, whose mean they move, and of all poses of a session.

pub mod pose;
pub mod session;

use std::f64::consts::TAU;

use realfft::RealFftPlanner;

use crate::running::running_median;

/// Hann's window of `n` samples.
fn window(n: usize) -> Vec<f64> {
    let last = n.saturating_sub(1).max(1) as f64;
    (0..n)
        .map(|k| 0.5 - 0.5 * (TAU * k as f64 / last).cos())
        .collect()
}

/// Power of windowed values at the frequencies `0, 1/n, ...` up to a half.
fn power(values: &[f64], window: &[f64]) -> Vec<f64> {
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(values.len());
    let mut tapered: Vec<f64> = values
        .iter()
        .zip(window)
        .map(|(value, weight)| value * weight)
        .collect();
    let mut spectrum = transform.make_output_vec();
    // It fails on wrong lengths only, and these are the transform's own.
    let _ = transform.process(&mut tapered, &mut spectrum);
    spectrum
        .iter()
        .map(realfft::num_complex::Complex::norm_sqr)
        .collect()
}

/// Running median of a spectrum, mirrored about its first and last frequency.
fn smooth(power: &[f64], width: usize) -> Vec<f64> {
    let (n, half) = (power.len(), width / 2);
    if n <= half {
        return running_median(power, width);
    }
    let before = power[1..=half].iter().rev();
    let after = power[n - 1 - half..n - 1].iter().rev();
    let padded: Vec<f64> = before.chain(power).chain(after).copied().collect();
    running_median(&padded, width)[half..half + n].to_vec()
}
