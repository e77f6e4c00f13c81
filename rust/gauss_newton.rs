//! The only solver: weighted nonlinear least squares by Gauss-Newton with Levenberg-Marquardt damping.
//!
//! It knows no sensor. Residuals arrive *whitened* (divided by their standard error), so that the inverse of `JᵀJ` at
//! the solution is the covariance of the parameters. It minimises
//!
//! ```text
//! F(x) = ½ Σ_k ρ(|r_k|²)                                                             (GN1)
//! ```
//!
//! over blocks `r_k` of residuals (single ones by default), ρ being the [`Loss`]. Each step solves the reweighted linear
//! problem in scaled parameters `D x`, `D = diag|J_j|`:
//!
//! ```text
//! δ(λ) = -D⁻¹ V diag(s/(s² + λ)) Uᵀ q,      U diag(s) Vᵀ = R D⁻¹,   RᵀR = JᵀWJ,  Rᵀq = JᵀWr   (GN2)
//! ```
//!
//! with λ = 0 (a pure Gauss-Newton step) whenever that lowers the cost. The two ways to converge are inequalities,
//! evaluated on magnitudes, whatever the sign of the last change of cost:
//!
//! ```text
//! |D δ(0)| ≤ step_tolerance · |D x|                     the undamped step no longer moves the parameters   (GN3)
//! max_j |J_jᵀWr| / (|J_j| |r|) ≤ gradient_tolerance     the residual is orthogonal to every column         (GN4)
//! ```

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::interrupt;

/// What a residual costs. `scale` is in standard errors of the (whitened) residual; 2ρ is χ² for small residuals.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Loss {
    /// ρ(s) = s: least squares.
    #[default]
    Linear,
    /// ρ(s) = s up to `scale²`, then linear in the residual. 1.345 keeps 95 % efficiency on Gaussian noise.
    Huber {
        /// Residual, in standard errors, at which the loss turns linear.
        scale: f64,
    },
    /// ρ(s) = 2 c² (√(1 + s/c²) - 1): a smooth Huber.
    SoftL1 {
        /// Residual, in standard errors, at which the loss bends.
        scale: f64,
    },
    /// ρ(s) = c² ln(1 + s/c²): gross outliers lose all influence. 2.385 keeps 95 % efficiency on Gaussian noise.
    Cauchy {
        /// Residual, in standard errors, at which the influence is largest.
        scale: f64,
    },
}

impl Loss {
    /// `(ρ, ρ', ρ'')` at a squared residual.
    #[must_use]
    pub fn rho(self, squared: f64) -> (f64, f64, f64) {
        match self {
            Self::Linear => (squared, 1.0, 0.0),
            Self::Huber { scale } => {
                if squared <= scale * scale {
                    (squared, 1.0, 0.0)
                } else {
                    let r = squared.sqrt();
                    let slope = scale / r;
                    (
                        2.0 * scale * r - scale * scale,
                        slope,
                        -0.5 * slope / squared,
                    )
                }
            }
            Self::SoftL1 { scale } => {
                let c2 = scale * scale;
                let root = (1.0 + squared / c2).sqrt();
                // 2c²(√(1+z) - 1) written without cancellation at small z.
                (
                    2.0 * squared / (1.0 + root),
                    1.0 / root,
                    -0.5 / (c2 * root * root * root),
                )
            }
            Self::Cauchy { scale } => {
                let c2 = scale * scale;
                let z = squared / c2;
                let slope = 1.0 / (1.0 + z);
                (c2 * z.ln_1p(), slope, -slope * slope / c2)
            }
        }
    }

    /// Weight ρ' of a squared residual in the reweighted linear problem.
    #[must_use]
    pub fn weight(self, squared: f64) -> f64 {
        self.rho(squared).1
    }

    /// Factor that turns `(JᵀWJ)⁻¹` into the covariance of the estimate for Gaussian noise.
    ///
    /// For blocks of `k` residuals, `E[w] E[ψ²] / E[ψ']²` with ψ = ρ'(|r|²) r averaged over the `χ_k` distribution
    /// (Huber 1981, eq. 6.4.2); one for least squares.
    #[must_use]
    pub fn covariance_factor(self, block: usize) -> f64 {
        if self == Self::Linear {
            return 1.0;
        }
        let (weight, psi2, slope) = self.expectations(block);
        weight * psi2 / slope.powi(2)
    }

    /// `E[ψ²]` per residual for Gaussian noise: Σψ² divided by it estimates χ² without the weight of outliers.
    #[must_use]
    pub fn expected_influence(self, block: usize) -> f64 {
        self.expectations(block).1
    }

    /// `(E[w], E[ψ²], E[ψ'])` over blocks of unit Gaussian residuals.
    fn expectations(self, block: usize) -> (f64, f64, f64) {
        let k = block as f64;
        let (mut mass, mut weight, mut psi2, mut slope) = (0.0, 0.0, 0.0, 0.0);
        // Simpson's rule over the radius: the integrands are smooth but for one kink, 4000 panels leave 1e-7.
        let (panels, end) = (4000, 10.0 + k.sqrt());
        for i in 0..=panels {
            let r = end * f64::from(i) / f64::from(panels);
            let simpson = match i {
                0 => 1.0,
                i if i == panels => 1.0,
                i if i % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let density =
                simpson * if block == 1 { 1.0 } else { r.powf(k - 1.0) } * (-0.5 * r * r).exp();
            let (_, first, second) = self.rho(r * r);
            mass += density;
            weight += density * first;
            psi2 += density * first * first * r * r / k;
            slope += density * (first + 2.0 * second * r * r / k);
        }
        (weight / mass, psi2 / mass, slope / mass)
    }
}

/// When to stop, and how residuals are charged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// GN3.
    pub step_tolerance: f64,
    /// GN4.
    pub gradient_tolerance: f64,
    /// Linearisations allowed.
    pub max_iterations: usize,
    /// The loss of one block.
    pub loss: Loss,
    /// Residuals per block: 1, or 3 when a residual is a vector that is right or wrong as a whole.
    pub block: usize,
    /// A singular value of the column-scaled Jacobian below this fraction of the largest counts as zero.
    pub rank_tolerance: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            step_tolerance: 1e-10,
            gradient_tolerance: 1e-12,
            max_iterations: 100,
            loss: Loss::Linear,
            block: 1,
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
    ZeroResidual,
    /// No step along the descent direction lowers the cost: it is flat to rounding, or the model is not smooth there.
    NoDescent,
    /// `max_iterations` linearisations were made.
    TooManyIterations,
}

impl Stop {
    /// The solution satisfies one of the convergence inequalities.
    #[must_use]
    pub fn is_converged(self) -> bool {
        matches!(
            self,
            Self::SmallStep | Self::SmallGradient | Self::ZeroResidual
        )
    }

    /// In words.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            Self::SmallStep => "converged: the Gauss-Newton step no longer moves the parameters",
            Self::SmallGradient => "converged: the residual is orthogonal to every parameter",
            Self::ZeroResidual => "converged: the residual vanishes to rounding",
            Self::NoDescent => "stopped: no step lowers the cost any further",
            Self::TooManyIterations => "stopped: iteration limit reached before convergence",
        }
    }
}

/// The least-squares problem at one point, compressed: near it `F = const + ½|R δ + q|²`.
#[derive(Debug, Clone)]
pub struct Linear {
    /// `(k, p)` with `RᵀR = JᵀWJ`.
    pub r_factor: DMatrix<f64>,
    /// `(k)` with `Rᵀq = JᵀWr`.
    pub rhs: DVector<f64>,
    /// F of GN1.
    pub cost: f64,
    /// Σ r², every weight one.
    pub chi2: f64,
    /// Residuals behind it.
    pub n_residuals: usize,
}

impl Linear {
    /// From weighted residuals and Jacobian: an orthogonal compression when there are more rows than columns.
    #[must_use]
    pub fn from_rows(
        residuals: DVector<f64>,
        jacobian: DMatrix<f64>,
        cost: f64,
        chi2: f64,
    ) -> Self {
        let (m, p) = jacobian.shape();
        if m <= p + 1 {
            return Self {
                r_factor: jacobian,
                rhs: residuals,
                cost,
                chi2,
                n_residuals: m,
            };
        }
        let qr = jacobian.qr();
        let mut rotated = residuals;
        qr.q_tr_mul(&mut rotated);
        Self {
            r_factor: qr.r(),
            rhs: rotated.rows(0, p).into_owned(),
            cost,
            chi2,
            n_residuals: m,
        }
    }

    /// From the normal equations, for problems with too many rows to keep: costs half the digits of the rank.
    #[must_use]
    pub fn from_normal_equations(
        gram: &DMatrix<f64>,
        gradient: &DVector<f64>,
        cost: f64,
        chi2: f64,
        n_residuals: usize,
    ) -> Self {
        let p = gram.nrows();
        // Scaled to a unit diagonal first: raw counts would otherwise spread the eigenvalues over 12 decades.
        let scale = DVector::from_fn(p, |j, _| positive_or_one(gram[(j, j)].max(0.0).sqrt()));
        let scaled = DMatrix::from_fn(p, p, |i, j| gram[(i, j)] / (scale[i] * scale[j]));
        let eigen = scaled.symmetric_eigen();
        let floor = f64::EPSILON * p as f64 * eigen.eigenvalues.amax();
        let mut r_factor = eigen.eigenvectors.transpose();
        let mut rhs = &r_factor * gradient.component_div(&scale);
        for k in 0..p {
            let value = eigen.eigenvalues[k];
            let root = if value > floor { value.sqrt() } else { 0.0 };
            rhs[k] = if root > 0.0 { rhs[k] / root } else { 0.0 };
            for j in 0..p {
                r_factor[(k, j)] *= root * scale[j];
            }
        }
        Self {
            r_factor,
            rhs,
            cost,
            chi2,
            n_residuals,
        }
    }
}

/// A problem the solver can work on. Weighted by the loss already.
pub trait Problem {
    /// The compressed problem at `x`.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn linearise(&self, x: &DVector<f64>) -> Result<Linear>;

    /// F of GN1 at `x`; infinite where the model does not hold, which the solver treats as a wall.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn cost(&self, x: &DVector<f64>) -> Result<f64>;
}

/// Where the solver ended and how sure that is.
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
    /// Σ r² of the whitened residuals, without the loss.
    pub chi2: f64,
    /// Left side of GN4.
    pub gradient: f64,
    /// Left side of GN3 over `|D x|`.
    pub step: f64,
    /// `RᵀR = JᵀWJ` at the solution.
    pub r_factor: DMatrix<f64>,
    /// Number of residuals.
    pub n_residuals: usize,
    /// Certainty of the parameters.
    pub certainty: Certainty,
}

/// What the Jacobian at the solution says about the parameters.
#[derive(Debug, Clone)]
pub struct Certainty {
    /// `(p, p)` for unit-variance residuals; over the determined directions only when `rank < p`.
    pub covariance: DMatrix<f64>,
    /// Directions determined.
    pub rank: usize,
    /// Of the Jacobian with unit columns, largest first, `p` of them.
    pub singular_values: DVector<f64>,
    /// Column `k` is the unit direction, in scaled parameters, of singular value `k`.
    pub directions: DMatrix<f64>,
}

impl Certainty {
    /// Largest over smallest singular value; infinite when a direction is not determined.
    #[must_use]
    pub fn condition(&self) -> f64 {
        let n = self.singular_values.len();
        if self.rank < n {
            f64::INFINITY
        } else {
            self.singular_values[0] / self.singular_values[n - 1]
        }
    }
}

/// SVD of a Jacobian (or its R factor) scaled to unit columns: covariance, rank, weak directions.
#[must_use]
pub fn certainty(
    r_factor: &DMatrix<f64>,
    covariance_factor: f64,
    rank_tolerance: f64,
) -> Certainty {
    let p = r_factor.ncols();
    let scaled = Scaled::new(r_factor, &column_norms(r_factor), &DVector::zeros(0));
    let rank = scaled.rank(rank_tolerance);
    let mut covariance = DMatrix::zeros(p, p);
    for k in 0..rank {
        let direction = scaled.v.column(k).component_div(&scaled.d) / scaled.s[k];
        covariance += &direction * direction.transpose();
    }
    Certainty {
        covariance: covariance * covariance_factor,
        rank,
        singular_values: scaled.s,
        directions: scaled.v,
    }
}

/// Minimises a problem given by rows: `linearise` returns whitened residuals `(m)` and their Jacobian `(m, p)`,
/// `residuals` the same residuals alone (cheaper; used for trial steps).
///
/// # Errors
/// When there are no parameters, blocks do not divide the residuals, or the start gives a cost that is not finite.
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
            options: *options,
        },
        start,
        options,
    )
}

/// The linear problem at one point, whatever form its normal equations have.
pub trait Local {
    /// F of GN1 here.
    fn cost(&self) -> f64;
    /// Residuals behind it.
    fn n_residuals(&self) -> usize;
    /// Whether residuals and derivatives are all numbers.
    fn is_finite(&self) -> bool;
    /// Left side of GN4.
    fn gradient_cosine(&self) -> f64;
    /// GN2; λ counts in units of the largest eigenvalue of the scaled normal equations.
    ///
    /// # Errors
    /// When the damped equations cannot be solved.
    fn step(&self, lambda: f64) -> Result<DVector<f64>>;
    /// By how much the step lowers the linear problem's cost.
    fn predicted(&self, step: &DVector<f64>) -> f64;
    /// What the step tolerance limits: for dense problems the left side of GN3 over `|D x|`.
    fn length(&self, step: &DVector<f64>) -> f64;
}

/// A problem whose points need not be vectors and whose normal equations may have structure.
pub trait Descent {
    /// Where the problem is evaluated.
    type Point;
    /// Its linearisation.
    type Local: Local;

    /// The linear problem at a point; `previous` is the one before, for scales that must not shrink.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn linearise(&self, point: &Self::Point, previous: Option<&Self::Local>)
    -> Result<Self::Local>;

    /// F of GN1; infinite where the model does not hold, which the solver treats as a wall.
    ///
    /// # Errors
    /// When the model cannot be evaluated there at all.
    fn cost(&self, point: &Self::Point) -> Result<f64>;

    /// The point a step away.
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
    /// Left side of GN4.
    pub gradient: f64,
    /// Length of the undamped step, as [`Local::length`] counts it.
    pub step: f64,
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
        certainty: certainty(
            &linear.r_factor,
            options.loss.covariance_factor(options.block),
            options.rank_tolerance,
        ),
        n_residuals: linear.n_residuals,
        r_factor: linear.r_factor,
    })
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
                "the residuals or their derivatives are not finite at the start of the fit; check the input for NaN",
            ));
        }
        let gradient = local.gradient_cosine();
        let step = local.length(&local.step(0.0)?);
        // Whitened residuals are of order one; a root mean square of 1e-13 is rounding whatever the unit.
        let mut stop = if local.cost() <= 1e-26 * local.n_residuals() as f64 {
            Some(Stop::ZeroResidual)
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
            match lower(problem, &point, &local, &mut damping)? {
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
                gradient,
                step,
            });
        }
        previous = Some(local);
    }
}

/// A step that lowers the cost, undamped when possible; `None` when even a tiny one does not.
fn lower<D: Descent>(
    problem: &D,
    point: &D::Point,
    local: &D::Local,
    damping: &mut f64,
) -> Result<Option<D::Point>> {
    for _ in 0..60 {
        let delta = local.step(*damping)?;
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
        // Flat to rounding: the change is below what the sum of squares can resolve, so take the Newton step as it is.
        if *damping == 0.0
            && predicted <= 1e-13 * local.cost()
            && (cost - local.cost()).abs() <= 1e-12 * local.cost()
        {
            return Ok(Some(moved));
        }
        *damping = (*damping * 8.0).max(1e-4);
    }
    Ok(None)
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
                "the residuals or their derivatives are not finite at the start of the fit; check the input for NaN",
            ));
        }
        // Marquardt's scaling, never shrinking: a column that fades must not let its parameter run away.
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

/// The compressed Jacobian in scaled parameters, decomposed once per linearisation.
struct Scaled {
    d: DVector<f64>,
    s: DVector<f64>,
    v: DMatrix<f64>,
    uq: DVector<f64>,
}

impl Scaled {
    fn new(r_factor: &DMatrix<f64>, d: &DVector<f64>, rhs: &DVector<f64>) -> Self {
        let p = r_factor.ncols();
        // Padded to at least p rows, so that the SVD has all p right vectors, the undetermined ones included.
        let rows = r_factor.nrows().max(p);
        let mut matrix = DMatrix::zeros(rows, p);
        matrix.rows_mut(0, r_factor.nrows()).copy_from(r_factor);
        for j in 0..p {
            matrix.column_mut(j).unscale_mut(d[j]);
        }
        let mut padded = DVector::zeros(rows);
        padded.rows_mut(0, rhs.len()).copy_from(rhs);
        let svd = matrix.svd(true, true);
        let (u, v_t) = (
            svd.u.unwrap_or_else(|| DMatrix::zeros(rows, p)),
            svd.v_t.unwrap_or_else(|| DMatrix::zeros(p, p)),
        );
        Self {
            d: d.clone(),
            s: svd.singular_values,
            v: v_t.transpose(),
            uq: u.transpose() * padded,
        }
    }

    fn rank(&self, tolerance: f64) -> usize {
        let floor = tolerance * self.s[0];
        self.s.iter().filter(|&&s| s > floor && s > 0.0).count()
    }

    /// GN2; with λ = 0 over the determined directions only.
    fn step(&self, lambda: f64, rank_tolerance: f64) -> DVector<f64> {
        let rank = self.rank(rank_tolerance);
        let mut scaled = DVector::zeros(self.d.len());
        for k in 0..rank {
            let s = self.s[k];
            scaled -= self.v.column(k) * (self.uq[k] * s / (s * s + lambda));
        }
        scaled.component_div(&self.d)
    }
}

/// Left side of GN4.
fn cosine(linear: &Linear) -> f64 {
    let gradient = linear.r_factor.transpose() * &linear.rhs;
    let norms = column_norms(&linear.r_factor);
    let size = (2.0 * linear.cost).sqrt();
    gradient
        .iter()
        .zip(norms.iter())
        .map(|(g, n)| g.abs() / n / size)
        .fold(0.0, f64::max)
}

fn column_norms(matrix: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_fn(matrix.ncols(), |j, _| {
        positive_or_one(matrix.column(j).norm())
    })
}

fn positive_or_one(value: f64) -> f64 {
    if value > 0.0 { value } else { 1.0 }
}

/// The adapter from closures that return rows.
struct Rows<L, R> {
    linearise: L,
    residuals: R,
    options: Options,
}

impl<L, R> Rows<L, R> {
    /// Cost of the residuals, and √ρ' of each block.
    fn charge(&self, residuals: &DVector<f64>) -> Result<(f64, Vec<f64>)> {
        let block = self.options.block;
        if block == 0 || !residuals.len().is_multiple_of(block) {
            return Err(Error::bad_input(format!(
                "{} residuals cannot be split into blocks of {block}",
                residuals.len()
            )));
        }
        let mut cost = 0.0;
        let roots = residuals
            .as_slice()
            .chunks_exact(block)
            .map(|chunk| {
                let (value, slope, _) = self.options.loss.rho(chunk.iter().map(|r| r * r).sum());
                cost += 0.5 * value;
                slope.sqrt()
            })
            .collect();
        Ok((cost, roots))
    }
}

impl<L, R> Problem for Rows<L, R>
where
    L: Fn(&DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>)>,
    R: Fn(&DVector<f64>) -> Result<DVector<f64>>,
{
    fn linearise(&self, x: &DVector<f64>) -> Result<Linear> {
        let (mut residuals, mut jacobian) = (self.linearise)(x)?;
        if jacobian.nrows() != residuals.len() || jacobian.ncols() != x.len() {
            return Err(Error::bad_input(format!(
                "a Jacobian of shape {:?} does not fit {} residuals and {} parameters",
                jacobian.shape(),
                residuals.len(),
                x.len()
            )));
        }
        let chi2 = residuals.norm_squared();
        let (cost, roots) = self.charge(&residuals)?;
        if self.options.loss != Loss::Linear {
            for (i, residual) in residuals.iter_mut().enumerate() {
                let root = roots[i / self.options.block];
                *residual *= root;
                jacobian.row_mut(i).scale_mut(root);
            }
        }
        Ok(Linear::from_rows(residuals, jacobian, cost, chi2))
    }

    fn cost(&self, x: &DVector<f64>) -> Result<f64> {
        let residuals = (self.residuals)(x)?;
        Ok(self.charge(&residuals)?.0)
    }
}
