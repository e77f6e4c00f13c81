//! The session model: one linearisation of all moves (per sample), normal equations with their solution (per pose).
//!
//! `cargo bench --bench session_model`; throughput is counted in samples and poses.

#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use trihedron::rotation::exp;
use trihedron::session_model::chain::Chain;
use trihedron::session_model::fit::gradient;
use trihedron::session_model::move_rows::Weights;
use trihedron::session_model::moves::{Move, MoveNoise};
use trihedron::session_model::{Distortion, Session, State, StaticMeans, Strengths};

const GRAVITY: f64 = 9.81;
const SAMPLES_PER_MOVE: usize = 200;
const STRENGTHS: Strengths = Strengths {
    corner_s: [160.0; 2],
    scatter: [1.0; 4],
    between: [0.6; 2],
    excess: [1.0; 2],
};

/// Poses joined by smooth turns of 1.8 rad in 2 s at 100 Hz, read by a plain instrument.
fn session(n_poses: usize) -> (Session, State) {
    let mut up = vec![Vector3::new(0.3, -0.5, 0.8).normalize()];
    let mut moves = Vec::new();
    let time_s: Vec<f64> = (0..n_poses).map(|i| 6.0 * i as f64).collect();
    for m in 0..n_poses - 1 {
        let phase = 2.4 * m as f64;
        let axis = Vector3::new(phase.sin(), phase.cos(), (0.7 * phase).sin()).normalize();
        let time: Vec<f64> = (0..SAMPLES_PER_MOVE)
            .map(|k| time_s[m] + 2.0 + 0.01 * k as f64)
            .collect();
        let span = 0.01 * (SAMPLES_PER_MOVE - 1) as f64;
        let (mut rate, mut force) = (Vec::new(), Vec::new());
        for t in &time {
            let x = 2.0 * std::f64::consts::PI * (t - time[0]) / span;
            rate.push(axis * (1.8 / span * (1.0 - x.cos())));
            let angle = 1.8 * (x - x.sin()) / (2.0 * std::f64::consts::PI);
            force.push(exp(&(-axis * angle)) * up[m] * GRAVITY);
        }
        up.push(exp(&(-axis * 1.8)) * up[m]);
        moves.push(Move::new(
            m,
            &time,
            rate,
            force,
            [time_s[m], time_s[m + 1]],
            [Vector3::zeros(); 2],
            m * SAMPLES_PER_MOVE,
        ));
    }
    let at_rest = |mean: Vec<Vector3<f64>>, sigma: f64| {
        let axes = vec![Vector3::repeat(sigma); mean.len()];
        StaticMeans::of(mean, axes, Vector3::repeat(2.0 * sigma), None).expect("one error a pose")
    };
    let zeros = vec![Vector3::zeros(); n_poses];
    let session = Session {
        gravity: GRAVITY,
        time_s,
        force: at_rest(up.iter().map(|u| u * GRAVITY).collect(), 1e-3),
        rate: Some(at_rest(zeros.clone(), 1e-4)),
        moves: Arc::new(moves),
        noise: MoveNoise {
            force_density: Vector3::repeat(2e-3),
            rate_density: Vector3::repeat(2e-4),
            jitter_s: 0.0,
            nominal_step_s: 0.01,
        },
        prior: None,
        scatter: Some([Vector3::repeat(1e-3), Vector3::repeat(1e-4)]),
        expected_scatter: 0.0,
    };
    let state = State {
        force_scale: Matrix3::identity(),
        force_bias: Vector3::zeros(),
        rate_scale: Matrix3::identity(),
        up,
        pose_rate_bias: zeros.clone(),
        pose_force_bias: zeros.clone(),
        own: [zeros.clone(), zeros],
        effect: DVector::zeros(0),
    };
    (session, state)
}

fn linearisation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("session_linearisation");
    let none = Distortion::default();
    for n_poses in [25, 100] {
        let (session, state) = session(n_poses);
        let planes = session.planes(&state);
        let samples = (SAMPLES_PER_MOVE * (n_poses - 1)) as u64;
        group.throughput(Throughput::Elements(samples));
        group.bench_with_input(BenchmarkId::new("samples", n_poses), &n_poses, |b, _| {
            b.iter(|| session.pass(black_box(&state), &none, &planes));
        });
    }
    group.finish();
}

fn solution(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("session_solve");
    let none = Distortion::default();
    for n_poses in [25, 100, 200] {
        let (session, state) = session(n_poses);
        let passed = session.pass(&state, &none, &session.planes(&state));
        let weights = Weights::of(&passed, &STRENGTHS).unwrap();
        let rows = session
            .groups(&state, &STRENGTHS, &none, &weights, &passed)
            .unwrap();
        let layout = session.layout(0);
        group.throughput(Throughput::Elements(n_poses as u64));
        group.bench_with_input(BenchmarkId::new("poses", n_poses), &n_poses, |b, _| {
            b.iter(|| {
                let chain = Chain::of(layout, rows.iter().map(|one| &one.rows));
                let side: DMatrix<f64> = gradient(layout, black_box(&rows));
                chain.factor(1e-12, None).unwrap().solve(&side)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, linearisation, solution);
criterion_main!(benches);
