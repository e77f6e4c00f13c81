//! Poisson integration: closed forms, order of convergence, sensitivities against differences, bad input.

use nalgebra::{Matrix3, SMatrix, Vector3};
use trihedron::poisson::{
    MoveRange, PreparedMove, RateModel, RateNoise, Turn, prepare, step_weights,
};
use trihedron::rotation::{exp, exp_and_left_jacobian, log, skew};
use trihedron::simd::Instructions;

const MODELS: [RateModel; 3] = [RateModel::Constant, RateModel::Linear, RateModel::Coning];
const QUIET: RateNoise = RateNoise {
    density: Vector3::new(0.0, 0.0, 0.0),
    sigma_time_s: 0.0,
    nominal_step_s: f64::INFINITY,
};

/// Deterministic numbers in (−1, 1).
fn noise(k: usize) -> f64 {
    let x = (k as f64 * 12.9898 + 4.1).sin() * 43758.5453;
    2.0 * (x - x.floor()) - 1.0
}

fn timestamps(n: usize, span: f64, jitter: f64) -> Vec<f64> {
    let h = span / (n - 1) as f64;
    (0..n)
        .map(|k| {
            let inner = k > 0 && k < n - 1;
            h * (k as f64 + if inner { jitter * noise(k) } else { 0.0 })
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

fn prepared(time: &[f64], raw: &[Vector3<f64>], model: RateModel) -> PreparedMove {
    prepare(time, raw, &range(time), model).expect("a valid move")
}

fn run(p: &PreparedMove, s: &Matrix3<f64>, b0: &Vector3<f64>, b1: &Vector3<f64>) -> Turn {
    p.integrate(s, b0, b1, &QUIET)
}

/// A rate whose direction wanders, so that the commutator matters.
fn wandering(t: f64) -> Vector3<f64> {
    Vector3::new(
        (2.0 * t).sin(),
        1.5 * (1.3 * t + 0.4).cos(),
        0.7 * (2.9 * t).sin(),
    )
}

fn sampled(time: &[f64], magnitude: f64) -> Vec<Vector3<f64>> {
    time.iter().map(|&t| wandering(t) * magnitude).collect()
}

fn scale() -> Matrix3<f64> {
    Matrix3::new(1.1, 0.02, -0.03, 0.01, 0.9, 0.04, -0.05, 0.02, 1.05)
}

#[test]
fn each_model_converges_at_its_order_on_irregular_timestamps() {
    let reference = {
        let time = timestamps(40_001, 2.0, 0.0);
        let raw = sampled(&time, 1.0);
        run(
            &prepared(&time, &raw, RateModel::Coning),
            &scale(),
            &Vector3::zeros(),
            &Vector3::zeros(),
        )
        .rotation
    };
    for (model, order) in MODELS.into_iter().zip([1.0, 2.0, 4.0]) {
        let error = |n: usize| {
            let time = timestamps(n, 2.0, 0.2);
            let p = prepared(&time, &sampled(&time, 1.0), model);
            let b = run(&p, &scale(), &Vector3::zeros(), &Vector3::zeros()).rotation;
            log(&(b * reference.transpose())).norm()
        };
        let seen = (error(101) / error(1601)).log2() / 4.0;
        // Jitter scatters the leading coefficient by some ten per cent: a quarter of an order over four octaves.
        assert!(
            (seen - order).abs() < 0.3,
            "{model:?} converges with order {seen}"
        );
    }
}

#[test]
fn sensitivities_match_differences_at_zero_tiny_and_ordinary_rates() {
    for model in MODELS {
        for magnitude in [0.0, 1e-7, 1.0] {
            let time = timestamps(60, 2.5, 0.2);
            let p = prepared(&time, &sampled(&time, magnitude), model);
            let (b0, b1) = (
                Vector3::new(0.01, -0.02, 0.005) * magnitude,
                Vector3::new(-0.03, 0.01, 0.02) * magnitude,
            );
            let turn = run(&p, &scale(), &b0, &b1);
            let step = 1e-5;
            // Central differences: truncation ~ step² |∫w'|³ < 1e-9, rounding 1e-15/step = 1e-10.
            let check =
                |plus: Matrix3<f64>, minus: Matrix3<f64>, theta: Vector3<f64>, what: &str| {
                    let numeric = (plus - minus) / (2.0 * step);
                    let gap = (numeric - turn.derivative(&theta)).norm();
                    assert!(
                        gap < 3e-9,
                        "{model:?} at {magnitude}: {what} is off by {gap}"
                    );
                };
            for i in 0..3 {
                for j in 0..3 {
                    let mut d = Matrix3::zeros();
                    d[(i, j)] = step;
                    check(
                        run(&p, &(scale() + d), &b0, &b1).rotation,
                        run(&p, &(scale() - d), &b0, &b1).rotation,
                        turn.wrt_scale.column(3 * i + j).into(),
                        "S",
                    );
                }
                let mut d = Vector3::zeros();
                d[i] = step;
                check(
                    run(&p, &scale(), &(b0 + d), &b1).rotation,
                    run(&p, &scale(), &(b0 - d), &b1).rotation,
                    turn.wrt_bias_before.column(i).into(),
                    "bias before",
                );
                check(
                    run(&p, &scale(), &b0, &(b1 + d)).rotation,
                    run(&p, &scale(), &b0, &(b1 - d)).rotation,
                    turn.wrt_bias_after.column(i).into(),
                    "bias after",
                );
            }
        }
    }
}

#[test]
fn lost_rows_and_repeated_timestamps_are_bridged() {
    let time = timestamps(101, 2.0, 0.0);
    let w = Vector3::new(0.4, 0.1, -0.2);
    let mut raw = vec![w; 101];
    raw[40] = Vector3::repeat(f64::NAN);
    let mut stamped = time.clone();
    stamped[60] = stamped[59];
    for model in MODELS {
        let turn = run(
            &prepared(&stamped, &raw, model),
            &Matrix3::identity(),
            &Vector3::zeros(),
            &Vector3::zeros(),
        );
        assert!(
            (turn.rotation - exp(&(-w * 2.0))).norm() < 1e-13,
            "{model:?}"
        );
    }
}

#[test]
fn a_range_outside_the_record_is_refused() {
    let time = timestamps(10, 1.0, 0.0);
    let raw = vec![Vector3::zeros(); 10];
    let mut wrong = range(&time);
    wrong.stop = 11;
    assert!(prepare(&time, &raw, &wrong, RateModel::Linear).is_err());
    let mut backward = time.clone();
    backward.swap(3, 4);
    assert!(prepare(&backward, &raw, &range(&time), RateModel::Linear).is_err());
    let mut merged = range(&time);
    merged.anchor_after_s = merged.anchor_before_s;
    assert!(prepare(&time, &raw, &merged, RateModel::Linear).is_err());
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
            let raw = sampled(&time, magnitude);
            for model in MODELS {
                let p = prepared(&time, &raw, model);
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
