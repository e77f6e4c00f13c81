//! Attitude: the chain of rotations against one product after the other, whatever the instructions and the threads.

use nalgebra::{Matrix3, Vector3};
use trihedron::attitude::{Form, IDENTITY, Quaternion, Samples};
use trihedron::poisson::{RateModel, step_weights};
use trihedron::rotation::{exp, log};
use trihedron::simd::Instructions;

const MODELS: [RateModel; 3] = [RateModel::Constant, RateModel::Linear, RateModel::Coning];

/// A wandering rate at uneven instants.
fn log_of(n: usize, speed: f64) -> (Vec<f64>, Vec<[f64; 3]>) {
    let time: Vec<f64> = (0..n)
        .map(|k| 0.01 * (k as f64 + 0.3 * (1.7 * k as f64).sin()))
        .collect();
    let rate = time
        .iter()
        .map(|t| {
            [
                speed * (2.0 * t).sin(),
                speed * 1.5 * (1.3 * t + 0.4).cos(),
                speed * 0.7 * (2.9 * t).sin(),
            ]
        })
        .collect();
    (time, rate)
}

/// One nalgebra product after the other.
fn slowly(time: &[f64], rate: &[[f64; 3]], model: RateModel) -> Vec<Matrix3<f64>> {
    let used: Vec<usize> = (0..time.len()).collect();
    let mut attitude = Matrix3::identity();
    let mut all = vec![attitude];
    for step in step_weights(time, &used, model) {
        let (zeroth, first) = step.moments(|k| Vector3::from(rate[k]));
        attitude *= exp(&(zeroth + zeroth.cross(&first)));
        all.push(attitude);
    }
    all
}

fn matrices(samples: &Samples<'_>, n: usize, initial: Quaternion) -> Vec<Matrix3<f64>> {
    let mut out = vec![0.0; 9 * n];
    samples
        .all(initial, Form::Matrix, &mut out)
        .expect("good samples");
    out.chunks_exact(9).map(Matrix3::from_row_slice).collect()
}

#[test]
fn every_instruction_set_and_model_gives_the_product_of_the_steps() {
    // Lengths below, at and beyond a tile of 512 steps; speeds whose steps are tiny, ordinary and beyond the series.
    for n in [1, 2, 3, 33, 513, 514, 1700] {
        for speed in [1e-9, 1.0, 300.0] {
            let (time, rate) = log_of(n, speed);
            for model in MODELS {
                let truth = slowly(&time, &rate, model);
                for &set in Instructions::offered() {
                    let samples = Samples::new(&time, &rate, model)
                        .expect("good samples")
                        .with(set);
                    let found = matrices(&samples, n, IDENTITY);
                    let gap = found
                        .iter()
                        .zip(&truth)
                        .map(|(a, b)| (a - b).norm())
                        .fold(0.0, f64::max);
                    // 1700 products, each wrong by some ulp.
                    assert!(gap < 2e-13, "{n} at {speed}, {model:?}, {set:?}: {gap}");
                    let last = samples
                        .last_from(IDENTITY, Form::Matrix)
                        .expect("good samples");
                    let last = Matrix3::from_row_slice(&last);
                    assert!((last - truth[n - 1]).norm() < 2e-13, "{n} at {speed}");
                }
            }
        }
    }
}

#[test]
fn all_forms_say_the_same_and_begin_where_they_are_told() {
    let (time, rate) = log_of(700, 3.0);
    let samples = Samples::new(&time, &rate, RateModel::Linear).expect("good samples");
    let turned = 0.6_f64;
    let start = [(0.5 * turned).cos(), 0.0, (0.5 * turned).sin(), 0.0];
    let truth: Vec<_> = slowly(&time, &rate, RateModel::Linear)
        .into_iter()
        .map(|r| exp(&Vector3::new(0.0, turned, 0.0)) * r)
        .collect();
    let (mut quaternions, mut vectors) = (vec![0.0; 4 * 700], vec![0.0; 3 * 700]);
    samples
        .all(start, Form::Quaternion, &mut quaternions)
        .expect("good samples");
    samples
        .all(start, Form::Vector, &mut vectors)
        .expect("good samples");
    let found = matrices(&samples, 700, start);
    for k in 0..700 {
        assert!((found[k] - truth[k]).norm() < 1e-13);
        let vector = Vector3::from_column_slice(&vectors[3 * k..3 * k + 3]);
        // Near half a turn the rotation vector is the root of a small difference: compared as rotations.
        assert!((exp(&vector) - truth[k]).norm() < 1e-13);
        assert!(vector.norm() <= std::f64::consts::PI + 1e-12);
        let [x, y, z, w] = [0, 1, 2, 3].map(|c| quaternions[4 * k + c]);
        let axis = Vector3::new(x, y, z);
        let angle = 2.0 * axis.norm().atan2(w);
        let direction = axis.try_normalize(1e-12).unwrap_or_default();
        assert!((log(&(exp(&(direction * angle)) * truth[k].transpose()))).norm() < 1e-13);
    }
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_threads() {
    // Five pieces of 32768 steps and a bit.
    let (time, rate) = log_of(170_000, 2.0);
    let run = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("pool")
            .install(|| {
                let samples = Samples::new(&time, &rate, RateModel::Linear).expect("good");
                let mut out = vec![0.0; 4 * time.len()];
                samples
                    .all(IDENTITY, Form::Quaternion, &mut out)
                    .expect("good");
                (out, samples.last().expect("good"))
            })
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one, three);
    let [w, x, y, z] = one.1;
    let end = &one.0[one.0.len() - 4..];
    for (a, b) in end.iter().zip([x, y, z, w]) {
        assert!((a - b).abs() < 1e-13);
    }
}

#[test]
fn repeated_timestamps_do_not_turn_and_bad_samples_are_named() {
    let (mut time, mut rate) = log_of(600, 1.0);
    time[300] = time[299];
    let samples = Samples::new(&time, &rate, RateModel::Constant).expect("good samples");
    let all = matrices(&samples, 600, IDENTITY);
    assert!((all[300] - all[299]).norm() < 1e-15);
    let refused = |time: &[f64], rate: &[[f64; 3]], words: &str| {
        for model in MODELS {
            let samples = Samples::new(time, rate, model).expect("equal lengths");
            let error = samples.last().expect_err(words).to_string();
            assert!(error.contains(words), "{error}");
            let mut out = vec![0.0; 9 * time.len()];
            assert!(samples.all(IDENTITY, Form::Matrix, &mut out).is_err());
        }
    };
    rate[450][1] = f64::NAN;
    refused(&time, &rate, "the rate of sample 450 is not finite");
    rate[450][1] = 0.0;
    time[520] = f64::NAN;
    refused(&time, &rate, "the time of sample 520 is not a number");
    time[520] = 1.0;
    refused(&time, &rate, "time runs backward at sample 520");
    assert!(Samples::new(&time[1..], &rate, RateModel::Linear).is_err());
    assert!(Samples::new(&[], &[], RateModel::Linear).is_err());
}
