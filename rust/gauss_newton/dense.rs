//! Problems over a plain vector, their Jacobian compressed to an R factor.

use nalgebra::{DMatrix, DVector};

use super::linear::{Certainty, Linear, Scaled, certainty, column_norms, cosine, positive_or_one};
use super::{Descent, Local, Options, Stop, descend};
use crate::error::{Error, Result};

/// A problem for the solver.
pub trait Problem {
    /// The compressed problem at `x`.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn linearise(&self, x: &DVector<f64>) -> Result<Linear>;

    /// F of GN1 at `x`; infinite where the model is invalid: the solver then shortens the step.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn cost(&self, x: &DVector<f64>) -> Result<f64>;
}

/// The solver's result and its uncertainty.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The parameters `(p)`.
    pub parameters: DVector<f64>,
    /// Why it stopped.
    pub stop: Stop,
    /// Linearisations made.
    pub iterations: usize,
    /// F of GN1.
    pub cost: f64,
    /// Σ r² of the whitened residuals.
    pub chi2: f64,
    /// Left side of GN4.
    pub gradient: f64,
    /// Left side of GN3 over `|D x|`.
    pub step: f64,
    /// `RᵀR = JᵀJ` at the solution.
    pub r_factor: DMatrix<f64>,
    /// Number of residuals.
    pub n_residuals: usize,
    /// Covariance and rank of the parameters.
    pub certainty: Certainty,
}

/// Minimises a problem given by rows: `linearise` returns whitened residuals `(m)` and their Jacobian `(m, p)`,
/// `residuals` the same residuals alone (cheaper; used for trial steps).
///
/// # Errors
/// When there are no parameters or the start gives a cost that is not finite.
pub fn minimise(
    linearise: impl Fn(&DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>)>,
    residuals: impl Fn(&DVector<f64>) -> Result<DVector<f64>>,
    start: DVector<f64>,
    options: &Options,
) -> Result<Solution> {
    minimise_problem(
        &Rows {
            linearise,
            residuals,
        },
        start,
        options,
    )
}

/// Minimises a [`Problem`].
///
/// # Errors
/// When there are no parameters or the start gives a cost that is not finite.
pub fn minimise_problem(
    problem: &impl Problem,
    start: DVector<f64>,
    options: &Options,
) -> Result<Solution> {
    if start.is_empty() {
        return Err(Error::bad_input("a fit needs at least one parameter"));
    }
    let dense = Dense {
        problem,
        rank_tolerance: options.rank_tolerance,
    };
    let ended = descend(&dense, start, options)?;
    let linear = ended.local.linear;
    Ok(Solution {
        parameters: ended.point,
        stop: ended.stop,
        iterations: ended.iterations,
        cost: linear.cost,
        chi2: linear.chi2,
        gradient: ended.gradient,
        step: ended.step,
        certainty: certainty(&linear.r_factor, options.rank_tolerance),
        n_residuals: linear.n_residuals,
        r_factor: linear.r_factor,
    })
}

/// A [`Problem`] over a plain vector, its Jacobian compressed to an R factor.
struct Dense<'a, P> {
    problem: &'a P,
    rank_tolerance: f64,
}

struct DenseLocal {
    linear: Linear,
    scale: DVector<f64>,
    scaled: Scaled,
    size: f64,
    rank_tolerance: f64,
}

impl<P: Problem> Descent for Dense<'_, P> {
    type Point = DVector<f64>;
    type Local = DenseLocal;

    fn linearise(&self, x: &DVector<f64>, previous: Option<&DenseLocal>) -> Result<DenseLocal> {
        let linear = self.problem.linearise(x)?;
        if linear.r_factor.iter().any(|value| !value.is_finite()) {
            return Err(Error::bad_input(
                "the residuals or their derivatives are not finite; check the input for NaN",
            ));
        }
        // Marquardt's scaling, never decreasing: a parameter whose column vanishes would take unbounded steps.
        let before = previous.map_or_else(|| DVector::zeros(x.len()), |local| local.scale.clone());
        let scale = before.zip_map(&column_norms(&linear.r_factor), f64::max);
        let scaled = Scaled::new(&linear.r_factor, &scale.map(positive_or_one), &linear.rhs);
        let size = scaled.d.component_mul(x).norm();
        Ok(DenseLocal {
            linear,
            scale,
            scaled,
            size,
            rank_tolerance: self.rank_tolerance,
        })
    }

    fn cost(&self, x: &DVector<f64>) -> Result<f64> {
        self.problem.cost(x)
    }

    fn moved(&self, x: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        x + step
    }
}

impl Local for DenseLocal {
    fn cost(&self) -> f64 {
        self.linear.cost
    }

    fn n_residuals(&self) -> usize {
        self.linear.n_residuals
    }

    fn is_finite(&self) -> bool {
        self.linear.rhs.iter().all(|value| value.is_finite())
    }

    fn gradient_cosine(&self) -> f64 {
        cosine(&self.linear)
    }

    fn step(&self, lambda: f64) -> Result<DVector<f64>> {
        let unit = self.scaled.s[0] * self.scaled.s[0];
        Ok(self.scaled.step(lambda * unit, self.rank_tolerance))
    }

    fn predicted(&self, step: &DVector<f64>) -> f64 {
        let linear = &self.linear;
        0.5 * (linear.rhs.norm_squared() - (&linear.r_factor * step + &linear.rhs).norm_squared())
    }

    fn length(&self, step: &DVector<f64>) -> f64 {
        if self.size > 0.0 {
            self.scaled.d.component_mul(step).norm() / self.size
        } else {
            f64::INFINITY
        }
    }
}

/// The adapter from closures that return rows.
struct Rows<L, R> {
    linearise: L,
    residuals: R,
}

impl<L, R> Problem for Rows<L, R>
where
    L: Fn(&DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>)>,
    R: Fn(&DVector<f64>) -> Result<DVector<f64>>,
{
    fn linearise(&self, x: &DVector<f64>) -> Result<Linear> {
        let (residuals, jacobian) = (self.linearise)(x)?;
        if jacobian.nrows() != residuals.len() || jacobian.ncols() != x.len() {
            return Err(Error::bad_input(format!(
                "a Jacobian of shape {:?} does not fit {} residuals and {} parameters",
                jacobian.shape(),
                residuals.len(),
                x.len()
            )));
        }
        let chi2 = residuals.norm_squared();
        Ok(Linear::from_rows(residuals, jacobian, 0.5 * chi2, chi2))
    }

    fn cost(&self, x: &DVector<f64>) -> Result<f64> {
        Ok(0.5 * (self.residuals)(x)?.norm_squared())
    }
}
