//! Accelerometer triad from still poses alone: `|S a' + b| = |g|` in every orientation (model.md, section 3).
//!
//! Nine parameters, `S` lower triangular or symmetric. The residual `|S a' + b| - |g|` of a pose is divided by the noise
//! of its mean *projected on gravity*, `σ² = uᵀ S Σ Sᵀ u` with `u = f/|f|`. σ is frozen while the solver runs and renewed
//! between runs: left free it would reward a large `S`.

mod descent;
mod held_out;
mod lanes;
mod noise;
mod problem;
mod start;
mod sums;

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use descent::{Direct, Equations};
pub use held_out::{HeldOut, held_out};
pub use problem::residual_gradient;
use problem::{Frozen, PoseProblem};
use start::Starts;
use sums::At;

use crate::ellipsoid::{self, Standardisation};
use crate::error::{Error, Result};
use crate::gauss_newton::{self, Certainty, Loss, Options, Stop};

/// Free parameters: six of `S`, three of `b`.
pub const N_PARAMETERS: usize = 9;

/// The solver's.
type Parameters = SVector<f64, N_PARAMETERS>;

/// The instrument trihedron in which `S` is expressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// z1 along accelerometer axis 1, z2 in the plane of axes 1 and 2: `S` lower triangular.
    Lower,
    /// `S` symmetric.
    Symmetric,
}

impl Frame {
    /// `(row, column)` of the six free entries of `S`; a symmetric `S` has the mirrored one as well.
    const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];
}

/// What is squared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Objective {
    /// `|S a' + b| - |g|`.
    Norm,
    /// `(|S a' + b|² - |g|²) / 2|g|`, the manual's objective in m/s².
    SquaredNorm,
}

/// Direct model `f = S a' + b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// m/s² per raw unit.
    pub s: Matrix3<f64>,
    /// m/s².
    pub b: Vector3<f64>,
}

impl Model {
    /// Raw reading → specific force.
    #[must_use]
    pub fn correct(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        self.s * reading + self.b
    }
}

/// How to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// |g| in m/s².
    pub gravity: f64,
    /// Of the answer.
    pub frame: Frame,
    /// What is squared.
    pub objective: Objective,
    /// How large residuals are charged.
    pub loss: Loss,
}

/// A fitted triad.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The answer.
    pub model: Model,
    /// Of `S` row by row, then `b`; entries fixed by the frame have none. For the stated noise, not rescaled.
    pub covariance: SMatrix<f64, 12, 12>,
    /// `|S a' + b| - |g|` in m/s² (less the mean inflation that noise across gravity gives a norm).
    pub residuals: Vec<f64>,
    /// Predicted standard error of each residual, m/s².
    pub sigmas: Vec<f64>,
    /// Weight that the loss gave each residual; empty for least squares, where each has its full one.
    pub weights: Vec<f64>,
    /// Σ (residual/sigma)².
    pub chi2: f64,
    /// The same estimated without the weight of outliers, Σψ²/E[ψ²]; `chi2` for least squares.
    pub robust_chi2: f64,
    /// Rank, singular values of the Jacobian in the solver's parameters.
    pub certainty: Certainty,
    /// The poses leave parameters so free that each was held near its start, to [`ANCHOR`] of |g|.
    pub is_anchored: bool,
    /// Why the solver stopped.
    pub stop: Stop,
    /// Linearisations over all renewals of σ.
    pub iterations: usize,
}

/// Readings with the noise covariance of each: `noise` has one entry for all, or one per pose.
#[derive(Debug, Clone, Copy)]
pub struct Readings<'a> {
    /// Raw.
    pub values: &'a [Vector3<f64>],
    /// Raw unit squared.
    pub noise: &'a [Matrix3<f64>],
    /// The pose of each reading; empty where each is a pose of its own.
    pub pose: &'a [usize],
}

impl Readings<'_> {
    fn noise_of(&self, i: usize) -> &Matrix3<f64> {
        if self.noise.len() == 1 {
            return &self.noise[0];
        }
        &self.noise[self.pose.get(i).copied().unwrap_or(i)]
    }

    fn check(&self) -> Result<()> {
        if self.values.is_empty() {
            return Err(Error::bad_input("there are no still poses to fit"));
        }
        if !self.pose.is_empty() {
            let last = self.pose.iter().max().copied().unwrap_or(0);
            if self.pose.len() != self.values.len() || last >= self.noise.len() {
                return Err(Error::bad_input(format!(
                    "{} pose numbers up to {last} do not belong to {} readings of {} poses",
                    self.pose.len(),
                    self.values.len(),
                    self.noise.len()
                )));
            }
        } else if self.noise.len() != 1 && self.noise.len() != self.values.len() {
            return Err(Error::bad_input(format!(
                "{} noise covariances do not belong to {} readings",
                self.noise.len(),
                self.values.len()
            )));
        }
        if let Some(i) = self
            .values
            .iter()
            .position(|a| a.iter().any(|value| !value.is_finite()))
        {
            return Err(Error::bad_input(format!("reading {i} is not finite")));
        }
        for (i, noise) in self.noise.iter().enumerate() {
            // An axis without noise is legal (a stuck channel is the audit's business), a pose without any is not.
            if noise.iter().any(|value| !value.is_finite()) || noise.trace() <= 0.0 {
                return Err(Error::bad_input(format!(
                    "the standard error of reading {i} must be finite and positive"
                )));
            }
        }
        Ok(())
    }
}

/// Above this many readings rows are not kept: the normal equations are summed in one parallel pass.
const ROWS_KEPT: usize = 20_000;

/// Standard error, in |g|, above which a scale, an angle or a zero counts as left free by the poses: errors no longer
/// propagate linearly, and no triad is made that badly.
pub const UNKNOWN: f64 = 0.02;

/// How far, in |g|, parameters left free may be from the sphere's: scales within 10 %, axes within 6°.
pub const ANCHOR: f64 = 0.1;

/// Times that σ is renewed at most; it depends on the answer only through directions and settles in two.
const RENEWALS: usize = 8;

/// Fits from an ellipsoid start, or from `start`.
///
/// Poses that leave a parameter unknown to 2 % of |g| (six faces leave three altogether) would let it run away into any
/// accident of the readings: all are then held near a sphere through the readings, and `is_anchored` tells.
///
/// A given start that leads nowhere (no convergence, or a triad a hundred times smaller than the sphere through the
/// readings: the way to `S = 0`) is given up for the ellipsoid.
///
/// # Errors
/// When readings are malformed or all the same, or the fit collapses to `S = 0`.
pub fn fit(readings: Readings<'_>, settings: &Settings, start: Option<Model>) -> Result<Fit> {
    let Some(given) = start else {
        return fit_from(readings, settings, None);
    };
    match fit_from(readings, settings, Some(given)) {
        Ok(found)
            if found.stop.is_converged() && !is_shrunken(&found.model, readings, settings) =>
        {
            Ok(found)
        }
        // A malformed start is a mistake to be told of, not to be worked around.
        Err(error @ Error::BadInput(_)) => Err(error),
        first => fit_from(readings, settings, None).or(first),
    }
}

/// Whether a triad is far smaller than the sphere through the readings.
fn is_shrunken(model: &Model, readings: Readings<'_>, settings: &Settings) -> bool {
    let stride = readings.values.len().div_ceil(ROWS_KEPT);
    let few: Vec<Vector3<f64>> = readings.values.iter().step_by(stride).copied().collect();
    Starts::of(&few)
        .and_then(|starts| starts.sphere(settings))
        .is_ok_and(|sphere| model.s.determinant().abs() < 1e-2 * sphere.s.determinant().abs())
}

fn fit_from(readings: Readings<'_>, settings: &Settings, start: Option<Model>) -> Result<Fit> {
    readings.check()?;
    if !settings.gravity.is_finite() || settings.gravity <= 0.0 {
        return Err(Error::bad_input(format!(
            "gravity must be a positive number in m/s², got {}",
            settings.gravity
        )));
    }
    let few = start::even_share(readings, ROWS_KEPT);
    // Of very many readings, a share shows nearly the same answer: all are then passed over a few times only.
    let shown = few.fitted(settings);
    let starts = Starts::of(few.values())?;
    let standard = match few {
        start::Share::All(_) => starts.standard,
        start::Share::Some { .. } => Standardisation::of(readings.values)?,
    };
    let nominal = match start.or(shown) {
        Some(model) => in_frame(&model, settings.frame)?,
        None => starts.sphere(settings)?,
    };
    let mut frozen = Frozen::at(readings, settings, &nominal);
    // What a share of the readings determines, all of them do.
    let is_anchored =
        shown.is_none() && problem::is_weak(&frozen.charge(readings), settings, &nominal);
    let begin = if is_anchored || start.is_some() || shown.is_some() {
        nominal
    } else {
        starts.best(settings)?
    };
    if spread(&begin, &standard) < SMALLEST_SPREAD * settings.gravity {
        return Err(Error::not_determined(WORTHLESS));
    }
    let first = pack(&begin, &standard);
    let mut theta = first;
    let volume = (begin.s * standard.size).determinant().abs();
    let anchor = is_anchored.then(|| DVector::from_column_slice(first.as_slice()));
    let mut iterations = 0;
    let mut widening = 1.0;
    for renewal in 0.. {
        let model = unpack(&theta, settings.frame, &standard);
        if renewal > 0 || begin != nominal {
            frozen.renew(readings, settings, &model);
        }
        frozen.widening = widening;
        let problem = PoseProblem {
            readings,
            settings,
            standard,
            frozen: &frozen,
            volume,
            anchor: anchor.clone(),
        };
        let settled = settle(&problem, &theta)?;
        iterations += settled.iterations;
        let change = (settled.theta - theta).norm() / theta.norm();
        theta = settled.theta;
        if is_anchored {
            // Scatter beyond the noise must not buy itself an angle of ten degrees where nothing else contradicts it.
            let spare = readings.values.len().saturating_sub(N_PARAMETERS).max(1);
            let scatter =
                problem.chi2(&DVector::from_column_slice(theta.as_slice())) / spare as f64;
            widening *= scatter.max(widening.powi(-2)).sqrt();
        }
        // σ moves with the parameters at first order only through S: 1e-7 in S is 1e-7 in σ, far below its own error.
        if change < 1e-7 || renewal >= RENEWALS {
            let mut fit = finish(&problem, &settled, iterations)?;
            fit.sigmas = frozen.sigma;
            return Ok(fit);
        }
    }
    unreachable!("the loop returns at its last renewal")
}

/// Where the solver ended for one set of σ.
struct Settled {
    theta: Parameters,
    stop: Stop,
    iterations: usize,
    found: Found,
}

/// What the solution is known by.
enum Found {
    /// Normal equations.
    Direct(Box<Equations>),
    /// Rows, or normal equations too weak to be solved as they are.
    Dense(Certainty),
}

fn settle(problem: &PoseProblem<'_>, theta: &Parameters) -> Result<Settled> {
    let settings = problem.settings;
    let options = Options {
        loss: settings.loss,
        ..Options::default()
    };
    let direct = Direct {
        charged: problem.charged(),
        at: At {
            model: unpack_standardised(theta.as_slice(), settings.frame),
            standard: problem.standard,
            settings: *settings,
            widening: problem.frozen.widening,
        },
        volume: problem.volume,
    };
    let has_anchor = problem.anchor.is_some();
    if !has_anchor && let Ok(ended) = gauss_newton::descend(&direct, *theta, &options) {
        return Ok(Settled {
            theta: ended.point,
            stop: ended.stop,
            iterations: ended.iterations,
            found: Found::Direct(Box::new(ended.local)),
        });
    }
    let start = DVector::from_column_slice(theta.as_slice());
    let solution = if problem.readings.values.len() > ROWS_KEPT && !has_anchor {
        gauss_newton::minimise_problem(&direct, start, &options)?
    } else {
        gauss_newton::minimise(
            |x| Ok(problem.linearise(x)),
            |x| Ok(problem.residuals(x)),
            start,
            &options,
        )?
    };
    Ok(Settled {
        theta: Parameters::from_column_slice(solution.parameters.as_slice()),
        stop: solution.stop,
        iterations: solution.iterations,
        found: Found::Dense(solution.certainty),
    })
}

/// Poses whose specific forces differ by less than this fraction of |g|, half a degree, are one pose, or `S` is nothing.
const SMALLEST_SPREAD: f64 = 1e-2;

const WORTHLESS: &str = "the fit runs into the worthless minimum S = 0, |b| = |g|: the poses hardly differ, or are not \
                         still; hold the sensor still in clearly different orientations";

/// Root mean square size of `S (a' - mean)`, m/s².
fn spread(model: &Model, standard: &Standardisation) -> f64 {
    (model.s * standard.size).norm() / 3.0_f64.sqrt()
}

fn finish(problem: &PoseProblem<'_>, settled: &Settled, iterations: usize) -> Result<Fit> {
    let settings = problem.settings;
    let factor = settings.loss.covariance_factor(1);
    let held = match &settled.found {
        Found::Direct(equations) => equations.certainty(factor),
        Found::Dense(certainty) => certainty.clone(),
    };
    // Noise in a reading enters residual and derivative alike and draws S towards zero, by (σ/g)² of itself.
    let pull = problem.noise_in_gradient(settled.theta.as_slice());
    let theta = settled.theta + fixed(&held.covariance) * pull;
    let certainty = match problem.anchor {
        None => held,
        Some(_) => gauss_newton::certainty(
            &problem.data_jacobian(&DVector::from_column_slice(settled.theta.as_slice())),
            factor,
            Options::default().rank_tolerance,
        ),
    };
    let model = unpack(&theta, settings.frame, &problem.standard);
    let shrink = (model.s * problem.standard.size).determinant().abs() / problem.volume;
    if shrink < 2.0 * problem::SMALLEST_VOLUME
        || spread(&model, &problem.standard) < SMALLEST_SPREAD * settings.gravity
    {
        return Err(Error::not_determined(WORTHLESS));
    }
    let map = map_to_entries(settings.frame, &problem.standard);
    let covariance = map * fixed(&certainty.covariance) * map.transpose();
    let residuals = problem.in_m_s2(&model);
    let squares = || {
        residuals
            .iter()
            .zip(&problem.frozen.sigma)
            .map(|(r, s)| (r / s).powi(2))
    };
    let chi2 = squares().sum();
    let (weights, robust_chi2) = if settings.loss == Loss::Linear {
        (Vec::new(), chi2)
    } else {
        let weights: Vec<f64> = squares().map(|z2| settings.loss.weight(z2)).collect();
        let influence: f64 = squares().zip(&weights).map(|(z2, w)| w * w * z2).sum();
        (weights, influence / settings.loss.expected_influence(1))
    };
    Ok(Fit {
        model,
        covariance,
        chi2,
        robust_chi2,
        residuals,
        sigmas: Vec::new(),
        weights,
        certainty,
        is_anchored: problem.anchor.is_some(),
        stop: settled.stop,
        iterations,
    })
}

/// The same numbers without a heap.
fn fixed(square: &DMatrix<f64>) -> SMatrix<f64, N_PARAMETERS, N_PARAMETERS> {
    SMatrix::from_column_slice(square.as_slice())
}

/// The same norms in the frame asked for.
///
/// # Errors
/// When `S` is singular.
pub fn in_frame(model: &Model, frame: Frame) -> Result<Model> {
    let m = model.s.transpose() * model.s;
    let s = match frame {
        Frame::Lower => ellipsoid::reversed_cholesky(&m),
        Frame::Symmetric => ellipsoid::symmetric_root(&m),
    }
    .ok_or_else(|| Error::bad_input("the starting S is singular"))?;
    let inverse = model
        .s
        .try_inverse()
        .ok_or_else(|| Error::bad_input("the starting S is singular"))?;
    Ok(Model {
        s,
        b: s * inverse * model.b,
    })
}

/// Solver's parameters: six entries of `S · size`, then `d = b + S centre`, so that columns are of one size.
fn pack(model: &Model, standard: &Standardisation) -> Parameters {
    let s = model.s * standard.size;
    let d = model.b + model.s * standard.centre;
    let mut theta = Parameters::zeros();
    for (k, &(i, j)) in Frame::ENTRIES.iter().enumerate() {
        theta[k] = s[(i, j)];
    }
    theta.fixed_rows_mut::<3>(6).copy_from(&d);
    theta
}

/// `S` and `d` in standardised readings.
fn unpack_standardised(theta: &[f64], frame: Frame) -> Model {
    let mut s = Matrix3::zeros();
    for (k, &(i, j)) in Frame::ENTRIES.iter().enumerate() {
        s[(i, j)] = theta[k];
        if frame == Frame::Symmetric {
            s[(j, i)] = theta[k];
        }
    }
    Model {
        s,
        b: Vector3::new(theta[6], theta[7], theta[8]),
    }
}

fn unpack(theta: &Parameters, frame: Frame, standard: &Standardisation) -> Model {
    standard.undo(&unpack_standardised(theta.as_slice(), frame))
}

/// `∂(S row by row, b)/∂θ`: linear, because `b = d - S centre`.
fn map_to_entries(frame: Frame, standard: &Standardisation) -> SMatrix<f64, 12, N_PARAMETERS> {
    let mut map = SMatrix::zeros();
    for (k, &(i, j)) in Frame::ENTRIES.iter().enumerate() {
        let mut place = |row: usize, column: usize| {
            map[(3 * row + column, k)] = 1.0 / standard.size;
            map[(9 + row, k)] -= standard.centre[column] / standard.size;
        };
        place(i, j);
        if frame == Frame::Symmetric && i != j {
            place(j, i);
        }
    }
    for i in 0..3 {
        map[(9 + i, 6 + i)] = 1.0;
    }
    map
}
