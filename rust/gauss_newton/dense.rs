//! Problems over a plain vector, their Jacobian compressed to an R factor.

use nalgebra::{DMatrix, DVector};

use super::linear::{Certainty, Linear, Scaled, certainty, column_norms, cosine, positive_or_one};
use super::{Descent, Local, Options, Stop, descend};
use crate::error::{Error, Result};

/// The solver's result and its uncertainty.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The parameters `(p)`.
    pub parameters: DVector<f64>,
    /// Why it stopped.
    pub stop: Stop,
    /// Linearisations made.
    pub iterations: usize,
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
    if start.is_empty() {
        return Err(Error::bad_input("a fit needs at least one parameter"));
    }
    let dense = Dense {
        linearise,
        residuals,
        rank_tolerance: options.rank_tolerance,
    };
    let ended = descend(&dense, start, options)?;
    Ok(Solution {
        parameters: ended.point,
        stop: ended.stop,
        iterations: ended.iterations,
        certainty: certainty(&ended.local.linear.r_factor, options.rank_tolerance),
    })
}

/// A problem over a plain vector, its Jacobian compressed to an R factor.
struct Dense<L, R> {
    linearise: L,
    residuals: R,
    rank_tolerance: f64,
}

struct DenseLocal {
    linear: Linear,
    scale: DVector<f64>,
    scaled: Scaled,
    size: f64,
    rank_tolerance: f64,
}

impl<L, R> Descent for Dense<L, R>
where
    L: Fn(&DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>)>,
    R: Fn(&DVector<f64>) -> Result<DVector<f64>>,
{
    type Point = DVector<f64>;
    type Local = DenseLocal;

    fn linearise(&self, x: &DVector<f64>, previous: Option<&DenseLocal>) -> Result<DenseLocal> {
        let (residuals, jacobian) = (self.linearise)(x)?;
        if jacobian.nrows() != residuals.len() || jacobian.ncols() != x.len() {
            return Err(Error::bad_input(format!(
                "a Jacobian of shape {:?} does not fit {} residuals and {} parameters",
                jacobian.shape(),
                residuals.len(),
                x.len()
            )));
        }
        let linear = Linear::from_rows(residuals, jacobian);
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
        Ok(0.5 * (self.residuals)(x)?.norm_squared())
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
