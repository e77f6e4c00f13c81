//! Timestamps of a log: statistics of their steps, and an even clock below or through them.
//!
//! Every pass shares pieces of fixed size between threads and joins them in order, so that results do not depend on the
//! number of threads.

mod blocks;
mod errors;
mod line;
mod median;
pub mod phase_sum;
mod steps;

pub use blocks::{block_means, block_medians, earliest};
pub use errors::{deviation, falls, less};
pub use line::robust_line;
pub use median::usual_step;
pub use steps::{Inside, Steps, inside, steps, steps_above};

use rayon::prelude::*;

/// Timestamps that a thread takes at a time.
const SHARE: usize = 1 << 16;

/// Index of a sample on an even clock, lost ones counted.
pub trait Tick: Copy + Send + Sync {
    /// As a double, exactly up to 2⁵³.
    fn number(self) -> f64;
}

impl Tick for i32 {
    fn number(self) -> f64 {
        f64::from(self)
    }
}

impl Tick for i64 {
    fn number(self) -> f64 {
        self as f64
    }
}

/// Writes `time - period tick` to `late`; without ticks the tick is the row.
///
/// # Panics
/// When lengths differ.
pub fn lateness<T: Tick>(time: &[f64], ticks: Option<&[T]>, period: f64, late: &mut [f64]) {
    assert_eq!(time.len(), late.len());
    let shares = late.par_chunks_mut(SHARE).zip(time.par_chunks(SHARE));
    match ticks {
        Some(ticks) => {
            assert_eq!(time.len(), ticks.len());
            shares
                .zip(ticks.par_chunks(SHARE))
                .for_each(|((late, time), ticks)| {
                    for ((late, &time), &tick) in late.iter_mut().zip(time).zip(ticks) {
                        *late = tick.number() * -period + time;
                    }
                });
        }
        None => shares.enumerate().for_each(|(k, (late, time))| {
            for (i, (late, &time)) in late.iter_mut().zip(time).enumerate() {
                *late = (k * SHARE + i) as f64 * -period + time;
            }
        }),
    }
}

/// A linear course of lateness: `slope (tick - origin) / scale + level`.
#[derive(Debug, Clone, Copy)]
pub struct Course {
    /// Slope of the line.
    pub slope: f64,
    /// Level of the line at `origin`.
    pub level: f64,
    /// Origin, ticks.
    pub origin: f64,
    /// Scale, ticks.
    pub scale: f64,
}

/// Writes the instant at which an even clock on `course` took each sample: `course + period tick`.
///
/// # Panics
/// When lengths differ.
pub fn lay<T: Tick>(ticks: &[T], course: &Course, period: f64, even: &mut [f64]) {
    assert_eq!(ticks.len(), even.len());
    even.par_chunks_mut(SHARE)
        .zip(ticks.par_chunks(SHARE))
        .for_each(|(even, ticks)| {
            for (even, &tick) in even.iter_mut().zip(ticks) {
                let tick = tick.number();
                *even = course.slope * ((tick - course.origin) / course.scale)
                    + course.level
                    + period * tick;
            }
        });
}
