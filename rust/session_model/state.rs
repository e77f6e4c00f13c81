//! Values of all unknowns, and the effects there.

use nalgebra::{DVector, Matrix3, Matrix3x2, SVector, Vector3};

use super::chain::Layout;
use super::{N_MODEL, N_POSE_SCATTER};
use crate::sensor_model::LOWER;

/// Effects in the corrected readings, linear in their parameters.
#[derive(Debug, Clone, Default)]
pub struct Distortion {
    /// `(points, 3, k)` row by row, SI; points are the poses, then the samples of every move.
    pub force: Option<Vec<f64>>,
    /// The same of the rate.
    pub rate: Option<Vec<f64>>,
    /// Number of parameters.
    pub k: usize,
    /// Prior standard deviation of each; empty where unknown.
    pub sizes: Vec<f64>,
}

/// Values of all unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Accelerometer `S`, lower triangular.
    pub force_scale: Matrix3<f64>,
    /// Accelerometer `b`, on centred readings.
    pub force_bias: Vector3<f64>,
    /// Gyro `S`.
    pub rate_scale: Matrix3<f64>,
    /// Vertical in the body, unit.
    pub up: Vec<Vector3<f64>>,
    /// Raw bias of the gyro in each pose.
    pub pose_rate_bias: Vec<Vector3<f64>>,
    /// Raw bias of the accelerometer in each pose, in addition to `b`.
    pub pose_force_bias: Vec<Vector3<f64>>,
    /// The part of either bias that belongs to one pose alone (accelerometer, gyro); zero without scatter.
    pub own: [Vec<Vector3<f64>>; 2],
    /// Effect parameters.
    pub effect: DVector<f64>,
}

impl Distortion {
    /// Effect `Σ D p` of one sensor at every point.
    #[must_use]
    pub fn at(
        columns: Option<&Vec<f64>>,
        k: usize,
        effect: &DVector<f64>,
    ) -> Option<Vec<Vector3<f64>>> {
        let columns = columns?;
        Some(
            columns
                .chunks_exact(3 * k.max(1))
                .map(|row| {
                    let (x, rest) = row.split_at(k);
                    let (y, z) = rest.split_at(k);
                    let along = |own: &[f64]| {
                        let pairs = own.iter().zip(effect.as_slice());
                        pairs.map(|(value, size)| value * size).sum::<f64>()
                    };
                    Vector3::new(along(x), along(y), along(z))
                })
                .collect(),
        )
    }
}

impl State {
    /// The state after a step.
    #[must_use]
    pub fn moved(&self, step: &DVector<f64>, layout: Layout) -> Self {
        let mut out = self.clone();
        for (c, &(i, j)) in LOWER.iter().enumerate() {
            out.force_scale[(i, j)] += step[c];
        }
        for i in 0..3 {
            out.force_bias[i] += step[6 + i];
            for j in 0..3 {
                out.rate_scale[(i, j)] += step[9 + 3 * i + j];
            }
        }
        for c in 0..layout.border - N_MODEL {
            out.effect[c] += step[N_MODEL + c];
        }
        for h in 0..layout.n_poses {
            let at = layout.at(h);
            let turn = tangent_plane(&self.up[h]) * nalgebra::Vector2::new(step[at], step[at + 1]);
            out.up[h] = (self.up[h] + turn).normalize();
            let three = |first: usize| {
                Vector3::new(step[at + first], step[at + first + 1], step[at + first + 2])
            };
            out.pose_rate_bias[h] += three(2);
            out.pose_force_bias[h] += three(5);
            if layout.pose == N_POSE_SCATTER {
                out.own[1][h] += three(8);
                out.own[0][h] += three(11);
            }
        }
        out
    }

    /// Mean of the raw biases of the accelerometer (0) or the gyro (1) over the poses, without the parts of single
    /// poses.
    #[must_use]
    pub fn mean_pose_bias(&self, sensor: usize) -> Vector3<f64> {
        let bias = [&self.pose_force_bias, &self.pose_rate_bias][sensor];
        let all = bias.iter().zip(&self.own[sensor]);
        all.map(|(bias, own)| bias - own).sum::<Vector3<f64>>() / bias.len() as f64
    }

    /// Accelerometer `b`, on centred readings, with one bias for the session (docs/model-session.md, 11.16).
    #[must_use]
    pub fn session_force_bias(&self) -> Vector3<f64> {
        self.force_bias - self.force_scale * self.mean_pose_bias(0)
    }

    /// The 18 parameters of the linear models.
    #[must_use]
    pub fn model(&self) -> SVector<f64, N_MODEL> {
        let mut out = SVector::<f64, N_MODEL>::zeros();
        for (c, &(i, j)) in LOWER.iter().enumerate() {
            out[c] = self.force_scale[(i, j)];
        }
        for i in 0..3 {
            out[6 + i] = self.force_bias[i];
            for j in 0..3 {
                out[9 + 3 * i + j] = self.rate_scale[(i, j)];
            }
        }
        out
    }
}

/// Two unit vectors perpendicular to a unit vector.
#[must_use]
pub fn tangent_plane(up: &Vector3<f64>) -> Matrix3x2<f64> {
    let mut helper = Vector3::zeros();
    helper[up.iamin()] = 1.0;
    let first = up.cross(&helper).normalize();
    Matrix3x2::from_columns(&[first, up.cross(&first)])
}
