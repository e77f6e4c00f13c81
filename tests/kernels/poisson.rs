//! Poisson integration: every instruction set against single steps. Order, derivatives, input: `tests/test_attitude.py`.

use nalgebra::{Matrix3, SMatrix, Vector3};
use trihedron::poisson::{MoveRange, RateModel, RateNoise, Turn, prepare, step_weights};
use trihedron::rotation::{exp, exp_and_left_jacobian, skew};
use trihedron::simd::Instructions;

use super::made_session::Uniform;

const MODELS: [RateModel; 3] = [RateModel::Constant, RateModel::Linear, RateModel::Coning];
const QUIET: RateNoise = RateNoise {
    density: Vector3::new(0.0, 0.0, 0.0),
    sigma_time_s: 0.0,
    nominal_step_s: f64::INFINITY,
};

fn timestamps(n: usize, span: f64, jitter: f64) -> Vec<f64> {
    let (h, mut random) = (span / (n - 1) as f64, Uniform(3));
    (0..n)
        .map(|k| {
            let inner = k > 0 && k < n - 1;
            h * (k as f64 + if inner { jitter * random.next() } else { 0.0 })
        })
        .collect()
}

fn range(time: &[f64]) -> MoveRange {
    MoveRange {
        start: 0,
        stop: time.len(),
        anchor_before_s: time[0] - 1.5,
        anchor_after_s: time[time.len() - 1] + 2.5,
    }
}

/// A rate whose direction wanders, so that the commutator matters.
fn wandering(t: f64) -> Vector3<f64> {
    Vector3::new(
        (2.0 * t).sin(),
        1.5 * (1.3 * t + 0.4).cos(),
        0.7 * (2.9 * t).sin(),
    )
}

fn scale() -> Matrix3<f64> {
    Matrix3::new(1.1, 0.02, -0.03, 0.01, 0.9, 0.04, -0.05, 0.02, 1.05)
}

/// The sums of equation (5.4), one step and one matrix product after the other.
fn slowly(
    time: &[f64],
    raw: &[Vector3<f64>],
    model: RateModel,
    s: &Matrix3<f64>,
    b: [Vector3<f64>; 2],
    noise: &RateNoise,
) -> Turn {
    let at = range(time);
    let span = at.anchor_after_s - at.anchor_before_s;
    let used: Vec<usize> = (0..time.len()).collect();
    let mut turn = Turn {
        rotation: Matrix3::identity(),
        wrt_scale: SMatrix::zeros(),
        wrt_bias_before: Matrix3::zeros(),
        wrt_bias_after: Matrix3::zeros(),
        cov_noise: Matrix3::zeros(),
        duration_s: 0.0,
    };
    for step in step_weights(time, &used, model) {
        let h = step.h;
        let (m0, m1) = step.moments(|k| raw[k]);
        let part = (0.5 * (time[step.from] + time[step.to]) - at.anchor_before_s) / span;
        let phi0 = s * m0 + (b[0] * (1.0 - part) + b[1] * part) * h;
        let phi1 = s * m1 + (b[1] - b[0]) * (h * h / 12.0 / span);
        let phi = phi0 + phi0.cross(&phi1);
        let to_start = turn.rotation.transpose() * exp_and_left_jacobian(&phi).1;
        let (p, q) = (
            to_start * (Matrix3::identity() - skew(&phi1)),
            to_start * skew(&phi0),
        );
        turn.wrt_scale +=
            Matrix3::from(p).kronecker(&m0.transpose()) + q.kronecker(&m1.transpose());
        turn.wrt_bias_before += p * (h * (1.0 - part)) - q * (h * h / 12.0 / span);
        turn.wrt_bias_after += p * (h * part) + q * (h * h / 12.0 / span);
        let of_raw = to_start * s;
        let variance = noise.density.component_mul(&noise.density) * h;
        turn.cov_noise += of_raw * Matrix3::from_diagonal(&variance) * of_raw.transpose();
        let jump = of_raw * (raw[step.to] - raw[step.from]);
        let is_gap = h > 1.5 * noise.nominal_step_s;
        let doubt = noise.sigma_time_s.powi(2) + if is_gap { h * h / 12.0 } else { 0.0 };
        turn.cov_noise += jump * jump.transpose() * doubt;
        turn.rotation = exp(&-phi) * turn.rotation;
        turn.duration_s += h;
    }
    turn
}

#[test]
fn every_instruction_set_gives_the_sums_of_single_steps() {
    let b = [
        Vector3::new(0.01, -0.02, 0.005),
        Vector3::new(-0.03, 0.01, 0.02),
    ];
    let noises = [
        QUIET,
        RateNoise {
            density: Vector3::new(0.01, 0.02, 0.03),
            sigma_time_s: 1e-4,
            nominal_step_s: 0.02,
        },
        RateNoise {
            nominal_step_s: 0.012,
            ..QUIET
        },
    ];
    // Fewer steps than lanes, not a multiple of them; steps tiny, ordinary, and beyond the series of half a radian.
    for n in [2, 4, 9, 60, 331] {
        for magnitude in [0.0, 1e-7, 1.0, 60.0] {
            let time = timestamps(n, 0.01 * n as f64, 0.3);
            let raw: Vec<_> = time.iter().map(|&t| wandering(t) * magnitude).collect();
            for model in MODELS {
                let p = prepare(&time, &raw, &range(&time), model).expect("a valid move");
                for noise in &noises {
                    let truth = slowly(&time, &raw, model, &scale(), b, noise);
                    for &set in Instructions::offered() {
                        let found = p.integrate_with(set, &scale(), &b[0], &b[1], noise);
                        let gap = [
                            (found.rotation - truth.rotation).norm(),
                            (found.wrt_scale - truth.wrt_scale).norm()
                                / truth.wrt_scale.norm().max(1.0),
                            (found.wrt_bias_before - truth.wrt_bias_before).norm(),
                            (found.wrt_bias_after - truth.wrt_bias_after).norm(),
                            (found.cov_noise - truth.cov_noise).norm()
                                / truth.cov_noise.norm().max(1e-12),
                            (found.duration_s - truth.duration_s).abs(),
                        ]
                        .into_iter()
                        .fold(0.0, f64::max);
                        // Some hundred products and sums of order one, each good to some ulp.
                        assert!(gap < 1e-12, "{n} at {magnitude}, {model:?}, {set:?}: {gap}");
                    }
                }
            }
        }
    }
}
