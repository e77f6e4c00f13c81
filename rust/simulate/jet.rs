//! Functions of time carried with their first two derivatives, so that rate and acceleration are exact.

use nalgebra::Vector3;
use std::ops::{Add, Mul, Neg, Sub};

/// A value with its first and second time derivative.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jet {
    /// Value.
    pub v: f64,
    /// First derivative.
    pub d: f64,
    /// Second derivative.
    pub dd: f64,
}

impl Jet {
    /// A constant.
    #[must_use]
    pub fn constant(v: f64) -> Self {
        Self { v, d: 0.0, dd: 0.0 }
    }

    /// `f(self)` by the chain rule, from `f`, `f'`, `f''` at the value.
    #[must_use]
    pub fn chain(self, f: f64, f1: f64, f2: f64) -> Self {
        Self {
            v: f,
            d: f1 * self.d,
            dd: f2 * self.d * self.d + f1 * self.dd,
        }
    }

    /// Sine and cosine.
    #[must_use]
    pub fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.v.sin_cos();
        (self.chain(s, c, -s), self.chain(c, -s, -c))
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            v: self.v + o.v,
            d: self.d + o.d,
            dd: self.dd + o.dd,
        }
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + (-o)
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self {
            v: self.v * o.v,
            d: self.d * o.v + self.v * o.d,
            dd: self.dd * o.v + 2.0 * self.d * o.d + self.v * o.dd,
        }
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, k: f64) -> Self {
        Self {
            v: self.v * k,
            d: self.d * k,
            dd: self.dd * k,
        }
    }
}

/// A unit quaternion (w, x, y, z) that rotates body coordinates to level ones, with its derivatives.
#[derive(Debug, Clone, Copy)]
pub struct QuaternionJet(pub [Jet; 4]);

impl QuaternionJet {
    /// A constant attitude.
    #[must_use]
    pub fn constant(q: &[f64; 4]) -> Self {
        Self(q.map(Jet::constant))
    }

    /// Rotation about a constant unit axis by a time-dependent angle.
    #[must_use]
    pub fn about(axis: &Vector3<f64>, angle: Jet) -> Self {
        let (s, c) = (angle * 0.5).sin_cos();
        Self([c, s * axis.x, s * axis.y, s * axis.z])
    }

    /// Exponential of a time-dependent rotation vector.
    #[must_use]
    pub fn exp(u: &[Jet; 3]) -> Self {
        let s = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
        // cos(√s/2) and sin(√s/2)/√s are entire functions of s; c' = -k/4.
        let (k, k1, k2) = half_sine_over_angle(s.v);
        let c = (0.5 * s.v.sqrt()).cos();
        let cosine = s.chain(c, -0.25 * k, -0.25 * k1);
        let scale = s.chain(k, k1, k2);
        Self([cosine, scale * u[0], scale * u[1], scale * u[2]])
    }

    /// Hamilton product.
    #[must_use]
    pub fn times(&self, o: &Self) -> Self {
        let [a, b, c, d] = self.0;
        let [e, f, g, h] = o.0;
        Self([
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ])
    }

    /// Value.
    #[must_use]
    pub fn value(&self) -> [f64; 4] {
        self.0.map(|j| j.v)
    }

    /// Body rate `2 q* q̇` and body angular acceleration `2 q* q̈` (vector parts).
    #[must_use]
    pub fn rate_and_acceleration(&self) -> (Vector3<f64>, Vector3<f64>) {
        let q = self.value();
        (
            conjugate_times(&q, &self.0.map(|j| j.d)) * 2.0,
            conjugate_times(&q, &self.0.map(|j| j.dd)) * 2.0,
        )
    }
}

/// Vector part of `q* p`.
fn conjugate_times(q: &[f64; 4], p: &[f64; 4]) -> Vector3<f64> {
    let qv = Vector3::new(q[1], q[2], q[3]);
    let pv = Vector3::new(p[1], p[2], p[3]);
    pv * q[0] - qv * p[0] - qv.cross(&pv)
}

/// `k(s) = sin(√s/2)/√s` and its first two derivatives in `s`.
fn half_sine_over_angle(s: f64) -> (f64, f64, f64) {
    if s < 1.0 {
        // k = ½ Σ (-s/4)^n/(2n+1)!; twelve terms reach 1e-18 at s = 1.
        let (mut k, mut k1, mut k2) = (0.0, 0.0, 0.0);
        let mut coefficient = 0.5;
        let (mut p, mut p1, mut p2) = (1.0, 0.0, 0.0);
        for n in 0..12 {
            let nf = f64::from(n);
            k += coefficient * p;
            k1 += coefficient * nf * p1;
            k2 += coefficient * nf * (nf - 1.0) * p2;
            p2 = p1;
            p1 = p;
            p *= s;
            coefficient *= -0.25 / ((2.0 * nf + 2.0) * (2.0 * nf + 3.0));
        }
        (k, k1, k2)
    } else {
        let h = 0.5 * s.sqrt();
        let (sin, cos) = h.sin_cos();
        let g = h * cos - sin;
        let h3 = h * h * h;
        (
            sin / (2.0 * h),
            g / (16.0 * h3),
            (-h * h * sin - 3.0 * g) / (128.0 * h3 * h * h),
        )
    }
}

/// Smooth step `10x³ - 15x⁴ + 6x⁵` on `[0, 1]` of a time-dependent argument, clamped outside.
#[must_use]
pub fn smooth_step(x: Jet) -> Jet {
    if x.v <= 0.0 {
        return Jet::constant(0.0);
    }
    if x.v >= 1.0 {
        return Jet::constant(1.0);
    }
    let v = x.v;
    x.chain(
        v * v * v * (10.0 + v * (6.0 * v - 15.0)),
        30.0 * v * v * (1.0 - v) * (1.0 - v),
        60.0 * v * (1.0 - v) * (1.0 - 2.0 * v),
    )
}

/// Integral of [`smooth_step`] from 0.
fn smooth_ramp(x: Jet) -> Jet {
    if x.v <= 0.0 {
        return Jet::constant(0.0);
    }
    if x.v >= 1.0 {
        return x - Jet::constant(0.5);
    }
    let v = x.v;
    x.chain(
        v * v * v * v * (2.5 + v * (v - 3.0)),
        v * v * v * (10.0 + v * (6.0 * v - 15.0)),
        30.0 * v * v * (1.0 - v) * (1.0 - v),
    )
}

/// Progress 0 → 1 over τ in `[0, 1]`: the speed rises smoothly over the fraction `ramp`, stays, and falls likewise.
#[must_use]
pub fn progress(tau: Jet, ramp: f64) -> Jet {
    let up = smooth_ramp(tau * (1.0 / ramp));
    let down = smooth_ramp((tau - Jet::constant(1.0 - ramp)) * (1.0 / ramp));
    (up - down) * (ramp / (1.0 - ramp))
}

/// Window that rises smoothly from 0 to 1 over the fraction `ramp` of τ and falls likewise at the end.
#[must_use]
pub fn window(tau: Jet, ramp: f64) -> Jet {
    smooth_step(tau * (1.0 / ramp)) * smooth_step((Jet::constant(1.0) - tau) * (1.0 / ramp))
}
