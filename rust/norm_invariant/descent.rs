//! The norm fit by its normal equations: no allocation per reading, and only 9×9 matrices decomposed per step.
//!
//! Normal equations cost half of the digits in weakly determined directions. They are used where the poses leave no
//! such direction ([`SMALLEST_PIVOT`]); elsewhere rows are kept and compressed orthogonally.

use std::cell::RefCell;

use nalgebra::{Cholesky, Const, DMatrix, DVector, SMatrix, SVector};

use super::parameters::unpack_standardised;
use super::sums::{self, At, WithNoise};
use super::{N_PARAMETERS, problem};
use crate::error::{Error, Result};
use crate::gauss_newton::{Certainty, Descent, Linear, Local, Problem, positive_or_one};

type Square = SMatrix<f64, N_PARAMETERS, N_PARAMETERS>;
type Column = SVector<f64, N_PARAMETERS>;

/// Smallest pivot of the normal equations with unit diagonal at which they are used: a column of which less than 1/300
/// is independent of the others costs five digits, and the step keeps ten.
const SMALLEST_PIVOT: f64 = 1e-5;

/// Readings weighted by their noise; the cost is infinite where `S` collapses.
pub(super) struct Direct<'a> {
    pub with_noise: WithNoise<'a>,
    pub at: At,
    /// `|det S|` of the start, in standardised readings.
    pub volume: f64,
    /// Point of the last cost, and its sums: the next linearisation is nearly always there.
    pub tried: RefCell<Option<(Column, sums::Normal)>>,
}

impl Direct<'_> {
    fn at(&self, x: &[f64]) -> At {
        At {
            model: unpack_standardised(x, self.at.settings.frame),
            ..self.at
        }
    }

    fn normal(&self, x: &[f64]) -> Result<sums::Normal> {
        sums::normal(&self.with_noise, &self.at(x))
            .ok_or_else(|| Error::bad_input("there are no static poses to fit"))
    }

    fn is_collapsed(&self, at: &At) -> bool {
        at.model.s.determinant().abs() < problem::SMALLEST_VOLUME * self.volume
    }

    fn cost_at(&self, x: &[f64]) -> f64 {
        let at = self.at(x);
        if self.is_collapsed(&at) {
            return f64::INFINITY;
        }
        sums::cost(&self.with_noise, &at)
    }

    /// The normal equations at a point.
    ///
    /// # Errors
    /// When they lose too many digits.
    pub(super) fn equations(&self, x: &Column, previous: Option<&Equations>) -> Result<Equations> {
        let normal = match self.tried.take() {
            Some((point, normal)) if point == *x => normal,
            _ => self.normal(x.as_slice())?,
        };
        let norms = Column::from_fn(|j, _| positive_or_one(normal.gram[(j, j)].sqrt()));
        // Marquardt's scaling, never decreasing: a parameter whose column vanishes would take unbounded steps.
        let scale = previous.map_or(norms, |local| local.scale.zip_map(&norms, f64::max));
        let scaled = Square::from_fn(|i, j| normal.gram[(i, j)] / (scale[i] * scale[j]));
        let factor = scaled
            .cholesky()
            .filter(|factor| {
                (0..N_PARAMETERS).all(|k| {
                    let pivot = factor.l_dirty()[(k, k)].powi(2);
                    pivot >= SMALLEST_PIVOT * scaled[(k, k)]
                })
            })
            .ok_or_else(|| Error::not_determined("the normal equations are too weak"))?;
        Ok(Equations {
            size: scale.component_mul(x).norm(),
            normal,
            n: self.with_noise.values.len(),
            norms,
            scale,
            scaled,
            factor,
        })
    }
}

/// The linear problem at one point, with its Cholesky factor of unit diagonal.
pub(super) struct Equations {
    normal: sums::Normal,
    n: usize,
    /// Norms of the columns, and the largest met so far.
    norms: Column,
    scale: Column,
    scaled: Square,
    factor: Cholesky<f64, Const<N_PARAMETERS>>,
    size: f64,
}

impl Equations {
    /// Covariance, rank and directions of the parameters.
    pub(super) fn certainty(&self) -> Certainty {
        let own =
            Square::from_fn(|i, j| self.normal.gram[(i, j)] / (self.norms[i] * self.norms[j]));
        let eigen = own.symmetric_eigen();
        let mut order: [usize; N_PARAMETERS] = std::array::from_fn(|k| k);
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let mut covariance = Square::zeros();
        for k in 0..N_PARAMETERS {
            let direction = eigen.eigenvectors.column(k).component_div(&self.norms);
            covariance += direction * direction.transpose() / eigen.eigenvalues[k];
        }
        Certainty {
            covariance: DMatrix::from_column_slice(
                N_PARAMETERS,
                N_PARAMETERS,
                covariance.as_slice(),
            ),
            rank: N_PARAMETERS,
            singular_values: DVector::from_fn(N_PARAMETERS, |k, _| {
                eigen.eigenvalues[order[k]].max(0.0).sqrt()
            }),
            directions: DMatrix::from_fn(N_PARAMETERS, N_PARAMETERS, |i, k| {
                eigen.eigenvectors[(i, order[k])]
            }),
        }
    }
}

impl Descent for Direct<'_> {
    type Point = Column;
    type Local = Equations;

    fn linearise(&self, x: &Column, previous: Option<&Equations>) -> Result<Equations> {
        self.equations(x, previous)
    }

    fn cost(&self, x: &Column) -> Result<f64> {
        if self.is_collapsed(&self.at(x.as_slice())) {
            return Ok(f64::INFINITY);
        }
        let normal = self.normal(x.as_slice())?;
        let cost = normal.cost;
        self.tried.replace(Some((*x, normal)));
        Ok(cost)
    }

    fn moved(&self, x: &Column, step: &DVector<f64>) -> Column {
        Column::from_fn(|k, _| x[k] + step[k])
    }
}
impl Local for Equations {
    fn cost(&self) -> f64 {
        self.normal.cost
    }

    fn n_residuals(&self) -> usize {
        self.n
    }

    fn is_finite(&self) -> bool {
        self.normal.slope.iter().all(|value| value.is_finite())
    }

    fn gradient_cosine(&self) -> f64 {
        let size = (2.0 * self.normal.cost).sqrt();
        self.normal
            .slope
            .iter()
            .zip(self.norms.iter())
            .map(|(g, n)| g.abs() / n / size)
            .fold(0.0, f64::max)
    }

    fn step(&self, lambda: f64) -> Result<DVector<f64>> {
        let slope = self.normal.slope.component_div(&self.scale);
        let scaled = if lambda == 0.0 {
            self.factor.solve(&slope)
        } else {
            let largest = self.scaled.symmetric_eigenvalues().max();
            (self.scaled + Square::identity() * (lambda * largest))
                .cholesky()
                .ok_or_else(|| Error::not_determined("the normal equations are too weak"))?
                .solve(&slope)
        };
        Ok(DVector::from_fn(N_PARAMETERS, |k, _| {
            -scaled[k] / self.scale[k]
        }))
    }

    fn predicted(&self, step: &DVector<f64>) -> f64 {
        let step = Column::from_fn(|k, _| step[k]);
        -(self.normal.slope.dot(&step) + 0.5 * step.dot(&(self.normal.gram * step)))
    }

    fn length(&self, step: &DVector<f64>) -> f64 {
        if self.size > 0.0 {
            let scaled: f64 = (0..N_PARAMETERS)
                .map(|k| (self.scale[k] * step[k]).powi(2))
                .sum();
            scaled.sqrt() / self.size
        } else {
            f64::INFINITY
        }
    }
}

/// The same sums for the general solver, which also solves weak normal equations.
impl Problem for Direct<'_> {
    fn linearise(&self, x: &DVector<f64>) -> Result<Linear> {
        let normal = self.normal(x.as_slice())?;
        Ok(Linear::from_normal_equations(
            &DMatrix::from_column_slice(N_PARAMETERS, N_PARAMETERS, normal.gram.as_slice()),
            &DVector::from_column_slice(normal.slope.as_slice()),
            normal.cost,
            normal.chi2,
            self.with_noise.values.len(),
        ))
    }

    fn cost(&self, x: &DVector<f64>) -> Result<f64> {
        Ok(self.cost_at(x.as_slice()))
    }
}
