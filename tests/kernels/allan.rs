//! Allan kernels: every instruction set, every kind, any length, any number of threads.

#![allow(clippy::unwrap_used)]

use proptest::prelude::*;
use trihedron::allan::tiles::{Difference, Kernel, energies};
use trihedron::allan::{self, Column, FromFn, Kind, Stream};

/// A congruential sequence of zero mean: seeds explicit, no dependence.
fn readings(n: usize, seed: u64) -> Vec<f64> {
    let mut state = seed
        .wrapping_mul(2_862_933_555_777_941_757)
        .wrapping_add(3_037_000_493);
    (0..n)
        .map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        })
        .collect()
}

fn column(data: &[f64]) -> Column<'_, f64> {
    Column {
        data,
        channels: 1,
        channel: 0,
    }
}

fn by_definition(x: &[f64], m: usize) -> f64 {
    let mean = |k: usize| x[k..k + m].iter().sum::<f64>() / m as f64;
    let terms = x.len() - 2 * m + 1;
    (0..terms)
        .map(|k| (mean(k + m) - mean(k)).powi(2))
        .sum::<f64>()
        / (2 * terms) as f64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn overlapping_is_the_definition(n in 2_usize..400, seed in 0_u64..1000, pick in 0_usize..1000) {
        let x = readings(n, seed);
        let m = 1 + pick % (n / 2);
        let got = allan::variances(&FromFn(n, |i| 1e3 + x[i]), &[m], Kind::Overlapping).unwrap();
        let want = by_definition(&x, m);
        prop_assert!((got.variance[0] - want).abs() <= 1e-11 * want.max(1e-3), "{} {}", got.variance[0], want);
        prop_assert_eq!(got.terms[0], n - 2 * m + 1);
    }

    #[test]
    fn every_instruction_set_agrees(n in 3_usize..3000, m in 1_usize..40, seed in 0_u64..1000) {
        let p = readings(n + 3 * m, seed);
        for difference in [Difference::Second, Difference::Third] {
            let plain = Kernel::Portable.energy(&p, 0, n, m, difference);
            let wide = Kernel::detect().energy(&p, 0, n, m, difference);
            prop_assert!((plain - wide).abs() <= 1e-13 * plain);
        }
    }

    #[test]
    fn chunk_sizes_do_not_matter(chunk in 1_usize..5000, seed in 0_u64..1000) {
        let x = readings(5000, seed);
        let clusters = [1, 7, 64, 1000, 2500];
        let whole = allan::variances(&column(&x), &clusters, Kind::Overlapping).unwrap();
        let mut stream = Stream::new(&clusters, 1 << 20).unwrap();
        for part in x.chunks(chunk) {
            stream.extend(&column(part)).unwrap();
        }
        let streamed = stream.finish().unwrap();
        for (a, b) in streamed.curve.variance.iter().zip(&whole.variance) {
            prop_assert!((a - b).abs() <= 1e-11 * b);
        }
    }
}

#[test]
fn a_tile_boundary_loses_no_term() {
    let p = readings(100_000, 5);
    for m in [1, 16_383, 32_767, 32_768, 32_769, 40_000] {
        let direct: f64 = (0..p.len() - 2 * m)
            .map(|k| (p[k + 2 * m] - 2.0 * p[k + m] + p[k]).powi(2))
            .sum();
        let got = energies(&p, &[m], Difference::Second)[0];
        assert!((got - direct).abs() < 1e-11 * direct, "{m}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let x = readings(200_000, 6);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| {
                allan::variances(&column(&x), &[1, 10, 1000, 50_000], Kind::Overlapping).unwrap()
            })
    };
    assert_eq!(run(1), run(2));
    assert_eq!(run(1), run(5));
}

#[test]
fn streamed_means_are_means() {
    let x = readings(10_000, 7);
    let mut stream = Stream::new(&[1], 1 << 20).unwrap();
    stream.extend(&column(&x)).unwrap();
    let (means, size) = stream.means(100);
    assert_eq!((means.len(), size), (100, 100));
    let direct = x[300..400].iter().sum::<f64>() / 100.0;
    assert!((means[3] - direct).abs() < 1e-13);
}

#[test]
fn octave_clusters_nest() {
    let sizes = allan::octave_clusters(1000, 4);
    assert_eq!(sizes[0], 1);
    assert!(sizes.windows(2).all(|w| w[0] < w[1]) && sizes.contains(&512));
}
