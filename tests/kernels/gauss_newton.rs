//! The solver on problems whose answer is known.

use nalgebra::{DMatrix, DVector};
use trihedron::Result;
use trihedron::gauss_newton::{Options, Solution, Stop, minimise};

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
    let residuals = |x: &DVector<f64>| model(x).map(|(r, _)| r);
    minimise(&model, residuals, DVector::from_vec(start), options).expect("solvable")
}

#[test]
fn the_bent_valley_is_followed_to_its_end() {
    let solution = solve(rosenbrock, vec![-1.2, 1.0], &Options::default());
    assert!(solution.stop.is_converged(), "{:?}", solution.stop);
    // The residual vanishes at (1, 1), so the answer is limited by rounding alone.
    assert!((solution.parameters - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-10);
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
