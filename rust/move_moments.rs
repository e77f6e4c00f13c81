//! First moments of a force and a rate over a move: the rotation of the force by a rate of unknown scale and axes.

use nalgebra::{Matrix3, Vector3};

use crate::rotation::exp;

/// `∫ f wᵀ dt` by trapezoids over every move, `f = S a + b` of the readings `a`, `w` the rate less the move's `bias`.
/// Rows that are not finite are skipped; `None` where fewer than two remain.
#[must_use]
pub fn moments(
    time: &[f64],
    reading: &[Vector3<f64>],
    direct: (&Matrix3<f64>, &Vector3<f64>),
    rate: &[Vector3<f64>],
    moves: &[[usize; 2]],
    bias: &[Vector3<f64>],
) -> Vec<Option<Matrix3<f64>>> {
    let is_number = |v: &Vector3<f64>| v.iter().all(|value| value.is_finite());
    let of_move = |(&[start, stop], bias): (&[usize; 2], &Vector3<f64>)| {
        let mut sum = Matrix3::zeros();
        let (mut before, mut rows): (Option<(f64, Matrix3<f64>)>, usize) = (None, 0);
        for i in start..stop {
            let (force, rate) = (direct.0 * reading[i] + direct.1, rate[i] - bias);
            if !(is_number(&force) && is_number(&rate)) {
                continue;
            }
            let now = (time[i], force * rate.transpose());
            if let Some((then, product)) = before {
                sum += (product + now.1) * (0.5 * (now.0 - then));
            }
            before = Some(now);
            rows += 1;
        }
        (rows > 1).then_some(sum)
    };
    moves.iter().zip(bias).map(of_move).collect()
}

/// `∫ f wᵀ dt` over every move as [`moments`], of the force `f` at rest before a move (`ends`, first) that the rate of
/// scale `scale` rotates forwards and of that after it (second) rotated back: at every angle the average of both,
/// weighted by the angle to the other end. Accelerations have no part in it.
#[must_use]
pub fn rotated_moments(
    time: &[f64],
    rate: &[Vector3<f64>],
    moves: &[[usize; 2]],
    bias: &[Vector3<f64>],
    scale: &Matrix3<f64>,
    ends: &[[Vector3<f64>; 2]],
) -> Vec<Matrix3<f64>> {
    let of_move = |k: usize| {
        let ([start, stop], bias, ends) = (moves[k], bias[k], ends[k]);
        let finite: Vec<usize> = (start..stop)
            .filter(|&i| rate[i].iter().all(|value| value.is_finite()))
            .collect();
        let steps: Vec<Vector3<f64>> = finite
            .windows(2)
            .map(|pair| {
                ((rate[pair[0]] + rate[pair[1]]) * 0.5 - bias) * (time[pair[1]] - time[pair[0]])
            })
            .collect();
        let halves: Vec<Matrix3<f64>> = steps
            .iter()
            .map(|step| exp(&(scale * step * 0.5)))
            .collect();
        let whole: f64 = steps.iter().map(|step| (scale * step).norm()).sum();
        // In the middle of every step, from the last to the first.
        let mut force = ends[1];
        let mut back: Vec<Vector3<f64>> = Vec::with_capacity(steps.len());
        for half in halves.iter().rev() {
            back.push(half * force);
            force = half * (half * force);
        }
        let (mut force, mut angle, mut sum) = (ends[0], 0.0, Matrix3::zeros());
        for ((step, half), back) in steps.iter().zip(&halves).zip(back.iter().rev()) {
            let turn = (scale * step).norm();
            let share = (angle + 0.5 * turn) / whole.max(f64::MIN_POSITIVE);
            let forwards = half.tr_mul(&force);
            sum += (forwards * (1.0 - share) + back * share) * step.transpose();
            force = half.tr_mul(&forwards);
            angle += turn;
        }
        sum
    };
    (0..moves.len()).map(of_move).collect()
}
