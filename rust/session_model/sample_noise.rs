//! Covariance of a move's residuals by the noise of its samples (docs/model-session.md, 11.6).

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::moves::{Move, MoveCovariance, MoveModel, MoveNoise, N_MOVE};
use super::response::Response;

/// Covariance of a move's residuals with gravity and velocity widened, each by its own factor; their covariance stays as
/// noise makes it. If it were widened too, a velocity without weight would determine parameters of the gyro through the
/// correlation. A factor below one is of the motion faster than the samples alone: other noise is measured.
pub(super) fn widened(response: &Response, excess: [f64; 2]) -> MoveCovariance {
    let less = excess.map(|factor| factor.min(1.0));
    let of_row = |row: usize| less[usize::from(row > 1)];
    let scaled = MoveCovariance::from_fn(|i, j| of_row(i) * of_row(j));
    let mut out = response.covariance + response.unresolved.component_mul(&scaled);
    let more = excess.map(|factor| factor.max(1.0).powi(2));
    let mut gravity = out.fixed_view_mut::<2, 2>(0, 0);
    gravity *= more[0];
    let mut velocity = out.fixed_view_mut::<3, 3>(2, 2);
    velocity *= more[1];
    out
}

/// Adds the lower triangle of `R C Rᵀ`.
fn add_square<const N: usize>(
    r: &SMatrix<f64, N, 3>,
    covariance: &Matrix3<f64>,
    out: &mut SMatrix<f64, N, N>,
) {
    let half = r * covariance;
    for j in 0..N {
        for i in j..N {
            out[(i, j)] +=
                half[(i, 0)] * r[(j, 0)] + half[(i, 1)] * r[(j, 1)] + half[(i, 2)] * r[(j, 2)];
        }
    }
}

/// Covariance by noise that is measured, and by motion faster than the samples. What has no known direction has equal
/// variance on all axes.
pub(super) fn of_samples(
    one: &Move,
    move_model: &MoveModel<'_>,
    noise: &MoveNoise,
    by_rate: &[SMatrix<f64, N_MOVE, 3>],
    by_force: &[Matrix3<f64>],
) -> [MoveCovariance; 2] {
    let even = |scale: &Matrix3<f64>, variance: &Vector3<f64>| {
        let mean = (scale.component_mul(scale) * variance).mean();
        Matrix3::identity() * (mean / (one.duration_s * one.step_s))
    };
    let white = |scale: &Matrix3<f64>, density: &Vector3<f64>, beside: &Vector3<f64>| {
        let variance = density.component_mul(density) / one.step_s;
        scale * Matrix3::from_diagonal(&variance) * scale.transpose() + even(scale, beside)
    };
    let (of_rate, of_force) = (&move_model.rate_scale, &move_model.force_scale);
    let passed = |rate: Matrix3<f64>, force: Matrix3<f64>| {
        let mut out = MoveCovariance::zeros();
        let mut of_velocity = Matrix3::zeros();
        for (r, f) in by_rate.iter().zip(by_force) {
            add_square(r, &rate, &mut out);
            add_square(f, &force, &mut of_velocity);
        }
        let mut velocity = out.fixed_view_mut::<3, 3>(2, 2);
        velocity += of_velocity;
        out.fill_upper_triangle_with_lower_triangle();
        out
    };
    [
        passed(
            white(of_rate, &noise.rate_density, &one.unresolved[3]),
            white(of_force, &noise.force_density, &one.unresolved[2]),
        ),
        passed(
            even(of_rate, &one.unresolved[1]),
            even(of_force, &one.unresolved[0]),
        ),
    ]
}
