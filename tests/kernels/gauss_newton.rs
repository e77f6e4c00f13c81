//! The solver on problems whose answer is known.

use nalgebra::{DMatrix, DVector, Vector3};
use proptest::prelude::*;
use trihedron::Result;
use trihedron::gauss_newton::{Linear, Options, Solution, Stop, certainty, minimise};

#[allow(clippy::unnecessary_wraps)] // the solver's signature
fn rosenbrock(x: &DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>)> {
    Ok((
        DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]),
        DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]),
    ))
}

fn solve(
    model: impl Fn(&DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>)>,
    start: Vec<f64>,
    options: &Options,
) -> Solution {
    minimise(
        &model,
        |x| model(x).map(|(r, _)| r),
        DVector::from_vec(start),
        options,
    )
    .expect("solvable")
}

#[test]
fn the_bent_valley_is_followed_to_its_end() {
    let solution = solve(rosenbrock, vec![-1.2, 1.0], &Options::default());
    assert!(solution.stop.is_converged(), "{:?}", solution.stop);
    // The residual vanishes at (1, 1), so the answer is limited by rounding alone.
    assert!((solution.parameters - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-10);
}

/// Six parameters (scale and bias per axis) from six faces tilted by up to 3°, without noise: the case in which a well
/// known autopilot ends its loop after the first improving step and leaves 0.3 m/s².
fn tilted_faces() -> (Vec<Vector3<f64>>, Vector3<f64>, Vector3<f64>) {
    let g = 9.81;
    let tilt = 3.0_f64.to_radians();
    let bias = Vector3::new(1.0, -0.8, 0.6);
    let scale = Vector3::new(1.03, 0.97, 1.02);
    let readings = (0..6)
        .map(|face| {
            let mut f = Vector3::zeros();
            f[face % 3] = if face < 3 { 1.0 } else { -1.0 };
            f[(face + 1) % 3] += tilt * if face % 2 == 0 { 1.0 } else { -0.7 };
            (f.normalize() * g).component_div(&scale) - bias
        })
        .collect();
    (readings, scale, bias)
}

#[test]
fn an_improving_step_is_not_the_end() {
    let (readings, scale, bias) = tilted_faces();
    let model = |x: &DVector<f64>| -> Result<(DVector<f64>, DMatrix<f64>)> {
        let mut residuals = DVector::zeros(6);
        let mut jacobian = DMatrix::zeros(6, 6);
        for (i, a) in readings.iter().enumerate() {
            let f = Vector3::from_fn(|j, _| x[j] * (a[j] + x[3 + j]));
            residuals[i] = f.norm() - 9.81;
            for j in 0..3 {
                jacobian[(i, j)] = f[j] / f.norm() * (a[j] + x[3 + j]);
                jacobian[(i, 3 + j)] = f[j] / f.norm() * x[j];
            }
        }
        Ok((residuals, jacobian))
    };
    let solution = solve(
        model,
        vec![1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
        &Options::default(),
    );
    assert!(solution.stop.is_converged());
    assert!(solution.iterations > 2, "{}", solution.iterations);
    for j in 0..3 {
        // The start is 1 m/s² away; nine digits can only come from iterating until the step vanishes.
        assert!((solution.parameters[j] - scale[j]).abs() < 1e-9);
        assert!((solution.parameters[3 + j] - bias[j]).abs() < 1e-9);
    }
}

#[test]
fn the_iteration_limit_is_reported_as_such() {
    let options = Options {
        max_iterations: 2,
        ..Options::default()
    };
    let solution = solve(rosenbrock, vec![-1.2, 1.0], &options);
    assert_eq!(solution.stop, Stop::TooManyIterations);
    assert!(!solution.stop.is_converged());
}

#[test]
fn a_direction_without_data_is_counted_not_invented() {
    // Two parameters that only appear as their sum.
    let model = |x: &DVector<f64>| -> Result<(DVector<f64>, DMatrix<f64>)> {
        Ok((
            DVector::from_fn(5, |i, _| x[0] + x[1] - i as f64),
            DMatrix::from_element(5, 2, 1.0),
        ))
    };
    let solution = solve(model, vec![7.0, 1.0], &Options::default());
    assert_eq!(solution.certainty.rank, 1);
    assert!((solution.parameters.sum() - 2.0).abs() < 1e-12);
    // The undetermined difference stays where it started.
    assert!((solution.parameters[0] - solution.parameters[1] - 6.0).abs() < 1e-12);
    // Variance of the sum: one fifth.
    assert!((solution.certainty.covariance.sum() - 0.2).abs() < 1e-12);
}

#[test]
fn fewer_rows_than_parameters_still_give_all_directions() {
    let rows = DMatrix::from_row_slice(1, 3, &[1.0, 0.0, 0.0]);
    let sure = certainty(&rows, 1e-9);
    assert_eq!(sure.rank, 1);
    assert_eq!(sure.singular_values.len(), 3);
    assert_eq!(sure.directions.shape(), (3, 3));
}

proptest! {
    #[test]
    fn normal_equations_and_rows_compress_to_the_same_problem(
        entries in prop::collection::vec(-1.0..1.0f64, 36), r in prop::collection::vec(-1.0..1.0f64, 12)
    ) {
        let jacobian = DMatrix::from_row_slice(12, 3, &entries);
        let residuals = DVector::from_vec(r);
        let gram = jacobian.transpose() * &jacobian;
        let gradient = jacobian.transpose() * &residuals;
        let rows = Linear::from_rows(residuals, jacobian, 0.0, 0.0);
        let normal = Linear::from_normal_equations(&gram, &gradient, 0.0, 0.0, 12);
        prop_assert!((rows.r_factor.transpose() * &rows.r_factor - &gram).norm() < 1e-12);
        prop_assert!((normal.r_factor.transpose() * &normal.r_factor - &gram).norm() < 1e-12);
        prop_assert!((rows.r_factor.transpose() * &rows.rhs - &gradient).norm() < 1e-12);
        prop_assert!((normal.r_factor.transpose() * &normal.rhs - &gradient).norm() < 1e-9);
    }
}
