//! The session model: one linearisation of all moves (per sample), normal equations with their solution (per pose).
//!
//! `cargo bench --bench session_model`; throughput is counted in samples and poses.

#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../tests/kernels/made_session.rs"]
mod made_session;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::DMatrix;
use trihedron::session_model::chain::Chain;
use trihedron::session_model::fit::gradient;
use trihedron::session_model::move_rows::Weights;
use trihedron::session_model::{Distortion, Session, State, Strengths};

const SAMPLES_PER_MOVE: usize = 200;
const STRENGTHS: Strengths = Strengths {
    corner_s: [160.0; 2],
    scatter: [1.0; 4],
    between: [0.6; 2],
    excess: [1.0; 2],
};

fn session(n_poses: usize) -> (Session, State) {
    made_session::made(n_poses, SAMPLES_PER_MOVE, true)
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
