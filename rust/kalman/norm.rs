//! The filter that needs no reference attitudes: at rest the corrected reading has the length of gravity.
//!
//! `z = |g| = |S (a' − n) + b| + v`: nine constants (`S` lower triangular or symmetric, `b`) and the slow noise `n` of all
//! three axes. The measurement is not linear, so each update is iterated, and after a session the whole run is repeated
//! with every pose linearised at the latest constants until nothing moves: that limit is the weighted batch fit.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::shaping::{Shaping, ShapingModel};
use super::timeline::{Steps, Timeline};
use super::ud::{Factors, Innovation, Transition, UdFilter};
use crate::error::{Error, Result};

/// Constants of the triad: six of `S`, three of `b`.
pub const N_PARAMETERS: usize = 9;

/// Which rotation of the body frame is chosen, since the length of a vector cannot tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// `S` lower triangular: parameters `s11 s21 s22 s31 s32 s33`.
    Lower,
    /// `S` symmetric: the same entries, mirrored.
    Symmetric,
}

/// Row and column of each of the six parameters of `S`.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

impl Frame {
    /// `S` and `b` of nine parameters.
    #[must_use]
    pub fn unpack(self, theta: &[f64]) -> (Matrix3<f64>, Vector3<f64>) {
        let mut s = Matrix3::zeros();
        for (value, (i, j)) in theta.iter().zip(ENTRIES) {
            s[(i, j)] = *value;
            if self == Self::Symmetric {
                s[(j, i)] = *value;
            }
        }
        (s, Vector3::new(theta[6], theta[7], theta[8]))
    }

    /// Derivative of `u·(S a + b)` with respect to the nine parameters.
    fn row(self, u: &Vector3<f64>, a: &Vector3<f64>, row: &mut [f64]) {
        for (value, (i, j)) in row.iter_mut().zip(ENTRIES) {
            *value = u[i] * a[j];
            if self == Self::Symmetric && i != j {
                *value += u[j] * a[i];
            }
        }
        row[6..9].copy_from_slice(u.as_slice());
    }
}

/// Mean reading of all three axes over one hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormPose {
    /// Mean raw readings.
    pub reading: [f64; 3],
    /// Start of the hold, s.
    pub start: f64,
    /// Length of the hold, s.
    pub hold: f64,
    /// Variance on top of the noise model per axis, raw².
    pub extra_variance: [f64; 3],
}

/// What is believed of the nine parameters before the first pose.
#[derive(Debug, Clone, PartialEq)]
pub struct NormPrior {
    /// Mean, in the order of [`Frame::unpack`].
    pub mean: [f64; N_PARAMETERS],
    /// Standard deviations.
    pub sigma: [f64; N_PARAMETERS],
}

/// Updates are repeated at most this often; four or five suffice unless the start is far off.
const MAX_ITERATIONS: usize = 20;
/// An iteration that moves every parameter by less than this part of its standard error is the last.
const SETTLED: f64 = 1e-3;
/// A run over all poses that moves every parameter by less than this part of its standard error is the last.
const CONVERGED: f64 = 1e-6;

/// The point of linearisation moves by at most this part of gravity or of a sensitivity at a time: a few poses in one
/// plane leave directions to which the length of gravity is stationary, and a full step there leads nowhere.
const LONGEST_STEP: f64 = 0.2;

/// A step longer than this many standard errors must lower the cost; shorter ones end at the fixed point of the runs,
/// which is not exactly where the cost, whose weights move as well, is least.
const LOOKED_AT: f64 = 0.1;
/// A step that does not lower the cost is halved at most this often.
const MOST_HALVINGS: usize = 12;

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
    /// Where the last call of [`Self::relinearise`] ended.
    settled: Vec<f64>,
}

/// Transition of the noise of all three axes over a pause and a hold.
fn transition<'a>(
    steps: &'a mut Steps,
    shapings: &[Shaping; 3],
    n_noise: usize,
    gap: f64,
    hold: f64,
) -> &'a Transition {
    steps.get(gap, hold, || {
        let mut phi = DMatrix::zeros(n_noise, n_noise);
        let mut q = DMatrix::zeros(n_noise, n_noise);
        let mut at = 0;
        for shaping in shapings {
            let (phi_axis, q_axis) = shaping.step(gap, hold);
            let k = phi_axis.nrows();
            phi.view_mut((at, at), (k, k)).copy_from(&phi_axis);
            q.view_mut((at, at), (k, k)).copy_from(&q_axis);
            at += k;
        }
        Transition::new(&phi, &q)
    })
}

impl NormFilter {
    /// A filter that has seen nothing yet.
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

    fn move_noise(&mut self, start: f64, hold: f64) -> Result<()> {
        let gap = self.timeline.gap(start, hold)?;
        let step = transition(&mut self.steps, &self.shapings, self.n_noise, gap, hold);
        self.filter.predict(step);
        self.timeline.pass(start, hold);
        Ok(())
    }

    /// Filter over all poses with every pose linearised at `theta`.
    fn run(&mut self, theta: &[f64], prior: &NormPrior) -> Result<(UdFilter, Vec<Innovation>)> {
        let mut filter = Self::start(&self.shapings, self.n_noise, prior);
        let mut timeline = Timeline::default();
        let mut innovations = Vec::with_capacity(self.poses.len());
        for i in 0..self.poses.len() {
            let pose = self.poses[i];
            let gap = timeline.gap(pose.start, pose.hold)?;
            filter.predict(transition(
                &mut self.steps,
                &self.shapings,
                self.n_noise,
                gap,
                pose.hold,
            ));
            timeline.pass(pose.start, pose.hold);
            innovations.push(self.update_at(&mut filter, &pose, theta));
        }
        Ok((filter, innovations))
    }

    /// Squared innovations with the constants held at `theta`, and its squared distance from the prior.
    ///
    /// The weights belong to `theta`: towards `S = 0` the noise in m/s² vanishes together with the signal, so that the
    /// worthless solution `S = 0`, `|b| = |g|` costs as much as no fit at all.
    fn cost(&mut self, theta: &[f64]) -> Result<f64> {
        let mut fixed = self.prior.clone();
        fixed.mean.copy_from_slice(theta);
        fixed.sigma = [0.0; N_PARAMETERS];
        let (_, innovations) = self.run(theta, &fixed)?;
        let data: f64 = innovations
            .iter()
            .map(|y| y.value * y.value / y.variance)
            .sum();
        let away: f64 = (0..N_PARAMETERS)
            .map(|i| ((theta[i] - self.prior.mean[i]) / self.prior.sigma[i]).powi(2))
            .sum();
        let cost = data + away;
        Ok(if cost.is_finite() {
            cost
        } else {
            f64::INFINITY
        })
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
            shaping.measurement_row(pose.hold, &mut row[at..at + k]);
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
            self.models[i].white_variance(pose.hold) + pose.extra_variance[i]
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
        self.timeline.gap(pose.start, pose.hold).map(|_| ())
    }

    /// Take one more pose, iterating its update until the point of linearisation is the estimate itself.
    ///
    /// # Errors
    /// When the pose is not finite or out of order.
    pub fn add(&mut self, pose: &NormPose) -> Result<Innovation> {
        self.check(pose)?;
        self.move_noise(pose.start, pose.hold)?;
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

    /// Take many poses without estimating anything: [`Self::relinearise`] then starts from the prior's mean, with all of
    /// them together.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn load(&mut self, poses: &[NormPose]) -> Result<()> {
        for pose in poses {
            self.check(pose)?;
            self.timeline.pass(pose.start, pose.hold);
            self.poses.push(*pose);
        }
        Ok(())
    }

    /// Run over all poses again, linearised at the latest constants, until they stay. Returns the number of runs, or
    /// `None` when `most` were not enough.
    ///
    /// Starts from the best of the latest constants, those of the last call and the prior's mean; a long step is
    /// shortened until it lowers the cost.
    ///
    /// # Errors
    /// Never for poses that were taken once.
    pub fn relinearise(&mut self, most: usize) -> Result<Option<usize>> {
        let mut theta = self.prior.mean.to_vec();
        let mut cost = self.cost(&theta)?;
        for candidate in [self.settled.clone(), self.filter.x[self.n_noise..].to_vec()] {
            let its = self.cost(&candidate)?;
            if its < cost {
                (theta, cost) = (candidate, its);
            }
        }
        let mut runs = None;
        for run in 1..=most {
            let (filter, innovations) = self.run(&theta, &self.prior.clone())?;
            self.filter = filter;
            self.innovations = innovations;
            let moved = self.moved(&self.filter, &theta);
            if moved < CONVERGED {
                runs = Some(run);
                break;
            }
            let from = theta.clone();
            self.approach(&mut theta, &self.filter.x[self.n_noise..]);
            if moved > LOOKED_AT {
                let mut its = self.cost(&theta)?;
                for _ in 0..MOST_HALVINGS {
                    if its < cost {
                        break;
                    }
                    for (value, start) in theta.iter_mut().zip(&from) {
                        *value = 0.5 * (*value + start);
                    }
                    its = self.cost(&theta)?;
                }
                cost = its;
            }
        }
        if runs.is_none() {
            // The last run's estimate is a full step from `theta` that nobody has looked at.
            let estimate = self.filter.x[self.n_noise..].to_vec();
            if self.cost(&estimate)? > cost {
                self.filter.x[self.n_noise..].copy_from_slice(&theta);
            }
        }
        self.settled = theta;
        Ok(runs)
    }

    /// What a future reading would do to the covariance.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn imagine(&mut self, pose: &NormPose) -> Result<()> {
        self.check(pose)?;
        self.move_noise(pose.start, pose.hold)?;
        let theta = self.filter.x[self.n_noise..].to_vec();
        let mut row = vec![0.0; self.filter.n()];
        let (_, variance) = self.linearise(pose, &self.filter.x[..self.n_noise], &theta, &mut row);
        self.filter.update_with_innovation(&row, 0.0, variance);
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

    /// Poses seen (imagined ones do not count).
    #[must_use]
    pub fn n_poses(&self) -> usize {
        self.poses.len()
    }

    /// End of the last hold, s.
    #[must_use]
    pub fn end(&self) -> Option<f64> {
        self.timeline.end()
    }
}
