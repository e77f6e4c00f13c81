//! The instrument and its motion, as mechanisms: nothing here is shared with an estimator.

pub mod jet;
pub mod motion;
