//! Poisson integration: noise and sensitivities of a move in parts. Order, derivatives: `tests/test_attitude.py`.

use nalgebra::{Matrix3, Vector3};
use trihedron::poisson::{MoveRange, RateModel, RateNoise, integrate_moves};

use super::made_session::Uniform;

fn timestamps(n: usize, span: f64, jitter: f64) -> Vec<f64> {
    let (h, mut random) = (span / (n - 1) as f64, Uniform(3));
    (0..n)
        .map(|k| {
            let inner = k > 0 && k < n - 1;
            h * (k as f64 + if inner { jitter * random.next() } else { 0.0 })
        })
        .collect()
}

/// A rate whose direction wanders, so that the commutator matters.
fn wandering(t: f64) -> Vector3<f64> {
    let (turning, leaning) = ((2.0 * t).sin(), 1.5 * (1.3 * t + 0.4).cos());
    Vector3::new(turning, leaning, 0.7 * (2.9 * t).sin())
}

fn scale() -> Matrix3<f64> {
    Matrix3::new(1.1, 0.02, -0.03, 0.01, 0.9, 0.04, -0.05, 0.02, 1.05)
}

#[test]
fn a_move_is_its_two_parts_one_after_the_other() {
    // A sample at which both parts meet, straight lines in them: B = B₂ B₁, G = G₁ + B₁ᵀ G₂, C = C₁ + B₁ᵀ C₂ B₁.
    let noise = RateNoise {
        density: Vector3::new(0.01, 0.02, 0.03),
        sigma_time_s: 1e-4,
        nominal_step_s: 0.012,
    };
    let before = [Vector3::new(0.01, -0.02, 0.005)];
    let after = [Vector3::new(-0.03, 0.01, 0.02)];
    for magnitude in [1e-7, 1.0, 60.0] {
        let time = timestamps(61, 0.6, 0.3);
        let raw: Vec<_> = time.iter().map(|&t| wandering(t) * magnitude).collect();
        let of = |start: usize, stop: usize| {
            let range = MoveRange {
                start,
                stop,
                anchor_before_s: -1.5,
                anchor_after_s: 3.1,
            };
            let (model, s) = (RateModel::Linear, scale());
            integrate_moves(&time, &raw, &[range], model, &s, &before, &after, &noise)
                .expect("a valid move")
                .remove(0)
        };
        let (whole, first, second) = (of(0, 61), of(0, 25), of(24, 61));
        let back = first.rotation.transpose();
        let gap = [
            (whole.rotation - second.rotation * first.rotation).norm(),
            (whole.wrt_scale - first.wrt_scale - back * second.wrt_scale).norm()
                / whole.wrt_scale.norm(),
            (whole.wrt_bias_before - first.wrt_bias_before - back * second.wrt_bias_before).norm(),
            (whole.wrt_bias_after - first.wrt_bias_after - back * second.wrt_bias_after).norm(),
            (whole.cov_noise - first.cov_noise - back * second.cov_noise * first.rotation).norm()
                / whole.cov_noise.norm(),
        ];
        // Some hundred products and sums of order one, each good to some ulp.
        assert!(
            gap.into_iter().fold(0.0, f64::max) < 1e-12,
            "{magnitude}: {gap:?}"
        );
    }
}
