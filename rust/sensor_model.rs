//! What a calibration of one triad is, whoever found it.

use nalgebra::{Matrix3, Vector3};

/// The instrument trihedron in which `S` is expressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// z1 along accelerometer axis 1, z2 in the plane of axes 1 and 2: `S` lower triangular.
    Lower,
    /// `S` symmetric.
    Symmetric,
}

/// Direct model `f = S a' + b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// m/s² per raw unit.
    pub s: Matrix3<f64>,
    /// m/s².
    pub b: Vector3<f64>,
}

impl Model {
    /// Raw reading → specific force.
    #[must_use]
    pub fn correct(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        self.s * reading + self.b
    }
}
