//! The sensitivities of one move, a stretch of it in every lane of a vector.
//!
//! A product of rotations is a chain in which every step waits for the one before. The move is therefore cut into as
//! many stretches as a vector has lanes; each is integrated from its own start, and stretches are joined at the end:
//! `B = B₂ B₁`, `G = G₁ + B₁ᵀ G₂`, `C = C₁ + B₁ᵀ C₂ B₁`.

mod moments;
mod sensitivities;

use nalgebra::{Matrix3, SMatrix, Vector3};

pub(super) use self::moments::Whole;
use self::moments::fill;
use self::sensitivities::add_steps;
use super::{RateModel, Turn, WrtScale};
use crate::simd::Instructions;

/// Stretches of a move.
const LANES: usize = 8;
type Row = [f64; LANES];
const ZERO: Row = [0.0; LANES];

/// One step of a move, in terms that do not depend on the calibration.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Step {
    /// `∫ w' dτ`.
    pub moment0: Vector3<f64>,
    /// `(1/h) ∫ τ w' dτ`, τ from the middle of the step.
    pub moment1: Vector3<f64>,
    /// Change of the raw reading over the step.
    pub change: Vector3<f64>,
    pub h: f64,
    /// Position of the middle of the step between the anchors: 0 before, 1 after.
    pub fraction: f64,
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
}

const EMPTY: StepRow = StepRow {
    moment0: [ZERO; 3],
    moment1: [ZERO; 3],
    change: [ZERO; 3],
    h: ZERO,
    fraction: ZERO,
};

/// The steps of a move: step `i` is row `i % rows` of lane `i / rows`; the last lane is filled up with steps of no
/// duration, which add nothing.
#[derive(Debug, Clone, Default)]
pub(super) struct Steps {
    rows: Vec<StepRow>,
    n: usize,
}

/// Scale, bias and noise of the rate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rate {
    pub scale: Matrix3<f64>,
    /// Bias at the anchor before, rad/s.
    pub bias: Vector3<f64>,
    /// Change of the bias from the anchor before to the one after, rad/s.
    pub change: Vector3<f64>,
    pub span_s: f64,
    /// Noise density squared of the raw reading, raw unit² s.
    pub variance: Vector3<f64>,
    /// Variance of a timestamp, s².
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
    /// Covariance of the noise, `xx xy xz yy yz zz`.
    cov: [Row; 6],
}

impl Steps {
    pub(super) fn new(n: usize) -> Self {
        Self {
            rows: vec![EMPTY; n.div_ceil(LANES)],
            n,
        }
    }

    /// The steps of a move without missing readings; `odd` computes those for which no cubic is suitable.
    pub(super) fn of(of: &Whole<'_>, model: RateModel, odd: impl Fn(usize) -> Step) -> Self {
        let mut out = Self::new(of.n_steps());
        let n_rows = out.rows.len();
        set_rows(&mut out.rows, 0, n_rows, of, model, &odd);
        out
    }

    pub(super) fn set(&mut self, i: usize, step: &Step) {
        let (row, lane) = (i % self.rows.len(), i / self.rows.len());
        set(&mut self.rows[row], lane, step);
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
        let mut sums = Sums::new();
        sums.add(instructions, &self.rows, rate);
        sums.joined(rate.span_s, self.duration_s())
    }
}

/// Rows computed and integrated at a time: few enough for the fastest cache.
const BLOCK: usize = 16;

/// The turn over a move without missing readings, integrated once.
pub(super) fn integrate_whole(
    instructions: Instructions,
    of: &Whole<'_>,
    model: RateModel,
    rate: &Rate,
    odd: impl Fn(usize) -> Step,
) -> Turn {
    let n_rows = of.n_steps().div_ceil(LANES);
    let mut block = [EMPTY; BLOCK];
    let mut sums = Sums::new();
    for first in (0..n_rows).step_by(BLOCK) {
        let rows = &mut block[..BLOCK.min(n_rows - first)];
        set_rows(rows, first, n_rows, of, model, &odd);
        sums.add(instructions, rows, rate);
    }
    sums.joined(rate.span_s, of.time_s[of.n_steps()] - of.time_s[0])
}

fn set_rows(
    rows: &mut [StepRow],
    first: usize,
    n_rows: usize,
    of: &Whole<'_>,
    model: RateModel,
    odd: &impl Fn(usize) -> Step,
) {
    let mut others = Vec::new();
    fill(rows, first, n_rows, of, model, &mut others);
    for i in others {
        let step = if i < of.n_steps() {
            odd(i)
        } else {
            Step::default()
        };
        set(&mut rows[i % n_rows - first], i / n_rows, &step);
    }
}

fn set(row: &mut StepRow, lane: usize, step: &Step) {
    for k in 0..3 {
        row.moment0[k][lane] = step.moment0[k];
        row.moment1[k][lane] = step.moment1[k];
        row.change[k][lane] = step.change[k];
    }
    row.h[lane] = step.h;
    row.fraction[lane] = step.fraction;
}

impl Sums {
    fn new() -> Self {
        let mut sums = Self {
            rotation: [ZERO; 9],
            wrt_scale: [ZERO; 27],
            wrt_bias: [[ZERO; 9]; 3],
            cov: [ZERO; 6],
        };
        for k in [0, 4, 8] {
            sums.rotation[k] = [1.0; LANES];
        }
        sums
    }

    fn add(&mut self, instructions: Instructions, rows: &[StepRow], rate: &Rate) {
        // With timestamp errors the change of the rate over every step counts, with lost samples that over some.
        let is_jumpy =
            rate.var_time > 0.0 || rows.iter().any(|row| row.h.iter().any(|&h| h > rate.gap_s));
        add_steps(instructions, rows, rate, is_jumpy, self);
    }

    fn joined(&self, span_s: f64, duration_s: f64) -> Turn {
        let mut rotation = Matrix3::identity();
        let mut wrt_scale = WrtScale::zeros();
        let mut wrt_bias = [Matrix3::zeros(); 3];
        let mut cov_noise = Matrix3::zeros();
        for lane in 0..LANES {
            let back = rotation.transpose();
            wrt_scale += back
                * SMatrix::<f64, 3, 9>::from_row_slice(
                    self.wrt_scale.map(|row| row[lane]).as_slice(),
                );
            for (sum, part) in wrt_bias.iter_mut().zip(&self.wrt_bias) {
                *sum += back * Matrix3::from_row_slice(part.map(|row| row[lane]).as_slice());
            }
            let [xx, xy, xz, yy, yz, zz] = self.cov.map(|row| row[lane]);
            cov_noise += back * Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * rotation;
            rotation =
                Matrix3::from_row_slice(self.rotation.map(|row| row[lane]).as_slice()) * rotation;
        }
        let [whole, late, slope] = wrt_bias;
        Turn {
            rotation,
            wrt_scale,
            wrt_bias_before: whole - late - slope / span_s,
            wrt_bias_after: late + slope / span_s,
            cov_noise,
            duration_s,
        }
    }
}
