//! One descent of a session: the linear problem at a state, weights of moves fixed (docs/model-session.md, 11.9).

use std::cell::{OnceCell, RefCell};

use nalgebra::{DMatrix, DVector};

use super::chain::Chain;
use super::factor::Factor;
use super::fit::{RIDGE, chi2_of, gradient};
use super::move_rows::{Passed, Weights};
use super::moves::Carried;
use super::rows::Group;
use super::{Distortion, Session, State, Strengths};
use crate::error::Result;
use crate::gauss_newton::{Descent, Local};

/// A session with fixed weights: the problem of one descent.
pub(super) struct FixedWeights<'a> {
    pub session: &'a Session,
    pub distortion: &'a Distortion,
    pub strengths: Strengths,
    pub weights: &'a Weights,
    /// The moves integrated at the state where the descent begins.
    pub first: RefCell<Option<Vec<Passed>>>,
    /// The state whose cost was computed last, and the moves integrated there.
    pub tried: RefCell<Option<(State, Vec<Carried>)>>,
}

/// The linear problem at a state.
pub(super) struct Here {
    pub groups: Vec<Group>,
    pub passed: Vec<Passed>,
    pub chain: Chain,
    /// Its factors without damping, computed at the first request.
    pub factor: OnceCell<Factor>,
    gradient: DMatrix<f64>,
    cost: f64,
    n: usize,
}

impl Descent for FixedWeights<'_> {
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
        // A triad that collapsed on the way has infinite cost: the step is shortened, the fit goes on.
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
