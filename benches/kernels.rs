//! Throughput of the kernels (criterion): `cargo bench`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, Vector3};
use std::hint::black_box;
use trihedron::allan::{Column, Kind, variances};
use trihedron::attitude::{Form, IDENTITY, Samples};
use trihedron::kalman::{AxisFilter, NoiseTerms, Pose, Prior, ShapingModel};
use trihedron::norm_invariant::{Frame, Readings, Settings, fit};
use trihedron::poisson::{MoveRange, RateModel, RateNoise, prepare};
use trihedron::rotation;
use trihedron::simd::Instructions;
use trihedron::stillness::block_statistics_with;

fn rotations(c: &mut Criterion) {
    let v = Vector3::new(0.01, -0.02, 0.03);
    c.bench_function("rotation::exp", |b| b.iter(|| rotation::exp(black_box(&v))));
}

/// Still samples of a triad in counts, in 25 orientations that go round the sphere.
fn still_samples(n: usize) -> Vec<Vector3<f64>> {
    (0..n)
        .map(|i| {
            let pose = (i % 25) as f64 + 0.5;
            let height = 1.0 - pose / 12.5;
            let radius = (1.0 - height * height).sqrt();
            let angle = 2.4 * pose;
            let up = Vector3::new(radius * angle.cos(), radius * angle.sin(), height);
            let ripple = Vector3::new(
                (i as f64).sin(),
                (1.7 * i as f64).cos(),
                (2.3 * i as f64).sin(),
            );
            up.component_mul(&Vector3::new(4070.0, 4040.0, 4065.0))
                + ripple * 5.0
                + Vector3::repeat(32768.0)
        })
        .collect()
}

fn norm_fits(c: &mut Criterion) {
    let settings = Settings {
        gravity: 9.81,
        frame: Frame::Lower,
    };
    let noise = [Matrix3::identity() * 12.5];
    let mut group = c.benchmark_group("norm_invariant::fit");
    group.sample_size(10);
    for n in [18, 500, 1_000_000] {
        let values = still_samples(n);
        group.bench_function(format!("{n} readings"), |b| {
            b.iter(|| {
                fit(
                    Readings {
                        values: black_box(&values),
                        noise: &noise,
                        pose: &[],
                    },
                    &settings,
                    None,
                )
            });
        });
    }
    group.finish();
}

/// One move of 10 000 samples: reduced to moments once, then integrated with all sensitivities per fit iteration.
fn poisson(c: &mut Criterion) {
    let n = 10_000;
    let time: Vec<f64> = (0..n).map(|k| f64::from(k) * 1e-3).collect();
    let raw: Vec<_> = time
        .iter()
        .map(|t| Vector3::new(t.sin(), (1.3 * t).cos(), 0.5))
        .collect();
    let range = MoveRange {
        start: 0,
        stop: raw.len(),
        anchor_before_s: -1.0,
        anchor_after_s: 11.0,
    };
    let noise = RateNoise {
        density: Vector3::repeat(1e-4),
        sigma_time_s: 0.0,
        nominal_step_s: 1e-3,
    };
    let scale = Matrix3::identity() * 1.01;
    let bias = Vector3::new(0.01, 0.0, -0.01);
    c.bench_function("poisson::prepare 10k coning", |b| {
        b.iter(|| prepare(black_box(&time), &raw, &range, RateModel::Coning));
    });
    if let Ok(prepared) = prepare(&time, &raw, &range, RateModel::Coning) {
        c.bench_function("poisson::integrate 10k with sensitivities", |b| {
            b.iter(|| prepared.integrate(black_box(&scale), &bias, &bias, &noise));
        });
    }
}

/// A million uneven steps: the last attitude, all of them, and blocks of static detection.
fn long_logs(c: &mut Criterion) {
    let n = 1_000_001_u32;
    let time: Vec<f64> = (0..n)
        .map(|k| 0.01 * (f64::from(k) + 0.3 * (1.7 * f64::from(k)).sin()))
        .collect();
    let rate: Vec<[f64; 3]> = time
        .iter()
        .map(|t| [2.0 * (0.3 * t).sin(), 1.5 * (0.17 * t).cos(), 0.2])
        .collect();
    let mut group = c.benchmark_group("a million samples");
    group
        .sample_size(10)
        .throughput(Throughput::Elements(u64::from(n)));
    for &set in Instructions::offered() {
        let Ok(samples) = Samples::new(&time, &rate, RateModel::Linear) else {
            return;
        };
        let samples = samples.with(set);
        group.bench_function(format!("attitude, last, {}", set.name()), |b| {
            b.iter(|| samples.last());
        });
        let mut out = vec![0.0; 9 * time.len()];
        group.bench_function(format!("attitude, all, {}", set.name()), |b| {
            b.iter(|| samples.all(IDENTITY, Form::Matrix, &mut out));
        });
        group.bench_function(format!("stillness, blocks of 20, {}", set.name()), |b| {
            b.iter(|| block_statistics_with(set, black_box(rate.as_flattened()), 20));
        });
    }
    group.finish();
}

fn allan(c: &mut Criterion) {
    let n = 1_u32 << 20;
    let data: Vec<f64> = (0..n).map(|k| (f64::from(k) * 0.618_034).fract()).collect();
    let column = Column {
        data: &data,
        channels: 1,
        channel: 0,
    };
    let clusters: Vec<usize> = (0..16)
        .map(|octave| 1 << octave)
        .take_while(|m| *m <= data.len() / 8)
        .collect();
    let mut group = c.benchmark_group("allan");
    group.throughput(Throughput::Elements((data.len() * clusters.len()) as u64));
    for kind in [
        Kind::Overlapping,
        Kind::Modified,
        Kind::Hadamard,
        Kind::Total,
    ] {
        group.bench_function(format!("{kind:?}"), |b| {
            b.iter(|| variances(black_box(&column), black_box(&clusters), kind));
        });
    }
    group.finish();
}

/// One pose of the Kalman filter of one axis: time update, measurement update, on a regular log.
fn kalman_poses(c: &mut Criterion) {
    let model = |averages, flicker_rates: &[f64]| ShapingModel {
        terms: NoiseTerms {
            quantisation: 0.0,
            white: 0.02,
            flicker: 0.01,
            walk: 1e-3,
            ramp: 1e-5,
            gauss_markov: 0.0,
            gauss_markov_rate: 0.0,
            resolution: 0.0,
        },
        flicker_rates: flicker_rates.to_vec(),
        ramp_frequency: 1e-5,
        ramp_damping: 0.7,
        dither: 0.0,
        averages,
    };
    let prior = Prior {
        mean: [0.0; 4],
        sigma: [1e6; 4],
        walk: [0.0; 4],
    };
    let six_rates = [1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0];
    for (name, model) in [
        (
            "kalman::AxisFilter::add, 8 states of the article",
            model(false, &[0.01]),
        ),
        (
            "kalman::AxisFilter::add, 9 states, exact means",
            model(true, &[0.01]),
        ),
        (
            "kalman::AxisFilter::add, 14 states, exact means",
            model(true, &six_rates),
        ),
    ] {
        let mut filter = AxisFilter::new(model, &prior).expect("a sound model");
        let mut k = 0_u32;
        c.bench_function(name, |b| {
            b.iter(|| {
                let angle = f64::from(k % 360).to_radians();
                let pose = Pose {
                    reading: 0.1 * angle.sin(),
                    reference: [
                        9.8 * angle.sin(),
                        9.8 * angle.cos(),
                        4.9 * (3.0 * angle).sin(),
                    ],
                    start: 10.0 * f64::from(k),
                    pose_s: 5.0,
                    extra_variance: 0.0,
                };
                k += 1;
                black_box(filter.add(black_box(&pose)))
            });
        });
    }
}

criterion_group!(
    benches,
    rotations,
    norm_fits,
    poisson,
    long_logs,
    allan,
    kalman_poses
);
criterion_main!(benches);
