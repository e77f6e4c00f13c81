//! Nine numbers as `S` and `b`: the length of a vector leaves a rotation free, the frame fixes it.

use nalgebra::{Matrix3, Vector3};

/// Which rotation of the body frame is chosen, since the length of a vector cannot tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// `S` lower triangular: parameters `s11 s21 s22 s31 s32 s33`.
    Lower,
    /// `S` symmetric: the same entries, mirrored.
    Symmetric,
}

/// Row and column of each of the six parameters of `S`.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

impl Frame {
    /// `S` and `b` of nine parameters.
    #[must_use]
    pub fn unpack(self, theta: &[f64]) -> (Matrix3<f64>, Vector3<f64>) {
        let mut s = Matrix3::zeros();
        for (value, (i, j)) in theta.iter().zip(ENTRIES) {
            s[(i, j)] = *value;
            if self == Self::Symmetric {
                s[(j, i)] = *value;
            }
        }
        (s, Vector3::new(theta[6], theta[7], theta[8]))
    }

    /// Derivative of `u·(S a + b)` with respect to the nine parameters.
    pub(super) fn row(self, u: &Vector3<f64>, a: &Vector3<f64>, row: &mut [f64]) {
        for (value, (i, j)) in row.iter_mut().zip(ENTRIES) {
            *value = u[i] * a[j];
            if self == Self::Symmetric && i != j {
                *value += u[j] * a[i];
            }
        }
        row[6..9].copy_from_slice(u.as_slice());
    }
}
