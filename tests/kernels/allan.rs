//! Allan kernels: every instruction set; tiles, kinds, lengths and streams: `tests/test_allan.py`.

use proptest::prelude::*;
use trihedron::allan::tiles::{Difference, Kernel};

use super::made_session::Uniform;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_instruction_set_agrees(n in 3_usize..3000, m in 1_usize..40, seed in 0_u64..1000) {
        let mut random = Uniform(seed);
        let p: Vec<f64> = (0..n + 3 * m).map(|_| random.next()).collect();
        for difference in [Difference::Second, Difference::Third] {
            let plain = Kernel::Portable.energy(&p, 0, n, m, difference);
            let wide = Kernel::detect().energy(&p, 0, n, m, difference);
            prop_assert!((plain - wide).abs() <= 1e-13 * plain);
        }
    }
}
