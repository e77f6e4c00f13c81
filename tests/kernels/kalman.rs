//! Kalman kernels: what dither does to rounding, and constants that walk. The filter itself: `tests/test_kalman.py`.

use trihedron::kalman::rounding::undithered_variance;
use trihedron::kalman::{AxisFilter, NoiseTerms, Pose, Prior, ShapingModel};

#[test]
fn dither_removes_the_rounding_error_from_a_mean() {
    let step = 0.3;
    assert!((undithered_variance(step, 0.0) - step * step / 12.0).abs() < 1e-16);
    assert!(undithered_variance(step, 0.5 * step) < 1e-4 * step * step / 12.0);
    // Direct: the error of the mean of round(x + noise) is the sawtooth convolved with the noise.
    let dither = 0.25 * step;
    let n = 400;
    let mean_error = |x: f64| {
        let cells = 4001;
        let (mut sum, mut weight) = (0.0, 0.0);
        for i in 0..cells {
            let u = (f64::from(i) / f64::from(cells - 1) - 0.5) * 12.0;
            let w = (-0.5 * u * u).exp();
            let v = x + u * dither;
            sum += w * ((v / step).round() * step - v);
            weight += w;
        }
        sum / weight
    };
    let direct: f64 = (0..n)
        .map(|i| mean_error((f64::from(i) + 0.5) / f64::from(n) * step).powi(2))
        .sum::<f64>()
        / f64::from(n);
    // Trapezoid over a sawtooth with 4001 cells: jumps cost 1e-3 of the step.
    assert!((undithered_variance(step, dither) / direct - 1.0).abs() < 0.01);
}

fn model() -> ShapingModel {
    ShapingModel {
        terms: NoiseTerms {
            quantisation: 0.0,
            white: 0.01,
            flicker: 0.0,
            walk: 0.001,
            ramp: 0.0,
            gauss_markov: 0.0,
            gauss_markov_rate: 0.0,
            resolution: 0.0,
        },
        flicker_rates: vec![],
        ramp_frequency: 1e-4,
        ramp_damping: 0.7,
        dither: 0.0,
        averages: true,
    }
}

fn prior() -> Prior {
    Prior {
        mean: [0.0; 4],
        sigma: [1e6; 4],
        walk: [0.0; 4],
    }
}

fn pose(start: f64) -> Pose {
    Pose {
        reading: 1.0,
        reference: [0.0, 0.0, 9.8],
        start,
        pose_s: 1.0,
        extra_variance: 0.0,
    }
}

#[test]
fn walking_constants_forget() {
    let mut walking = prior();
    walking.walk[3] = 0.1;
    let mut still = AxisFilter::new(model(), &prior()).expect("a sound model");
    let mut moving = AxisFilter::new(model(), &walking).expect("a sound model");
    for i in 0..50 {
        let mut p = pose(2.0 * f64::from(i));
        p.reference = [
            9.8 * f64::from(i % 3 - 1),
            9.8 * f64::from(i % 5 - 2),
            9.8 * f64::from(i % 7 - 3),
        ];
        still.add(&p).expect("a sound pose");
        moving.add(&p).expect("a sound pose");
    }
    assert!(moving.sigma()[3] > 2.0 * still.sigma()[3]);
}
