//! Throughput of the Allan kernels (criterion): `cargo bench --bench allan`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use trihedron::allan::prefix::Prefix;
use trihedron::allan::tiles::{Difference, Kernel, energies};
use trihedron::allan::{Column, Kind, octave_clusters, variances};

const N: usize = 1 << 20;

fn readings() -> Vec<f64> {
    let mut state = 1_u64;
    (0..N)
        .map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        })
        .collect()
}

fn kinds(c: &mut Criterion) {
    let x = readings();
    let column = Column {
        data: &x,
        channels: 1,
        channel: 0,
    };
    let clusters = octave_clusters(N / 8, 4);
    let mut group = c.benchmark_group("allan");
    group.throughput(Throughput::Elements((N * clusters.len()) as u64));
    for kind in [
        Kind::Overlapping,
        Kind::NonOverlapping,
        Kind::Modified,
        Kind::Hadamard,
        Kind::Total,
    ] {
        group.bench_function(BenchmarkId::from_parameter(format!("{kind:?}")), |b| {
            b.iter(|| variances(black_box(&column), black_box(&clusters), kind));
        });
    }
    group.finish();
}

fn parts(c: &mut Criterion) {
    let x = readings();
    let column = Column {
        data: &x,
        channels: 1,
        channel: 0,
    };
    let p = Prefix::new(&column).sums;
    let mut group = c.benchmark_group("allan parts");
    group.throughput(Throughput::Elements(N as u64));
    group.bench_function("running sum", |b| {
        b.iter(|| Prefix::new(black_box(&column)));
    });
    for lag in [1, 1000, 100_000] {
        group.bench_function(BenchmarkId::new("one lag", lag), |b| {
            b.iter(|| energies(black_box(&p), &[lag], Difference::Second));
        });
    }
    for kernel in [Kernel::detect(), Kernel::Portable] {
        group.bench_function(
            BenchmarkId::new("instructions", format!("{kernel:?}")),
            |b| {
                b.iter(|| kernel.energy(black_box(&p), 0, N - 200, 100, Difference::Second));
            },
        );
    }
    group.finish();
}

criterion_group!(benches, kinds, parts);
criterion_main!(benches);
