//! The instrument and its motion as physical mechanisms: nothing here is shared with an estimator.

pub mod jet;
pub mod mechanism;
pub mod motion;
pub mod noise;
pub mod random;
pub mod sampling;

/// Three channels sampled together.
pub type Sample = [f64; 3];
