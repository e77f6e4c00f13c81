//! Levels of a telegraph signal in the means of poses, against biases that scatter and walk.

use nalgebra::{DMatrix, DVector};

use super::{Inside, orthonormal};
use crate::error::{Error, Result};
use crate::order_statistics::median;

/// A level seen in fewer poses is a disturbance of these poses.
const FEWEST_AT_A_LEVEL: usize = 3;
/// Variance of the bias walk between poses, relative to that of the scatter.
const WALKS: [f64; 7] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
/// Relative gain below which a change of one state is none.
const ROUNDING: f64 = 1e-9;

/// Means of poses, and what they consist of besides the signal.
#[derive(Debug, Clone)]
pub struct Means {
    /// What the poses read beyond gravity and the effects of a hypothesis.
    pub reading: DVector<f64>,
    /// What one unit of the signal adds to each.
    pub seen: DVector<f64>,
    /// `(poses, k)` columns that any reading may contain.
    pub known: DMatrix<f64>,
    /// Time of each pose.
    pub time: Vec<f64>,
    /// Least variance of the readings about their combination, that of their noise.
    pub noise: f64,
}

/// State in every pose, between -1 and 1, and its gain in log-likelihood over biases that scatter and walk; `None` with
/// one level.
///
/// # Errors
/// `BadInput` when lengths differ.
pub fn levels(means: &Means, inside: &Inside) -> Result<Option<(Vec<f64>, f64)>> {
    let n = means.reading.len();
    let lengths = [
        means.seen.len(),
        means.known.nrows(),
        means.time.len(),
        inside.switches.len(),
    ];
    if lengths.iter().any(|&one| one != n) {
        return Err(Error::bad_input(
            "every pose has a reading, its columns and a time",
        ));
    }
    let basis = orthonormal(&means.known);
    let rest = DMatrix::identity(n, n) - &basis * basis.transpose();
    let state = states(means, &rest, inside);
    let low = state.iter().filter(|&&one| one < 0.0).count();
    let high = state.iter().filter(|&&one| one > 0.0).count();
    if n <= means.known.ncols() || low.min(high) < FEWEST_AT_A_LEVEL {
        return Ok(None);
    }
    // The level of a pose without a switch is one of two, chosen by the mean that it is to explain.
    let chosen = inside
        .switches
        .iter()
        .filter(|&&switches| !switches)
        .count() as f64;
    let mut with = means.known.clone().insert_column(0, 0.0);
    with.set_column(0, &means.seen.component_mul(&state));
    let dof = (n - means.known.ncols()) as f64;
    let gain = likelihood(means, &with, dof) - likelihood(means, &means.known, dof);
    let cost = std::f64::consts::LN_2 * chosen + 0.5 * (n as f64).ln();
    Ok(Some((state.as_slice().to_vec(), inside.gain + gain - cost)))
}

/// Largest log-likelihood of readings that scatter and walk at random about a combination of `known`. Scatter below
/// the noise of the means would reward a combination of as many columns as there are poses.
fn likelihood(means: &Means, known: &DMatrix<f64>, dof: f64) -> f64 {
    let (time, n) = (&means.time, means.time.len());
    let first = time.iter().copied().fold(f64::INFINITY, f64::min);
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let usual = median(&mut steps).max(f64::MIN_POSITIVE);
    let walk = DMatrix::from_fn(n, n, |i, j| (time[i].min(time[j]) - first) / usual);
    let of_walk = |share: f64| {
        let root = (share * &walk + DMatrix::identity(n, n))
            .cholesky()?
            .unpack();
        let y = root.solve_lower_triangular(&means.reading)?;
        let basis = orthonormal(&root.solve_lower_triangular(known)?);
        let left = (&y - &basis * (basis.transpose() * &y)).norm_squared();
        let log_det = root.diagonal().map(f64::ln).sum();
        let variance = (left / dof).max(means.noise);
        Some(-log_det - 0.5 * (dof * variance.ln() + left / variance))
    };
    WALKS
        .into_iter()
        .filter_map(of_walk)
        .fold(f64::NEG_INFINITY, f64::max)
}

/// States that explain most of the readings. From the sign of every reading on, the state of one pose after another is
/// changed while that explains more.
fn states(means: &Means, rest: &DMatrix<f64>, inside: &Inside) -> DVector<f64> {
    let (seen, reading) = (&means.seen, rest * &means.reading);
    let mut state = DVector::from_fn(seen.len(), |i, _| match inside.switches[i] {
        true => inside.state[i],
        false if reading[i] * seen[i] < 0.0 => -1.0,
        false => 1.0,
    });
    for _ in 0..seen.len().pow(2) {
        let column = rest * seen.component_mul(&state);
        let (along, norm) = (reading.dot(&column), column.norm_squared());
        let explained = DVector::from_fn(seen.len(), |i, _| {
            // Inner products of the reading with the column, and of the column with itself, after the change.
            let turned = -2.0 * state[i] * seen[i];
            let after = along + turned * reading[i];
            let own = norm + 2.0 * turned * column[i] + turned * turned * rest[(i, i)];
            let counts = !inside.switches[i] && after > 0.0 && own > 0.0;
            if counts { after * after / own } else { 0.0 }
        });
        let (best, most) = explained.argmax();
        if most <= along.max(0.0).powi(2) / norm.max(f64::MIN_POSITIVE) * (1.0 + ROUNDING) {
            break;
        }
        state[best] = -state[best];
    }
    state
}
