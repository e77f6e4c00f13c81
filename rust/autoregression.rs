//! An autoregression of a motion, which predicts it from sample to sample.

/// Its order.
const ORDER: usize = 10;
/// Frequencies of its spectrum: many more than samples in a gap.
const SPECTRUM: usize = 1 << 14;
/// Least power that the filter leaves of a sine: a motion without noise has infinite ones.
const LEAST: f64 = 1e-12;

/// The prediction-error filter, beginning with one.
#[derive(Debug, Clone)]
pub struct Autoregression([f64; ORDER + 1]);

impl Autoregression {
    /// The filter that Burg's method fits to all axes of moves (of two samples and more) together (Burg 1975), every
    /// move in units of its own steps.
    #[must_use]
    pub fn of(moves: &[&[[f64; 3]]]) -> Self {
        let mut pairs: Vec<[Vec<f64>; 2]> = Vec::new();
        for one in moves {
            let steps = one
                .windows(2)
                .flat_map(|w| (0..3).map(|c| (w[1][c] - w[0][c]).powi(2)));
            let size =
                (steps.sum::<f64>() / (3 * (one.len() - 1)) as f64).sqrt() + f64::MIN_POSITIVE;
            for c in 0..3 {
                let mean = one.iter().map(|row| row[c]).sum::<f64>() / one.len() as f64;
                let scaled: Vec<f64> = one.iter().map(|row| (row[c] - mean) / size).collect();
                pairs.push([scaled[1..].to_vec(), scaled[..scaled.len() - 1].to_vec()]);
            }
        }
        let mut out = [0.0; ORDER + 1];
        out[0] = 1.0;
        for order in 1..=ORDER {
            let (mut product, mut power) = (0.0, f64::MIN_POSITIVE);
            for [forward, backward] in &pairs {
                for (f, b) in forward.iter().zip(backward) {
                    product += f * b;
                    power += f * f + b * b;
                }
            }
            let reflection = -2.0 * product / power;
            let before = out;
            for i in 1..=order {
                out[i] += reflection * before[order - i];
            }
            for [forward, backward] in &mut pairs {
                for (f, b) in forward.iter_mut().zip(backward.iter_mut()) {
                    (*f, *b) = (*f + reflection * *b, *b + reflection * *f);
                }
                // The next order pairs each forward error with the backward error one sample earlier.
                if !forward.is_empty() {
                    forward.remove(0);
                    backward.pop();
                }
            }
        }
        Self(out)
    }

    /// `(lags)` autocovariance, from the spectrum.
    #[must_use]
    pub fn covariance(&self, lags: usize) -> Vec<f64> {
        let cosine: Vec<f64> = (0..SPECTRUM)
            .map(|k| (std::f64::consts::TAU * k as f64 / SPECTRUM as f64).cos())
            .collect();
        let sine = |k: usize| cosine[(k + 3 * SPECTRUM / 4) % SPECTRUM];
        let power: Vec<f64> = (0..SPECTRUM)
            .map(|f| {
                let (mut re, mut im) = (0.0, 0.0);
                for (j, c) in self.0.iter().enumerate() {
                    re += c * cosine[f * j % SPECTRUM];
                    im += c * sine(f * j % SPECTRUM);
                }
                1.0 / (re * re + im * im).max(LEAST)
            })
            .collect();
        (0..lags)
            .map(|lag| {
                let terms = power
                    .iter()
                    .enumerate()
                    .map(|(f, p)| p * cosine[f * lag % SPECTRUM]);
                terms.sum::<f64>() / SPECTRUM as f64
            })
            .collect()
    }

    /// What a shock of one adds to `n` samples from its own on.
    #[must_use]
    pub fn response(&self, n: usize) -> Vec<f64> {
        let mut out = vec![1.0];
        for i in 1..n {
            let sum: f64 = (1..=i.min(ORDER)).map(|j| self.0[j] * out[i - j]).sum();
            out.push(-sum);
        }
        out
    }
}
