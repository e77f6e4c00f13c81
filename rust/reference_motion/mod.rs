//! A gyro beside known motion: its attitude against the reference's, absolutely and over the whole recording.
//!
//! The log is cut into blocks of about a second. In each the gyro carries the attitude from the block's start, and
//! every row of the reference inside gives the rotation of the world between the two; their mean is one observation.
//! Summed over blocks it is linear in all unknowns (docs/reference.md):
//!
//! ```text
//! y(t) = ∫ C (δS w' + δb + ...) dt + ∫ C β dt + a(t) + e_w(t) + C e_b(t) + white
//! ```
//!
//! with a(t) the angle random walk, β the bias walk, and the reference's own slow error in the world (`e_w`) and in the
//! body (`e_b`), each a Matérn-3/2 process: a Kalman filter gives the evidence in time linear in the length.

mod blocks;
mod evidence;

pub use blocks::{Block, Log, Truth, blocks};
pub use evidence::{Normal, Smoothed, Strengths, normal, smoothed};
