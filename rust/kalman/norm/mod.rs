//! The filter that needs no reference attitudes: in a static pose the corrected reading has the norm of gravity.
//!
//! `z = |g| = |S (a' − n) + b| + v`: nine constants (`S` lower triangular or symmetric, `b`) and the slow noise `n` of
//! all three axes. The measurement is not linear: each update is iterated, and after a session the whole run is
//! repeated with every pose linearised at the latest constants until convergence, which is the weighted batch fit.

mod frame;
mod pose;
mod relinearise;

use nalgebra::{DMatrix, Vector3};

pub use self::frame::Frame;
pub use self::pose::{NormPose, NormPrior};
use super::shaping::{Shaping, ShapingModel};
use super::timeline::{Steps, Timeline};
use super::ud::{Factors, Innovation, Transition, UdFilter};
use crate::error::{Error, Result};

/// Constants of the triad: six of `S`, three of `b`.
pub const N_PARAMETERS: usize = 9;

/// Updates are repeated at most this often; four or five suffice unless the start is far off.
const MAX_ITERATIONS: usize = 20;
/// An iteration that moves every parameter by less than this part of its standard error is the last.
const SETTLED: f64 = 1e-3;
/// The point of linearisation moves by at most this part of gravity or of a sensitivity at a time: a few poses in one
/// plane leave directions in which the norm is stationary, and a full step along them is arbitrary.
const LONGEST_STEP: f64 = 0.2;

/// Recursive estimate of a triad from the length of gravity alone.
#[derive(Debug, Clone)]
pub struct NormFilter {
    models: [ShapingModel; 3],
    shapings: [Shaping; 3],
    frame: Frame,
    gravity: f64,
    prior: NormPrior,
    n_noise: usize,
    filter: UdFilter,
    timeline: Timeline,
    steps: Steps,
    poses: Vec<NormPose>,
    innovations: Vec<Innovation>,
    /// Parameters at the end of the last call of [`Self::relinearise`].
    settled: Vec<f64>,
}

/// Transition of the noise of all three axes over a pause and a pose.
fn transition<'a>(
    steps: &'a mut Steps,
    shapings: &[Shaping; 3],
    n_noise: usize,
    gap: f64,
    pose_s: f64,
) -> &'a Transition {
    steps.get(gap, pose_s, || {
        let mut phi = DMatrix::zeros(n_noise, n_noise);
        let mut q = DMatrix::zeros(n_noise, n_noise);
        let mut at = 0;
        for shaping in shapings {
            let (phi_axis, q_axis) = shaping.step(gap, pose_s);
            let k = phi_axis.nrows();
            phi.view_mut((at, at), (k, k)).copy_from(&phi_axis);
            q.view_mut((at, at), (k, k)).copy_from(&q_axis);
            at += k;
        }
        Transition::new(&phi, &q)
    })
}

impl NormFilter {
    /// A filter before its first pose.
    ///
    /// # Errors
    /// When the noise, the prior or gravity is malformed.
    pub fn new(
        models: [ShapingModel; 3],
        frame: Frame,
        gravity: f64,
        prior: &NormPrior,
    ) -> Result<Self> {
        if !(gravity.is_finite() && gravity > 0.0) {
            return Err(Error::bad_input(format!(
                "gravity must be positive, got {gravity} m/s²"
            )));
        }
        if prior.sigma.iter().any(|s| !(s.is_finite() && *s > 0.0))
            || prior.mean.iter().any(|m| !m.is_finite())
        {
            return Err(Error::bad_input(
                "the start of the calibration must be finite, with positive standard deviations",
            ));
        }
        let (s, _) = frame.unpack(&prior.mean);
        if s.determinant() == 0.0 {
            return Err(Error::bad_input(
                "the start of the calibration must have three independent axes: S = 0 is a fixed point of the norm",
            ));
        }
        let shapings = [
            models[0].system()?,
            models[1].system()?,
            models[2].system()?,
        ];
        let n_noise = shapings.iter().map(|s| s.layout().n()).sum();
        let filter = Self::start(&shapings, n_noise, prior);
        Ok(Self {
            models,
            shapings,
            frame,
            gravity,
            prior: prior.clone(),
            n_noise,
            filter,
            timeline: Timeline::default(),
            steps: Steps::default(),
            poses: Vec::new(),
            innovations: Vec::new(),
            settled: prior.mean.to_vec(),
        })
    }

    fn start(shapings: &[Shaping; 3], n_noise: usize, prior: &NormPrior) -> UdFilter {
        let n = n_noise + N_PARAMETERS;
        let mut covariance = DMatrix::zeros(n, n);
        let mut at = 0;
        for shaping in shapings {
            let p0 = shaping.start();
            let k = p0.nrows();
            covariance.view_mut((at, at), (k, k)).copy_from(&p0);
            at += k;
        }
        let mut x = vec![0.0; n];
        for i in 0..N_PARAMETERS {
            covariance[(n_noise + i, n_noise + i)] = prior.sigma[i].powi(2);
            x[n_noise + i] = prior.mean[i];
        }
        UdFilter::new(x, Factors::of(&covariance))
    }

    fn move_noise(&mut self, start: f64, pose_s: f64) -> Result<()> {
        let gap = self.timeline.gap(start, pose_s)?;
        let step = transition(&mut self.steps, &self.shapings, self.n_noise, gap, pose_s);
        self.filter.predict(step);
        self.timeline.pass(start, pose_s);
        Ok(())
    }

    /// Row, predicted length and white variance of a pose, linearised at `theta` and the given noise states.
    fn linearise(
        &self,
        pose: &NormPose,
        noise: &[f64],
        theta: &[f64],
        row: &mut [f64],
    ) -> (f64, f64) {
        let (s, b) = self.frame.unpack(theta);
        let mut a = Vector3::from(pose.reading);
        let mut at = 0;
        for (axis, shaping) in self.shapings.iter().enumerate() {
            let k = shaping.layout().n();
            shaping.measurement_row(pose.pose_s, &mut row[at..at + k]);
            a[axis] -= row[at..at + k]
                .iter()
                .zip(&noise[at..at + k])
                .map(|(h, x)| h * x)
                .sum::<f64>();
            at += k;
        }
        let f = s * a + b;
        let length = f.norm();
        let u = if length > 0.0 {
            f / length
        } else {
            Vector3::z()
        };
        let along = s.transpose() * u;
        let mut at = 0;
        for (axis, shaping) in self.shapings.iter().enumerate() {
            let k = shaping.layout().n();
            for value in &mut row[at..at + k] {
                *value *= -along[axis];
            }
            at += k;
        }
        self.frame.row(&u, &a, &mut row[self.n_noise..]);
        let white = Vector3::from_fn(|i, _| {
            self.models[i].white_variance(pose.pose_s) + pose.extra_variance[i]
        });
        let variance = along.component_mul(&along).dot(&white);
        // Noise across the vertical lengthens the vector on average: E|f + ε| = |f| + tr((I − u uᵀ) Σ) / 2|f|.
        let total: f64 = (0..3).map(|i| s.column(i).norm_squared() * white[i]).sum();
        let lengthening = (total - variance) / (2.0 * self.gravity);
        (length - lengthening, variance)
    }

    /// One update linearised at `theta`: the measurement minus its linear prediction from the current estimate.
    fn update_at(&self, filter: &mut UdFilter, pose: &NormPose, theta: &[f64]) -> Innovation {
        let n = filter.n();
        let mut row = vec![0.0; n];
        let (predicted, variance) =
            self.linearise(pose, &filter.x[..self.n_noise], theta, &mut row);
        let ahead: f64 = (0..N_PARAMETERS)
            .map(|i| row[self.n_noise + i] * (filter.x[self.n_noise + i] - theta[i]))
            .sum();
        filter.update_with_innovation(&row, self.gravity - predicted - ahead, variance)
    }

    fn check(&self, pose: &NormPose) -> Result<()> {
        let number = self.poses.len() + 1;
        if pose.reading.iter().any(|a| !a.is_finite())
            || pose
                .extra_variance
                .iter()
                .any(|v| !(v.is_finite() && *v >= 0.0))
        {
            return Err(Error::bad_input(format!(
                "pose {number}: the readings must be finite and their extra variances not negative"
            )));
        }
        self.timeline.gap(pose.start, pose.pose_s).map(|_| ())
    }

    /// Processes one more pose; its update is iterated until the point of linearisation is the estimate itself.
    ///
    /// # Errors
    /// When the pose is not finite or out of order.
    pub fn add(&mut self, pose: &NormPose) -> Result<Innovation> {
        self.check(pose)?;
        self.move_noise(pose.start, pose.pose_s)?;
        let before = self.filter.clone();
        let mut theta = before.x[self.n_noise..].to_vec();
        let mut first = None;
        for _ in 0..MAX_ITERATIONS {
            let mut filter = before.clone();
            let seen = self.update_at(&mut filter, pose, &theta);
            first.get_or_insert(seen);
            let moved = self.moved(&filter, &theta);
            self.approach(&mut theta, &filter.x[self.n_noise..]);
            self.filter = filter;
            if moved < SETTLED {
                break;
            }
        }
        self.poses.push(*pose);
        let seen = first.unwrap_or(Innovation {
            value: 0.0,
            variance: 0.0,
        });
        self.innovations.push(seen);
        Ok(seen)
    }

    /// Largest move of a parameter from `theta` in its standard errors.
    fn moved(&self, filter: &UdFilter, theta: &[f64]) -> f64 {
        (0..N_PARAMETERS)
            .map(|i| {
                let at = self.n_noise + i;
                (filter.x[at] - theta[i]).abs() / filter.factors.variance(at).sqrt()
            })
            .fold(0.0, f64::max)
    }

    /// Move a point of linearisation towards an estimate, not further than [`LONGEST_STEP`].
    fn approach(&self, theta: &mut [f64], estimate: &[f64]) {
        let (s, _) = self.frame.unpack(theta);
        let change: Vec<f64> = estimate
            .iter()
            .zip(&*theta)
            .map(|(to, from)| to - from)
            .collect();
        let (ds, db) = self.frame.unpack(&change);
        let relative = s
            .try_inverse()
            .map_or(f64::INFINITY, |inverse| (ds * inverse).amax());
        let length = relative.max(db.amax() / self.gravity);
        let part = if length > LONGEST_STEP {
            LONGEST_STEP / length
        } else {
            1.0
        };
        for (value, step) in theta.iter_mut().zip(change) {
            *value += part * step;
        }
    }

    /// Stores poses without estimating: [`Self::relinearise`] then starts from the prior's mean, with all poses
    /// together.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn load(&mut self, poses: &[NormPose]) -> Result<()> {
        for pose in poses {
            self.check(pose)?;
            self.timeline.pass(pose.start, pose.pose_s);
            self.poses.push(*pose);
        }
        Ok(())
    }

    /// The nine parameters.
    #[must_use]
    pub fn parameters(&self) -> &[f64] {
        &self.filter.x[self.n_noise..]
    }

    /// Their covariance.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        self.filter.factors.covariance_from(self.n_noise)
    }

    /// Innovations of the latest run.
    #[must_use]
    pub fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }
}
