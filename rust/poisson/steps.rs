//! Integration steps: the moments of the rate over each step as weighted sums over its samples.

use nalgebra::Vector3;

use super::RateModel;

/// One integration step as sums over samples: `∫ w dτ = Σ zeroth_j w_j`, `(1/h) ∫ τ w dτ = Σ first_j w_j`, τ from the
/// middle of the step.
#[derive(Debug, Clone, Copy)]
pub struct StepWeights {
    /// The samples that the rate polynomial runs through; unused ones carry no weight.
    pub sample: [usize; 4],
    /// Weights of the zeroth moment, s.
    pub zeroth: [f64; 4],
    /// Weights of the first moment, s.
    pub first: [f64; 4],
    /// Sample at which the step begins.
    pub from: usize,
    /// Sample at which it ends.
    pub to: usize,
    /// Its duration, s.
    pub h: f64,
}

/// `∫ L dτ` and `(1/h) ∫ τ L dτ` over `[−h/2, h/2]` of the cubic with roots `a, b, c`.
fn cubic_moments(a: f64, b: f64, c: f64, h: f64) -> (f64, f64) {
    let h2 = h * h;
    (
        -h * ((a + b + c) * h2 / 12.0 + a * b * c),
        h2 * (h2 / 80.0 + (a * b + a * c + b * c) / 12.0),
    )
}

impl StepWeights {
    fn constant(from: usize, to: usize, h: f64) -> Self {
        Self {
            sample: [from; 4],
            zeroth: [h, 0.0, 0.0, 0.0],
            first: [0.0; 4],
            from,
            to,
            h,
        }
    }

    fn line(from: usize, to: usize, h: f64) -> Self {
        Self {
            sample: [from, to, from, to],
            zeroth: [0.5 * h, 0.5 * h, 0.0, 0.0],
            first: [-h / 12.0, h / 12.0, 0.0, 0.0],
            from,
            to,
            h,
        }
    }

    /// The cubic through four samples at `t`, over the step between the samples `left` and `left + 1` of them.
    fn cubic(sample: [usize; 4], t: &[f64; 4], left: usize, h: f64) -> Self {
        let middle = 0.5 * (t[left] + t[left + 1]);
        let tau = t.map(|x| x - middle);
        let (mut zeroth, mut first) = ([0.0; 4], [0.0; 4]);
        for j in 0..4 {
            let [a, b, c] = [tau[(j + 1) % 4], tau[(j + 2) % 4], tau[(j + 3) % 4]];
            let (i0, i1) = cubic_moments(a, b, c, h);
            let scale = 1.0 / ((tau[j] - a) * (tau[j] - b) * (tau[j] - c));
            zeroth[j] = i0 * scale;
            first[j] = i1 * scale;
        }
        Self {
            sample,
            zeroth,
            first,
            from: sample[left],
            to: sample[left + 1],
            h,
        }
    }

    /// Step `i` of the `n` samples `used(0), used(1), …` (ascending, of increasing time).
    pub(crate) fn at(
        time_s: &[f64],
        used: impl Fn(usize) -> usize,
        n: usize,
        i: usize,
        model: RateModel,
    ) -> Self {
        let (p, q) = (used(i), used(i + 1));
        let h = time_s[q] - time_s[p];
        match model {
            RateModel::Constant => Self::constant(p, q, h),
            RateModel::Coning if n >= 4 => {
                let first = i.saturating_sub(1).min(n - 4);
                let index = [0, 1, 2, 3].map(|j| used(first + j));
                let t = index.map(|k| time_s[k]);
                let gaps = [t[1] - t[0], t[2] - t[1], t[3] - t[2]];
                let widest = gaps[0].max(gaps[1]).max(gaps[2]);
                let narrowest = gaps[0].min(gaps[1]).min(gaps[2]);
                if widest > UNEVEN_STEPS * narrowest {
                    Self::line(p, q, h)
                } else {
                    Self::cubic(index, &t, i - first, h)
                }
            }
            RateModel::Linear | RateModel::Coning => Self::line(p, q, h),
        }
    }

    /// Both moments of a signal.
    pub fn moments(&self, signal: impl Fn(usize) -> Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let (mut zeroth, mut first) = (Vector3::zeros(), Vector3::zeros());
        for j in 0..4 {
            if self.zeroth[j] != 0.0 || self.first[j] != 0.0 {
                let value = signal(self.sample[j]);
                zeroth += value * self.zeroth[j];
                first += value * self.first[j];
            }
        }
        (zeroth, first)
    }
}

/// Ratio of neighbouring steps (jitter, three lost samples) above which a cubic through them may be worse than a straight
/// line: it overshoots.
const UNEVEN_STEPS: f64 = 4.5;

/// Integration steps between the samples `used` (ascending, of strictly increasing time).
#[must_use]
pub fn step_weights(time_s: &[f64], used: &[usize], model: RateModel) -> Vec<StepWeights> {
    let n = used.len();
    (0..n.saturating_sub(1))
        .map(|i| StepWeights::at(time_s, |k| used[k], n, i, model))
        .collect()
}
