//! Calibration by Kalman filter with the identified noise in its state (docs/kalman.md).
//!
//! One axis reads `U = k·f + U0 + n(t)`: constants `c = (k, U0)` and coloured noise `n`. The noise is modelled as the
//! output of a shaping filter whose states extend the state vector, so that the remaining noise is white and the Kalman
//! filter is the best linear estimate. Covariances are stored as `P = U D Uᵀ` and stay positive.

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
