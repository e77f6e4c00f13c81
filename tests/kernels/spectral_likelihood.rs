//! The inverted likelihood: what must hold of it for any spectrum.

use proptest::prelude::*;
use trihedron::spectral_likelihood::{Bins, invert};

/// Sixty bins of white, flicker and walk with chi-square powers given as multiples of their expectation.
fn bins(strength: [f64; 3], draws: &[f64]) -> Bins {
    let frequency: Vec<f64> = (1..=draws.len()).map(|j| j as f64 / 120.0).collect();
    let basis = vec![
        vec![1.0; draws.len()],
        frequency.iter().map(|f| 0.1 / f).collect::<Vec<f64>>(),
        frequency
            .iter()
            .map(|f| 1e-3 / (f * f))
            .collect::<Vec<f64>>(),
    ];
    let expectation = |b: usize| (0..3).map(|k| strength[k] * basis[k][b]).sum::<f64>();
    let line: Vec<f64> = (0..draws.len())
        .map(|b| {
            if b % 2 == 0 {
                ((b + 1) as f64).powi(-2)
            } else {
                0.0
            }
        })
        .collect();
    let power: Vec<f64> = (0..draws.len())
        .map(|b| draws[b] * expectation(b))
        .collect();
    Bins {
        count: vec![3.0; draws.len()],
        line_cross: power
            .iter()
            .zip(&line)
            .map(|(p, t)| 0.3 * p.sqrt() * t)
            .collect(),
        line_square: line.iter().map(|t| t * t).collect(),
        power,
        basis,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn intervals_hold_their_values_and_grow_with_the_rise(
        white in 0.1..10.0_f64,
        flicker in 0.0..3.0_f64,
        walk in 0.0..3.0_f64,
        draws in prop::collection::vec(0.05..3.0_f64, 60),
    ) {
        let bins = bins([white, flicker, walk], &draws);
        let narrow = invert(&bins, 2.0, (1, 2), 2, 0.05).expect("valid bins");
        let wide = invert(&bins, 6.0, (1, 2), 2, 0.05).expect("valid bins");
        for (near, far) in narrow.terms.iter().zip(&wide.terms) {
            prop_assert!(far.lower <= near.lower && near.lower <= near.most_likely);
            prop_assert!(near.most_likely <= near.upper && near.upper <= far.upper);
            prop_assert!(near.median.is_finite() && near.median >= 0.0);
            prop_assert!((near.lower > 0.0) == (near.rise_without > 2.0));
        }
        // Leaving out two costs no less than leaving out either.
        let alone = wide.terms[1].rise_without.max(wide.terms[2].rise_without);
        prop_assert!(wide.rise_without_pair >= alone - 1e-4);
        prop_assert!(wide.line.lower <= wide.line.median && wide.line.median <= wide.line.upper);
    }
}
