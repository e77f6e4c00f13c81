//! The motion of a fitted session, at the poses, then at the samples of every move.

use nalgebra::{Matrix3, Vector3};

use super::Session;
use super::fit::Fit;

/// Corrected readings in the body, one at every point.
pub struct Path {
    /// Rate, rad/s; none in poses.
    pub rate: Vec<Vector3<f64>>,
    /// Specific force, m/s².
    pub force: Vec<Vector3<f64>>,
    /// Minus gravity, m/s², propagated by the gyro from the start of each move.
    pub gravity: Vec<Vector3<f64>>,
    /// Rotation since the move began.
    pub turned: Vec<Matrix3<f64>>,
}

impl Session {
    /// The motion at a fit.
    #[must_use]
    pub fn path(&self, fit: &Fit) -> Path {
        let still: Vec<_> = fit.state.up.iter().map(|up| up * self.gravity).collect();
        let mut out = Path {
            rate: vec![Vector3::zeros(); still.len()],
            gravity: still.clone(),
            turned: vec![Matrix3::identity(); still.len()],
            force: still,
        };
        for (one, of) in fit.passed.iter().zip(self.moves.iter()) {
            let begin = out.force[of.before];
            let attitude = &one.carried.attitude;
            out.rate.extend_from_slice(&one.carried.rate);
            out.force.extend_from_slice(&one.carried.force);
            out.gravity.extend(attitude.iter().map(|turn| turn * begin));
            out.turned.extend_from_slice(attitude);
        }
        out
    }

    /// Local level (z up, any azimuth) → body at every point, rotated by the gyro in moves, levelled in poses.
    ///
    /// Poses that no chain of moves reaches have NaN but for the vertical, which gravity shows.
    #[must_use]
    pub fn attitude(&self, fit: &Fit) -> Vec<Matrix3<f64>> {
        let up = &fit.state.up;
        let levelled = |near: Vector3<f64>, up: &Vector3<f64>| {
            let x = (near - up * up.dot(&near)).normalize();
            Matrix3::from_columns(&[x, up.cross(&x), *up])
        };
        let nowhere = Vector3::repeat(f64::NAN);
        let unknown = |up: &Vector3<f64>| Matrix3::from_columns(&[nowhere, nowhere, *up]);
        let mut out: Vec<Matrix3<f64>> = up.iter().map(unknown).collect();
        out[0] = levelled(Vector3::ith(up[0].iamin(), 1.0), &up[0]);
        for (one, of) in fit.passed.iter().zip(self.moves.iter()) {
            let begin = out[of.before];
            out.extend(one.carried.attitude.iter().map(|turn| turn * begin));
            let x: Vector3<f64> = out[out.len() - 1].column(0).into();
            if begin[(0, 0)].is_finite() {
                out[of.before + 1] = levelled(x, &up[of.before + 1]);
            }
        }
        out
    }
}
