//! Rotations: round trips and derivatives at zero, tiny, ordinary and half-turn angles.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use std::f64::consts::PI as HALF_TURN;
use trihedron::rotation::{exp, exp_and_left_jacobian, log, skew};

fn angles() -> impl Strategy<Value = Vector3<f64>> {
    let magnitude = prop_oneof![
        Just(0.0),
        1e-12..1e-6,
        1e-6..1e-1,
        0.1..3.1,
        HALF_TURN - 1e-3..HALF_TURN - 1e-6
    ];
    (magnitude, prop::array::uniform3(-1.0..1.0f64)).prop_map(|(m, d)| {
        let d = Vector3::from(d);
        if d.norm() < 1e-3 {
            Vector3::x() * m
        } else {
            d.normalize() * m
        }
    })
}

proptest! {
    #[test]
    fn exp_is_a_proper_rotation_and_log_inverts_it(v in angles()) {
        let r = exp(&v);
        // 9 products of numbers near one: a few ulp.
        prop_assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-14);
        prop_assert!((r.determinant() - 1.0).abs() < 1e-14);
        // Near a half turn the axis is found from a square root: half the digits of 1e-16 would be 1e-8, Shepperd keeps 1e-12.
        prop_assert!((log(&r) - v).norm() < 1e-12);
    }

    #[test]
    fn left_jacobian_is_the_derivative_of_exp(v in angles(), d in prop::array::uniform3(-1.0..1.0f64)) {
        let d = Vector3::from(d);
        let h = 1e-5;
        let numeric = (exp(&(v + d * h)) - exp(&(v - d * h))) / (2.0 * h);
        let (turn, jacobian) = exp_and_left_jacobian(&v);
        let analytic = skew(&(jacobian * d)) * turn;
        // Central differences of step 1e-5: truncation h² = 1e-10, rounding 1e-16/h = 1e-11.
        prop_assert!((numeric - analytic).norm() < 1e-9);
    }
}
