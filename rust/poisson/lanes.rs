//! The sensitivities of one move, a stretch of it in every lane of a vector.
//!
//! A product of rotations is a chain in which every step waits for the one before. The move is therefore cut into as
//! many stretches as a vector has lanes; each is integrated from its own start, and stretches are joined at the end:
//! `B = B₂ B₁`, `G = G₁ + B₁ᵀ G₂`, `C = C₁ + B₁ᵀ C₂ B₁`.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::{Turn, WrtScale};
use crate::rotation::{SERIES_LIMIT, series, short_series};
use crate::simd::{Instructions, fma, for_each_instruction_set};

/// Stretches of a move.
const LANES: usize = 8;
type Row = [f64; LANES];
const ZERO: Row = [0.0; LANES];

/// One step of a move, reduced to what does not depend on the calibration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    /// `∫ w' dτ`.
    pub moment0: Vector3<f64>,
    /// `(1/h) ∫ τ w' dτ`, τ from the middle of the step.
    pub moment1: Vector3<f64>,
    /// Change of the raw reading over the step.
    pub change: Vector3<f64>,
    pub h: f64,
    /// Where the middle of the step lies between the anchors: 0 before, 1 after.
    pub fraction: f64,
    /// Variance of the reading over this step beyond the rate noise, raw unit².
    pub var_extra: Vector3<f64>,
}

/// One step of every stretch.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct StepRow {
    moment0: [Row; 3],
    moment1: [Row; 3],
    change: [Row; 3],
    h: Row,
    fraction: Row,
    var_extra: [Row; 3],
}

/// The steps of a move: step `i` is row `i % rows` of lane `i / rows`; the last lane is filled up with steps of no
/// duration, which change nothing.
#[derive(Debug, Clone)]
pub(super) struct Steps {
    rows: Vec<StepRow>,
    n: usize,
}

/// What the rate is made of, and its noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rate {
    pub scale: Matrix3<f64>,
    /// At the anchor before, rad/s.
    pub bias: Vector3<f64>,
    /// From the anchor before to the one after.
    pub change: Vector3<f64>,
    pub span_s: f64,
    /// Of the raw reading, raw unit² s.
    pub variance: Vector3<f64>,
    /// Of a time stamp, s².
    pub var_time: f64,
    /// A step longer than this has lost samples.
    pub gap_s: f64,
}

/// Sums over the steps of every stretch.
#[repr(align(64))]
struct Sums {
    /// Start of the stretch → now, row by row.
    rotation: [Row; 9],
    /// `Σ P m₀ᵀ + Q m₁ᵀ` with the sensitivities `P`, `Q` to the moments of the rate: entry `(i, 3 j + k)` of `G`.
    wrt_scale: [Row; 27],
    /// `Σ P h`, `Σ P h · fraction` and `Σ Q h²/12`.
    wrt_bias: [[Row; 9]; 3],
    /// `xx xy xz yy yz zz`.
    cov: [Row; 6],
}

impl Steps {
    pub(super) fn new(n: usize) -> Self {
        let empty = StepRow {
            moment0: [ZERO; 3],
            moment1: [ZERO; 3],
            change: [ZERO; 3],
            h: ZERO,
            fraction: ZERO,
            var_extra: [ZERO; 3],
        };
        Self {
            rows: vec![empty; n.div_ceil(LANES)],
            n,
        }
    }

    pub(super) fn set(&mut self, i: usize, step: &Step) {
        let (row, lane) = (i % self.rows.len(), i / self.rows.len());
        let row = &mut self.rows[row];
        for k in 0..3 {
            row.moment0[k][lane] = step.moment0[k];
            row.moment1[k][lane] = step.moment1[k];
            row.change[k][lane] = step.change[k];
            row.var_extra[k][lane] = step.var_extra[k];
        }
        row.h[lane] = step.h;
        row.fraction[lane] = step.fraction;
    }

    pub(super) fn len(&self) -> usize {
        self.n
    }

    pub(super) fn raw_angle(&self) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for lane in 0..LANES {
            for row in &self.rows {
                sum += Vector3::from(row.moment0.map(|axis| axis[lane]));
            }
        }
        sum
    }

    pub(super) fn duration_s(&self) -> f64 {
        (0..LANES)
            .map(|lane| self.rows.iter().map(|row| row.h[lane]).sum::<f64>())
            .sum()
    }

    pub(super) fn integrate(&self, instructions: Instructions, rate: &Rate) -> Turn {
        let mut sums = Sums {
            rotation: [ZERO; 9],
            wrt_scale: [ZERO; 27],
            wrt_bias: [[ZERO; 9]; 3],
            cov: [ZERO; 6],
        };
        for k in [0, 4, 8] {
            sums.rotation[k] = [1.0; LANES];
        }
        // Stamps with errors let the rate's change over every step count, lost samples that over some.
        let is_jumpy = rate.var_time > 0.0
            || self
                .rows
                .iter()
                .any(|row| row.h.iter().any(|&h| h > rate.gap_s));
        add_steps(instructions, &self.rows, rate, is_jumpy, &mut sums);
        self.joined(&sums, rate.span_s)
    }

    fn joined(&self, sums: &Sums, span_s: f64) -> Turn {
        let mut rotation = Matrix3::identity();
        let mut wrt_scale = WrtScale::zeros();
        let mut wrt_bias = [Matrix3::zeros(); 3];
        let mut cov_noise = Matrix3::zeros();
        for lane in 0..LANES {
            let back = rotation.transpose();
            wrt_scale += back
                * SMatrix::<f64, 3, 9>::from_row_slice(
                    sums.wrt_scale.map(|row| row[lane]).as_slice(),
                );
            for (sum, part) in wrt_bias.iter_mut().zip(&sums.wrt_bias) {
                *sum += back * Matrix3::from_row_slice(part.map(|row| row[lane]).as_slice());
            }
            let [xx, xy, xz, yy, yz, zz] = sums.cov.map(|row| row[lane]);
            cov_noise += back * Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * rotation;
            rotation =
                Matrix3::from_row_slice(sums.rotation.map(|row| row[lane]).as_slice()) * rotation;
        }
        let [whole, late, slope] = wrt_bias;
        Turn {
            rotation,
            wrt_scale,
            wrt_bias_before: whole - late - slope / span_s,
            wrt_bias_after: late + slope / span_s,
            cov_noise,
            duration_s: self.duration_s(),
        }
    }
}

for_each_instruction_set! {
    fn add_steps(rows: &[StepRow], rate: &Rate, is_jumpy: bool, sums: &mut Sums) = add_steps_lanes
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
        // Nearly always all lanes turn by less than half a radian.
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

/// δθ = Bᵀ J(φ) δφ, δφ = (I − [φ₁]×) δφ₀ + [φ₀]× δφ₁: what the step adds to every sum.
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
            var[k] = h * fma::<FUSED>(row.var_extra[k][l], h, rate.variance[k]);
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

/// The covariance from stamps with errors, and from lost samples: they leave the rate anywhere between its neighbours,
/// uniform, so h²/12.
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
