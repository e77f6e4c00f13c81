//! A straight line through points with outliers.

use crate::order_statistics::median;

/// Median absolute deviation to standard deviation of a Gaussian.
const MAD_TO_SIGMA: f64 = 1.4826;
/// Standard deviations beyond which a point is excluded.
const FAR: f64 = 4.0;
const ROUNDS: usize = 3;
/// Distance within which points are never excluded, in the unit of `y`.
const NEAR: f64 = 1e-12;

/// `(slope, level)` of the line through `(u, y)`; points far from the median residual are excluded, in three rounds.
///
/// # Panics
/// When lengths differ.
#[must_use]
pub fn robust_line(u: &[f64], y: &[f64]) -> (f64, f64) {
    assert_eq!(u.len(), y.len());
    let mut line = through(u, y, |_| true);
    let (mut left, mut scratch) = (vec![0.0; y.len()], Vec::new());
    for _ in 0..ROUNDS {
        for ((left, u), y) in left.iter_mut().zip(u).zip(y) {
            *left = y - (line.0 * u + line.1);
        }
        scratch.clone_from(&left);
        let middle = median(&mut scratch);
        for (s, left) in scratch.iter_mut().zip(&left) {
            *s = (left - middle).abs();
        }
        let limit = FAR * MAD_TO_SIGMA * median(&mut scratch) + NEAR;
        let keep = |i: usize| (left[i] - middle).abs() <= limit;
        if (0..y.len()).filter(|&i| keep(i)).count() < 3 {
            break;
        }
        line = through(u, y, keep);
    }
    line
}

fn through(u: &[f64], y: &[f64], keep: impl Fn(usize) -> bool) -> (f64, f64) {
    let kept = || (0..y.len()).filter(|&i| keep(i));
    let n = kept().count() as f64;
    let (u_mean, y_mean) = (
        kept().map(|i| u[i]).sum::<f64>() / n,
        kept().map(|i| y[i]).sum::<f64>() / n,
    );
    let (mut square, mut product) = (0.0, 0.0);
    for i in kept() {
        let du = u[i] - u_mean;
        square += du * du;
        product += du * (y[i] - y_mean);
    }
    let slope = if square > 0.0 { product / square } else { 0.0 };
    (slope, y_mean - slope * u_mean)
}
