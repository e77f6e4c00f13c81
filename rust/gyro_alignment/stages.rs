//! The fit: a robust approach from several starts, then generalised least squares with the covariance (5.8).

use super::covariance::{Layout, whole_covariance};
use super::{Alignment, Evaluated, LastTurns, Model};
use crate::banded::BandedCholesky;
use crate::error::{Error, Result};
use crate::gauss_newton::{self, Certainty, Loss, Options, Solution, Stop};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// How to fit.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// What a move costs whose residual is far beyond its noise; scales in standard errors.
    pub loss: Loss,
    /// Times the covariance is computed anew; between the first and the last of them a step or two are taken each.
    pub max_rounds: usize,
    /// The first start is a solution of nearly the same problem: it is not approached, but weighed at once.
    pub is_near: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            loss: Loss::Linear,
            max_rounds: 40,
            is_near: false,
        }
    }
}

/// The answer and its certainty.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Both sensors at the solution.
    pub model: Model,
    /// Weighted sum of squares, robust weights included, and its degrees of freedom.
    pub chi2: f64,
    /// Rows minus determined parameters; what was known of the offset is none.
    pub dof: usize,
    /// SVD of the whitened Jacobian with unit columns.
    pub certainty: Certainty,
    /// Robust weight of every move; one when it is in full force.
    pub weights: Vec<f64>,
    /// Squared Mahalanobis distance (two degrees of freedom) of every used move.
    pub mahalanobis: Vec<f64>,
    /// `B f_i − f_j` of every move, used or not, m/s².
    pub residuals: Vec<Vector3<f64>>,
    /// Covariance of each from its own measurements.
    pub cov_residuals: Vec<Matrix3<f64>>,
    /// Predicted force after each move, m/s².
    pub predicted: Vec<Vector3<f64>>,
    /// Linearisations made.
    pub iterations: usize,
    /// Whether the solver and the covariance both settled, and why it stopped.
    pub is_converged: bool,
    /// In words.
    pub stopped_because: &'static str,
}

/// Angle, rad, beyond which the robust approach stops believing a move.
const DOUBTFUL_ANGLE: f64 = 0.05;
/// Linearisations of a round whose covariance or weights are still to change: a fit to the end would be for nothing.
const STEPS: usize = 1;
/// Relative step at which the approach has come near enough to be weighed.
const NEAR: f64 = 1e-4;
/// Standard errors by which the parameters together may still move.
const SETTLED: f64 = 1e-3;

/// Fits from each start and keeps the best; then weighs by the full covariance.
///
/// # Errors
/// When the pieces do not fit together, no start is given, or no start gives finite residuals.
pub fn fit(problem: &Alignment, starts: &[Model], settings: &Settings) -> Result<Fit> {
    problem.check()?;
    let turns = LastTurns::default();
    let mut base = match starts {
        [near, ..] if settings.is_near => near.clone(),
        _ => approach(problem, starts, &turns)?,
    };
    let mut weights = vec![1.0; problem.links.len()];
    let mut iterations = 0;
    let mut settled = false;
    let mut last: Option<Solution> = None;
    let max_rounds = settings.max_rounds.max(1);
    let mut is_last = max_rounds == 1;
    for round in 0..max_rounds {
        let at = problem.evaluate(base.clone(), &turns);
        let layout = Layout::new(problem, &at);
        let (factor, mahalanobis) = layout.covariance(problem, &at, &weights)?;
        let mut next_weights: Vec<f64> = mahalanobis
            .iter()
            .map(|&squared| settings.loss.weight(squared).max(1e-6))
            .collect();
        if last.is_none() {
            // The approach was not weighed: its residuals say nothing about outliers yet.
            next_weights.fill(1.0);
        }
        let change_of_weights = next_weights
            .iter()
            .zip(&weights)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        let factor = if change_of_weights > 0.0 {
            layout.covariance(problem, &at, &next_weights)?.0
        } else {
            factor
        };
        weights = next_weights;
        let steps = if is_last {
            Options::default().max_iterations
        } else {
            STEPS
        };
        let solution = weigh(problem, &base, &layout, &factor, &turns, steps)?;
        iterations += solution.iterations;
        let start = problem.pack(&base);
        let moved = &solution.parameters - start;
        // In standard errors: the covariance of the residuals follows the parameters far more slowly than this.
        let distance = (&solution.r_factor * &moved).norm();
        base = problem.unpack(&base, &solution.parameters);
        let is_near = distance < SETTLED && change_of_weights < 1e-3;
        last = Some(solution);
        if is_near && is_last {
            settled = true;
            break;
        }
        // Once there, to the end; and so if the rounds run out.
        is_last = is_last || is_near || round + 2 == max_rounds;
    }
    let solution = last.ok_or_else(|| Error::bad_input("a fit needs at least one round"))?;
    let at = problem.evaluate(base, &turns);
    finish(problem, at, &weights, &solution, iterations, settled)
}

/// Least squares on directions with a robust loss, accelerometer fixed, from every start; the cheapest wins.
fn approach(problem: &Alignment, starts: &[Model], turns: &LastTurns) -> Result<Model> {
    let mut fixed = problem.clone();
    fixed.accelerometer_basis = DMatrix::zeros(12, 0);
    fixed.is_offset_free = false;
    let n_used = fixed.used.iter().filter(|&&used| used).count();
    let options = Options {
        loss: Loss::SoftL1 { scale: 1.0 },
        block: 3,
        step_tolerance: NEAR,
        max_iterations: 60,
        ..Options::default()
    };
    let unit = 1.0 / (DOUBTFUL_ANGLE * problem.gravity);
    let mut best: Option<(f64, Model)> = None;
    for start in starts {
        let rows = |x: &DVector<f64>| {
            let at = fixed.evaluate(fixed.unpack(start, x), turns);
            let mut residual = DVector::zeros(3 * n_used);
            let mut jacobian = DMatrix::zeros(3 * n_used, 9);
            let mut row = 0;
            for index in (0..fixed.links.len()).filter(|&index| fixed.used[index]) {
                let one = fixed.move_row(&at, index);
                residual.rows_mut(row, 3).copy_from(&(one.residual * unit));
                jacobian.rows_mut(row, 3).copy_from(&(one.jacobian * unit));
                row += 3;
            }
            (residual, jacobian)
        };
        let Ok(solution) = gauss_newton::minimise(
            |x| Ok(rows(x)),
            |x| Ok(rows(x).0),
            fixed.pack(start),
            &options,
        ) else {
            continue;
        };
        if best.as_ref().is_none_or(|(cost, _)| solution.cost < *cost) {
            best = Some((solution.cost, fixed.unpack(start, &solution.parameters)));
        }
    }
    best.map(|(_, model)| model).ok_or_else(|| {
        Error::bad_input(
            "the gyro fit has no usable start: give the nominal scale of the gyro (rad/s per raw unit)",
        )
    })
}

/// One generalised least-squares fit with the covariance fixed.
fn weigh(
    problem: &Alignment,
    base: &Model,
    layout: &Layout,
    factor: &BandedCholesky,
    turns: &LastTurns,
    steps: usize,
) -> Result<Solution> {
    let whitened = |x: &DVector<f64>| {
        let at = problem.evaluate(problem.unpack(base, x), turns);
        let (residual, jacobian) = layout.linearise(problem, &at);
        let mut columns = jacobian.insert_column(0, 0.0);
        columns.set_column(0, &residual);
        factor.whiten(&mut columns);
        columns
    };
    gauss_newton::minimise(
        |x| {
            let columns = whitened(x);
            Ok((columns.column(0).into_owned(), columns.remove_column(0)))
        },
        |x| Ok(whitened(x).column(0).into_owned()),
        problem.pack(base),
        &Options {
            max_iterations: steps,
            ..Options::default()
        },
    )
}

fn finish(
    problem: &Alignment,
    at: Evaluated,
    weights: &[f64],
    solution: &Solution,
    iterations: usize,
    settled: bool,
) -> Result<Fit> {
    let layout = Layout::new(problem, &at);
    let (factor, mahalanobis) = layout.covariance(problem, &at, weights)?;
    let (residual, jacobian) = layout.linearise(problem, &at);
    let mut columns = jacobian.insert_column(0, 0.0);
    columns.set_column(0, &residual);
    factor.whiten(&mut columns);
    let whitened = columns.column(0).into_owned();
    let chi2 = whitened.norm_squared();
    let jacobian = columns.remove_column(0);
    let certainty = gauss_newton::certainty(&jacobian, 1.0, Options::default().rank_tolerance);
    // Where rounding of the cost hides the last part of the descent, what is left of it is still known.
    let left = (&jacobian * (&certainty.covariance * (jacobian.transpose() * &whitened))).norm();
    let rows: Vec<_> = (0..problem.links.len())
        .map(|index| problem.move_row(&at, index))
        .collect();
    // What was known of the offset is no observation: against it moves are as free as without.
    let dof = (layout.n - problem.n_offset_rows()).saturating_sub(certainty.rank);
    Ok(Fit {
        chi2,
        dof,
        certainty,
        weights: weights.to_vec(),
        mahalanobis,
        residuals: rows.iter().map(|row| row.residual).collect(),
        cov_residuals: (0..rows.len())
            .map(|index| whole_covariance(problem, &at, index))
            .collect(),
        predicted: problem
            .links
            .iter()
            .zip(at.turns.iter())
            .map(|(link, turn)| turn.rotation * at.forces[link.before])
            .collect(),
        model: at.model,
        iterations,
        is_converged: settled
            && (solution.stop.is_converged()
                || (solution.stop == Stop::NoDescent && left < SETTLED)),
        stopped_because: solution.stop.name(),
    })
}
