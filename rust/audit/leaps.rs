//! Single readings that lie far from where both neighbours lead.

use rayon::prelude::*;

use super::SHARE;

/// Rows on either side that predict a reading.
const BESIDE: usize = 3;

/// A row with a reading far from its prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Leap {
    /// The row.
    pub row: usize,
    /// Reading minus the cubic through two neighbours on either side, by axis.
    pub away: [f64; 3],
    /// Its standard error by noise and by how unevenly the neighbours themselves move.
    pub error: [f64; 3],
}

/// Rows of which an axis is at least `least` standard errors away; `noise` is that of one sample. Rows near an end, or
/// beside a missing reading, have no prediction.
#[must_use]
pub fn leaps(rows: &[[f64; 3]], noise: &[f64; 3], least: f64) -> Vec<Leap> {
    let width = 2 * BESIDE + 1;
    if rows.len() < width {
        return Vec::new();
    }
    let starts: Vec<usize> = (0..=rows.len() - width).step_by(SHARE).collect();
    let of_share = |&start: &usize| {
        let stop = (start + SHARE + width - 1).min(rows.len());
        let windows = rows[start..stop].windows(width).enumerate();
        windows
            .filter_map(|(k, window)| leap(window, start + k + BESIDE, noise, least))
            .collect::<Vec<_>>()
    };
    starts.par_iter().flat_map_iter(of_share).collect()
}

fn leap(window: &[[f64; 3]], row: usize, noise: &[f64; 3], least: f64) -> Option<Leap> {
    let mut out = Leap {
        row,
        away: [0.0; 3],
        error: [0.0; 3],
    };
    let mut is_far = false;
    for axis in 0..3 {
        let x = |k: usize| window[k][axis];
        // Neither changes of speed on one side nor those from one side to the other contain the reading itself.
        let left = x(0) - 2.0 * x(1) + x(2);
        let right = x(4) - 2.0 * x(5) + x(6);
        let across = (x(4) - x(2)) - (x(2) - x(1)) - (x(5) - x(4));
        let uneven = left.abs().max(right.abs()).max(across.abs());
        out.away[axis] = x(3) - (4.0 * (x(2) + x(4)) - (x(1) + x(5))) / 6.0;
        out.error[axis] = (2.0 * noise[axis] * noise[axis] + uneven * uneven).sqrt();
        if !(out.away[axis].is_finite() && out.error[axis].is_finite()) {
            return None;
        }
        is_far |= out.away[axis].abs() > least * out.error[axis];
    }
    is_far.then_some(out)
}
