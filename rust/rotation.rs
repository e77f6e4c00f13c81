//! Rotations by vectors: exponential, logarithm and their derivatives.
//!
//! Convention: `exp(v)` is the active rotation by angle `|v|` about `v`, so `exp(v) x` rotates `x`.

use nalgebra::{Matrix3, Vector3};

use crate::simd::{FUSED_BASELINE, fma};

/// The cross-product matrix `[v]x`, so that `skew(v) * x == v × x`.
#[must_use]
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Up to this squared angle (half a radian) seven terms of the Taylor series are exact to rounding; beyond it the
/// closed forms lose less than two digits.
pub(crate) const SERIES_LIMIT: f64 = 0.25;

/// Taylor coefficients in `θ²`, highest first: of `sin θ/θ`, `(1 − cos θ)/θ²` and `(θ − sin θ)/θ³`.
const SINE: [f64; 7] = [
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];
const COSINE: [f64; 7] = [
    1.0 / 87_178_291_200.0,
    -1.0 / 479_001_600.0,
    1.0 / 3_628_800.0,
    -1.0 / 40_320.0,
    1.0 / 720.0,
    -1.0 / 24.0,
    0.5,
];
const EXCESS: [f64; 7] = [
    1.0 / 1_307_674_368_000.0,
    -1.0 / 6_227_020_800.0,
    1.0 / 39_916_800.0,
    -1.0 / 362_880.0,
    1.0 / 5040.0,
    -1.0 / 120.0,
    1.0 / 6.0,
];

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "loops compiled per instruction set call it"
)]
fn horner<const FUSED: bool>(coefficients: &[f64; 7], x: f64) -> f64 {
    let mut sum = coefficients[0];
    for c in &coefficients[1..] {
        sum = fma::<FUSED>(sum, x, *c);
    }
    sum
}

/// [`series`] for squared angles up to [`SERIES_LIMIT`].
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "loops compiled per instruction set call it"
)]
pub(crate) fn short_series<const FUSED: bool>(theta2: f64) -> (f64, f64, f64) {
    (
        horner::<FUSED>(&SINE, theta2),
        horner::<FUSED>(&COSINE, theta2),
        horner::<FUSED>(&EXCESS, theta2),
    )
}

/// `(sin θ/θ, (1 − cos θ)/θ², (θ − sin θ)/θ³)` with Taylor series up to half a radian.
pub(crate) fn series(theta2: f64) -> (f64, f64, f64) {
    if theta2 <= SERIES_LIMIT {
        short_series::<FUSED_BASELINE>(theta2)
    } else {
        let theta = theta2.sqrt();
        let half = (0.5 * theta).sin();
        (
            theta.sin() / theta,
            2.0 * half * half / theta2,
            (theta - theta.sin()) / (theta2 * theta),
        )
    }
}

/// Rotation matrix of a rotation vector (Rodrigues), exact for any angle.
#[must_use]
pub fn exp(v: &Vector3<f64>) -> Matrix3<f64> {
    let (a, b, _) = series(v.norm_squared());
    let k = skew(v);
    Matrix3::identity() + k * a + k * k * b
}

/// [`exp`] of a vector and its left Jacobian, `exp(v + δ) ≈ exp(J δ) exp(v)`, from one series.
#[must_use]
pub fn exp_and_left_jacobian(v: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let (a, b, c) = series(v.norm_squared());
    let k = skew(v);
    let k2 = k * k;
    (
        Matrix3::identity() + k * a + k2 * b,
        Matrix3::identity() + k * b + k2 * c,
    )
}

/// Rotation vector (angle in `[0, π]`) of a rotation matrix; robust at zero and at π.
#[must_use]
pub fn log(r: &Matrix3<f64>) -> Vector3<f64> {
    // Through the unit quaternion: Shepperd's choice of the largest component keeps every angle well conditioned.
    let t = r.trace();
    let d = [t, r[(0, 0)], r[(1, 1)], r[(2, 2)]];
    let mut largest = 0;
    for i in 1..4 {
        if d[i] > d[largest] {
            largest = i;
        }
    }
    let mut q = [0.0; 4];
    q[largest] = 0.5 * (1.0 + 2.0 * d[largest] - t).max(0.0).sqrt();
    if largest == 0 {
        let s = 0.25 / q[0];
        q[1] = (r[(2, 1)] - r[(1, 2)]) * s;
        q[2] = (r[(0, 2)] - r[(2, 0)]) * s;
        q[3] = (r[(1, 0)] - r[(0, 1)]) * s;
    } else {
        let i = largest - 1;
        let j = (i + 1) % 3;
        let k = (i + 2) % 3;
        let s = 0.25 / q[largest];
        q[0] = (r[(k, j)] - r[(j, k)]) * s;
        q[1 + j] = (r[(j, i)] + r[(i, j)]) * s;
        q[1 + k] = (r[(k, i)] + r[(i, k)]) * s;
    }
    if q[0] < 0.0 {
        q = q.map(|c| -c);
    }
    let v = Vector3::new(q[1], q[2], q[3]);
    let n = v.norm();
    if n < 1e-8 {
        v * 2.0
    } else {
        v * (2.0 * n.atan2(q[0]) / n)
    }
}
