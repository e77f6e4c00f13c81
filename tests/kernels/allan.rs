//! Allan kernels: every instruction set, every tile; kinds, lengths and streams: `tests/test_allan.py`.

use proptest::prelude::*;
use trihedron::allan::tiles::{Difference, Kernel, energies};

use super::made_session::Uniform;

fn readings(n: usize, seed: u64) -> Vec<f64> {
    let mut random = Uniform(seed);
    (0..n).map(|_| random.next()).collect()
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
