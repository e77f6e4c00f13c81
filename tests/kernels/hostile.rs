//! Whatever numbers arrive (missing, infinite, absurd, all equal), a kernel answers or refuses; it never panics or hangs.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use trihedron::allan::{self, Column, Kind, Stream};
use trihedron::gauss_newton::Loss;
use trihedron::norm_invariant::{Frame, Objective, Readings, Settings};
use trihedron::screening::{Scale, jumps};
use trihedron::simulate::noise;
use trihedron::{ellipsoid, norm_invariant, stillness};

/// Mostly ordinary readings, and everything a damaged log holds.
fn reading() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => -20.0..20.0f64,
        2 => Just(0.0),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(f64::NEG_INFINITY),
        1 => Just(1e300),
        1 => Just(-1e-300),
        1 => Just(5e-324),
        1 => any::<f64>(),
    ]
}

/// Readings of one kind only now and then: a channel that is dead, or all missing.
fn channel(longest: usize) -> impl Strategy<Value = Vec<f64>> {
    prop_oneof![
        4 => prop::collection::vec(reading(), 0..longest),
        2 => prop::collection::vec(-20.0..20.0f64, 0..longest),
        1 => (reading(), 0..longest).prop_map(|(v, n)| vec![v; n]),
    ]
}

fn kind() -> impl Strategy<Value = Kind> {
    prop_oneof![
        Just(Kind::Overlapping),
        Just(Kind::NonOverlapping),
        Just(Kind::Modified),
        Just(Kind::Hadamard),
        Just(Kind::Total),
    ]
}

fn column(data: &[f64]) -> Column<'_, f64> {
    Column {
        data,
        channels: 1,
        channel: 0,
    }
}

fn vectors(longest: usize) -> impl Strategy<Value = Vec<Vector3<f64>>> {
    channel(3 * longest).prop_map(|flat| {
        flat.chunks_exact(3)
            .map(Vector3::from_column_slice)
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn allan_variances_answer_or_refuse(x in channel(300), m in prop::collection::vec(0usize..200, 0..5), kind in kind()) {
        if let Ok(curve) = allan::variances(&column(&x), &m, kind) {
            prop_assert_eq!(curve.variance.len(), m.len());
            prop_assert_eq!(curve.terms.len(), m.len());
        }
    }

    #[test]
    fn a_stream_answers_or_refuses(x in channel(500), cut in 0usize..500, m in prop::collection::vec(0usize..300, 0..5)) {
        let Ok(mut stream) = Stream::new(&m, 1 << 16) else { return Ok(()) };
        let cut = cut.min(x.len());
        if stream.extend(&column(&x[..cut])).is_ok() && stream.extend(&column(&x[cut..])).is_ok() {
            let _ = stream.finish();
            let _ = stream.means(cut);
        }
    }

    #[test]
    fn blocks_and_jumps_answer_or_refuse(x in channel(300), size in 0usize..200, stride in 0usize..9, limit in reading()) {
        let _ = stillness::block_statistics(&x, size);
        let _ = jumps(&column(&x), &[Scale { size, stride, limit }]);
    }

    #[test]
    fn an_ellipsoid_and_a_norm_answer_or_refuse(v in vectors(30), g in reading(), symmetric: bool, squared: bool, spread in reading()) {
        let frame = if symmetric { Frame::Symmetric } else { Frame::Lower };
        if let Ok(model) = ellipsoid::calibrate(&v, g, frame) {
            prop_assert!(model.s.iter().chain(model.b.iter()).all(|x| x.is_finite()));
        }
        let settings = Settings {
            gravity: g,
            frame,
            objective: if squared { Objective::SquaredNorm } else { Objective::Norm },
            loss: Loss::Linear,
        };
        let noise = vec![Matrix3::identity() * spread; v.len()];
        let _ = norm_invariant::fit(Readings { values: &v, noise: &noise, pose: &[] }, &settings, None);
    }

    #[test]
    fn simulated_noise_has_the_length_asked_for(n in 0usize..500, dt in reading(), sizes in prop::array::uniform5(reading()), seed: u64) {
        let terms = noise::Terms { white: sizes[0], quantisation: sizes[1], walk: sizes[2], flicker: sizes[3], ramp: sizes[4] };
        let keys = noise::Keys { white: seed, quantisation: 1, walk: 2, flicker: 3 };
        if let Ok(out) = noise::three_axes(n, dt, &[terms; 3], &[keys; 3]) {
            prop_assert_eq!(out.len(), 3 * n);
        }
    }
}
