//! The sensitivities of one move, a stretch of it in every lane of a vector.
//!
//! A product of rotations is a chain in which every step waits for the one before. The move is therefore cut into as
//! many stretches as a vector has lanes; each is integrated from its own start, and stretches are joined at the end:
//! `B = B₂ B₁`, `G = G₁ + B₁ᵀ G₂`, `C = C₁ + B₁ᵀ C₂ B₁`.

mod moments;
mod sensitivities;

use nalgebra::{Matrix3, SMatrix, Vector3};

pub(super) use self::moments::REACH;
use self::moments::{Moments, cubic_moments};
use self::sensitivities::add_steps;
use super::{Turn, WrtScale};
use crate::simd::Instructions;

/// Stretches of a move.
pub(super) const LANES: usize = 8;
type Row = [f64; LANES];
const ZERO: Row = [0.0; LANES];

/// One step of a move, reduced to what does not depend on the calibration.
#[derive(Debug, Clone, Copy, Default)]
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

const EMPTY: StepRow = StepRow {
    moment0: [ZERO; 3],
    moment1: [ZERO; 3],
    change: [ZERO; 3],
    h: ZERO,
    fraction: ZERO,
    var_extra: [ZERO; 3],
};

/// The steps of a move: step `i` is row `i % rows` of lane `i / rows`; the last lane is filled up with steps of no
/// duration, which change nothing.
#[derive(Debug, Clone, Default)]
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
    /// Steps still to be set, in the memory of others.
    pub(super) fn reset(&mut self, n: usize) {
        self.n = n;
        self.rows.resize(n.div_ceil(LANES), EMPTY);
        for i in n..self.rows.len() * LANES {
            self.set(i, &Step::default());
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

    /// As many steps from `i` on as there are lanes, from the samples before the first of them to the one after the last
    /// one's end; whether no step is too uneven for a cubic.
    pub(super) fn set_cubics(
        &mut self,
        i: usize,
        time_s: &[f64; REACH],
        raw: &[Vector3<f64>; REACH],
        var_extra: Option<&[Vector3<f64>]>,
        anchors: (f64, f64),
    ) -> bool {
        let mut all = Moments::EMPTY;
        if !cubic_moments(Instructions::detect(), time_s, raw, &mut all) {
            return false;
        }
        let (anchor_before_s, span_s) = anchors;
        let fraction = all.middle.map(|middle| (middle - anchor_before_s) / span_s);
        let n_rows = self.rows.len();
        let (mut at, mut lane) = (i % n_rows, i / n_rows);
        for l in 0..LANES {
            let row = &mut self.rows[at];
            for k in 0..3 {
                row.moment0[k][lane] = all.zeroth[k][l];
                row.moment1[k][lane] = all.first[k][l];
                row.change[k][lane] = all.change[k][l];
                row.var_extra[k][lane] = var_extra.map_or(0.0, |var| var[l][k]);
            }
            row.h[lane] = all.h[l];
            row.fraction[lane] = fraction[l];
            at += 1;
            if at == n_rows {
                (at, lane) = (0, lane + 1);
            }
        }
        true
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
