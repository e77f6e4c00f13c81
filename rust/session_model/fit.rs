//! The fit of a session at given strengths of the processes behind its biases (docs/model-session.md, 11.9-11.12).

use std::cell::RefCell;

use nalgebra::DMatrix;

use super::chain::{Chain, Layout};
use super::factor::Factor;
use super::fixed_weights::FixedWeights;
use super::move_rows::{Passed, Weights};
use super::moves::Move;
use super::rows::Group;
use super::{Distortion, Session, State, Strengths};
use crate::error::Result;
use crate::gauss_newton::{Local, Options, Stop, descend};

/// Added to the diagonal of the scaled normal equations: undetermined directions stay finite.
pub const RIDGE: f64 = 1e-12;
/// Converged: the undamped step moves all whitened rows together by less than this many standard errors, these widened
/// to the actual scatter of the rows.
const STEP_TOLERANCE: f64 = 1e-3;
/// The same for a descent whose weights are then renewed: they change by far less on the remaining way.
const ROUGH_TOLERANCE: f64 = 0.1;
/// Angle, rad, between a vertical and the plane in which it was compared, below which moves integrated there are
/// reused: residual and noise shrink together, in second order.
const SAME_PLANE: f64 = 1e-2;
/// Largest number of iterations of such a descent, and of any.
const ROUGH_ITERATIONS: usize = 12;
const MOST_ITERATIONS: usize = 50;
/// Largest number of renewals of the moves' weights; they depend on the state in second order and mostly converge in
/// two. Later ones go half way.
const RENEWALS: usize = 6;
const WHOLE_RENEWALS: usize = 2;

/// A fitted session.
#[derive(Debug)]
pub struct Fit {
    /// State at the optimum.
    pub state: State,
    /// Strengths of the noise processes.
    pub strengths: Strengths,
    /// Effects in the model.
    pub distortion: Distortion,
    /// Whitening of the moves.
    pub weights: Weights,
    /// Moves integrated at that state.
    pub passed: Vec<Passed>,
    /// All rows at that state.
    pub groups: Vec<Group>,
    /// Their normal equations.
    pub chain: Chain,
    /// The same factored.
    pub factor: Factor,
    /// Why the last descent stopped.
    pub stop: Stop,
    /// Total number of linearisations.
    pub iterations: usize,
}

impl Fit {
    /// `Σ r²`.
    #[must_use]
    pub fn chi2(&self) -> f64 {
        chi2_of(&self.groups)
    }

    /// Sizes of the unknowns.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.chain.layout
    }

    fn log_weight(&self) -> f64 {
        self.groups.iter().map(|group| group.log_weight).sum()
    }

    /// Log-likelihood with all unknowns integrated out, up to a constant.
    #[must_use]
    pub fn log_marginal(&self) -> f64 {
        -0.5 * self.chi2() - 0.5 * self.factor.log_det() + self.log_weight()
    }
}

pub(super) fn chi2_of<'a>(groups: impl IntoIterator<Item = &'a Group>) -> f64 {
    groups
        .into_iter()
        .map(|g| g.rows.residual.norm_squared())
        .sum()
}

/// `Jᵀr` `(n, 1)`.
#[must_use]
pub fn gradient<'a>(layout: Layout, groups: impl IntoIterator<Item = &'a Group>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(layout.n(), 1);
    for group in groups {
        let r = DMatrix::from_column_slice(group.rows.len(), 1, group.rows.residual.as_slice());
        group.rows.add_transposed(layout, &r, &mut out);
    }
    out
}

impl Session {
    /// Whether the planes in which moves were compared are perpendicular to the verticals of a state.
    fn compares_in(&self, passed: &[Passed], state: &State) -> bool {
        let tilt = |(one, known): (&Move, &Passed)| known.plane.tr_mul(&state.up[one.before + 1]);
        self.moves
            .iter()
            .zip(passed)
            .all(|pair| tilt(pair).norm() < SAME_PLANE)
    }
}

/// How near the state at which a fit begins, and how far it goes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Extent {
    /// The start is the state of another fit: residuals of the moves show their weights.
    pub is_near: bool,
    /// It ends after the first descent, near enough for a search of noise strengths.
    pub is_rough: bool,
}

/// Fits a session at given strengths: descents with fixed weights of the moves, renewed until the state converges.
///
/// # Errors
/// When the start cannot be evaluated or a row's weight is undetermined.
pub fn fit(
    session: &Session,
    start: State,
    strengths: Strengths,
    distortion: &Distortion,
    extent: Extent,
) -> Result<Fit> {
    fit_from(session, start, None, strengths, distortion, extent)
}

/// [`fit`], with the moves as integrated at the start where these are known.
pub(super) fn fit_from(
    session: &Session,
    start: State,
    known: Option<Vec<Passed>>,
    strengths: Strengths,
    distortion: &Distortion,
    extent: Extent,
) -> Result<Fit> {
    let mut options = Options {
        step_tolerance: STEP_TOLERANCE,
        gradient_tolerance: 1e-14,
        max_iterations: MOST_ITERATIONS,
        ..Options::default()
    };
    let mut state = start;
    let mut iterations = 0;
    let mut spread = 1.0_f64;
    let mut before: Option<Weights> = None;
    // Far from the optimum every residual is large.
    let is_new = known.is_none() && !extent.is_near;
    let mut passed = match known {
        Some(known) if session.compares_in(&known, &state) => known,
        _ => session.pass(&state, distortion, &session.planes(&state)),
    };
    for renewal in 0.. {
        let is_rough = renewal == 0 && !session.moves.is_empty();
        (options.step_tolerance, options.max_iterations) = if is_rough {
            (ROUGH_TOLERANCE, ROUGH_ITERATIONS)
        } else {
            (STEP_TOLERANCE * spread, MOST_ITERATIONS)
        };
        let weights = match before {
            Some(before) if renewal > WHOLE_RENEWALS => {
                Weights::between(&before, &passed, &strengths)?
            }
            _ if renewal == 0 && is_new => Weights::gaussian(&passed, &strengths)?,
            _ => Weights::of(&passed, &strengths)?,
        };
        let problem = FixedWeights {
            session,
            distortion,
            strengths,
            weights: &weights,
            first: RefCell::new(Some(passed)),
            tried: RefCell::new(None),
        };
        let ended = descend(&problem, state, &options)?;
        iterations += ended.iterations;
        state = ended.point;
        let local = ended.local;
        let shown = (2.0 * local.cost() / local.n_residuals().max(1) as f64)
            .sqrt()
            .max(1.0);
        passed = local.passed;
        let is_there = ended.stop != Stop::SmallStep || ended.step <= STEP_TOLERANCE * spread;
        let is_settled = (ended.iterations == 1 && is_there && !(renewal == 0 && is_new))
            || session.moves.is_empty();
        // Where residuals far exceed their noise a descent ends late, and renewed weights would start it again.
        let is_endless = !is_rough && ended.stop == Stop::TooManyIterations;
        spread = shown;
        if is_settled || is_endless || extent.is_rough || renewal >= RENEWALS {
            let factor = match local.factor.into_inner() {
                Some(factor) => factor,
                None => local.chain.factor(RIDGE, None)?,
            };
            return Ok(Fit {
                state,
                strengths,
                distortion: distortion.clone(),
                weights,
                passed,
                groups: local.groups,
                chain: local.chain,
                factor,
                stop: ended.stop,
                iterations,
            });
        }
        before = Some(weights);
    }
    unreachable!("the loop returns at its last renewal")
}
