//! Times of the poses, and the transitions between them, each computed once.

use super::ud::Transition;
use crate::error::{Error, Result};

/// Steps stored: regular logs need one, and recomputing one takes microseconds.
const REMEMBERED_STEPS: usize = 64;

/// An overlap of poses shorter than this part of the pose is a rounding error of the clock.
const CLOCK_ROUNDING: f64 = 1e-6;

/// Poses in order of time.
#[derive(Debug, Clone, Default)]
pub struct Timeline {
    end: Option<f64>,
    n_poses: usize,
}

impl Timeline {
    /// Number of poses.
    #[must_use]
    pub fn n_poses(&self) -> usize {
        self.n_poses
    }

    /// Pause before a pose of `pose_s` seconds from `start` on.
    ///
    /// # Errors
    /// When the start is not finite, the length not positive, or the pose starts before the last one ended.
    pub fn gap(&self, start: f64, pose_s: f64) -> Result<f64> {
        let pose = self.n_poses + 1;
        if !(pose_s.is_finite() && pose_s > 0.0 && start.is_finite()) {
            return Err(Error::bad_input(format!(
                "pose {pose}: a pose needs a finite start and a positive length, got {start} s and {pose_s} s"
            )));
        }
        match self.end {
            None => Ok(0.0),
            Some(end) if start >= end => Ok(start - end),
            Some(end) if end - start <= CLOCK_ROUNDING * pose_s => Ok(0.0),
            Some(end) => Err(Error::bad_input(format!(
                "pose {pose} starts at {start} s, before the last pose ended at {end} s: give the poses in order of time"
            ))),
        }
    }

    /// Adds a pose.
    pub fn pass(&mut self, start: f64, pose_s: f64) {
        self.end = Some(start + pose_s);
        self.n_poses += 1;
    }
}

/// Transitions by pause and pose.
#[derive(Debug, Clone, Default)]
pub struct Steps {
    known: Vec<([u64; 2], Transition)>,
    latest: usize,
}

impl Steps {
    /// The transition over `gap` and `pose_s`, computed by `make` unless it is stored.
    pub fn get(&mut self, gap: f64, pose_s: f64, make: impl FnOnce() -> Transition) -> &Transition {
        let key = [gap.to_bits(), pose_s.to_bits()];
        let is_latest = self.known.get(self.latest).is_some_and(|(k, _)| *k == key);
        if !is_latest {
            if let Some(found) = self.known.iter().position(|(k, _)| *k == key) {
                self.latest = found;
            } else {
                if self.known.len() == REMEMBERED_STEPS {
                    self.known.clear();
                }
                self.known.push((key, make()));
                self.latest = self.known.len() - 1;
            }
        }
        &self.known[self.latest].1
    }

    /// The transition requested last.
    #[must_use]
    pub fn last(&self) -> Option<&Transition> {
        self.known.get(self.latest).map(|(_, step)| step)
    }
}
