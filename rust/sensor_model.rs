//! Calibration of one triad, by any method.

use nalgebra::{Matrix3, Vector3};

/// Row and column of each element of a lower-triangular `S`.
pub const LOWER: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

/// Direct model `f = S a' + b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// Scale and misalignment, m/s² per raw unit.
    pub s: Matrix3<f64>,
    /// Bias term, m/s².
    pub b: Vector3<f64>,
}

impl Model {
    /// Raw reading → specific force.
    #[must_use]
    pub fn correct(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        self.s * reading + self.b
    }
}
