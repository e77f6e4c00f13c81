//! Throughput of the fit by norms and of the Kalman filter (criterion): `cargo bench --bench kernels`. Attitude, static
//! detection and reading beside other libraries: `benches/rivals.py`.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix3, Vector3};
use std::hint::black_box;
use trihedron::kalman::{AxisFilter, NoiseTerms, Pose, Prior, ShapingModel};
use trihedron::norm_invariant::{Readings, fit};

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
    let noise = [Matrix3::identity() * 12.5];
    let mut group = c.benchmark_group("norm_invariant::fit");
    group.sample_size(10);
    for n in [18, 500] {
        let values = still_samples(n);
        group.bench_function(format!("{n} readings"), |b| {
            b.iter(|| {
                fit(
                    Readings {
                        values: black_box(&values),
                        noise: &noise,
                    },
                    9.81,
                    None,
                )
            });
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

criterion_group!(benches, norm_fits, kalman_poses);
criterion_main!(benches);
