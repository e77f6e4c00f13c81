//! One step of every stretch at a time: its rotation, and its contribution to the sensitivities and to the noise.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use super::{LANES, Rate, Row, StepRow, Sums, ZERO};
use crate::rotation::{SERIES_LIMIT, series, short_series};
use crate::simd::{fma, for_each_instruction_set};

for_each_instruction_set! {
    pub(super) fn add_steps(rows: &[StepRow], rate: &Rate, is_jumpy: bool, sums: &mut Sums) = add_steps_lanes
}

#[inline(always)]
fn add_steps_lanes<const FUSED: bool>(
    rows: &[StepRow],
    rate: &Rate,
    is_jumpy: bool,
    sums: &mut Sums,
) {
    let mut phi = Phi {
        zeroth: [ZERO; 3],
        first: [ZERO; 3],
        whole: [ZERO; 3],
        square: ZERO,
        series: [ZERO; 3],
    };
    let mut to_start = [ZERO; 9];
    for row in rows {
        rotation_vectors::<FUSED>(row, rate, &mut phi);
        // Nearly always the rotation in all lanes is below half a radian.
        if phi.square.iter().all(|&q| q <= SERIES_LIMIT) {
            for l in 0..LANES {
                let (a, b, c) = short_series::<FUSED>(phi.square[l]);
                phi.series[0][l] = a;
                phi.series[1][l] = b;
                phi.series[2][l] = c;
            }
        } else {
            for l in 0..LANES {
                let (a, b, c) = series(phi.square[l]);
                phi.series[0][l] = a;
                phi.series[1][l] = b;
                phi.series[2][l] = c;
            }
        }
        turn::<FUSED>(&phi, &mut sums.rotation, &mut to_start);
        sensitivities::<FUSED>(row, rate, &phi, &to_start, sums);
        if is_jumpy {
            jumps::<FUSED>(row, rate, &to_start, &mut sums.cov);
        }
    }
}

/// `φ₀`, `φ₁`, `φ = φ₀ + φ₀ × φ₁`, `|φ|²` and its series, of one step of every stretch.
#[repr(align(64))]
struct Phi {
    zeroth: [Row; 3],
    first: [Row; 3],
    whole: [Row; 3],
    square: Row,
    series: [Row; 3],
}

#[inline(always)]
fn rotation_vectors<const FUSED: bool>(row: &StepRow, rate: &Rate, phi: &mut Phi) {
    let s = &rate.scale;
    let slope = rate.change / rate.span_s / 12.0;
    for l in 0..LANES {
        let h = row.h[l];
        let (m0, m1) = (&row.moment0, &row.moment1);
        let (mut zeroth, mut first) = ([0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let bias = fma::<FUSED>(rate.change[i], row.fraction[l], rate.bias[i]);
            let (a, b, c) = (s[(i, 0)], s[(i, 1)], s[(i, 2)]);
            zeroth[i] = fma::<FUSED>(
                a,
                m0[0][l],
                fma::<FUSED>(b, m0[1][l], fma::<FUSED>(c, m0[2][l], bias * h)),
            );
            first[i] = fma::<FUSED>(
                a,
                m1[0][l],
                fma::<FUSED>(b, m1[1][l], fma::<FUSED>(c, m1[2][l], slope[i] * (h * h))),
            );
        }
        let mut square = 0.0;
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let whole = zeroth[i] + fma::<FUSED>(zeroth[j], first[k], -(zeroth[k] * first[j]));
            square = fma::<FUSED>(whole, whole, square);
            phi.whole[i][l] = whole;
            phi.zeroth[i][l] = zeroth[i];
            phi.first[i][l] = first[i];
        }
        phi.square[l] = square;
    }
}

/// `to_start = Bᵀ J(φ)`, then `B ← exp(−[φ]×) B`.
#[inline(always)]
fn turn<const FUSED: bool>(phi: &Phi, rotation: &mut [Row; 9], to_start: &mut [Row; 9]) {
    for l in 0..LANES {
        let v = [phi.whole[0][l], phi.whole[1][l], phi.whole[2][l]];
        let q = phi.square[l];
        let (a, b, c) = (phi.series[0][l], phi.series[1][l], phi.series[2][l]);
        let back = rodrigues::<FUSED>(v, -a, b, q);
        let left = rodrigues::<FUSED>(v, b, c, q);
        let mut old = [0.0; 9];
        for k in 0..9 {
            old[k] = rotation[k][l];
        }
        for i in 0..3 {
            for j in 0..3 {
                to_start[3 * i + j][l] = fma::<FUSED>(
                    old[i],
                    left[j],
                    fma::<FUSED>(old[3 + i], left[3 + j], old[6 + i] * left[6 + j]),
                );
                rotation[3 * i + j][l] = fma::<FUSED>(
                    back[3 * i],
                    old[j],
                    fma::<FUSED>(back[3 * i + 1], old[3 + j], back[3 * i + 2] * old[6 + j]),
                );
            }
        }
    }
}

/// `I + a [v]× + b [v]×²` row by row, `q = |v|²`.
#[inline(always)]
fn rodrigues<const FUSED: bool>(v: [f64; 3], a: f64, b: f64, q: f64) -> [f64; 9] {
    let [x, y, z] = v;
    let (bx, by, bz) = (b * x, b * y, b * z);
    let c = fma::<FUSED>(-b, q, 1.0);
    let (xy, xz, yz) = (bx * y, bx * z, by * z);
    let (ax, ay, az) = (a * x, a * y, a * z);
    [
        fma::<FUSED>(bx, x, c),
        xy - az,
        xz + ay,
        xy + az,
        fma::<FUSED>(by, y, c),
        yz - ax,
        xz - ay,
        yz + ax,
        fma::<FUSED>(bz, z, c),
    ]
}

/// δθ = Bᵀ J(φ) δφ, δφ = (I − [φ₁]×) δφ₀ + [φ₀]× δφ₁: adds the step to every sum.
#[inline(always)]
fn sensitivities<const FUSED: bool>(
    row: &StepRow,
    rate: &Rate,
    phi: &Phi,
    to_start: &[Row; 9],
    sums: &mut Sums,
) {
    let s = &rate.scale;
    for l in 0..LANES {
        let h = row.h[l];
        let (late, slope) = (h * row.fraction[l], h * h * (1.0 / 12.0));
        let m0 = [row.moment0[0][l], row.moment0[1][l], row.moment0[2][l]];
        let m1 = [row.moment1[0][l], row.moment1[1][l], row.moment1[2][l]];
        let mut var = [0.0; 3];
        for k in 0..3 {
            var[k] = h * rate.variance[k];
        }
        let mut of_raw = [[0.0; 3]; 3];
        for i in 0..3 {
            let t = [
                to_start[3 * i][l],
                to_start[3 * i + 1][l],
                to_start[3 * i + 2][l],
            ];
            for j in 0..3 {
                let (k, m) = ((j + 1) % 3, (j + 2) % 3);
                // Column j of T [v]× is T_k v_m − T_m v_k with (j, k, m) cyclic.
                let p = t[j] - fma::<FUSED>(t[k], phi.first[m][l], -(t[m] * phi.first[k][l]));
                let q = fma::<FUSED>(t[k], phi.zeroth[m][l], -(t[m] * phi.zeroth[k][l]));
                for c in 0..3 {
                    let sum = &mut sums.wrt_scale[9 * i + 3 * j + c][l];
                    *sum = fma::<FUSED>(p, m0[c], fma::<FUSED>(q, m1[c], *sum));
                }
                let at = 3 * i + j;
                let [whole, later, sloped] = &mut sums.wrt_bias;
                whole[at][l] = fma::<FUSED>(p, h, whole[at][l]);
                later[at][l] = fma::<FUSED>(p, late, later[at][l]);
                sloped[at][l] = fma::<FUSED>(q, slope, sloped[at][l]);
                of_raw[i][j] = fma::<FUSED>(
                    t[0],
                    s[(0, j)],
                    fma::<FUSED>(t[1], s[(1, j)], t[2] * s[(2, j)]),
                );
            }
        }
        let mut entry = 0;
        for i in 0..3 {
            for j in i..3 {
                let mut sum = sums.cov[entry][l];
                for k in 0..3 {
                    sum = fma::<FUSED>(of_raw[i][k] * of_raw[j][k], var[k], sum);
                }
                sums.cov[entry][l] = sum;
                entry += 1;
            }
        }
    }
}

/// The covariance from timestamp errors and from lost samples: a step with lost samples changes its rate at an unknown
/// time, uniform over h, hence h²/12.
#[inline(always)]
fn jumps<const FUSED: bool>(row: &StepRow, rate: &Rate, to_start: &[Row; 9], cov: &mut [Row; 6]) {
    let s = &rate.scale;
    for l in 0..LANES {
        let h = row.h[l];
        let var = rate.var_time + if h > rate.gap_s { h * h / 12.0 } else { 0.0 };
        let d = [row.change[0][l], row.change[1][l], row.change[2][l]];
        let (mut si, mut jump) = ([0.0; 3], [0.0; 3]);
        for i in 0..3 {
            si[i] = fma::<FUSED>(
                s[(i, 0)],
                d[0],
                fma::<FUSED>(s[(i, 1)], d[1], s[(i, 2)] * d[2]),
            );
        }
        for i in 0..3 {
            jump[i] = fma::<FUSED>(
                to_start[3 * i][l],
                si[0],
                fma::<FUSED>(
                    to_start[3 * i + 1][l],
                    si[1],
                    to_start[3 * i + 2][l] * si[2],
                ),
            );
        }
        let mut entry = 0;
        for i in 0..3 {
            for j in i..3 {
                cov[entry][l] = fma::<FUSED>(jump[i] * jump[j], var, cov[entry][l]);
                entry += 1;
            }
        }
    }
}
