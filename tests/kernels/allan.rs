//! Allan kernels: every instruction set, every tile; kinds, lengths and streams: `tests/test_allan.py`.

use proptest::prelude::*;
use trihedron::allan::tiles::{Difference, Kernel, energies};

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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_instruction_set_agrees(n in 3_usize..3000, m in 1_usize..40, seed in 0_u64..1000) {
        let p = readings(n + 3 * m, seed);
        for difference in [Difference::Second, Difference::Third] {
            let plain = Kernel::Portable.energy(&p, 0, n, m, difference);
            let wide = Kernel::detect().energy(&p, 0, n, m, difference);
            prop_assert!((plain - wide).abs() <= 1e-13 * plain);
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
