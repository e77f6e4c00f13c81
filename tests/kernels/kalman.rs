//! Kalman kernels: the factored filter against dense algebra, discretisation against closed forms.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use trihedron::kalman::discretisation::discretise;
use trihedron::kalman::rounding::undithered_variance;
use trihedron::kalman::ud::{Factors, Transition, UdFilter};
use trihedron::kalman::{AxisFilter, NoiseTerms, Pose, Prior, ShapingModel};

fn covariance(n: usize, entries: &[f64]) -> DMatrix<f64> {
    let a = DMatrix::from_row_slice(n, n, &entries[..n * n]);
    &a * a.transpose()
}

fn entries(n: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-2.0..2.0f64, n * n)
}

proptest! {
    #[test]
    fn factors_multiply_back_to_the_covariance(values in entries(6)) {
        let p = covariance(6, &values);
        // Sums of six products of numbers up to 24; factors of a badly conditioned matrix lose nothing in the product.
        prop_assert!((Factors::of(&p).covariance_from(0) - p).amax() < 1e-12);
    }

    #[test]
    fn a_measurement_does_what_the_dense_formula_says(
        values in entries(5), h in prop::collection::vec(-2.0..2.0f64, 5), z in -5.0..5.0f64, r in 0.01..2.0f64,
    ) {
        let p = covariance(5, &values);
        let mut filter = UdFilter::new(vec![0.0; 5], Factors::of(&p));
        let seen = filter.update(&h, z, r);
        let h = DVector::from_vec(h);
        let s = (h.transpose() * &p * &h)[(0, 0)] + r;
        let gain = &p * &h / s;
        let rest = DMatrix::identity(5, 5) - &gain * h.transpose();
        let joseph = &rest * &p * rest.transpose() + &gain * gain.transpose() * r;
        // Entries up to 20, condition of the update up to s/r ~ 1e4: 1e-16 × 20 × 1e4.
        prop_assert!((filter.factors.covariance_from(0) - joseph).amax() < 1e-10);
        prop_assert!((filter.estimate() - gain * z).amax() < 1e-10);
        prop_assert!((seen.variance - s).abs() < 1e-12 * s);
    }

    #[test]
    fn the_time_update_moves_only_the_first_states(
        values in entries(6), phi in prop::collection::vec(-1.5..1.5f64, 9), q in entries(3),
    ) {
        let p = covariance(6, &values);
        let (phi, q) = (DMatrix::from_row_slice(3, 3, &phi), covariance(3, &q));
        let mut filter = UdFilter::new(vec![1.0; 6], Factors::of(&p));
        filter.predict(&Transition::new(&phi, &q));
        let mut whole = DMatrix::identity(6, 6);
        whole.view_mut((0, 0), (3, 3)).copy_from(&phi);
        let mut expected = &whole * p * whole.transpose();
        let mut block = expected.view_mut((0, 0), (3, 3));
        block += &q;
        // Entries up to 500, a few dozen products each.
        prop_assert!((filter.factors.covariance_from(0) - expected).amax() < 1e-11);
        prop_assert!((filter.estimate() - whole * DVector::from_element(6, 1.0)).amax() < 1e-14);
    }

    #[test]
    fn a_gauss_markov_process_discretises_to_its_closed_form(rate in -6.0..4.0f64, step in -3.0..4.0f64) {
        let (beta, t) = (10f64.powf(rate), 10f64.powf(step));
        let (phi, q) = discretise(
            &DMatrix::from_element(1, 1, -beta), &DMatrix::from_element(1, 1, 2.0 * beta), t,
        );
        // Doubling k times multiplies the relative rounding of e^x by 2^k = β t; the result itself decays as e^{−β t}.
        prop_assert!((phi[(0, 0)] - (-beta * t).exp()).abs() < 1e-14);
        let exact = -(-2.0 * beta * t).exp_m1();
        prop_assert!((q[(0, 0)] - exact).abs() < 1e-13 * exact);
    }
}

#[test]
fn an_integrated_walk_discretises_to_its_polynomials() {
    let f = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
    let qc = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 1.0]);
    for t in [1e-3, 1.0, 1e4f64] {
        let (phi, q) = discretise(&f, &qc, t);
        let exact = [t.powi(3) / 3.0, t.powi(2) / 2.0, t.powi(2) / 2.0, t];
        for (got, want) in q.iter().zip(exact) {
            assert!((got - want).abs() < 1e-12 * want, "{got} against {want}");
        }
        assert!((phi[(0, 1)] - t).abs() < 1e-14 * t);
    }
}

#[test]
fn dither_removes_the_rounding_error_from_a_mean() {
    let step = 0.3;
    assert!((undithered_variance(step, 0.0) - step * step / 12.0).abs() < 1e-16);
    assert!(undithered_variance(step, 0.5 * step) < 1e-4 * step * step / 12.0);
    // Direct: the error of the mean of round(x + noise) is the sawtooth convolved with the noise.
    let dither = 0.25 * step;
    let n = 400;
    let mean_error = |x: f64| {
        let cells = 4001;
        let (mut sum, mut weight) = (0.0, 0.0);
        for i in 0..cells {
            let u = (f64::from(i) / f64::from(cells - 1) - 0.5) * 12.0;
            let w = (-0.5 * u * u).exp();
            let v = x + u * dither;
            sum += w * ((v / step).round() * step - v);
            weight += w;
        }
        sum / weight
    };
    let direct: f64 = (0..n)
        .map(|i| mean_error((f64::from(i) + 0.5) / f64::from(n) * step).powi(2))
        .sum::<f64>()
        / f64::from(n);
    // Trapezoid over a sawtooth with 4001 cells: jumps cost 1e-3 of the step.
    assert!((undithered_variance(step, dither) / direct - 1.0).abs() < 0.01);
}

fn model() -> ShapingModel {
    ShapingModel {
        terms: NoiseTerms {
            quantisation: 0.0,
            white: 0.01,
            flicker: 0.0,
            walk: 0.001,
            ramp: 0.0,
            gauss_markov: 0.0,
            gauss_markov_rate: 0.0,
            resolution: 0.0,
        },
        flicker_rates: vec![],
        ramp_frequency: 1e-4,
        ramp_damping: 0.7,
        dither: 0.0,
        averages: true,
    }
}

fn prior() -> Prior {
    Prior {
        mean: [0.0; 4],
        sigma: [1e6; 4],
        walk: [0.0; 4],
    }
}

fn pose(start: f64) -> Pose {
    Pose {
        reading: 1.0,
        reference: [0.0, 0.0, 9.8],
        start,
        hold: 1.0,
        extra_variance: 0.0,
    }
}

#[test]
fn poses_out_of_order_are_refused_and_leave_the_filter_as_it_was() {
    let mut filter = AxisFilter::new(model(), &prior()).expect("a sound model");
    filter.add(&pose(0.0)).expect("a sound pose");
    let before = (filter.constants(), filter.sigma(), filter.n_poses());
    let error = filter.add(&pose(0.5)).expect_err("overlaps the last hold");
    assert!(error.to_string().contains("in order of time"));
    assert_eq!(
        (filter.constants(), filter.sigma(), filter.n_poses()),
        before
    );
}

#[test]
fn a_reading_without_uncertainty_is_refused() {
    let mut exact = model();
    exact.terms.white = 0.0;
    assert!(AxisFilter::new(exact, &prior()).is_err());
}

#[test]
fn walking_constants_forget() {
    let mut walking = prior();
    walking.walk[3] = 0.1;
    let mut still = AxisFilter::new(model(), &prior()).expect("a sound model");
    let mut moving = AxisFilter::new(model(), &walking).expect("a sound model");
    for i in 0..50 {
        let mut p = pose(2.0 * f64::from(i));
        p.reference = [
            9.8 * f64::from(i % 3 - 1),
            9.8 * f64::from(i % 5 - 2),
            9.8 * f64::from(i % 7 - 3),
        ];
        still.add(&p).expect("a sound pose");
        moving.add(&p).expect("a sound pose");
    }
    assert!(moving.sigma()[3] > 2.0 * still.sigma()[3]);
}
