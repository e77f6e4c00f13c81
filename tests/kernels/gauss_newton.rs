//! The solver on problems whose answer is known.

use nalgebra::{DMatrix, DVector, Vector3};
use proptest::prelude::*;
use trihedron::Result;
use trihedron::gauss_newton::{Linear, Loss, Options, Solution, Stop, certainty, minimise};

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

fn line(values: &[f64]) -> impl Fn(&DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>)> + '_ {
    move |x: &DVector<f64>| {
        let n = values.len();
        Ok((
            DVector::from_fn(n, |i, _| x[0] + x[1] * i as f64 - values[i]),
            DMatrix::from_fn(n, 2, |i, j| if j == 0 { 1.0 } else { i as f64 }),
        ))
    }
}

#[test]
fn a_robust_loss_ignores_a_gross_outlier_and_says_what_that_costs() {
    let mut values: Vec<f64> = (0..20).map(|i| 2.0 + 0.5 * f64::from(i)).collect();
    values[7] += 1000.0;
    let plain = solve(line(&values), vec![0.0, 0.0], &Options::default());
    assert!((plain.parameters[0] - 2.0).abs() > 10.0);
    for (loss, bound) in [
        // Huber and soft-L1 keep pulling with one `scale` of force; Cauchy lets go.
        (Loss::Huber { scale: 1.345 }, 0.3),
        (Loss::SoftL1 { scale: 1.0 }, 0.3),
        (Loss::Cauchy { scale: 2.385 }, 0.02),
    ] {
        let options = Options {
            loss,
            ..Options::default()
        };
        let robust = solve(line(&values), vec![0.0, 0.0], &options);
        assert!(robust.stop.is_converged(), "{loss:?} {:?}", robust.stop);
        assert!(
            (robust.parameters[0] - 2.0).abs() < bound,
            "{loss:?} {}",
            robust.parameters
        );
    }
}

#[test]
fn the_price_of_robustness_is_the_textbook_one() {
    // 95 % asymptotic efficiency at the customary constants: E[ψ²]/E[ψ']² = 1/0.95, here multiplied by E[w].
    for loss in [Loss::Huber { scale: 1.345 }, Loss::Cauchy { scale: 2.385 }] {
        let n = 20_000;
        let (mut mass, mut weight) = (0.0, 0.0);
        for i in 0..n {
            let r = 8.0 * (f64::from(i) + 0.5) / f64::from(n);
            let density = (-0.5 * r * r).exp();
            mass += density;
            weight += density * loss.weight(r * r);
        }
        let efficiency = (weight / mass) / loss.covariance_factor(1);
        // The constants are quoted to three or four digits.
        assert!((efficiency - 0.95).abs() < 2e-3, "{loss:?} {efficiency}");
    }
    assert!((Loss::Linear.covariance_factor(3) - 1.0).abs() < f64::EPSILON);
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
    assert!(solution.certainty.condition().is_infinite());
    assert!((solution.parameters.sum() - 2.0).abs() < 1e-12);
    // The undetermined difference stays where it started.
    assert!((solution.parameters[0] - solution.parameters[1] - 6.0).abs() < 1e-12);
    // Variance of the sum: one fifth.
    assert!((solution.certainty.covariance.sum() - 0.2).abs() < 1e-12);
}

#[test]
fn fewer_rows_than_parameters_still_give_all_directions() {
    let rows = DMatrix::from_row_slice(1, 3, &[1.0, 0.0, 0.0]);
    let sure = certainty(&rows, 1.0, 1e-9);
    assert_eq!(sure.rank, 1);
    assert_eq!(sure.singular_values.len(), 3);
    assert_eq!(sure.directions.shape(), (3, 3));
}

proptest! {
    #[test]
    fn the_loss_and_its_derivatives_agree(s in 1e-6..100.0f64, c in 0.3..5.0f64) {
        for loss in [Loss::Linear, Loss::Huber { scale: c }, Loss::SoftL1 { scale: c }, Loss::Cauchy { scale: c }] {
            prop_assume!((s - c * c).abs() > 1e-3); // Huber's second derivative jumps there.
            let h = 1e-5 * s;
            let (_, first, second) = loss.rho(s);
            let (up, slope_up, _) = loss.rho(s + h);
            let (down, slope_down, _) = loss.rho(s - h);
            // Central differences with relative step 1e-5: error 1e-10 of the third derivative, rounding 1e-11.
            prop_assert!(((up - down) / (2.0 * h) - first).abs() < 1e-8);
            prop_assert!(((slope_up - slope_down) / (2.0 * h) - second).abs() < 1e-7 * (1.0 + second.abs() / s));
        }
    }

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
