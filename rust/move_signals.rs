//! Regressors of effects along the samples of a session: play, time derivatives and time shifts inside moves.

use rayon::prelude::*;

/// Half-open range of the samples of a move.
type Edges = [usize; 2];

/// Play (backlash): distance of a path from a follower that it drags with slack, in half-widths, within -1 and 1.
///
/// `path` has rows of `columns` numbers.
#[must_use]
pub fn play(path: &[f64], columns: usize, half_width: f64) -> Vec<f64> {
    let mut follower: Vec<f64> = path.iter().take(columns).copied().collect();
    let mut out = Vec::with_capacity(path.len());
    for row in path.chunks_exact(columns.max(1)) {
        for (follower, value) in follower.iter_mut().zip(row) {
            *follower = follower.max(value - half_width).min(value + half_width);
            out.push((value - *follower) / half_width);
        }
    }
    out
}

/// Time derivative inside moves, zero outside: the slope of the cubic spline of every move with zero slope at both ends.
/// A difference of neighbours would lose 6 % at a tenth of the sampling frequency, where hands tremble.
#[must_use]
pub fn derivative(time: &[f64], values: &[[f64; 3]], moves: &[Edges]) -> Vec<[f64; 3]> {
    let mut out = vec![[0.0; 3]; values.len()];
    for &[start, stop] in moves {
        out[start..stop].copy_from_slice(&spline_slopes(&time[start..stop], &values[start..stop]));
    }
    out
}

/// Values at a time `ahead` seconds later inside moves, constant beyond their ends, by the cubic spline of every move
/// with zero slope at both ends; unchanged outside.
#[must_use]
pub fn shifted(time: &[f64], values: &[[f64; 3]], moves: &[Edges], ahead: f64) -> Vec<[f64; 3]> {
    let each: Vec<Vec<[f64; 3]>> = moves
        .par_iter()
        .map(|&[start, stop]| {
            if stop < start + 2 {
                return values[start..stop].to_vec();
            }
            shifted_move(&time[start..stop], &values[start..stop], ahead)
        })
        .collect();
    let mut out = values.to_vec();
    for (&[start, stop], of_move) in moves.iter().zip(each) {
        out[start..stop].copy_from_slice(&of_move);
    }
    out
}

/// [`shifted`] of one move of two samples or more.
fn shifted_move(t: &[f64], y: &[[f64; 3]], ahead: f64) -> Vec<[f64; 3]> {
    let slopes = spline_slopes(t, y);
    let last = t.len() - 1;
    let mut k = 0;
    t.iter()
        .map(|time| {
            let at = (time + ahead).clamp(t[0], t[last]);
            while k + 1 < last && t[k + 1] <= at {
                k += 1;
            }
            let h = t[k + 1] - t[k];
            let x = (at - t[k]) / h;
            let mut row = [0.0; 3];
            for c in 0..3 {
                let (d0, d1) = (slopes[k][c] * h, slopes[k + 1][c] * h);
                let rise = y[k + 1][c] - y[k][c];
                // Hermite's cubic about its left end.
                let bend = 3.0 * rise - 2.0 * d0 - d1 + x * (d0 + d1 - 2.0 * rise);
                row[c] = y[k][c] + x * (d0 + x * bend);
            }
            row
        })
        .collect()
}

/// Slopes of the spline at its knots: continuous curvature inside, zero slope at both ends.
fn spline_slopes(t: &[f64], y: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let n = t.len();
    let mut slope = vec![[0.0; 3]; n];
    // Forward elimination of the tridiagonal system; `upper` couples a knot to the next one.
    let mut upper = vec![0.0; n];
    for k in 1..n.saturating_sub(1) {
        let (before, after) = (t[k] - t[k - 1], t[k + 1] - t[k]);
        let pivot = 2.0 * (before + after) - after * upper[k - 1];
        upper[k] = before / pivot;
        for c in 0..3 {
            let left = (y[k][c] - y[k - 1][c]) / before;
            let right = (y[k + 1][c] - y[k][c]) / after;
            let side = 3.0 * (after * left + before * right);
            slope[k][c] = (side - after * slope[k - 1][c]) / pivot;
        }
    }
    for k in (1..n.saturating_sub(1)).rev() {
        for c in 0..3 {
            slope[k][c] -= upper[k] * slope[k + 1][c];
        }
    }
    slope
}
