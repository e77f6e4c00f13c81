//! The one joint estimator of a session of static poses and moves (docs/model-session.md).
//!
//! Unknowns: those that all poses share (accelerometer `S` lower and `b`, gyro `S`, effect parameters), and for every
//! pose the vertical in the body and the biases of both sensors. Biases are states in *raw* units: the raw reading is
//! the measurement, so that a smaller `S` reduces no residual. Rows of static readings involve one pose, moves and
//! walks two neighbours: the normal equations are a chain with a border ([`chain`]).

mod bias_rows;
mod blocks;
pub mod candidate_gains;
pub mod chain;
mod elimination;
mod ends;
mod equations;
pub mod factor;
pub mod fit;
mod fixed_weights;
pub mod gaps;
pub mod held_out;
pub mod hypothesis;
mod lanes;
pub mod lost_samples;
mod move_losses;
pub mod move_rows;
pub mod moves;
mod open_move;
pub mod path;
mod possible;
mod possible_rate;
pub mod predict;
pub mod response;
mod rest_rows;
pub mod rows;
mod sample_noise;
pub mod state;
pub mod strength_search;
pub mod strengths;

use std::sync::Arc;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::error::{Error, Result};
use chain::Layout;
use moves::{Move, MoveNoise};
pub use state::{Distortion, State, tangent_plane};

/// Parameters of both linear models: six of the accelerometer's `S`, three of its `b`, nine of the gyro's `S`.
pub const N_MODEL: usize = 18;
/// Unknowns of a pose without scatter: vertical (2), bias of the gyro (3), of the accelerometer (3).
pub const N_POSE: usize = 8;
/// Strengths of scatter: one of the accelerometer, whose axes gravity's length does not separate, three of the gyro.
pub const N_SCATTER: usize = 4;
/// Unknowns of a pose with scatter: also the part of either bias that belongs to this pose alone (3 each).
pub const N_POSE_SCATTER: usize = 14;

/// Means of one sensor over the static poses, raw and centred.
#[derive(Debug, Clone)]
pub struct StaticMeans {
    /// Mean reading of each pose.
    pub mean: Vec<Vector3<f64>>,
    /// Standard error of each mean.
    pub sigma: Vec<Vector3<f64>>,
    /// `Σ^(-1/2)` of the error of each mean.
    pub white: Vec<Matrix3<f64>>,
    /// White noise, raw unit · √s.
    pub density: Vector3<f64>,
}

impl StaticMeans {
    /// Means with standard errors along the sensor's axes and, where `along` is given, another error along one
    /// direction (a unit vector and its standard error, not finite where unknown).
    ///
    /// # Errors
    /// When there are not as many directions as poses.
    pub fn of(
        mean: Vec<Vector3<f64>>,
        sigma: Vec<Vector3<f64>>,
        density: Vector3<f64>,
        along: Option<(&[Vector3<f64>], &[f64])>,
    ) -> Result<Self> {
        if let Some((direction, error)) = along
            && (direction.len(), error.len()) != (sigma.len(), sigma.len())
        {
            return Err(Error::bad_input(format!(
                "{} poses need as many verticals and errors along them",
                sigma.len()
            )));
        }
        let white = sigma
            .iter()
            .enumerate()
            .map(|(i, axes)| {
                let plain = Matrix3::from_diagonal(&axes.map(f64::recip));
                let Some((direction, error)) = along.map(|(d, e)| (d[i], e[i])) else {
                    return plain;
                };
                if !(error.is_finite() && error > 0.0) {
                    return plain;
                }
                // Across the direction the errors of the axes, along it its own error.
                let across = Matrix3::identity() - direction * direction.transpose();
                let covariance = across * Matrix3::from_diagonal(&axes.map(|s| s * s)) * across
                    + direction * direction.transpose() * (error * error);
                let eigen = covariance.symmetric_eigen();
                let inverse = eigen
                    .eigenvalues
                    .map(|v| v.max(f64::MIN_POSITIVE).sqrt().recip());
                eigen.eigenvectors
                    * Matrix3::from_diagonal(&inverse)
                    * eigen.eigenvectors.transpose()
            })
            .collect();
        Ok(Self {
            mean,
            sigma,
            white,
            density,
        })
    }
}

/// Prior of the linear models.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Mean, `(18)`.
    pub mean: SVector<f64, N_MODEL>,
    /// `L⁻¹` of the covariance `L Lᵀ`.
    pub white: SMatrix<f64, N_MODEL, N_MODEL>,
    /// Whether it describes instruments in general: its rows then belong to no domain.
    pub is_weak: bool,
}

/// All readings of a session.
#[derive(Debug, Clone)]
pub struct Session {
    /// |g|, m/s².
    pub gravity: f64,
    /// Rotation of the Earth about the vertical, rad/s, which the gyro reads in static poses; 0 without a latitude.
    pub earth_up: f64,
    /// Middle of each pose, s.
    pub time_s: Vec<f64>,
    /// Accelerometer in static poses.
    pub force: StaticMeans,
    /// Gyro in static poses.
    pub rate: Option<StaticMeans>,
    /// Moves between neighbouring poses.
    pub moves: Arc<Vec<Move>>,
    /// Noise of the moves' samples.
    pub noise: MoveNoise,
    /// Prior of the linear models, if any.
    pub prior: Option<Prior>,
    /// Scatter of the biases at strength one, raw units (accelerometer, gyro); `None`: biases only walk.
    pub scatter: Option<[Vector3<f64>; 2]>,
    /// Strength of the accelerometer's scatter expected from the noise inside poses; 0 where it shows none (11.12d).
    pub expected_scatter: f64,
}

/// Strengths of the processes behind the biases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strengths {
    /// Corner time at which white noise and walk meet, s: accelerometer, gyro.
    pub corner_s: [f64; 2],
    /// Scatter from pose to pose in units of [`Session::scatter`]: accelerometer, then each axis of the gyro.
    pub scatter: [f64; N_SCATTER],
    /// Departure of a bias from the line between its poses, during a move, in units of its scatter.
    pub between: [f64; 2],
    /// Factors on the standard errors of gravity after moves and of the velocity over them; below 1 on the part of
    /// motion faster than the samples.
    pub excess: [f64; 2],
}

impl Strengths {
    /// Biases without walk and scatter.
    pub const NONE: Self = Self {
        corner_s: [f64::INFINITY; 2],
        scatter: [0.0; N_SCATTER],
        between: [0.0; 2],
        excess: [1.0; 2],
    };
}

impl Strengths {
    /// Largest change of a logarithm from `other`; 0 where none differs.
    #[must_use]
    pub fn changed_from(&self, other: &Self) -> f64 {
        let pairs = (self.corner_s.iter().zip(&other.corner_s))
            .chain(self.scatter.iter().zip(&other.scatter))
            .chain(self.between.iter().zip(&other.between))
            .chain(self.excess.iter().zip(&other.excess));
        pairs.fold(0.0, |most, (a, b)| most.max((a / b).ln().abs()))
    }
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
                "a session needs at least 2 static poses, got {h}"
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
