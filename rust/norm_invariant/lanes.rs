//! Eight readings at a time: the terms of the sums over readings.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use nalgebra::Vector3;

use super::{Frame, Model, N_PARAMETERS, Settings};
use crate::ellipsoid::Standardisation;
use crate::simd::fma;

pub(super) const LANES: usize = 8;
/// One number per reading.
pub(super) type Row = [f64; LANES];
pub(super) const ZERO: Row = [0.0; LANES];

/// Values by eights without a copy; the last ones are filled up.
pub(super) struct Eights<'a, T> {
    whole: &'a [[T; LANES]],
    rest: [T; LANES],
}

impl<'a, T: Copy> Eights<'a, T> {
    #[inline(always)]
    pub(super) fn of(values: &'a [T], missing: T) -> Self {
        let (whole, few) = values.as_chunks::<LANES>();
        let mut rest = [missing; LANES];
        rest[..few.len()].copy_from_slice(few);
        Self { whole, rest }
    }

    #[inline(always)]
    pub(super) fn at(&self, i: usize) -> &[T; LANES] {
        self.whole.get(i).unwrap_or(&self.rest)
    }
}

/// Eight standardised readings.
#[inline(always)]
pub(super) fn load(values: &[Vector3<f64>; LANES], standard: &Standardisation, out: &mut [Row; 3]) {
    for l in 0..LANES {
        for c in 0..3 {
            out[c][l] = values[l][c];
        }
    }
    let scale = 1.0 / standard.size;
    for c in 0..3 {
        for l in 0..LANES {
            out[c][l] = (out[c][l] - standard.centre[c]) * scale;
        }
    }
}

/// One of the readings, to fill up the last eight with.
#[inline(always)]
pub(super) fn filler(values: &[Vector3<f64>]) -> Vector3<f64> {
    values.last().copied().unwrap_or_default()
}

/// Eight numbers, or the first of them where there is room for fewer.
#[inline(always)]
pub(super) fn store(found: &Row, out: &mut [f64]) {
    if let Ok(eight) = <&mut Row>::try_from(&mut *out) {
        *eight = *found;
    } else {
        let n = out.len();
        out.copy_from_slice(&found[..n]);
    }
}

/// `f = S u + b` in one lane.
#[inline(always)]
pub(super) fn force<const FUSED: bool>(model: &Model, u: &[Row; 3], l: usize) -> [f64; 3] {
    let (s, b) = (&model.s, &model.b);
    let mut f = [0.0; 3];
    for i in 0..3 {
        f[i] = fma::<FUSED>(
            s[(i, 0)],
            u[0][l],
            fma::<FUSED>(s[(i, 1)], u[1][l], fma::<FUSED>(s[(i, 2)], u[2][l], b[i])),
        );
    }
    f
}

#[inline(always)]
pub(super) fn dot<const FUSED: bool>(a: [f64; 3], b: [f64; 3]) -> f64 {
    fma::<FUSED>(a[0], b[0], fma::<FUSED>(a[1], b[1], a[2] * b[2]))
}

/// Residual in m/s², and the length by which `f` is divided in its derivative.
#[inline(always)]
pub(super) fn misfit<const FUSED: bool>(
    f: [f64; 3],
    excess: f64,
    settings: &Settings,
) -> (f64, f64) {
    let norm = dot::<FUSED>(f, f).sqrt();
    (norm - settings.gravity - excess, norm)
}

/// The columns of the six entries of `S` and of `b`, from `v` along the derivative and the reading `u`.
#[inline(always)]
pub(super) fn columns<const FUSED: bool>(
    v: [f64; 3],
    u: [f64; 3],
    mirrored: f64,
) -> [f64; N_PARAMETERS] {
    let mut out = [0.0; N_PARAMETERS];
    for (k, &(i, j)) in Frame::ENTRIES.iter().enumerate() {
        out[k] = v[i] * u[j];
        if i != j {
            out[k] = fma::<FUSED>(mirrored * v[j], u[i], out[k]);
        }
    }
    out[6] = v[0];
    out[7] = v[1];
    out[8] = v[2];
    out
}

pub(super) fn mirrored(frame: Frame) -> f64 {
    match frame {
        Frame::Lower => 0.0,
        Frame::Symmetric => 1.0,
    }
}
