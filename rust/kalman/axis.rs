//! The filter of one axis: reference accelerations known, constants and noise estimated together.

use nalgebra::{DMatrix, DVector};

use super::shaping::{Layout, Shaping, ShapingModel};
use super::timeline::{Steps, Timeline};
use super::ud::{Factors, Transition, UdFilter};
use crate::error::{Error, Result};
use crate::simd::{Instructions, for_each_instruction_set};

/// Constants of one axis: sensitivity to each of the three reference components, and bias (raw).
pub const N_CONSTANTS: usize = 4;

/// One reading of the axis in a known attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Mean raw reading over the pose.
    pub reading: f64,
    /// Specific force [m/s²] along the three reference axes.
    pub reference: [f64; 3],
    /// Start of the pose, s.
    pub start: f64,
    /// Length of the pose, s.
    pub pose_s: f64,
    /// Variance on top of the noise model (a disturbed pose, an uncertain reference), raw².
    pub extra_variance: f64,
}

/// Prior of the constants, before the first pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Mean of `(kx, ky, kz, U0)`.
    pub mean: [f64; N_CONSTANTS],
    /// Standard deviations.
    pub sigma: [f64; N_CONSTANTS],
    /// Intensity of a slow walk of each constant, per √s; zero keeps it constant.
    pub walk: [f64; N_CONSTANTS],
}

/// One step of the filter, for diagnostics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisStep {
    /// Measured minus predicted reading.
    pub innovation: f64,
    /// Variance that the filter predicted for it.
    pub innovation_variance: f64,
}

/// Recursive estimate of one axis, pose by pose.
#[derive(Debug, Clone)]
pub struct AxisFilter {
    model: ShapingModel,
    shaping: Shaping,
    layout: Layout,
    /// Intensities of the constants' walks; when any is positive the constants are moving states as well.
    walk: [f64; N_CONSTANTS],
    moving: usize,
    pub(crate) filter: UdFilter,
    pub(crate) row: Vec<f64>,
    /// Row of the slow noise over all states.
    slow: Vec<f64>,
    timeline: Timeline,
    steps: Steps,
}

impl AxisFilter {
    /// A filter before its first pose.
    ///
    /// # Errors
    /// When the noise or the prior is malformed.
    pub fn new(model: ShapingModel, prior: &Prior) -> Result<Self> {
        let shaping = model.system()?;
        let layout = shaping.layout();
        let n_noise = layout.n();
        let n = n_noise + N_CONSTANTS;
        for (name, values, least) in [
            ("standard deviations", &prior.sigma, f64::MIN_POSITIVE),
            ("walks", &prior.walk, 0.0),
        ] {
            if values.iter().any(|v| !(v.is_finite() && *v >= least)) {
                return Err(Error::bad_input(format!(
                    "the {name} of the constants must be finite and positive, got {values:?}"
                )));
            }
        }
        if prior.mean.iter().any(|v| !v.is_finite()) {
            return Err(Error::bad_input(
                "the prior mean of the constants must be finite",
            ));
        }
        let mut covariance = DMatrix::zeros(n, n);
        covariance
            .view_mut((0, 0), (n_noise, n_noise))
            .copy_from(&shaping.start());
        let mut x = vec![0.0; n];
        for i in 0..N_CONSTANTS {
            covariance[(n_noise + i, n_noise + i)] = prior.sigma[i].powi(2);
            x[n_noise + i] = prior.mean[i];
        }
        let mut slow = shaping.slow_row().as_slice().to_vec();
        slow.resize(n, 0.0);
        let moving = if prior.walk.iter().any(|w| *w > 0.0) {
            n
        } else {
            n_noise
        };
        Ok(Self {
            filter: UdFilter::new(x, Factors::of(&covariance)),
            row: vec![0.0; n],
            slow,
            model,
            shaping,
            layout,
            walk: prior.walk,
            moving,
            timeline: Timeline::default(),
            steps: Steps::default(),
        })
    }

    /// Number of noise states; the four constants follow them.
    #[must_use]
    pub fn n_noise(&self) -> usize {
        self.layout.n()
    }

    /// Number of poses processed.
    #[must_use]
    pub fn n_poses(&self) -> usize {
        self.timeline.n_poses()
    }

    /// Row of the slow noise over all states.
    #[must_use]
    pub fn slow_row(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.slow)
    }

    /// Transition of all states over the last step.
    #[must_use]
    pub fn last_phi(&self) -> DMatrix<f64> {
        let n = self.filter.n();
        let mut phi = DMatrix::identity(n, n);
        if let Some(step) = self.steps.last() {
            phi.view_mut((0, 0), (self.moving, self.moving))
                .copy_from(&step.phi());
        }
        phi
    }

    fn advance(&mut self, reference: [f64; 3], start: f64, pose_s: f64) -> Result<()> {
        let gap = self.timeline.gap(start, pose_s)?;
        if reference.iter().any(|f| !f.is_finite()) {
            return Err(Error::bad_input(format!(
                "pose {}: the reference is not finite",
                self.n_poses() + 1
            )));
        }
        let (m, k) = (self.moving, self.n_noise());
        let Self {
            shaping,
            walk,
            steps,
            filter,
            row,
            ..
        } = self;
        let step = steps.get(gap, pose_s, || {
            let (phi_noise, q_noise) = shaping.step(gap, pose_s);
            let mut phi = DMatrix::identity(m, m);
            let mut q = DMatrix::zeros(m, m);
            phi.view_mut((0, 0), (k, k)).copy_from(&phi_noise);
            q.view_mut((0, 0), (k, k)).copy_from(&q_noise);
            for i in k..m {
                q[(i, i)] = walk[i - k].powi(2) * (gap + pose_s);
            }
            Transition::new(&phi, &q)
        });
        filter.predict(step);
        shaping.measurement_row(pose_s, &mut row[..k]);
        row[k..k + 3].copy_from_slice(&reference);
        row[k + 3] = 1.0;
        self.timeline.pass(start, pose_s);
        Ok(())
    }

    /// Processes one more pose.
    ///
    /// # Errors
    /// When the pose is not finite, or earlier than the last one.
    pub fn add(&mut self, pose: &Pose) -> Result<AxisStep> {
        if !(pose.reading.is_finite()
            && pose.extra_variance.is_finite()
            && pose.extra_variance >= 0.0)
        {
            return Err(Error::bad_input(format!(
                "pose {}: the reading must be finite and its extra variance not negative",
                self.n_poses() + 1
            )));
        }
        self.advance(pose.reference, pose.start, pose.pose_s)?;
        let r = self.model.white_variance(pose.pose_s) + pose.extra_variance;
        let seen = self.filter.update(&self.row, pose.reading, r);
        Ok(AxisStep {
            innovation: seen.value,
            innovation_variance: seen.variance,
        })
    }

    /// `(kx, ky, kz, U0)`.
    #[must_use]
    pub fn constants(&self) -> [f64; N_CONSTANTS] {
        let k = self.n_noise();
        std::array::from_fn(|i| self.filter.x[k + i])
    }

    /// Covariance of the constants.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        self.filter.factors.covariance_from(self.n_noise())
    }

    /// Standard errors of the constants.
    #[must_use]
    pub fn sigma(&self) -> [f64; N_CONSTANTS] {
        self.filter.factors.last_variances().map(f64::sqrt)
    }

    fn drift_and_variance(&self) -> (f64, f64) {
        // Beyond the noise states the row is zero.
        let row = &self.slow[..self.n_noise()];
        let value = row.iter().zip(&self.filter.x).map(|(h, x)| h * x).sum();
        (value, self.filter.factors.variance_along(row))
    }
}

/// Results of the filter of one axis, pose by pose.
#[derive(Debug, Clone, Default)]
pub struct AxisTrack {
    /// Constants after each pose.
    pub constants: Vec<[f64; N_CONSTANTS]>,
    /// Their standard errors.
    pub sigma: Vec<[f64; N_CONSTANTS]>,
    /// Covariance of the constants after the last pose.
    pub covariance: DMatrix<f64>,
    /// Measured minus predicted readings.
    pub innovation: Vec<f64>,
    /// Variances that the filter predicted for them.
    pub innovation_variance: Vec<f64>,
    /// Filtered slow noise at the end of each pose.
    pub drift: Vec<f64>,
    /// Its standard error.
    pub drift_sigma: Vec<f64>,
}

/// Run the filter over all poses.
///
/// # Errors
/// As [`AxisFilter::new`] and [`AxisFilter::add`].
pub fn track(model: &ShapingModel, prior: &Prior, poses: &[Pose]) -> Result<AxisTrack> {
    let mut filter = AxisFilter::new(model.clone(), prior)?;
    let n = poses.len();
    let mut out = AxisTrack {
        constants: Vec::with_capacity(n),
        sigma: Vec::with_capacity(n),
        innovation: Vec::with_capacity(n),
        innovation_variance: Vec::with_capacity(n),
        drift: Vec::with_capacity(n),
        drift_sigma: Vec::with_capacity(n),
        ..AxisTrack::default()
    };
    for pose in poses {
        let step = filter.add(pose)?;
        let (drift, variance) = filter.drift_and_variance();
        out.constants.push(filter.constants());
        out.sigma.push(filter.filter.factors.last_variances());
        out.innovation.push(step.innovation);
        out.innovation_variance.push(step.innovation_variance);
        out.drift.push(drift);
        out.drift_sigma.push(variance);
    }
    // All square roots at once: one by one they take as long as the update.
    let instructions = Instructions::detect();
    take_roots(instructions, out.sigma.as_flattened_mut());
    take_roots(instructions, &mut out.drift_sigma);
    out.covariance = filter.covariance();
    Ok(out)
}

for_each_instruction_set! {
    fn take_roots(values: &mut [f64]) = take_roots_body
}

#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "it takes the instructions of its caller"
)]
fn take_roots_body<const FUSED: bool>(values: &mut [f64]) {
    for value in values {
        *value = value.sqrt();
    }
}
