//! The only solver: weighted nonlinear least squares by Gauss-Newton with Levenberg-Marquardt damping.
//!
//! It is independent of sensors. Residuals are passed *whitened* (divided by their standard error), so that the inverse
//! of `JᵀJ` at the solution is the covariance of the parameters. It minimises
//!
//! ```text
//! F(x) = ½ Σ_k r_k²                                                                  (GN1)
//! ```
//!
//! Each step solves the linear problem in scaled parameters `D x`, `D = diag|J_j|`:
//!
//! ```text
//! δ(λ) = -D⁻¹ V diag(s/(s² + λ)) Uᵀ q,      U diag(s) Vᵀ = R D⁻¹,   RᵀR = JᵀJ,  Rᵀq = Jᵀr     (GN2)
//! ```
//!
//! with λ = 0 (a pure Gauss-Newton step) whenever that lowers the cost. It converges when one of two inequalities is
//! met, both on magnitudes and independent of the sign of the last change of cost:
//!
//! ```text
//! |D δ(0)| ≤ step_tolerance · |D x|                     the undamped step no longer moves the parameters   (GN3)
//! max_j |J_jᵀr|  / (|J_j| |r|) ≤ gradient_tolerance     the residual is orthogonal to every column         (GN4)
//! ```

mod dense;
mod linear;

use nalgebra::DVector;

use crate::error::{Error, Result};
use crate::interrupt;
pub use dense::{Solution, minimise};
pub use linear::{Certainty, Linear, certainty};

/// Stopping criteria.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// GN3.
    pub step_tolerance: f64,
    /// GN4.
    pub gradient_tolerance: f64,
    /// Largest number of linearisations.
    pub max_iterations: usize,
    /// A singular value of the column-scaled Jacobian below this fraction of the largest counts as zero.
    pub rank_tolerance: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            step_tolerance: 1e-10,
            gradient_tolerance: 1e-12,
            max_iterations: 100,
            rank_tolerance: 1e-9,
        }
    }
}

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// GN3 holds.
    SmallStep,
    /// GN4 holds.
    SmallGradient,
    /// The residuals vanish to rounding.
    NoResidual,
    /// No step along the descent direction lowers the cost: it is flat to rounding, or the model is not smooth there.
    NoDescent,
    /// `max_iterations` linearisations were made.
    TooManyIterations,
}

impl Stop {
    /// Whether the solution satisfies one of the convergence inequalities.
    #[must_use]
    pub fn is_converged(self) -> bool {
        matches!(
            self,
            Self::SmallStep | Self::SmallGradient | Self::NoResidual
        )
    }

    /// Its identifier; reports choose the wording.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SmallStep => "small-step",
            Self::SmallGradient => "small-gradient",
            Self::NoResidual => "zero-residual",
            Self::NoDescent => "no-descent",
            Self::TooManyIterations => "too-many-iterations",
        }
    }
}

/// The linear problem at one point, for any form of its normal equations.
pub trait Local {
    /// F of GN1 here.
    fn cost(&self) -> f64;
    /// Number of residuals.
    fn n_residuals(&self) -> usize;
    /// Whether residuals and derivatives are all finite.
    fn is_finite(&self) -> bool;
    /// Left side of GN4.
    fn gradient_cosine(&self) -> f64;
    /// GN2; λ counts in units of the largest eigenvalue of the scaled normal equations.
    ///
    /// # Errors
    /// When the damped equations cannot be solved.
    fn step(&self, lambda: f64) -> Result<DVector<f64>>;
    /// Decrease of the linear problem's cost by a step.
    fn predicted(&self, step: &DVector<f64>) -> f64;
    /// Length that the step tolerance limits: for dense problems the left side of GN3 over `|D x|`.
    fn length(&self, step: &DVector<f64>) -> f64;
}

/// A problem whose points need not be vectors and whose normal equations may have structure.
pub trait Descent {
    /// Point at which the problem is evaluated.
    type Point;
    /// Its linearisation.
    type Local: Local;

    /// The linear problem at a point; `previous` is the one before, for scales that must not shrink.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn linearise(&self, point: &Self::Point, previous: Option<&Self::Local>)
    -> Result<Self::Local>;

    /// F of GN1; infinite where the model is invalid: the solver then shortens the step.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn cost(&self, point: &Self::Point) -> Result<f64>;

    /// The point after a step.
    fn moved(&self, point: &Self::Point, step: &DVector<f64>) -> Self::Point;
}

/// Where a descent ended.
#[derive(Debug)]
pub struct Ended<P, L> {
    /// The point.
    pub point: P,
    /// Its linear problem.
    pub local: L,
    /// Why it stopped.
    pub stop: Stop,
    /// Linearisations made.
    pub iterations: usize,
    /// Length of the undamped step, as [`Local::length`] counts it.
    pub step: f64,
}

/// The descent itself: Gauss-Newton steps, damped where a full one does not lower the cost.
///
/// # Errors
/// When the start gives a cost that is not finite, or the model cannot be evaluated.
pub fn descend<D: Descent>(
    problem: &D,
    start: D::Point,
    options: &Options,
) -> Result<Ended<D::Point, D::Local>> {
    let mut point = start;
    let mut previous: Option<D::Local> = None;
    let mut damping = 0.0_f64;
    let mut iterations = 0;
    loop {
        if interrupt::is_requested() {
            return Err(Error::not_determined("the fit was interrupted"));
        }
        let local = problem.linearise(&point, previous.as_ref())?;
        iterations += 1;
        if !local.cost().is_finite() || !local.is_finite() {
            return Err(Error::bad_input(
                "the residuals or their derivatives are not finite; check the input for NaN",
            ));
        }
        let gradient = local.gradient_cosine();
        let undamped = local.step(0.0)?;
        let step = local.length(&undamped);
        // Whitened residuals are of order one; a root mean square of 1e-13 is rounding in any unit.
        let mut stop = if local.cost() <= 1e-26 * local.n_residuals() as f64 {
            Some(Stop::NoResidual)
        } else if step <= options.step_tolerance {
            Some(Stop::SmallStep)
        } else if gradient <= options.gradient_tolerance {
            Some(Stop::SmallGradient)
        } else if iterations > options.max_iterations {
            Some(Stop::TooManyIterations)
        } else {
            None
        };
        if stop.is_none() {
            match lower(problem, &point, &local, undamped, &mut damping)? {
                Some(next) => point = next,
                None => stop = Some(Stop::NoDescent),
            }
        }
        if let Some(stop) = stop {
            return Ok(Ended {
                point,
                local,
                stop,
                iterations,
                step,
            });
        }
        previous = Some(local);
    }
}

/// Share of the cost below which a change of it is rounding: a residual of the size of its standard error is the
/// difference of quantities that are 1e5 times as large, to sixteen digits. The Newton step is then taken as it is.
const FLAT: f64 = 1e-10;

/// A step that lowers the cost, undamped when possible; `None` when even a tiny one does not.
fn lower<D: Descent>(
    problem: &D,
    point: &D::Point,
    local: &D::Local,
    undamped: DVector<f64>,
    damping: &mut f64,
) -> Result<Option<D::Point>> {
    if local.predicted(&undamped) <= FLAT * local.cost() {
        let moved = problem.moved(point, &undamped);
        if (problem.cost(&moved)? - local.cost()).abs() <= FLAT * local.cost() {
            return Ok(Some(moved));
        }
    }
    let mut known = Some(undamped);
    for _ in 0..60 {
        let delta = match known.take() {
            Some(step) if *damping == 0.0 => step,
            _ => local.step(*damping)?,
        };
        let moved = problem.moved(point, &delta);
        let cost = problem.cost(&moved)?;
        let predicted = local.predicted(&delta);
        let gain = (local.cost() - cost) / predicted;
        if cost.is_finite() && predicted > 0.0 && gain > 1e-4 {
            if gain > 0.75 {
                *damping = if *damping > 1e-6 { *damping * 0.1 } else { 0.0 };
            } else if gain < 0.25 {
                *damping = (*damping * 4.0).max(1e-4);
            }
            return Ok(Some(moved));
        }
        *damping = (*damping * 8.0).max(1e-4);
    }
    Ok(None)
}
