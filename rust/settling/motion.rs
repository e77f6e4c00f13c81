//! Rotation of the sensor inside its poses: mean rate by gravity, shape by the gyro (docs/diagnosis-method.md, 8.7f).

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::{N_BLOCKS, Poses, mean};
use crate::order_statistics::median;

/// Degrees of freedom of the heavy tails of motions: those of moves have as many (docs/model-session.md, 11.18a).
const DEGREES: f64 = 4.0;
/// Standard errors from the usual motion to its upper limit.
const CLEAR: f64 = 2.0;
/// Median of the sum of squares of two standard normal variables.
const MEDIAN_OF_TWO: f64 = 2.0 * std::f64::consts::LN_2;

/// Rotation of the sensor inside one pose.
#[derive(Debug, Clone, Copy)]
pub struct PoseMotion {
    /// Mean rate, rad/s, and its variance.
    pub rate: [Vector3<f64>; 2],
    /// Change of the vertical from the mean over the pose to the end of the move before and to the beginning of the next.
    pub leans: [Vector3<f64>; 2],
    /// Variance of the rotation from the mean to either, rad².
    pub edge_variance: [f64; 2],
}

/// What the readings of one pose say of its motion: mean rate across the vertical by gravity, rad/s; rotation from the
/// mean to the edges beyond that of an even rate, rad, by the gyro; their error variances.
pub(super) struct Seen {
    rate: Vector3<f64>,
    curve: [Vector3<f64>; 2],
    variance: [f64; 2],
    /// Log-likelihood by which gravity prefers changes of the bias to a rotation as the cause of the gyro's curve.
    pub of_bias: f64,
}

/// Motion of all poses, of which the likeliest begins at the rate `spread` and decays with `tau`.
pub(super) fn motions(
    poses: &Poses<'_>,
    seen: Vec<Option<Seen>>,
    spread: f64,
    tau: f64,
) -> Vec<PoseMotion> {
    let lasts = |i: usize| {
        let [first, last] = poses.spans[i];
        last.saturating_sub(first).max(1) as f64 * poses.step
    };
    // Rotations over a whole pose (those of short and of long ones are alike), and bends; the errors of either.
    let usual = [0, 1].map(|k| {
        let unit = |i: usize| if k == 0 { lasts(i).powi(2) } else { 1.0 };
        let each = seen.iter().enumerate();
        let known = each.filter_map(|(i, one)| Some((unit(i), one.as_ref()?)));
        let (mut squares, mut errors): (Vec<f64>, Vec<f64>) = known
            .map(|(unit, one)| (unit, one.square(k) / MEDIAN_OF_TWO, one.variance[k]))
            .map(|(unit, square, error)| (unit * (square - error), unit * error))
            .unzip();
        if squares.is_empty() {
            return [0.0; 2];
        }
        let error = CLEAR * median(&mut errors) / (squares.len() as f64).sqrt();
        [median(&mut squares).max(0.0), error]
    });
    // As large as is likeliest, which a few large ones make too large for all others, or as gravity shows at most.
    let of_rates = |lasts: f64| {
        let likeliest = (spread * tau * (1.0 - (-lasts / tau).exp())).powi(2);
        let rotation = likeliest.min(usual[0][0] + usual[0][1]);
        rotation / (lasts * lasts)
    };
    let each = seen.into_iter().enumerate();
    each.map(|(i, seen)| {
        let lasts = lasts(i);
        let prior = [of_rates(lasts), usual[1][0]];
        // A pose without readings has the usual motion.
        let seen = seen.unwrap_or(Seen {
            rate: Vector3::zeros(),
            curve: [Vector3::zeros(); 2],
            variance: [f64::INFINITY; 2],
            of_bias: 0.0,
        });
        // Heavy tails: the variance of a pose is drawn about the usual one, and its own motion tells of it.
        let [of_rate, of_curve] = [0, 1].map(|k| {
            let own = (seen.square(k) - 2.0 * seen.variance[k]).max(0.0);
            (DEGREES * prior[k] + own) / (DEGREES + 2.0)
        });
        let share = |prior: f64, k: usize| {
            if prior > 0.0 {
                prior / (prior + seen.variance[k])
            } else {
                0.0
            }
        };
        let (rate, curve) = (share(of_rate, 0), share(of_curve, 1));
        let left = [of_rate * (1.0 - rate), of_curve * (1.0 - curve)];
        let turned = seen.rate * rate;
        // Time from the middle of the pose, s.
        let [first, last] = poses.spans[i];
        let at = poses.edges[i].map(|k| {
            (k.clamp(first, last.max(first)) as f64 - first as f64) * poses.step - 0.5 * lasts
        });
        let up = Vector3::from(poses.up[i]);
        // About the vertical, which gravity does not show, all of it is left.
        let about = up.component_mul(&up);
        PoseMotion {
            rate: [
                turned,
                about * of_rate + (Vector3::repeat(1.0) - about) * left[0],
            ],
            leans: [0, 1].map(|k| up.cross(&(turned * at[k] + seen.curve[k] * curve))),
            edge_variance: at.map(|at| left[0] * at * at + left[1]),
        }
    })
    .collect()
}

impl Seen {
    /// Square of the rate, or mean square of the curve at both edges, both across the vertical.
    fn square(&self, k: usize) -> f64 {
        if k == 0 {
            self.rate.norm_squared()
        } else {
            0.5 * (self.curve[0].norm_squared() + self.curve[1].norm_squared())
        }
    }
}

/// `None` where readings are missing, or have no noise.
pub(super) fn seen(poses: &Poses<'_>, i: usize) -> Option<Seen> {
    let [first, last] = poses.spans[i];
    let n = last.checked_sub(first).filter(|n| *n >= 2 * N_BLOCKS)?;
    let up = Vector3::from(poses.up[i]);
    let across = Matrix3::identity() - up * up.transpose();
    let turning = -up.cross_matrix() / poses.gravity * poses.scale[1];
    let [of_rate, of_tilt] = [0, 1].map(|sensor| {
        let noise = Vector3::from(poses.noise[sensor][i]);
        let by = if sensor == 0 {
            across * poses.scale[0]
        } else {
            turning
        };
        0.5 * (by * Matrix3::from_diagonal(&noise)).norm_squared()
    });
    let [rates, forces] = poses.readings.map(|readings| &readings[first..last]);
    let mean_rate = mean(rates);
    let (mut turned, mut sum, mut slope) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
    let mut parts = [[Vector3::zeros(); 2]; N_BLOCKS];
    let edges = poses.edges[i].map(|k| k.clamp(first, last - 1) - first);
    let mut at_edges = [Vector3::zeros(); 2];
    for (k, (rate, force)) in rates.iter().zip(forces).enumerate() {
        // Rotation to the middle of the sample, beyond that at the mean rate.
        let step = (Vector3::from(*rate) - mean_rate) * poses.step;
        let here = across * poses.scale[0] * (turned + 0.5 * step);
        turned += step;
        sum += here;
        for (at_edge, edge) in at_edges.iter_mut().zip(edges) {
            if k == edge {
                *at_edge = here;
            }
        }
        // Gravity shows the rotation at the mean rate beside it.
        let at = k as f64 - 0.5 * (n as f64 - 1.0);
        let tilt = turning * Vector3::from(*force);
        slope += (tilt - here) * at;
        let part = &mut parts[(k * N_BLOCKS / n).min(N_BLOCKS - 1)];
        part[0] += tilt;
        part[1] += tilt - here;
    }
    let lasts = n as f64 * poses.step;
    let [as_bias, as_motion] = [0, 1].map(|of| {
        let means = parts.map(|part| part[of] * (N_BLOCKS as f64 / n as f64));
        let chi2 = bends(&means, of_tilt, of as f64 * of_rate * lasts * lasts);
        // Heavy tails: the tail of a move is neither motion at rest nor bias.
        (0.5 * DEGREES + (N_BLOCKS - 2) as f64) * (chi2 / DEGREES).ln_1p()
    });
    let rate = slope * (12.0 / ((n as f64).powi(3) * poses.step));
    let curve = at_edges.map(|here| here - sum / n as f64);
    (rate + curve[0])
        .iter()
        .all(|value| value.is_finite())
        .then_some(Seen {
            rate,
            curve,
            variance: [
                // Of a slope of even noise; of the bends of the gyro's integral, 6/5 less the 1 of its mean.
                12.0 * of_tilt / (lasts * lasts) + 0.2 * of_rate,
                of_rate * lasts * lasts / 12.0,
            ],
            of_bias: as_motion - as_bias,
        })
}

/// χ² of the parts of a pose about a straight line: even noise, `of_mean` the variance of the mean over the pose, and a
/// random walk, of variance `walked` over the pose.
fn bends(parts: &[Vector3<f64>; N_BLOCKS], of_mean: f64, walked: f64) -> f64 {
    let covariance = SMatrix::<f64, N_BLOCKS, N_BLOCKS>::from_fn(|i, j| {
        let at = |within: f64| walked * (i.min(j) as f64 + within) / N_BLOCKS as f64;
        if i == j {
            of_mean * N_BLOCKS as f64 + at(1.0 / 3.0)
        } else {
            at(0.5)
        }
    });
    let read = SMatrix::<f64, N_BLOCKS, 3>::from_fn(|i, axis| parts[i][axis]);
    let second = SMatrix::<f64, { N_BLOCKS - 2 }, N_BLOCKS>::from_fn(|i, j| {
        [1.0, -2.0, 1.0]
            .get(j.wrapping_sub(i))
            .copied()
            .unwrap_or(0.0)
    });
    let bent = second * read;
    let half = (second * covariance * second.transpose()).cholesky();
    half.map_or(0.0, |half| bent.dot(&half.solve(&bent)))
}
