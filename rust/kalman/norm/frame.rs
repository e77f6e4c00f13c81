//! Nine parameters as `S` and `b`: the norm of a vector does not determine a rotation, the frame fixes it.

use nalgebra::{Matrix3, Vector3};

use crate::sensor_model::LOWER;

/// The body frame, which the norm of a vector determines only up to a rotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// `S` lower triangular: parameters `S_xx S_yx S_yy S_zx S_zy S_zz`.
    Lower,
    /// `S` symmetric: the same entries, mirrored.
    Symmetric,
}

impl Frame {
    /// `S` and `b` of nine parameters.
    #[must_use]
    pub fn unpack(self, theta: &[f64]) -> (Matrix3<f64>, Vector3<f64>) {
        let mut s = Matrix3::zeros();
        for (value, (i, j)) in theta.iter().zip(LOWER) {
            s[(i, j)] = *value;
            if self == Self::Symmetric {
                s[(j, i)] = *value;
            }
        }
        (s, Vector3::new(theta[6], theta[7], theta[8]))
    }

    /// Derivative of `u·(S a + b)` with respect to the nine parameters.
    pub(super) fn row(self, u: &Vector3<f64>, a: &Vector3<f64>, row: &mut [f64]) {
        for (value, (i, j)) in row.iter_mut().zip(LOWER) {
            *value = u[i] * a[j];
            if self == Self::Symmetric && i != j {
                *value += u[j] * a[i];
            }
        }
        row[6..9].copy_from_slice(u.as_slice());
    }
}
