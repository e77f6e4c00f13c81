//! Throughput of the kernels (criterion): `cargo bench`.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use std::hint::black_box;
use trihedron::rotation;

fn rotations(c: &mut Criterion) {
    let v = Vector3::new(0.01, -0.02, 0.03);
    c.bench_function("rotation::exp", |b| b.iter(|| rotation::exp(black_box(&v))));
}

criterion_group!(benches, rotations);
criterion_main!(benches);
