//! Input of the filter: poses, and the prior before the first.

use super::N_PARAMETERS;

/// Mean reading of all three axes over one pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormPose {
    /// Mean raw readings.
    pub reading: [f64; 3],
    /// Start of the pose, s.
    pub start: f64,
    /// Length of the pose, s.
    pub pose_s: f64,
    /// Variance on top of the noise model per axis, raw².
    pub extra_variance: [f64; 3],
}

/// Prior of the nine parameters before the first pose.
#[derive(Debug, Clone, PartialEq)]
pub struct NormPrior {
    /// Mean, in the order of [`super::Frame::unpack`].
    pub mean: [f64; N_PARAMETERS],
    /// Standard deviations.
    pub sigma: [f64; N_PARAMETERS],
}
