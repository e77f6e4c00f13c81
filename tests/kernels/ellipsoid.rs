//! The quadric of a triad.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use trihedron::ellipsoid::{Standardisation, fit_ellipsoid, fit_quadric};
use trihedron::norm_invariant::Model;

use super::made_session::Uniform;

const G: f64 = 9.81;

/// Six faces and twelve edges of a cube.
pub fn cube_poses() -> Vec<Vector3<f64>> {
    let corners =
        (0..27).map(|k| Vector3::new(k / 9, k / 3 % 3, k % 3).map(|x| f64::from(x) - 1.0));
    let is_pose = |v: &Vector3<f64>| v.norm() > 0.5 && v.norm() < 1.6;
    corners.filter(is_pose).map(|v| v.normalize()).collect()
}

/// Readings of a lower-triangular triad in these poses.
pub fn readings(model: &Model, up: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let inverse = model.s.try_inverse().expect("regular");
    up.iter().map(|u| inverse * (u * G - model.b)).collect()
}

/// A triad in counts: zero near mid-range, axes a few per cent and degrees off.
pub fn triad(e: [f64; 9]) -> Model {
    let off = Matrix3::new(e[0], 0.0, 0.0, e[1], e[2], 0.0, e[3], e[4], e[5]);
    let s = (Matrix3::identity() + off * 0.1) * 2.4e-3;
    let zero = Vector3::new(e[6], e[7], e[8]) * 800.0 + Vector3::repeat(32768.0);
    Model { s, b: -s * zero }
}

pub fn nine() -> impl Strategy<Value = [f64; 9]> {
    prop::array::uniform9(-1.0..1.0f64)
}

proptest! {
    #[test]
    fn exact_readings_give_the_triad_and_the_constrained_fit_alike(e in nine()) {
        let truth = triad(e);
        let points = readings(&truth, &cube_poses());
        let standard = Standardisation::of(&points).expect("spread");
        let u: Vec<_> = points.iter().map(|a| standard.apply(a)).collect();
        let free = fit_quadric(&u).expect("nine coefficients").model(G).expect("an ellipsoid");
        let bound = fit_ellipsoid(&u).expect("ellipsoid").model(G).expect("ellipsoid");
        // The ridge of 1e-12 against the smallest eigenvalue of the scatter, about 1e-3.
        prop_assert!((free.s - bound.s).norm() < 1e-6 * free.s.norm());
        let found = standard.undo(&free);
        // 32768 counts of zero against 4000 of signal, condition of the poses about ten: 1e-16 · 10² · 10.
        prop_assert!((found.s - truth.s).norm() < 1e-12 * truth.s.norm() * 100.0);
        prop_assert!((found.b - truth.b).norm() < 1e-9);
    }
}

#[test]
fn where_noise_makes_a_hyperboloid_the_constrained_fit_is_still_an_ellipsoid() {
    // All poses within 25° of one axis: the far side is extrapolated and noise decides its sign.
    let mut hyperboloids = 0;
    let mut random = Uniform(1);
    // A linear congruential generator is random enough to spoil a fit.
    let mut noise = || 0.5 * random.next();
    for _ in 0..50 {
        let cap: Vec<Vector3<f64>> = (0..12)
            .map(|_| {
                let tilt = Vector3::new(0.4 * noise(), 0.4 * noise(), 1.0).normalize();
                tilt * (1.0 + 0.02 * noise())
            })
            .collect();
        let standard = Standardisation::of(&cap).expect("spread");
        let u: Vec<_> = cap.iter().map(|a| standard.apply(a)).collect();
        let free = fit_quadric(&u).expect("determined").model(G);
        if free.is_none() {
            hyperboloids += 1;
            assert!(fit_ellipsoid(&u).expect("scatter").model(G).is_some());
        }
    }
    assert!(
        hyperboloids > 5,
        "the case under test did not occur: {hyperboloids}"
    );
}
