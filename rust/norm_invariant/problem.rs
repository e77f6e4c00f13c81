//! The norm residual and its analytic Jacobian, row by row, with the noise that is predicted for each.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector3};

use super::parameters::unpack_standardised;
use super::{ANCHOR, Model, N_PARAMETERS, Parameters, Readings, UNKNOWN};
use crate::ellipsoid::Standardisation;
use crate::sensor_model::LOWER;

/// Least volume of `S` as a part of the start's: below it lies the minimum `S = 0, |b| = |g|`.
pub(super) const SMALLEST_VOLUME: f64 = 1e-2;

/// Predictions of the noise for each residual at a given model, fixed while the solver runs.
pub(super) struct FixedNoise {
    /// Standard error of the residual, m/s².
    pub sigma: Vec<f64>,
    /// Factor on every sigma in the fit: above one where an anchored fit finds more scatter than the noise explains.
    pub widening: f64,
    /// Expected excess of the norm from noise across gravity, `(tr SΣSᵀ - σ²)/2|g|`, m/s².
    pub excess: Vec<f64>,
}

impl FixedNoise {
    pub(super) fn at(readings: Readings<'_>, gravity: f64, model: &Model, widening: f64) -> Self {
        let (sigma, excess) = (0..readings.values.len())
            .map(|i| predicted(readings, gravity, model, i))
            .unzip();
        Self {
            sigma,
            widening,
            excess,
        }
    }

    fn sigma_of(&self, i: usize) -> f64 {
        self.sigma[i] * self.widening
    }
}

/// Standard error and expected excess of one residual.
pub(super) fn predicted(
    readings: Readings<'_>,
    gravity: f64,
    model: &Model,
    i: usize,
) -> (f64, f64) {
    let f = model.correct(&readings.values[i]);
    let u = f / f.norm();
    let noise = model.s * readings.noise_of(i) * model.s.transpose();
    let along = u.dot(&(noise * u));
    let across = noise.trace() - along;
    // A pose whose noisy axes all lie across gravity still has some noise along it.
    let floor = 1e-6 * noise.trace();
    (along.max(floor).sqrt(), across / (2.0 * gravity))
}

/// Data of the problem at one set of predictions.
pub(super) struct PoseProblem<'a> {
    pub readings: Readings<'a>,
    /// |g|, m/s².
    pub gravity: f64,
    pub standard: Standardisation,
    pub fixed: &'a FixedNoise,
    /// `|det S|` of the start, in standardised readings.
    pub volume: f64,
    /// Values to which the parameters are tied, to `ANCHOR` of |g| each, when the poses leave some undetermined.
    pub anchor: Option<Parameters>,
}

impl PoseProblem<'_> {
    fn n(&self) -> usize {
        self.readings.values.len()
    }

    /// Number of rows of the anchor.
    fn n_held(&self) -> usize {
        self.anchor.map_or(0, |_| N_PARAMETERS)
    }

    fn standardised(&self, i: usize) -> Vector3<f64> {
        self.standard.apply(&self.readings.values[i])
    }

    fn misfit(&self, f: &Vector3<f64>, i: usize) -> f64 {
        f.norm() - self.gravity - self.fixed.excess[i]
    }

    /// Whitened residuals of the readings, then those of the anchor; infinite where `S` collapses.
    pub(super) fn residuals(&self, x: &DVector<f64>) -> DVector<f64> {
        let (n, model) = (self.n(), unpack_standardised(x.as_slice()));
        let mut residuals = DVector::from_element(n + self.n_held(), f64::INFINITY);
        if model.s.determinant().abs() < SMALLEST_VOLUME * self.volume {
            return residuals;
        }
        for i in 0..n {
            let f = model.correct(&self.standardised(i));
            residuals[i] = self.misfit(&f, i) / self.fixed.sigma_of(i);
        }
        if let Some(anchor) = &self.anchor {
            let held = (x - anchor) / (ANCHOR * self.gravity);
            residuals.rows_mut(n, N_PARAMETERS).copy_from(&held);
        }
        residuals
    }

    /// Derivatives of the rows.
    pub(super) fn jacobian(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let (n, model) = (self.n(), unpack_standardised(x.as_slice()));
        let mut jacobian = DMatrix::zeros(n + self.n_held(), N_PARAMETERS);
        for i in 0..n {
            let u = self.standardised(i);
            let slope = residual_gradient(&model.correct(&u), &u);
            let row = slope / self.fixed.sigma_of(i);
            jacobian.row_mut(i).tr_copy_from(&row);
        }
        let held = 1.0 / (ANCHOR * self.gravity);
        jacobian.rows_mut(n, self.n_held()).fill_diagonal(held);
        jacobian
    }

    /// χ² of the readings, with the widened sigmas.
    pub(super) fn chi2(&self, x: &DVector<f64>) -> f64 {
        self.residuals(x).rows(0, self.n()).norm_squared()
    }

    /// Jacobian rows of the readings alone.
    pub(super) fn data_jacobian(&self, x: &DVector<f64>) -> DMatrix<f64> {
        self.jacobian(x).rows(0, self.n()).into_owned()
    }

    /// `E[Jᵀr]` at the truth: a whitened residual and its own derivative share noise, so that their product has a mean.
    ///
    /// With `n` the noise of a reading, `E[∂r/∂S_jk · r] = u_j (Σ Sᵀ u)_k + (P S Σ Sᵀ u)_j a_k/|g|`, `P = I - uuᵀ`, and
    /// for `b` the second term without `a`.
    pub(super) fn noise_in_gradient(&self, x: &DVector<f64>) -> Parameters {
        let model = unpack_standardised(x.as_slice());
        let mut sum = Parameters::zeros();
        for i in 0..self.n() {
            let a = self.standardised(i);
            let up = model.correct(&a).normalize();
            let noise = self.readings.noise_of(i) / self.standard.size.powi(2);
            let shared = noise * model.s.transpose() * up;
            let spread = model.s * shared;
            let across = (spread - up * up.dot(&spread)) / self.gravity;
            let mut first = columns(&up, &shared);
            first.fixed_rows_mut::<3>(6).fill(0.0);
            let mean = first + columns(&across, &a);
            sum += mean / self.fixed.sigma_of(i).powi(2);
        }
        sum
    }

    /// Norm residuals in m/s² of a model in raw units.
    pub(super) fn in_m_s2(&self, model: &Model) -> Vec<f64> {
        let values = self.readings.values.iter().enumerate();
        values
            .map(|(i, value)| self.misfit(&model.correct(value), i))
            .collect()
    }
}

/// Whether the directions of gravity in these readings leave some scale, angle or bias undetermined.
///
/// In true coordinates `δf = M f + z`, a pose measures `uᵀδf = |g| Σ M_jk u_j u_k + zᵀu`: the information on the nine
/// parameters depends on directions and noise alone.
pub(super) fn is_weak(
    readings: Readings<'_>,
    fixed: &FixedNoise,
    gravity: f64,
    model: &Model,
) -> bool {
    let mut information = SMatrix::<f64, N_PARAMETERS, N_PARAMETERS>::zeros();
    for (value, sigma) in readings.values.iter().zip(&fixed.sigma) {
        let up = model.correct(value).normalize();
        let row = columns(&up, &up) * (gravity / sigma);
        information += row * row.transpose();
    }
    information
        .cholesky()
        .is_none_or(|factor| factor.inverse().diagonal().max() > UNKNOWN * UNKNOWN)
}

/// Gradient of the residual in m/s² with respect to the solver's parameters, `S_xx S_yx S_yy S_zx S_zy S_zz` and `b`,
/// at a (standardised) reading `u` with `f = S u + b`.
#[must_use]
pub fn residual_gradient(f: &Vector3<f64>, u: &Vector3<f64>) -> SVector<f64, N_PARAMETERS> {
    columns(&(f / f.norm()), u)
}

/// Derivatives of `along · (S u + b)` with respect to the solver's parameters.
fn columns(along: &Vector3<f64>, u: &Vector3<f64>) -> SVector<f64, N_PARAMETERS> {
    let mut slope = SVector::<f64, N_PARAMETERS>::zeros();
    for (k, &(i, j)) in LOWER.iter().enumerate() {
        slope[k] = along[i] * u[j];
    }
    slope.fixed_rows_mut::<3>(6).copy_from(along);
    slope
}
