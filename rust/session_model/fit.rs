//! The fit of a session, and the strengths of the processes behind its zeros (docs/model-session.md, 11.9-11.12).

use std::cell::{OnceCell, RefCell};

use nalgebra::{DMatrix, DVector};

use super::chain::{Chain, Layout};
use super::factor::Factor;
use super::move_rows::{Passed, Weights};
use super::moves::Carried;
use super::rows::Group;
use super::strengths::CORNER_GRID_S;
use super::{Distortion, Session, State, Strengths};
use crate::error::Result;
use crate::gauss_newton::{Descent, Local, Options, Stop, descend};

/// Added to the diagonal of the scaled normal equations: directions that nothing sees stay finite.
pub const RIDGE: f64 = 1e-12;
/// The undamped step moves all whitened rows together by less than this many standard errors: converged.
const STEP_TOLERANCE: f64 = 1e-3;
/// Renewals of the moves' weights; they follow the state in second order and settle in two.
const RENEWALS: usize = 6;

/// A fitted session.
#[derive(Debug)]
pub struct Fit {
    /// Where it ended.
    pub state: State,
    /// Strengths of the processes there.
    pub strengths: Strengths,
    /// Scatter (accelerometer, gyro) that is likely, though it may be too small to be taken into the fit.
    pub likely_scatter: [f64; 2],
    /// Effects in it.
    pub distortion: Distortion,
    /// Whitening of the moves.
    pub weights: Weights,
    /// Moves carried there.
    pub passed: Vec<Passed>,
    /// All rows there.
    pub groups: Vec<Group>,
    /// Their normal equations.
    pub chain: Chain,
    /// The same factored.
    pub factor: Factor,
    /// Why the last descent stopped.
    pub stop: Stop,
    /// Linearisations made in all.
    pub iterations: usize,
    /// Length of the undamped step there, in standard errors of all rows together.
    pub step: f64,
    /// Left side of the orthogonality test.
    pub gradient: f64,
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

    /// Log-likelihood with the poses integrated out and what they share at its optimum, up to a constant.
    #[must_use]
    pub fn log_profile(&self) -> f64 {
        -0.5 * self.chi2() - 0.5 * self.factor.log_det_poses() + self.log_weight()
    }

    /// Whether the walk of either zero (accelerometer, gyro) is as strong as the grid allows: it then stands in for
    /// something else, a drift or a scatter.
    #[must_use]
    pub fn is_walk_at_edge(&self) -> [bool; 2] {
        self.strengths
            .corner_s
            .map(|corner| corner <= CORNER_GRID_S[0])
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

/// A session with its weights held: what one descent works on.
struct Held<'a> {
    session: &'a Session,
    distortion: &'a Distortion,
    strengths: Strengths,
    weights: &'a Weights,
    /// The moves at the state that the descent begins at, already carried.
    first: RefCell<Option<Vec<Passed>>>,
    /// The state whose cost was asked for last, and the moves carried there.
    tried: RefCell<Option<(State, Vec<Carried>)>>,
}

/// The linear problem of a state.
struct Here {
    groups: Vec<Group>,
    passed: Vec<Passed>,
    chain: Chain,
    /// Its factors without damping, made when first asked for.
    factor: OnceCell<Factor>,
    gradient: DMatrix<f64>,
    cost: f64,
    n: usize,
}

impl Descent for Held<'_> {
    type Point = State;
    type Local = Here;

    fn linearise(&self, state: &State, _previous: Option<&Here>) -> Result<Here> {
        let known = self.first.borrow_mut().take();
        let passed = known.unwrap_or_else(|| {
            let carried = match self.tried.borrow_mut().take() {
                Some((at, carried)) if at == *state => carried.into_iter().map(Some).collect(),
                _ => vec![None; self.session.moves.len()],
            };
            self.session
                .pass_carried(state, self.distortion, &self.weights.plane, carried)
        });
        let groups = self.session.groups(
            state,
            &self.strengths,
            self.distortion,
            self.weights,
            &passed,
        )?;
        let layout = self.session.layout(self.distortion.k);
        let chain = Chain::of(layout, groups.iter().map(|group| &group.rows));
        Ok(Here {
            gradient: gradient(layout, &groups),
            cost: 0.5 * chi2_of(&groups),
            n: groups.iter().map(|group| group.rows.len()).sum(),
            groups,
            passed,
            chain,
            factor: OnceCell::new(),
        })
    }

    fn cost(&self, state: &State) -> Result<f64> {
        let chi2 = self
            .session
            .chi2(state, &self.strengths, self.distortion, self.weights);
        // A triad that collapsed on the way is a wall, not an end.
        Ok(chi2.map_or(f64::INFINITY, |(value, carried)| {
            if value.is_finite() {
                *self.tried.borrow_mut() = Some((state.clone(), carried));
                0.5 * value
            } else {
                f64::INFINITY
            }
        }))
    }

    fn moved(&self, state: &State, step: &DVector<f64>) -> State {
        state.moved(step, self.session.layout(self.distortion.k))
    }
}

impl Here {
    fn image(&self, step: &DVector<f64>) -> impl Iterator<Item = (&Group, DVector<f64>)> {
        self.groups
            .iter()
            .map(|group| (group, group.rows.image(self.chain.layout, step)))
    }

    fn undamped(&self) -> Result<&Factor> {
        if let Some(factor) = self.factor.get() {
            return Ok(factor);
        }
        let made = self.chain.factor(RIDGE, None)?;
        Ok(self.factor.get_or_init(|| made))
    }
}

impl Local for Here {
    fn cost(&self) -> f64 {
        self.cost
    }

    fn n_residuals(&self) -> usize {
        self.n
    }

    fn is_finite(&self) -> bool {
        self.gradient.iter().all(|value| value.is_finite())
    }

    fn gradient_cosine(&self) -> f64 {
        let size = (2.0 * self.cost).sqrt().max(f64::MIN_POSITIVE);
        self.chain
            .diagonal()
            .iter()
            .zip(self.gradient.iter())
            .filter(|(d, _)| **d > 0.0)
            .map(|(d, g)| g.abs() / d.sqrt() / size)
            .fold(0.0, f64::max)
    }

    fn step(&self, lambda: f64) -> Result<DVector<f64>> {
        let x = if lambda == 0.0 {
            self.undamped()?.solve(&self.gradient)
        } else {
            let factor = self.chain.factor(RIDGE + lambda, None)?;
            factor.solve(&self.gradient)
        };
        Ok(-x.column(0).into_owned())
    }

    fn predicted(&self, step: &DVector<f64>) -> f64 {
        let after: f64 = self
            .image(step)
            .map(|(group, image)| (image + &group.rows.residual).norm_squared())
            .sum();
        self.cost - 0.5 * after
    }

    fn length(&self, step: &DVector<f64>) -> f64 {
        self.image(step)
            .map(|(_, image)| image.norm_squared())
            .sum::<f64>()
            .sqrt()
    }
}

/// Fits a session at given strengths: descents with the moves' weights held, renewed until they no longer move it.
///
/// # Errors
/// When the start cannot be evaluated or nothing determines a row's weight.
pub fn fit(
    session: &Session,
    start: State,
    strengths: Strengths,
    distortion: &Distortion,
) -> Result<Fit> {
    let options = Options {
        step_tolerance: STEP_TOLERANCE,
        gradient_tolerance: 1e-14,
        max_iterations: 50,
        ..Options::default()
    };
    let mut state = start;
    let mut iterations = 0;
    let planes = session.planes(&state);
    let mut passed = session.pass(&state, distortion, &planes);
    for renewal in 0.. {
        let weights = Weights::of(&passed, &strengths)?;
        let held = Held {
            session,
            distortion,
            strengths,
            weights: &weights,
            first: RefCell::new(Some(passed)),
            tried: RefCell::new(None),
        };
        let ended = descend(&held, state, &options)?;
        iterations += ended.iterations;
        state = ended.point;
        let local = ended.local;
        passed = local.passed;
        let is_settled = ended.iterations == 1 || session.moves.is_empty();
        if is_settled || renewal >= RENEWALS {
            let factor = match local.factor.into_inner() {
                Some(factor) => factor,
                None => local.chain.factor(RIDGE, None)?,
            };
            return Ok(Fit {
                state,
                strengths,
                likely_scatter: strengths.scatter,
                distortion: distortion.clone(),
                weights,
                passed,
                groups: local.groups,
                chain: local.chain,
                factor,
                stop: ended.stop,
                iterations,
                step: ended.step,
                gradient: ended.gradient,
            });
        }
    }
    unreachable!("the loop returns at its last renewal")
}
