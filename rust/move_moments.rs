//! First moments of a force and a rate over a move: the rotation of the force by a rate of unknown scale and axes.

use nalgebra::{Matrix3, Vector3};

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
