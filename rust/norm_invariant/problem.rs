//! The norm residual and its analytic Jacobian, row by row.

use nalgebra::{DMatrix, DVector, SVector, Vector3};

use super::noise;
use super::parameters::unpack_standardised;
use super::sums::{self, At, WithNoise};
use super::{ANCHOR, Frame, Model, N_PARAMETERS, Parameters, Readings, Settings, UNKNOWN};
use crate::ellipsoid::Standardisation;

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
    fn sigma_of(&self, i: usize) -> f64 {
        self.sigma[i] * self.widening
    }

    /// The readings with their predicted noise.
    pub(super) fn with_noise<'a>(&'a self, readings: Readings<'a>) -> WithNoise<'a> {
        WithNoise {
            values: readings.values,
            sigma: &self.sigma,
            excess: &self.excess,
        }
    }

    pub(super) fn at(readings: Readings<'_>, settings: &Settings, model: &Model) -> Self {
        let n = readings.values.len();
        let mut new = Self {
            sigma: vec![0.0; n],
            widening: 1.0,
            excess: vec![0.0; n],
        };
        new.renew(readings, settings, model);
        new
    }

    /// Recomputes the predictions at another model.
    pub(super) fn renew(&mut self, readings: Readings<'_>, settings: &Settings, model: &Model) {
        let at = At::raw(*model, *settings);
        noise::predict(&readings, &at, &mut self.sigma, &mut self.excess);
    }
}

/// Standard error and expected excess of one residual.
pub(super) fn predicted(
    readings: Readings<'_>,
    settings: &Settings,
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
    (along.max(floor).sqrt(), across / (2.0 * settings.gravity))
}

/// Data of the problem at one set of predictions.
pub(super) struct PoseProblem<'a> {
    pub readings: Readings<'a>,
    pub settings: &'a Settings,
    pub standard: Standardisation,
    pub fixed: &'a FixedNoise,
    /// `|det S|` of the start, in standardised readings.
    pub volume: f64,
    /// Values to which the parameters are tied, to `ANCHOR` of |g| each, when the poses leave some undetermined.
    pub anchor: Option<DVector<f64>>,
}

impl PoseProblem<'_> {
    /// Whitened residual of reading `i` and its gradient.
    fn row(&self, model: &Model, i: usize) -> (f64, SVector<f64, N_PARAMETERS>) {
        let u = self.standard.apply(&self.readings.values[i]);
        let f = model.correct(&u);
        let residual = self.misfit(&f, i);
        let slope = residual_gradient(&f, &u, self.settings);
        let sigma = self.fixed.sigma_of(i);
        (residual / sigma, slope / sigma)
    }

    fn misfit(&self, f: &Vector3<f64>, i: usize) -> f64 {
        f.norm() - self.settings.gravity - self.fixed.excess[i]
    }

    fn collapses(&self, model: &Model) -> bool {
        model.s.determinant().abs() < SMALLEST_VOLUME * self.volume
    }

    /// Rows of the readings, and of the anchor below them.
    pub(super) fn linearise(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let model = unpack_standardised(x.as_slice(), self.settings.frame);
        let n = self.readings.values.len();
        let extra = self.anchor.as_ref().map_or(0, DVector::len);
        let mut residuals = DVector::zeros(n + extra);
        let mut jacobian = DMatrix::zeros(n + extra, N_PARAMETERS);
        for i in 0..n {
            let (residual, slope) = self.row(&model, i);
            residuals[i] = residual;
            jacobian.row_mut(i).tr_copy_from(&slope);
        }
        if let Some(anchor) = &self.anchor {
            let width = ANCHOR * self.settings.gravity;
            residuals
                .rows_mut(n, extra)
                .copy_from(&((x - anchor) / width));
            jacobian
                .view_mut((n, 0), (extra, N_PARAMETERS))
                .fill_diagonal(1.0 / width);
        }
        (residuals, jacobian)
    }

    /// χ² of the readings, with the widened sigmas.
    pub(super) fn chi2(&self, x: &DVector<f64>) -> f64 {
        let n = self.readings.values.len();
        self.residuals(x).rows(0, n).norm_squared()
    }

    /// Jacobian rows of the readings alone.
    pub(super) fn data_jacobian(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let (_, jacobian) = self.linearise(x);
        jacobian.rows(0, self.readings.values.len()).into_owned()
    }

    pub(super) fn residuals(&self, x: &DVector<f64>) -> DVector<f64> {
        let model = unpack_standardised(x.as_slice(), self.settings.frame);
        let n = self.readings.values.len();
        let extra = self.anchor.as_ref().map_or(0, DVector::len);
        let mut residuals = DVector::from_element(n + extra, f64::INFINITY);
        if self.collapses(&model) {
            return residuals;
        }
        for i in 0..n {
            let f = model.correct(&self.standard.apply(&self.readings.values[i]));
            residuals[i] = self.misfit(&f, i) / self.fixed.sigma_of(i);
        }
        if let Some(anchor) = &self.anchor {
            let held = (x - anchor) / (ANCHOR * self.settings.gravity);
            residuals.rows_mut(n, extra).copy_from(&held);
        }
        residuals
    }

    /// The readings with their predicted noise.
    pub(super) fn with_noise(&self) -> WithNoise<'_> {
        self.fixed.with_noise(self.readings)
    }

    /// `E[Jᵀr]` at the truth, see [`noise::noise_in_gradient`].
    pub(super) fn noise_in_gradient(&self, x: &[f64]) -> Parameters {
        let at = At {
            model: unpack_standardised(x, self.settings.frame),
            standard: self.standard,
            settings: *self.settings,
            widening: self.fixed.widening,
        };
        noise::noise_in_gradient(&self.readings, &self.fixed.sigma, &at)
    }

    /// Norm residuals in m/s² of a model in raw units.
    pub(super) fn in_m_s2(&self, model: &Model) -> Vec<f64> {
        sums::misfits(&self.with_noise(), &At::raw(*model, *self.settings))
    }
}

/// Whether the directions of gravity in these readings leave some scale, angle or bias undetermined.
///
/// In true coordinates `δf = M f + z`, a pose measures `uᵀδf = |g| Σ M_jk u_j u_k + zᵀu`: the information on the nine
/// parameters depends on directions and noise alone.
pub(super) fn is_weak(with_noise: &WithNoise<'_>, settings: &Settings, model: &Model) -> bool {
    let information = sums::information(with_noise, &At::raw(*model, *settings));
    information
        .cholesky()
        .is_none_or(|factor| factor.inverse().diagonal().max() > UNKNOWN * UNKNOWN)
}

/// Gradient of the residual in m/s² with respect to the solver's parameters, `S_xx S_yx S_yy S_zx S_zy S_zz` and `b`,
/// at a (standardised) reading `u` with `f = S u + b`.
#[must_use]
pub fn residual_gradient(
    f: &Vector3<f64>,
    u: &Vector3<f64>,
    settings: &Settings,
) -> SVector<f64, N_PARAMETERS> {
    let along = f / f.norm();
    let mut slope = SVector::<f64, N_PARAMETERS>::zeros();
    for (k, &(i, j)) in Frame::ENTRIES.iter().enumerate() {
        slope[k] = along[i] * u[j];
        if settings.frame == Frame::Symmetric && i != j {
            slope[k] += along[j] * u[i];
        }
    }
    slope.fixed_rows_mut::<3>(6).copy_from(&along);
    slope
}
