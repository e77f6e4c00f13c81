//! Moments of the raw readings over eight steps at a time.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use nalgebra::Vector3;

use super::{LANES, Row, ZERO};
use crate::poisson::steps::UNEVEN_STEPS;
use crate::simd::{fma, for_each_instruction_set};

/// Samples that the cubics of as many steps as there are lanes run through.
pub(in crate::poisson) const REACH: usize = LANES + 3;

/// Steps one after the other, as [`super::Step`] holds one.
pub(super) struct Moments {
    pub zeroth: [Row; 3],
    pub first: [Row; 3],
    pub change: [Row; 3],
    pub h: Row,
    pub middle: Row,
}

impl Moments {
    pub(super) const EMPTY: Self = Self {
        zeroth: [ZERO; 3],
        first: [ZERO; 3],
        change: [ZERO; 3],
        h: ZERO,
        middle: ZERO,
    };
}

for_each_instruction_set! {
    /// The steps from sample 1 on, each by the cubic through its ends and their neighbours; whether no step is so uneven
    /// that a straight line is better (`out` then says nothing).
    pub(super) fn cubic_moments(
        time_s: &[f64; REACH], raw: &[Vector3<f64>; REACH], out: &mut Moments,
    ) -> bool = cubic_moments_body
}

#[inline(always)]
fn cubic_moments_body<const FUSED: bool>(
    time_s: &[f64; REACH],
    raw: &[Vector3<f64>; REACH],
    out: &mut Moments,
) -> bool {
    let mut tau = [ZERO; 4];
    let mut is_even = true;
    for l in 0..LANES {
        let t = [time_s[l], time_s[l + 1], time_s[l + 2], time_s[l + 3]];
        let gaps = [t[1] - t[0], t[2] - t[1], t[3] - t[2]];
        let widest = gaps[0].max(gaps[1]).max(gaps[2]);
        let narrowest = gaps[0].min(gaps[1]).min(gaps[2]);
        is_even &= widest <= UNEVEN_STEPS * narrowest;
        let middle = 0.5 * (t[1] + t[2]);
        for j in 0..4 {
            tau[j][l] = t[j] - middle;
        }
        out.h[l] = gaps[1];
        out.middle[l] = middle;
    }
    if !is_even {
        return false;
    }
    let mut axes = [[0.0; REACH]; 3];
    for (i, row) in raw.iter().enumerate() {
        for k in 0..3 {
            axes[k][i] = row[k];
        }
    }
    let (mut zeroth, mut first) = ([ZERO; 3], [ZERO; 3]);
    for j in 0..4 {
        for l in 0..LANES {
            let [at, a, b, c] = [0, 1, 2, 3].map(|k| tau[(j + k) % 4][l]);
            let h = out.h[l];
            let h2 = h * h;
            let (ab, sum) = (a * b, a + b);
            let scale = 1.0 / ((at - a) * (at - b) * (at - c));
            let cubed = fma::<FUSED>(sum + c, h2 * (1.0 / 12.0), ab * c);
            let squared = fma::<FUSED>(sum, c, ab);
            let w0 = -h * cubed * scale;
            let w1 = h2 * fma::<FUSED>(squared, 1.0 / 12.0, h2 * (1.0 / 80.0)) * scale;
            for k in 0..3 {
                let x = axes[k][l + j];
                zeroth[k][l] = fma::<FUSED>(w0, x, zeroth[k][l]);
                first[k][l] = fma::<FUSED>(w1, x, first[k][l]);
            }
        }
    }
    for k in 0..3 {
        for l in 0..LANES {
            out.change[k][l] = axes[k][l + 2] - axes[k][l + 1];
        }
    }
    (out.zeroth, out.first) = (zeroth, first);
    true
}
