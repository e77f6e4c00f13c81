//! Method 2 for gyros: the rotation between still poses must carry one measured specific force into the other.
//!
//! For the move from pose `i` to pose `j`
//!
//! ```text
//! r = Tⱼᵀ (B(S_ω, z) f_i − f_j),      f = S_f a' + b_f                                      (5.7)
//! ```
//!
//! `Tⱼ` spans the plane across `f_j`: the length of `f` belongs to the accelerometer, so a move carries rank-two
//! information. `z` is the bias of the gyro, interpolated between the means of the two poses. The residuals are
//! weighed by their full covariance (5.8), in which neighbouring moves are correlated through the pose they share. With
//! free accelerometer parameters the rows `|f_h| − |g|` of every pose join in, and the fit is the joint one. A given
//! accelerometer with standard errors is held to them by rows of its own, which is to weigh its errors as noise that all
//! moves share.

mod covariance;
mod stages;

use crate::error::{Error, Result};
use crate::poisson::{PreparedMove, RateNoise, Turn, integrate_all};
use crate::rotation::skew;
use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, Matrix3x2, SMatrix, Vector3};
use std::cell::RefCell;
use std::rc::Rc;

pub use stages::{Fit, Settings, fit};

/// Means of one still pose.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// Raw accelerometer mean.
    pub reading: Vector3<f64>,
    /// Variance of each component of that mean.
    pub var_reading: Vector3<f64>,
    /// Raw gyro mean: the bias here.
    pub bias: Vector3<f64>,
    /// Variance of each component of that mean.
    pub var_bias: Vector3<f64>,
}

/// A move joins two poses.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    /// Hold before.
    pub before: usize,
    /// Hold after.
    pub after: usize,
}

/// Both sensors' direct models.
#[derive(Debug, Clone)]
pub struct Model {
    /// `S_f`.
    pub accelerometer_scale: Matrix3<f64>,
    /// `b_f`.
    pub accelerometer_bias: Vector3<f64>,
    /// `S_ω`.
    pub gyroscope_scale: Matrix3<f64>,
    /// A rate in the moves that the poses do not show, rad/s (zero unless asked for).
    pub rate_offset: Vector3<f64>,
    /// How far each free accelerometer direction was followed from the start.
    pub followed: DVector<f64>,
}

/// Everything measured.
#[derive(Debug, Clone)]
pub struct Alignment {
    /// Still poses.
    pub poses: Vec<Pose>,
    /// Which poses each move joins.
    pub links: Vec<Link>,
    /// The moves.
    pub moves: Vec<PreparedMove>,
    /// Moves that take part in the fit; the others are only predicted.
    pub used: Vec<bool>,
    /// Known magnitude of gravity, m/s².
    pub gravity: f64,
    /// Noise of the integrated rate.
    pub noise: RateNoise,
    /// Variance of the true change of the bias from pose to pose, raw unit².
    pub var_bias_walk: Vector3<f64>,
    /// Directions in `(S_f row by row, b_f)` that are free: `(12, k)`; no columns when the accelerometer is given.
    pub accelerometer_basis: DMatrix<f64>,
    /// Whether these directions are standard errors of a given accelerometer (each then has a row of its own that holds
    /// it to zero) instead of free parameters, for which the norms of the poses speak.
    pub is_accelerometer_given: bool,
    /// Whether the rate offset is free.
    pub is_offset_free: bool,
    /// What is known of it beforehand: rows `(m, 3)` whose product with it has mean zero and variance one.
    pub offset_white: DMatrix<f64>,
}

/// 3 × 12 derivative of `f` with respect to `(S_f row by row, b_f)`.
type WrtAccelerometer = SMatrix<f64, 3, 12>;

fn force_wrt_accelerometer(reading: &Vector3<f64>) -> WrtAccelerometer {
    let mut out = WrtAccelerometer::zeros();
    for i in 0..3 {
        for j in 0..3 {
            out[(i, 3 * i + j)] = reading[j];
        }
        out[(i, 9 + i)] = 1.0;
    }
    out
}

/// Two unit vectors across `direction`.
#[must_use]
pub fn tangent_plane(direction: &Vector3<f64>) -> Matrix3x2<f64> {
    let smallest = direction.iamin();
    let mut helper = Vector3::zeros();
    helper[smallest] = 1.0;
    let first = direction.cross(&helper).normalize();
    let second = direction.cross(&first).normalize();
    Matrix3x2::from_columns(&[first, second])
}

/// The model evaluated: forces of the poses and rotations of the moves.
struct Evaluated {
    model: Model,
    forces: Vec<Vector3<f64>>,
    turns: Rc<Vec<Turn>>,
}

/// The rotations integrated last: they depend on the gyro's scale and offset alone, and the solver, the covariance and the
/// next round all ask for them at the same point.
#[derive(Default)]
struct LastTurns(RefCell<Option<TurnsAt>>);

/// Scale and bias of a point, and the turns integrated there.
type TurnsAt = (Matrix3<f64>, Vector3<f64>, Rc<Vec<Turn>>);

/// Residual of one move and everything it answers to, in three components.
struct MoveRow {
    residual: Vector3<f64>,
    /// Derivative with respect to the rotation vector at the start of the move: `B [f_i]×`.
    wrt_angle: Matrix3<f64>,
    jacobian: DMatrix<f64>,
}

impl Alignment {
    /// Checks that sizes agree.
    ///
    /// # Errors
    /// When they do not, or a link names a pose that does not exist.
    pub fn check(&self) -> Result<()> {
        let m = self.moves.len();
        if self.links.len() != m || self.used.len() != m {
            return Err(Error::bad_input(format!(
                "{m} moves came with {} links and {} flags",
                self.links.len(),
                self.used.len()
            )));
        }
        let n = self.poses.len();
        if let Some(link) = self
            .links
            .iter()
            .find(|link| link.before >= n || link.after >= n)
        {
            return Err(Error::bad_input(format!(
                "a move joins poses {} and {}, but there are {n} poses",
                link.before, link.after
            )));
        }
        if !self.used.iter().any(|&used| used) {
            return Err(Error::not_determined(
                "no move between two still poses is left: record turns with a still pose before and after each",
            ));
        }
        if self.accelerometer_basis.nrows() != 12 {
            return Err(Error::bad_input(
                "the accelerometer basis must have 12 rows",
            ));
        }
        if self.offset_white.ncols() != 3 {
            return Err(Error::bad_input(
                "what is known of the rate offset must have 3 columns",
            ));
        }
        Ok(())
    }

    /// Number of rows about the rate offset.
    fn n_offset_rows(&self) -> usize {
        if self.is_offset_free {
            self.offset_white.nrows()
        } else {
            0
        }
    }

    /// Number of free accelerometer parameters.
    #[must_use]
    pub fn n_accelerometer(&self) -> usize {
        self.accelerometer_basis.ncols()
    }

    /// Number of free parameters: accelerometer, `S_ω`, offset.
    #[must_use]
    pub fn n_parameters(&self) -> usize {
        self.n_accelerometer() + 9 + if self.is_offset_free { 3 } else { 0 }
    }

    /// Parameters at the start: accelerometer increments are counted from `base`.
    fn pack(&self, base: &Model) -> DVector<f64> {
        let k = self.n_accelerometer();
        let mut x = DVector::zeros(self.n_parameters());
        for i in 0..3 {
            for j in 0..3 {
                x[k + 3 * i + j] = base.gyroscope_scale[(i, j)];
            }
            if self.is_offset_free {
                x[k + 9 + i] = base.rate_offset[i];
            }
        }
        x
    }

    fn unpack(&self, base: &Model, x: &DVector<f64>) -> Model {
        let k = self.n_accelerometer();
        let mut model = base.clone();
        if k > 0 {
            let followed = x.rows(0, k);
            let change = &self.accelerometer_basis * followed;
            model.followed += followed;
            for i in 0..3 {
                for j in 0..3 {
                    model.accelerometer_scale[(i, j)] += change[3 * i + j];
                }
                model.accelerometer_bias[i] += change[9 + i];
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                model.gyroscope_scale[(i, j)] = x[k + 3 * i + j];
            }
            if self.is_offset_free {
                model.rate_offset[i] = x[k + 9 + i];
            }
        }
        model
    }

    fn evaluate(&self, model: Model, last: &LastTurns) -> Evaluated {
        let forces = self
            .poses
            .iter()
            .map(|pose| model.accelerometer_scale * pose.reading + model.accelerometer_bias)
            .collect();
        let known = last.0.borrow().as_ref().and_then(|(scale, offset, turns)| {
            (*scale == model.gyroscope_scale && *offset == model.rate_offset)
                .then(|| Rc::clone(turns))
        });
        let turns = known.unwrap_or_else(|| {
            let turns = Rc::new(self.integrate(&model));
            *last.0.borrow_mut() =
                Some((model.gyroscope_scale, model.rate_offset, Rc::clone(&turns)));
            turns
        });
        Evaluated {
            model,
            forces,
            turns,
        }
    }

    fn integrate(&self, model: &Model) -> Vec<Turn> {
        let bias = |pose: usize| model.rate_offset - model.gyroscope_scale * self.poses[pose].bias;
        let before: Vec<_> = self.links.iter().map(|link| bias(link.before)).collect();
        let after: Vec<_> = self.links.iter().map(|link| bias(link.after)).collect();
        integrate_all(
            &self.moves,
            &model.gyroscope_scale,
            &before,
            &after,
            &self.noise,
        )
    }

    fn move_row(&self, at: &Evaluated, index: usize) -> MoveRow {
        let link = self.links[index];
        let turn = &at.turns[index];
        let (from, to) = (at.forces[link.before], at.forces[link.after]);
        let wrt_angle = turn.rotation * skew(&from);
        let k = self.n_accelerometer();
        let mut jacobian = DMatrix::zeros(3, self.n_parameters());
        if k > 0 {
            let wrt = turn.rotation * force_wrt_accelerometer(&self.poses[link.before].reading)
                - force_wrt_accelerometer(&self.poses[link.after].reading);
            jacobian
                .columns_mut(0, k)
                .copy_from(&(wrt * &self.accelerometer_basis));
        }
        let (z0, z1) = (self.poses[link.before].bias, self.poses[link.after].bias);
        for i in 0..3 {
            for j in 0..3 {
                let theta = turn.wrt_scale.column(3 * i + j)
                    - turn.wrt_bias_before.column(i) * z0[j]
                    - turn.wrt_bias_after.column(i) * z1[j];
                jacobian.set_column(k + 3 * i + j, &(wrt_angle * theta));
            }
            if self.is_offset_free {
                let theta = turn.wrt_bias_before.column(i) + turn.wrt_bias_after.column(i);
                jacobian.set_column(k + 9 + i, &(wrt_angle * theta));
            }
        }
        MoveRow {
            residual: turn.rotation * from - to,
            wrt_angle,
            jacobian,
        }
    }
}

/// Rows of the stacked residual: which pose or move they belong to.
#[derive(Debug, Clone, Copy)]
enum Rows {
    /// A given accelerometer direction, in its standard errors: one row.
    Given(usize),
    /// What is known of the rate offset beforehand: one row.
    Offset(usize),
    /// `|f| − |g|` of a pose: one row.
    Norm(usize),
    /// A move, with the plane it is seen in: two rows.
    Move(usize, Matrix2x3<f64>),
}

impl Rows {
    fn len(&self) -> usize {
        match self {
            Self::Given(_) | Self::Offset(_) | Self::Norm(_) => 1,
            Self::Move(..) => 2,
        }
    }
}
