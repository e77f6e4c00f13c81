//! Calibration by Kalman filter with the identified noise in its state (docs/kalman.md).
//!
//! One axis reads `U = k·f + U0 + n(t)`: constants `c = (k, U0)` and coloured noise `n`. The noise becomes the output of
//! a shaping filter whose states join the state vector, so that what remains is white and least squares in Kalman's
//! form is the best linear estimate. Covariances live in the factors `P = U D Uᵀ` and cannot lose their sign.

pub mod axis;
pub mod discretisation;
pub mod least_squares;
pub mod norm;
pub mod rounding;
pub mod shaping;
pub mod smoother;
pub mod timeline;
pub mod ud;

pub use axis::{AxisFilter, AxisTrack, Pose, Prior, track};
pub use norm::{Frame, NormFilter, NormPose, NormPrior};
pub use shaping::{NoiseTerms, ShapingModel};
