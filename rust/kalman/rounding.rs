//! Rounding error of an ADC in the mean of many readings.

use std::f64::consts::PI;

/// Variance of that part of the rounding error of an ADC of the given resolution (LSB) that averaging does not remove.
///
/// Rounding is a sawtooth of the input; noise of standard deviation `dither` before the ADC smooths it, so that
/// harmonic `m` of the mean error is reduced by `exp(−2π²m²σ²/Δ²)`: `Δ²/(2π²) Σ exp(−4π²m²σ²/Δ²)/m²`. Without dither
/// this is `Δ²/12`. Source: Widrow and Kollár, Quantization Noise (2008), chapter on dither.
#[must_use]
pub fn undithered_variance(resolution: f64, dither: f64) -> f64 {
    if resolution == 0.0 {
        return 0.0;
    }
    let ratio = 4.0 * (PI * dither / resolution).powi(2);
    if ratio < 1e-3 {
        // The sum converges slowly here; it is within 4 % of the value without dither.
        return resolution * resolution / 12.0;
    }
    let sum: f64 = (1..200)
        .map(|m| f64::from(m * m))
        .map(|m2| (-ratio * m2).exp() / m2)
        .sum();
    resolution * resolution / (2.0 * PI * PI) * sum
}
