//! Samples lost at random behind rewritten timestamps: their number in every move is Poisson, beside noise of the moves
//! and disturbed ones (docs/model-session.md, 11.17).

use std::iter::successors;

use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector2};
use rayon::prelude::*;

use super::Strengths;
use super::fit::{Fit, RIDGE};
use super::hypothesis::{Hypothesis, Weighed};
use super::move_losses::{Explained, Losses, explained};
use super::move_rows::Whitening;
use super::strength_search::EXTRAPOLATED;
use crate::error::{Error, Result};

/// Prior of the share of disturbed moves: Beta(1, 1 + this).
const UNDISTURBED: f64 = 18.0;
/// Excess of the moves' noise: least step of its search, as a factor, and how far it is searched beyond that of the
/// fit.
const EXCESS_STEP: f64 = 1.6;
/// Renewals of the weights by the residuals that they leave, and change of the log-likelihood below which none follows.
const RENEWALS: usize = 12;
const SAME: f64 = 0.02;
/// Losses per move above which a fit has taken some into its scale.
const ABSORBED: f64 = 0.1;
/// Losses per move at which a glance shows whether losses are likely: the evidence is as wide as a decade.
const GLANCED: [f64; 3] = [0.1, 1.0, 10.0];
/// First of the gyro's elements of `S` in the border.
const RATE_SCALE_AT: usize = 9;
/// Number of them.
pub const N_RATE: usize = 9;

/// One share of lost samples.
#[derive(Debug, Clone)]
pub struct Share {
    /// Log-evidence: all but excess and share of disturbed moves integrated out.
    pub log_evidence: f64,
    /// Change of the gyro's `S`, row by row, from that of the fit.
    pub step: SVector<f64, N_RATE>,
    /// Its covariance.
    pub covariance: SMatrix<f64, N_RATE, N_RATE>,
}

/// Share of lost samples, excess of the moves' noise and share of disturbed moves.
#[derive(Clone, Copy)]
struct At {
    share: f64,
    excess: f64,
    disturbed: f64,
}

impl At {
    fn of(share: f64) -> Self {
        Self {
            share,
            excess: 1.0,
            disturbed: 1.0 / UNDISTURBED,
        }
    }
}

/// The moves of a fit.
struct Mixture<'a> {
    fit: &'a Fit,
    hypothesis: Hypothesis,
    losses: Vec<Losses>,
    excesses: Vec<f64>,
}

impl<'a> Mixture<'a> {
    fn of(fit: &'a Fit) -> Result<Self> {
        let shown = fit.strengths.excess[0];
        let (least, most) = (shown.min(1.0), shown.max(1.0) * EXCESS_STEP);
        let tried = successors(Some(least), |excess| Some(excess * EXCESS_STEP));
        Ok(Self {
            fit,
            hypothesis: Hypothesis::of(fit, &[], &[])?,
            losses: fit.passed.iter().map(Losses::of).collect(),
            excesses: tried.take_while(|one| *one < most * EXCESS_STEP).collect(),
        })
    }

    fn strengths(&self, excess: f64) -> Strengths {
        let mut out = self.fit.strengths;
        out.excess[0] = excess;
        out
    }

    fn explained(&self, left: &[Vector2<f64>], at: At) -> Vec<Explained> {
        let strengths = self.strengths(at.excess);
        let moves = self.fit.passed.iter().zip(&self.losses).zip(left);
        let each = moves.map(|((passed, losses), x)| {
            let noise = passed
                .covariance(&strengths)
                .fixed_view::<2, 2>(0, 0)
                .into_owned();
            explained(x, &noise, &losses.at(at.share), at.disturbed)
        });
        each.collect()
    }

    /// The likeliest excess beside a share, with what explains the moves there and the logarithm of their likelihood.
    fn likeliest(&self, left: &[Vector2<f64>], at: At) -> (At, Vec<Explained>, f64) {
        let tried = self.excesses.iter().map(|&excess| {
            let at = At { excess, ..at };
            let each = self.explained(left, at);
            let log: f64 = each.iter().map(|e| e.log_likelihood).sum();
            let away = excess.ln() / EXTRAPOLATED;
            let prior = UNDISTURBED * (1.0 - at.disturbed).ln() - 0.5 * away * away;
            (at, each, log + prior)
        });
        let best = tried.max_by(|a, b| a.2.total_cmp(&b.2));
        best.unwrap_or((at, Vec::new(), f64::NEG_INFINITY))
    }

    /// The moves' rows about the residuals `left`, by a bound of their log-likelihoods or by all explanations together.
    fn rows(&self, left: &[Vector2<f64>], each: &[Explained], is_bound: bool) -> Option<Weighed> {
        let moves = self.hypothesis.moves.iter().zip(left).zip(each);
        self.hypothesis.with_moves(moves.map(|((open, left), e)| {
            let covariance = if is_bound {
                e.bound.try_inverse()?
            } else {
                e.spread
            };
            let mut white = Whitening::zeros();
            let root = covariance.cholesky()?.l().try_inverse()?;
            white.fixed_view_mut::<2, 2>(0, 0).copy_from(&root);
            let away = covariance * e.gradient;
            let mut residual = open.residual();
            for row in 0..2 {
                residual[row] += away[row] - left[row];
            }
            let log = e.log_likelihood + 0.5 * e.gradient.dot(&away);
            Some((white, Some(residual), log))
        }))
    }

    fn left_by(&self, step: &DVector<f64>) -> Vec<Vector2<f64>> {
        let layout = self.fit.layout();
        let moves = self.hypothesis.moves.iter();
        moves
            .map(|open| open.moved(layout, step).fixed_rows::<2>(0).into_owned())
            .collect()
    }

    /// Residuals where the fit has taken a share of the rotation into its scale.
    fn absorbing(&self, share: f64) -> Vec<Vector2<f64>> {
        let mut step = DVector::zeros(self.fit.layout().n());
        let scale = self.fit.state.rate_scale.transpose();
        for (i, value) in scale.as_slice().iter().enumerate() {
            step[RATE_SCALE_AT + i] = -share * value;
        }
        self.left_by(&step)
    }

    /// The mode beside a share, from the residuals `left`.
    fn mode(&self, share: f64, mut left: Vec<Vector2<f64>>) -> Result<Share> {
        let undetermined =
            || Error::not_determined("the tilt errors determine no scale beside lost samples");
        let layout = self.fit.layout();
        let mut at = At::of(share);
        let mut step = DVector::zeros(layout.n());
        let mut before = f64::NEG_INFINITY;
        let mut each;
        let mut value;
        let mut renewal = 0;
        loop {
            (at, each, value) = self.likeliest(&left, at);
            if value - before < SAME || renewal == RENEWALS {
                break;
            }
            before = value;
            renewal += 1;
            let disturbed: f64 = each.iter().map(|e| e.disturbed).sum();
            at.disturbed = (disturbed / (each.len() as f64 + UNDISTURBED)).clamp(1e-3, 0.5);
            let rows = self.rows(&left, &each, true).ok_or_else(undetermined)?;
            let (chain, side) = self.hypothesis.with_processes(rows, &self.fit.strengths);
            step = -chain.factor(RIDGE, None)?.solve(&side).column(0);
            left = self.left_by(&step);
        }
        let strengths = &self.fit.strengths;
        let likelihood: f64 = each.iter().map(|e| e.log_likelihood).sum();
        let rows = self.rows(&left, &each, true).ok_or_else(undetermined)?;
        // A bound: where the mode is not reached yet, the curvature there would promise too much.
        let reached = self.hypothesis.beside(strengths, &rows) + value - likelihood;
        let (chain, _) = self.hypothesis.with_processes(rows, strengths);
        let bound = chain.factor(RIDGE, None)?.log_det();
        let rows = self.rows(&left, &each, false).ok_or_else(undetermined)?;
        let (chain, _) = self.hypothesis.with_processes(rows, strengths);
        let factor = chain.factor(RIDGE, None)?;
        let log_evidence = reached + 0.5 * (bound - factor.log_det());
        let mut picked = DMatrix::zeros(layout.n(), N_RATE);
        for i in 0..N_RATE {
            picked[(RATE_SCALE_AT + i, i)] = 1.0;
        }
        let covariance = factor.inner(&picked);
        Ok(Share {
            log_evidence,
            step: step.fixed_rows::<N_RATE>(RATE_SCALE_AT).into_owned(),
            covariance: covariance.fixed_view::<N_RATE, N_RATE>(0, 0).into_owned(),
        })
    }
}

impl Fit {
    /// Evidence and scale of the gyro at every share of lost samples, in order, none the first; `None` where no share
    /// is likelier than none.
    ///
    /// # Errors
    /// When there are no shares, or the moves determine no scale.
    pub fn lost_samples(&self, shares: &[f64]) -> Result<Option<Vec<Share>>> {
        let mixture = Mixture::of(self)?;
        let n_samples = mixture.losses.iter().map(|one| one.n_samples);
        let usual = n_samples.sum::<f64>() / mixture.losses.len().max(1) as f64;
        let best = |&share: &f64| {
            let found = mixture.mode(share, mixture.absorbing(0.0))?;
            if share * usual <= ABSORBED {
                return Ok(found);
            }
            let other = mixture.mode(share, mixture.absorbing(share))?;
            let is_better = other.log_evidence > found.log_evidence;
            Ok(if is_better { other } else { found })
        };
        if shares.is_empty() {
            return Err(Error::bad_input("shares of lost samples are missing"));
        }
        let mut glanced = GLANCED.map(|losses| shares.partition_point(|s| s * usual < losses));
        glanced = glanced.map(|k| k.min(shares.len() - 1));
        let asked = [0, glanced[0], glanced[1], glanced[2]].map(|k| shares[k]);
        let seen = asked.par_iter().map(best).collect::<Result<Vec<Share>>>()?;
        let is_none = |one: &Share| one.log_evidence <= seen[0].log_evidence;
        if seen.iter().all(is_none) {
            return Ok(None);
        }
        shares.par_iter().map(best).collect::<Result<_>>().map(Some)
    }
}
