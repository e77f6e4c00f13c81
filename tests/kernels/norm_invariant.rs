//! The norm fit: derivatives, recovery, and the minimum it must never find.

use nalgebra::{DVector, Matrix3, Vector3};
use proptest::prelude::*;
use trihedron::norm_invariant::{Model, Readings, fit, residual_gradient};

use super::ellipsoid::{cube_poses, nine, readings, triad};

const G: f64 = 9.81;

proptest! {
    #[test]
    fn the_jacobian_is_the_derivative(e in nine(), u in prop::array::uniform3(-1.0..1.0f64)) {
        let u = Vector3::from(u);
        let unpack = |x: &DVector<f64>| {
            Matrix3::new(x[0], 0.0, 0.0, x[1], x[2], 0.0, x[3], x[4], x[5]) * u + Vector3::new(x[6], x[7], x[8])
        };
        let residual = |x: &DVector<f64>| unpack(x).norm();
        let x = DVector::from_iterator(9, e.iter().enumerate().map(|(k, v)| v + if k > 5 { 9.0 } else { 0.0 }));
        let analytic = residual_gradient(&unpack(&x), &u);
        for k in 0..9 {
            let h = 1e-5;
            let (mut up, mut down) = (x.clone(), x.clone());
            up[k] += h;
            down[k] -= h;
            // Central differences of step 1e-5 on a function of order ten: 1e-10 and 1e-15/1e-5.
            prop_assert!(((residual(&up) - residual(&down)) / (2.0 * h) - analytic[k]).abs() < 1e-8);
        }
    }

    #[test]
    fn no_start_leads_to_the_worthless_minimum(e in nine(), scale in -3.0..3.0f64, shift in prop::array::uniform3(-20.0..20.0f64)) {
        // S = 0, |b| = |g| fits exactly. From starts wrong by factors up to twenty the fit finds the triad or says no.
        let truth = triad(e);
        let values = readings(&truth, &cube_poses());
        let values = Readings { values: &values, noise: &[Matrix3::identity()] };
        let start = Model { s: truth.s * scale.exp(), b: truth.b * scale.exp() + Vector3::from(shift) };
        if let Ok(found) = fit(values, G, Some(start)) {
            let volume = (found.model.s.determinant() / truth.s.determinant()).abs();
            prop_assert!(volume > 1e-3, "collapsed to {volume}");
            if found.stop.is_converged() && found.chi2 < 1.0 {
                let same = found.model.s.transpose() * found.model.s - truth.s.transpose() * truth.s;
                prop_assert!(same.norm() < 1e-5 * truth.s.norm_squared());
            }
        }
    }
}
