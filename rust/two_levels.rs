//! A level that switches between two values, beside white noise: a hidden Markov chain of two states (Baum and Welch).

/// Iterations of the levels' likelihood.
const ROUNDS: usize = 25;
/// Least variance about the levels.
const LEAST: f64 = 1e-12;
/// Range of the probability that the level is left from one value to the next.
const LEAVES: (f64, f64) = (1e-3, 0.5);

/// Log-likelihood, the two levels, and whether each value is of the second.
#[derive(Debug, Clone)]
pub struct TwoLevels {
    /// Of the values.
    pub log_likelihood: f64,
    /// Both levels.
    pub levels: [f64; 2],
    /// Of each value.
    pub is_second: Vec<bool>,
}

/// The most likely levels of `values`, from a first guess.
#[must_use]
pub fn two_levels(values: &[f64], mut levels: [f64; 2]) -> TwoLevels {
    let n = values.len();
    let steps = values.windows(2).map(|w| w[1] - w[0]);
    let mean = steps.clone().sum::<f64>() / (n - 1) as f64;
    let square = steps.map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
    let mut variance = 0.5 * square + LEAST;
    let mut leave = [0.05; 2];
    let mut log_likelihood = f64::NEG_INFINITY;
    let mut weight = vec![[0.5; 2]; n];
    for _ in 0..ROUNDS {
        let stay = |from: usize, to: usize| {
            if from == to {
                1.0 - leave[from]
            } else {
                leave[from]
            }
        };
        let mut seen = vec![[0.0; 2]; n];
        let mut share = vec![0.0; n];
        let mut forward = vec![[0.0; 2]; n];
        let mut ahead = [0.5; 2];
        log_likelihood = -0.5 * n as f64 * (std::f64::consts::TAU * variance).ln();
        for i in 0..n {
            let exponent = levels.map(|level| -0.5 * (values[i] - level).powi(2) / variance);
            let top = exponent[0].max(exponent[1]);
            seen[i] = exponent.map(|e| (e - top).exp());
            let joint = [ahead[0] * seen[i][0], ahead[1] * seen[i][1]];
            share[i] = joint[0] + joint[1];
            forward[i] = joint.map(|p| p / share[i]);
            log_likelihood += share[i].ln() + top;
            let from = forward[i];
            ahead = [0, 1].map(|to| from[0] * stay(0, to) + from[1] * stay(1, to));
        }
        let mut backward = [1.0; 2];
        let mut left = [0.0; 2];
        for i in (0..n).rev() {
            let both = [forward[i][0] * backward[0], forward[i][1] * backward[1]];
            weight[i] = both.map(|w| w / (both[0] + both[1]));
            if i > 0 {
                let next = [0, 1].map(|to| seen[i][to] * backward[to] / share[i]);
                left[0] += forward[i - 1][0] * leave[0] * next[1];
                left[1] += forward[i - 1][1] * leave[1] * next[0];
                backward = [0, 1].map(|from| stay(from, 0) * next[0] + stay(from, 1) * next[1]);
            }
        }
        for k in 0..2 {
            let total: f64 = weight.iter().map(|w| w[k]).sum();
            let sum: f64 = weight.iter().zip(values).map(|(w, y)| w[k] * y).sum();
            levels[k] = sum / total;
            // The last value is left for none.
            leave[k] = (left[k] / (total - weight[n - 1][k])).clamp(LEAVES.0, LEAVES.1);
        }
        let about =
            |w: &[f64; 2], y: f64| w[0] * (y - levels[0]).powi(2) + w[1] * (y - levels[1]).powi(2);
        let total: f64 = weight.iter().zip(values).map(|(w, &y)| about(w, y)).sum();
        variance = (total / n as f64).max(LEAST);
    }
    TwoLevels {
        log_likelihood,
        levels,
        is_second: weight.iter().map(|w| w[1] > 0.5).collect(),
    }
}
