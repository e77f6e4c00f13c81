//! The one joint estimator of a session of still poses and moves (docs/model-session.md).
//!
//! Unknowns: what all poses share (accelerometer `S` lower and `b`, gyro `S`, effect parameters), and for every pose the
//! vertical in the body and the zeros of both sensors. Zeros are states in *raw* units: the raw reading is the datum, so
//! that no sensor can buy itself a smaller residual by shrinking. Rest rows speak of one pose, moves and walks of two
//! neighbours: the normal equations are a chain with a border ([`chain`]).

pub mod chain;
pub mod fit;
pub mod moves;
pub mod predict;
pub mod rows;

use nalgebra::{DVector, Matrix3, Matrix3x2, SMatrix, SVector, Vector3};

use crate::error::{Error, Result};
use chain::Layout;
use moves::{Move, MoveNoise};

/// Parameters of both linear models: six of the accelerometer's `S`, three of its `b`, nine of the gyro's `S`.
pub const N_MODEL: usize = 18;
/// Unknowns of a pose without scatter: vertical (2), zero of the gyro (3), of the accelerometer (3).
pub const N_POSE: usize = 8;
/// With the share of either zero that is this pose's alone.
pub const N_POSE_SCATTER: usize = 14;
/// `(row, column)` of the free elements of the accelerometer's `S`.
pub const LOWER: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

/// Means of one sensor over the still poses, raw and centred.
#[derive(Debug, Clone)]
pub struct AtRest {
    /// Mean reading of each pose.
    pub mean: Vec<Vector3<f64>>,
    /// Its standard error.
    pub sigma: Vec<Vector3<f64>>,
    /// White noise, raw unit · √s.
    pub density: Vector3<f64>,
}

/// Values the linear models are held to.
#[derive(Debug, Clone)]
pub struct Prior {
    /// `(18)`.
    pub mean: SVector<f64, N_MODEL>,
    /// `L⁻¹` of the covariance `L Lᵀ`.
    pub white: SMatrix<f64, N_MODEL, N_MODEL>,
    /// Whether it only says what any instrument is like: its rows then belong to no domain.
    pub is_weak: bool,
}

/// Everything that was read.
#[derive(Debug, Clone)]
pub struct Session {
    /// |g|, m/s².
    pub gravity: f64,
    /// Middle of each pose, s.
    pub time_s: Vec<f64>,
    /// Accelerometer at rest.
    pub force: AtRest,
    /// Gyro at rest.
    pub rate: Option<AtRest>,
    /// Moves between neighbouring poses.
    pub moves: Vec<Move>,
    /// Noise of their samples.
    pub noise: MoveNoise,
    /// What is known beforehand.
    pub prior: Option<Prior>,
    /// Scatter of the zeros that strength one means, raw units (accelerometer, gyro); `None`: zeros only walk.
    pub scatter: Option<[Vector3<f64>; 2]>,
}

/// Strengths of the processes behind the zeros.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strengths {
    /// Corner time at which white noise and walk meet, s: accelerometer, gyro.
    pub corner_s: [f64; 2],
    /// Scatter from pose to pose in units of [`Session::scatter`].
    pub scatter: [f64; 2],
}

/// What effects add to the corrected readings, linear in their parameters.
#[derive(Debug, Clone, Default)]
pub struct Distortion {
    /// `(points, 3, k)` row by row, SI; points are the poses, then the samples of every move.
    pub force: Option<Vec<f64>>,
    /// The same of the rate.
    pub rate: Option<Vec<f64>>,
    /// Parameters.
    pub k: usize,
}

/// A point in the space of all unknowns.
#[derive(Debug, Clone)]
pub struct State {
    /// Accelerometer `S`, lower triangular.
    pub force_scale: Matrix3<f64>,
    /// Accelerometer `b`, on centred readings.
    pub force_bias: Vector3<f64>,
    /// Gyro `S`.
    pub rate_scale: Matrix3<f64>,
    /// Vertical in the body, unit.
    pub up: Vec<Vector3<f64>>,
    /// Raw zero of the gyro in each pose.
    pub rate_zero: Vec<Vector3<f64>>,
    /// Raw zero of the accelerometer in each pose, beside `b`.
    pub force_zero: Vec<Vector3<f64>>,
    /// The share of either zero that is one pose's alone (accelerometer, gyro); zero without scatter.
    pub own: [Vec<Vector3<f64>>; 2],
    /// Effect parameters.
    pub effect: DVector<f64>,
}

impl Session {
    /// Number of poses.
    #[must_use]
    pub fn n_poses(&self) -> usize {
        self.force.mean.len()
    }

    /// Poses and samples of moves together.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.n_poses() + self.moves.iter().map(Move::n_samples).sum::<usize>()
    }

    /// Sizes of the unknowns with `k` effect parameters.
    #[must_use]
    pub fn layout(&self, k: usize) -> Layout {
        Layout {
            border: N_MODEL + k,
            pose: if self.scatter.is_some() {
                N_POSE_SCATTER
            } else {
                N_POSE
            },
            n_poses: self.n_poses(),
        }
    }

    /// Checks sizes and noise.
    ///
    /// # Errors
    /// When arrays do not fit one another, a pose has no noise, or a move does not join neighbours.
    pub fn check(&self) -> Result<()> {
        let h = self.n_poses();
        if h < 2 {
            return Err(Error::bad_input(format!(
                "a session needs at least 2 still poses, got {h}"
            )));
        }
        let sizes = [self.time_s.len(), self.force.sigma.len()];
        let rate_sizes = self
            .rate
            .as_ref()
            .map_or([h, h], |rate| [rate.mean.len(), rate.sigma.len()]);
        if sizes.iter().chain(&rate_sizes).any(|&size| size != h) {
            return Err(Error::bad_input(format!(
                "{h} poses need as many times, means and standard errors"
            )));
        }
        for sensor in [Some(&self.force), self.rate.as_ref()]
            .into_iter()
            .flatten()
        {
            let is_sound = |v: &Vector3<f64>| v.iter().all(|s| s.is_finite() && *s > 0.0);
            if !sensor.sigma.iter().all(is_sound) {
                return Err(Error::bad_input(
                    "the standard error of a pose is zero or not finite: its readings never change; check the column",
                ));
            }
            if !sensor.mean.iter().all(|v| v.iter().all(|x| x.is_finite())) {
                return Err(Error::bad_input("the mean of a pose is not finite"));
            }
        }
        if let Some(one) = self.moves.iter().find(|one| one.before + 1 >= h) {
            return Err(Error::bad_input(format!(
                "a move begins in pose {} and there is none after it",
                one.before
            )));
        }
        if !self.moves.is_empty() && self.rate.is_none() {
            return Err(Error::bad_input("moves need a gyro"));
        }
        Ok(())
    }
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
                    Vector3::from_fn(|i, _| (0..k).map(|c| row[i * k + c] * effect[c]).sum::<f64>())
                })
                .collect(),
        )
    }

    /// Two distortions side by side.
    #[must_use]
    pub fn beside(&self, other: &Self) -> Self {
        let k = self.k + other.k;
        let join = |a: Option<&Vec<f64>>, b: Option<&Vec<f64>>| {
            if a.is_none() && b.is_none() {
                return None;
            }
            let rows = a
                .map(|a| a.len() / self.k)
                .or_else(|| b.map(|b| b.len() / other.k))?;
            let mut out = Vec::with_capacity(rows * k);
            for r in 0..rows {
                match a {
                    Some(a) => out.extend_from_slice(&a[r * self.k..(r + 1) * self.k]),
                    None => out.extend(std::iter::repeat_n(0.0, self.k)),
                }
                match b {
                    Some(b) => out.extend_from_slice(&b[r * other.k..(r + 1) * other.k]),
                    None => out.extend(std::iter::repeat_n(0.0, other.k)),
                }
            }
            Some(out)
        };
        Self {
            force: join(self.force.as_ref(), other.force.as_ref()),
            rate: join(self.rate.as_ref(), other.rate.as_ref()),
            k,
        }
    }
}

impl State {
    /// The state a step away.
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
            out.rate_zero[h] += three(2);
            out.force_zero[h] += three(5);
            if layout.pose == N_POSE_SCATTER {
                out.own[1][h] += three(8);
                out.own[0][h] += three(11);
            }
        }
        out
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

/// Two unit vectors across a unit vector.
#[must_use]
pub fn tangent_plane(up: &Vector3<f64>) -> Matrix3x2<f64> {
    let mut helper = Vector3::zeros();
    helper[up.iamin()] = 1.0;
    let first = up.cross(&helper).normalize();
    Matrix3x2::from_columns(&[first, up.cross(&first)])
}
