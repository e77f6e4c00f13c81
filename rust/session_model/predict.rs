//! What a fitted session says beyond its optimum: leverage, projections for score tests, held-out prediction, covariance
//! of both linear models (docs/model-session.md, 11.13-11.16).

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};
use rayon::prelude::*;

use super::chain::Chain;
use super::fit::{Fit, RIDGE, gradient};
use super::rows::{Domain, Group};
use super::{AtRest, LOWER, Session};
use crate::error::Result;

/// Domains that are judged: all but the prior.
pub const N_DOMAINS: usize = 4;
/// Ridge of the training rows: the held-out pose's own unknowns keep a weak prior, the same for every model compared.
const TRAINING_RIDGE: f64 = 1e-6;
/// Directions of a fold whose predicted variance is above this many noise variances were left open by the training rows.
const OPEN: f64 = 1e4;

/// Held-out prediction of blocks of rows.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// `(folds, domains)` innovation χ².
    pub chi2: Vec<[f64; N_DOMAINS]>,
    /// `(folds)` log-determinant of the predicted covariance.
    pub log_det: Vec<f64>,
    /// `(domains)` directions predicted.
    pub n_rows: [f64; N_DOMAINS],
    /// `(rows)` whitened innovations.
    pub residual: Vec<f64>,
    /// `(rows)` the same over each row's own noise alone.
    pub innovation: Vec<f64>,
}

/// One zero for the session, raw and centred.
#[derive(Debug, Clone)]
pub struct SessionZero {
    /// Weight of every pose.
    pub weights: Vec<Vector3<f64>>,
    /// The zero.
    pub mean: Vector3<f64>,
    /// Its variance by poses that differ beyond their noise.
    pub variance: Vector3<f64>,
}

/// Domain of row `r` of a group.
#[must_use]
pub fn domain_of(group: &Group, r: usize) -> Domain {
    if group.domain == Domain::Moves && group.rows.len() == super::moves::N_MOVE && r >= 2 {
        Domain::Dynamics
    } else {
        group.domain
    }
}

impl Fit {
    /// First row of every group.
    #[must_use]
    pub fn first_rows(&self) -> Vec<usize> {
        let mut at = 0;
        self.groups
            .iter()
            .map(|group| {
                let first = at;
                at += group.rows.len();
                first
            })
            .collect()
    }

    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.groups.iter().map(|group| group.rows.len()).sum()
    }

    /// `(rows)` share of every row that the fit used up.
    #[must_use]
    pub fn leverage(&self) -> Vec<f64> {
        let marginals = self.factor.marginals();
        self.groups
            .iter()
            .flat_map(|group| marginals.leverage(&group.rows).as_slice().to_vec())
            .collect()
    }

    /// Columns `(rows, k)` minus what the unknowns of the fit can imitate.
    #[must_use]
    pub fn project(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let layout = self.layout();
        let firsts = self.first_rows();
        let mut side = DMatrix::zeros(layout.n(), columns.ncols());
        for (group, &first) in self.groups.iter().zip(&firsts) {
            let part = columns.rows(first, group.rows.len()).into_owned();
            group.rows.add_transposed(layout, &part, &mut side);
        }
        let x = self.factor.solve(&side);
        let mut out = columns.clone();
        for (group, &first) in self.groups.iter().zip(&firsts) {
            let mut part = out.rows_mut(first, group.rows.len());
            part -= group.rows.times(layout, &x);
        }
        out
    }

    /// Predicts every fold's rows from the others (blocked cross-validation). A fold is a list of groups.
    ///
    /// # Errors
    /// When the rest of the rows determines nothing at all.
    pub fn held_out(&self, folds: &[Vec<usize>]) -> Result<HeldOut> {
        let layout = self.layout();
        let firsts = self.first_rows();
        let side = gradient(layout, &self.groups);
        let scale = self.chain.diagonal().map(|value| {
            let length = value.max(0.0).sqrt();
            if length > 0.0 { length } else { 1.0 }
        });
        let parts: Vec<Result<FoldPart>> = folds
            .par_iter()
            .map(|fold| {
                let held = Chain::of(layout, fold.iter().map(|&g| &self.groups[g].rows));
                let mut train = self.chain.clone();
                train.add_scaled(&held, -1.0);
                let factor = train.factor(TRAINING_RIDGE, Some(&scale))?;
                let n: usize = fold.iter().map(|&g| self.groups[g].rows.len()).sum();
                let mut jacobian_t = DMatrix::zeros(layout.n(), n);
                let mut residual = DVector::zeros(n);
                let mut at = 0;
                for &g in fold {
                    let rows = &self.groups[g].rows;
                    let r = rows.len();
                    let mut part = DMatrix::zeros(layout.n(), r);
                    rows.add_transposed(layout, &DMatrix::identity(r, r), &mut part);
                    jacobian_t.columns_mut(at, r).copy_from(&part);
                    residual.rows_mut(at, r).copy_from(&rows.residual);
                    at += r;
                }
                // The training optimum is one linear step from that of all rows.
                let others = &side - &jacobian_t * &residual;
                let solved = factor.solve(&jacobian_t);
                let mut spread = jacobian_t.tr_mul(&solved);
                for i in 0..n {
                    spread[(i, i)] += 1.0;
                }
                let innovation = &residual - solved.tr_mul(&others).column(0);
                let spread = (&spread + spread.transpose()) * 0.5;
                let eigen = spread.symmetric_eigen();
                let along = eigen.eigenvectors.tr_mul(&innovation);
                let mut whitened = DVector::zeros(n);
                let mut plain = DVector::zeros(n);
                let mut share = DVector::zeros(n);
                let mut log_det = 0.0;
                for k in 0..n {
                    let value = eigen.eigenvalues[k];
                    if value < OPEN {
                        let vector = eigen.eigenvectors.column(k);
                        whitened.axpy(along[k] / value.sqrt(), &vector, 1.0);
                        plain.axpy(along[k], &vector, 1.0);
                        share += vector.component_mul(&vector);
                        log_det += value.ln();
                    }
                }
                Ok(FoldPart {
                    whitened,
                    plain,
                    share,
                    log_det,
                })
            })
            .collect();
        let mut out = HeldOut {
            chi2: Vec::with_capacity(folds.len()),
            log_det: Vec::with_capacity(folds.len()),
            n_rows: [0.0; N_DOMAINS],
            residual: vec![0.0; self.n_rows()],
            innovation: vec![0.0; self.n_rows()],
        };
        for (fold, part) in folds.iter().zip(parts) {
            let part = part?;
            let mut chi2 = [0.0; N_DOMAINS];
            let mut at = 0;
            for &g in fold {
                let group = &self.groups[g];
                for r in 0..group.rows.len() {
                    let domain = domain_of(group, r) as usize;
                    if domain < N_DOMAINS {
                        chi2[domain] += part.whitened[at].powi(2);
                        out.n_rows[domain] += part.share[at];
                    }
                    out.residual[firsts[g] + r] = part.whitened[at];
                    out.innovation[firsts[g] + r] = part.plain[at];
                    at += 1;
                }
            }
            out.chi2.push(chi2);
            out.log_det.push(part.log_det);
        }
        Ok(out)
    }

    /// The session's one zero of the gyro: weights of the poses, raw mean, variance of it by poses that differ beyond
    /// their noise (11.16).
    #[must_use]
    pub fn session_zero(&self, session: &Session) -> Option<SessionZero> {
        let rate = session.rate.as_ref()?;
        let (weights, spread) = pooled(rate, &self.read_zeros(rate));
        let mut mean = Vector3::zeros();
        let mut variance = Vector3::zeros();
        for (w, z) in weights.iter().zip(&self.state.rate_zero) {
            mean += w.component_mul(z);
            variance += w.component_mul(w).component_mul(&spread);
        }
        Some(SessionZero {
            weights,
            mean,
            variance,
        })
    }

    /// What each pose reads less what effects add there.
    fn read_zeros(&self, rate: &AtRest) -> Vec<Vector3<f64>> {
        let effects = super::Distortion::at(
            self.distortion.rate.as_ref(),
            self.distortion.k,
            &self.state.effect,
        );
        let inverse = self.state.rate_scale.try_inverse();
        rate.mean
            .iter()
            .enumerate()
            .map(|(i, mean)| match (&effects, inverse) {
                (Some(effects), Some(inverse)) => mean - inverse * effects[i],
                _ => *mean,
            })
            .collect()
    }

    /// `(24, 24)` covariance of `(S_a, b_a, S_ω, b_ω)` row by row, on raw readings whose centres were `origins`
    /// (accelerometer, gyro), and `b_ω` itself.
    #[must_use]
    pub fn linear_covariance(
        &self,
        session: &Session,
        origins: &[Vector3<f64>; 2],
    ) -> (DMatrix<f64>, Vector3<f64>) {
        let layout = self.layout();
        let mut map = DMatrix::zeros(layout.n(), 24);
        for (c, &(i, j)) in LOWER.iter().enumerate() {
            map[(c, 3 * i + j)] = 1.0;
            map[(c, 9 + i)] -= origins[0][j];
        }
        for i in 0..3 {
            map[(6 + i, 9 + i)] = 1.0;
        }
        let mut bias = Vector3::zeros();
        let mut beyond = Matrix3::zeros();
        if let Some(one) = self.session_zero(session) {
            let scale = &self.state.rate_scale;
            let zero = origins[1] + one.mean;
            bias = -(scale * zero);
            beyond = scale * Matrix3::from_diagonal(&one.variance) * scale.transpose();
            for i in 0..3 {
                for j in 0..3 {
                    map[(9 + 3 * i + j, 12 + 3 * i + j)] = 1.0;
                    map[(9 + 3 * i + j, 21 + i)] = -zero[j];
                    for (h, w) in one.weights.iter().enumerate() {
                        map[(layout.at(h) + 2 + j, 21 + i)] = -scale[(i, j)] * w[j];
                    }
                }
            }
        }
        let solved = self.factor.solve(&map);
        let mut covariance = map.tr_mul(&solved);
        let mut corner = covariance.view_mut((21, 21), (3, 3));
        corner += beyond;
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        (covariance, bias)
    }

    /// Covariance of the border: both linear models, then effects.
    #[must_use]
    pub fn border_covariance(&self) -> DMatrix<f64> {
        let layout = self.layout();
        let mut picked = DMatrix::zeros(layout.n(), layout.border);
        picked
            .view_mut((0, 0), (layout.border, layout.border))
            .fill_with_identity();
        self.factor
            .solve(&picked)
            .rows(0, layout.border)
            .into_owned()
    }

    /// The factor of all rows but those of some groups: what the others say.
    ///
    /// # Errors
    /// When they determine nothing.
    pub fn without(&self, groups: &[usize]) -> Result<super::chain::Factor> {
        let held = Chain::of(self.layout(), groups.iter().map(|&g| &self.groups[g].rows));
        let mut rest = self.chain.clone();
        rest.add_scaled(&held, -1.0);
        rest.factor(RIDGE.max(TRAINING_RIDGE), None)
    }

    /// Covariance of the five residuals of each move, SI, before the fit used any of it up.
    #[must_use]
    pub fn move_covariance(&self) -> Vec<SMatrix<f64, 5, 5>> {
        self.passed
            .iter()
            .map(|one| one.response.covariance)
            .collect()
    }
}

struct FoldPart {
    whitened: DVector<f64>,
    plain: DVector<f64>,
    share: DVector<f64>,
    log_det: f64,
}

/// A spread of the zeros counts when χ² exceeds its degrees of freedom by four of its standard deviations.
const BEYOND_CHANCE: f64 = 4.0;

/// Random-effects weights of zero readings and the variance between them (`DerSimonian` and Laird 1986), axis by axis.
fn pooled(rate: &AtRest, zeros: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, Vector3<f64>) {
    let n = zeros.len();
    let mut weights = vec![Vector3::zeros(); n];
    let mut spread = Vector3::zeros();
    for axis in 0..3 {
        let precision: Vec<f64> = rate.sigma.iter().map(|s| s[axis].powi(-2)).collect();
        let total: f64 = precision.iter().sum();
        let mean = precision
            .iter()
            .zip(zeros)
            .map(|(p, z)| p * z[axis])
            .sum::<f64>()
            / total;
        let chi2: f64 = precision
            .iter()
            .zip(zeros)
            .map(|(p, z)| p * (z[axis] - mean).powi(2))
            .sum();
        let dof = n as f64 - 1.0;
        let squares: f64 = precision.iter().map(|p| p * p).sum();
        if chi2 > dof + BEYOND_CHANCE * (2.0 * dof.max(1.0)).sqrt() {
            spread[axis] = (chi2 - dof) / (total - squares / total).max(f64::MIN_POSITIVE);
        }
        let raw: Vec<f64> = rate
            .sigma
            .iter()
            .map(|s| 1.0 / (s[axis].powi(2) + spread[axis]))
            .collect();
        let sum: f64 = raw.iter().sum();
        for (w, value) in weights.iter_mut().zip(raw) {
            w[axis] = value / sum;
        }
    }
    (weights, spread)
}
