//! The norm residual and its analytic Jacobian, row by row or as normal equations.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector3};
use rayon::prelude::*;

use super::{
    ANCHOR, Frame, Model, N_PARAMETERS, Objective, Readings, Settings, UNKNOWN, unpack_standardised,
};
use crate::ellipsoid::Standardisation;
use crate::error::Result;
use crate::gauss_newton::{Linear, Problem};

/// `S` may not shrink its volume below this fraction of the start's: beyond lies the minimum `S = 0, |b| = |g|`.
pub(super) const SMALLEST_VOLUME: f64 = 1e-2;

/// What the noise predicts for each residual at a given model, held fixed while the solver runs.
pub(super) struct Frozen {
    /// Standard error of the residual, m/s².
    pub sigma: Vec<f64>,
    /// Factor on every sigma in the fit: above one where an anchored fit finds more scatter than the noise explains.
    pub widening: f64,
    /// Expected excess of the norm from noise across gravity, `(tr SΣSᵀ - σ²)/2|g|`, m/s².
    pub excess: Vec<f64>,
}

impl Frozen {
    fn charged(&self, i: usize) -> f64 {
        self.sigma[i] * self.widening
    }

    pub(super) fn at(readings: Readings<'_>, settings: &Settings, model: &Model) -> Self {
        let (sigma, excess) = (0..readings.values.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| predicted(readings, settings, model, i))
            .unzip();
        Self {
            sigma,
            widening: 1.0,
            excess,
        }
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
    let across = match settings.objective {
        Objective::Norm => noise.trace() - along,
        Objective::SquaredNorm => noise.trace(),
    };
    // A pose whose noisy axes all lie across gravity still has the noise of the quietest direction, not none.
    let floor = 1e-6 * noise.trace();
    (along.max(floor).sqrt(), across / (2.0 * settings.gravity))
}

/// All that one evaluation needs.
pub(super) struct PoseProblem<'a> {
    pub readings: Readings<'a>,
    pub settings: &'a Settings,
    pub standard: Standardisation,
    pub frozen: &'a Frozen,
    /// `|det S|` of the start, in standardised readings.
    pub volume: f64,
    /// Where the parameters are held, to `ANCHOR` of |g| each, when the poses leave some free.
    pub anchor: Option<DVector<f64>>,
}

impl PoseProblem<'_> {
    /// Whitened residual of reading `i` and its gradient.
    fn row(&self, model: &Model, i: usize) -> (f64, SVector<f64, N_PARAMETERS>) {
        let u = self.standard.apply(&self.readings.values[i]);
        let f = model.correct(&u);
        let residual = self.misfit(&f, i);
        let slope = residual_gradient(&f, &u, self.settings);
        let sigma = self.frozen.charged(i);
        (residual / sigma, slope / sigma)
    }

    fn misfit(&self, f: &Vector3<f64>, i: usize) -> f64 {
        let g = self.settings.gravity;
        let raw = match self.settings.objective {
            Objective::Norm => f.norm() - g,
            Objective::SquaredNorm => (f.norm_squared() - g * g) / (2.0 * g),
        };
        raw - self.frozen.excess[i]
    }

    fn collapses(&self, model: &Model) -> bool {
        model.s.determinant().abs() < SMALLEST_VOLUME * self.volume
    }

    /// Rows of the readings, and of the anchor below them.
    pub(super) fn linearise(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let model = unpack_standardised(x, self.settings.frame);
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

    /// Of the readings, with the sigmas charged.
    pub(super) fn chi2(&self, x: &DVector<f64>) -> f64 {
        let n = self.readings.values.len();
        self.residuals(x).rows(0, n).norm_squared()
    }

    /// Rows of the readings alone.
    pub(super) fn data_jacobian(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let (_, jacobian) = self.linearise(x);
        jacobian.rows(0, self.readings.values.len()).into_owned()
    }

    pub(super) fn residuals(&self, x: &DVector<f64>) -> DVector<f64> {
        let model = unpack_standardised(x, self.settings.frame);
        let n = self.readings.values.len();
        let extra = self.anchor.as_ref().map_or(0, DVector::len);
        let mut residuals = DVector::from_element(n + extra, f64::INFINITY);
        if self.collapses(&model) {
            return residuals;
        }
        for i in 0..n {
            let f = model.correct(&self.standard.apply(&self.readings.values[i]));
            residuals[i] = self.misfit(&f, i) / self.frozen.charged(i);
        }
        if let Some(anchor) = &self.anchor {
            let held = (x - anchor) / (ANCHOR * self.settings.gravity);
            residuals.rows_mut(n, extra).copy_from(&held);
        }
        residuals
    }

    /// `E[Jᵀr]` at the truth: what the noise common to a whitened residual and its own derivative leaves on average.
    ///
    /// With `n` the noise of a reading, `E[∂r/∂S_jk · r] = u_j (Σ Sᵀ u)_k + (P S Σ Sᵀ u)_j a_k/|g|`, `P = I - uuᵀ`, and
    /// for `b` the second term without `a`.
    pub(super) fn noise_in_gradient(&self, x: &DVector<f64>) -> DVector<f64> {
        let model = unpack_standardised(x, self.settings.frame);
        let n = self.readings.values.len();
        let parts: Vec<SVector<f64, N_PARAMETERS>> = (0..n.div_ceil(SHARE))
            .into_par_iter()
            .map(|k| {
                (k * SHARE..((k + 1) * SHARE).min(n))
                    .map(|i| self.noise_in_row(&model, i))
                    .sum()
            })
            .collect();
        let total: SVector<f64, N_PARAMETERS> = parts.iter().sum();
        DVector::from_column_slice(total.as_slice())
    }

    fn noise_in_row(&self, model: &Model, i: usize) -> SVector<f64, N_PARAMETERS> {
        let size = self.standard.size;
        let reading = self.standard.apply(&self.readings.values[i]);
        let f = model.correct(&reading);
        let u = f / f.norm();
        let shared = self.readings.noise_of(i) * (model.s.transpose() * u) / (size * size);
        let spread = model.s * shared;
        let across = (spread - u * u.dot(&spread)) / self.settings.gravity;
        let mut mean = SVector::<f64, N_PARAMETERS>::zeros();
        for (k, &(row, column)) in Frame::ENTRIES.iter().enumerate() {
            mean[k] = u[row] * shared[column] + across[row] * reading[column];
            if self.settings.frame == Frame::Symmetric && row != column {
                mean[k] += u[column] * shared[row] + across[column] * reading[row];
            }
        }
        mean.fixed_rows_mut::<3>(6).copy_from(&across);
        mean / self.frozen.charged(i).powi(2)
    }

    /// Norm residuals in m/s² of a model in raw units.
    pub(super) fn in_m_s2(&self, model: &Model) -> Vec<f64> {
        (0..self.readings.values.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| self.misfit(&model.correct(&self.readings.values[i]), i))
            .collect()
    }
}

/// Whether the directions of gravity in these readings leave some scale, angle or zero unknown.
///
/// In the truth's own coordinates `δf = M f + z`, a pose sees `uᵀδf = |g| Σ M_jk u_j u_k + zᵀu`: the information on the
/// nine numbers depends on directions and noise alone.
pub(super) fn is_weak(readings: Readings<'_>, settings: &Settings, model: &Model) -> bool {
    let n = readings.values.len();
    let parts: Vec<SMatrix<f64, N_PARAMETERS, N_PARAMETERS>> = (0..n.div_ceil(SHARE))
        .into_par_iter()
        .map(|k| {
            let mut part = SMatrix::<f64, N_PARAMETERS, N_PARAMETERS>::zeros();
            for i in k * SHARE..((k + 1) * SHARE).min(n) {
                let f = model.correct(&readings.values[i]);
                let u = f / f.norm();
                let mut row = SVector::<f64, N_PARAMETERS>::zeros();
                for (entry, &(j, k)) in Frame::ENTRIES.iter().enumerate() {
                    row[entry] = u[j] * u[k];
                }
                row.fixed_rows_mut::<3>(6).copy_from(&u);
                let sigma = predicted(readings, settings, model, i).0 / settings.gravity;
                part.ger(sigma.powi(-2), &row, &row, 1.0);
            }
            part
        })
        .collect();
    let information: SMatrix<f64, N_PARAMETERS, N_PARAMETERS> = parts.iter().sum();
    information
        .cholesky()
        .is_none_or(|factor| factor.inverse().diagonal().max() > UNKNOWN * UNKNOWN)
}

/// Gradient of the residual in m/s² with respect to the solver's parameters, `S11 S21 S22 S31 S32 S33` and `b`, at a
/// (standardised) reading `u` with `f = S u + b`.
#[must_use]
pub fn residual_gradient(
    f: &Vector3<f64>,
    u: &Vector3<f64>,
    settings: &Settings,
) -> SVector<f64, N_PARAMETERS> {
    let along = match settings.objective {
        Objective::Norm => f / f.norm(),
        Objective::SquaredNorm => f / settings.gravity,
    };
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

/// Sums over one share of the readings.
#[derive(Clone, Copy)]
struct Sums {
    gram: SMatrix<f64, N_PARAMETERS, N_PARAMETERS>,
    slope: SVector<f64, N_PARAMETERS>,
    cost: f64,
    chi2: f64,
}

impl Sums {
    fn zero() -> Self {
        Self {
            gram: SMatrix::zeros(),
            slope: SVector::zeros(),
            cost: 0.0,
            chi2: 0.0,
        }
    }

    fn plus(self, other: &Self) -> Self {
        Self {
            gram: self.gram + other.gram,
            slope: self.slope + other.slope,
            cost: self.cost + other.cost,
            chi2: self.chi2 + other.chi2,
        }
    }
}

/// Readings per share: shares are summed in order, so that the answer does not depend on the number of threads.
const SHARE: usize = 16_384;

/// The same problem when there are too many readings to keep a row of each.
pub(super) struct SampleProblem<'a, 'b>(pub &'a PoseProblem<'b>);

impl SampleProblem<'_, '_> {
    fn shares(&self, share: impl Fn(std::ops::Range<usize>) -> Sums + Sync) -> Sums {
        let n = self.0.readings.values.len();
        let parts: Vec<Sums> = (0..n.div_ceil(SHARE))
            .into_par_iter()
            .map(|k| share(k * SHARE..((k + 1) * SHARE).min(n)))
            .collect();
        parts.iter().fold(Sums::zero(), Sums::plus)
    }
}

impl Problem for SampleProblem<'_, '_> {
    fn linearise(&self, x: &DVector<f64>) -> Result<Linear> {
        let model = unpack_standardised(x, self.0.settings.frame);
        let sums = self.shares(|range| {
            let mut sums = Sums::zero();
            for i in range {
                let (residual, slope) = self.0.row(&model, i);
                let squared = residual * residual;
                let (value, weight, _) = self.0.settings.loss.rho(squared);
                sums.gram.ger(weight, &slope, &slope, 1.0);
                sums.slope.axpy(weight * residual, &slope, 1.0);
                sums.cost += 0.5 * value;
                sums.chi2 += squared;
            }
            sums
        });
        Ok(Linear::from_normal_equations(
            &DMatrix::from_column_slice(N_PARAMETERS, N_PARAMETERS, sums.gram.as_slice()),
            &DVector::from_column_slice(sums.slope.as_slice()),
            sums.cost,
            sums.chi2,
            self.0.readings.values.len(),
        ))
    }

    fn cost(&self, x: &DVector<f64>) -> Result<f64> {
        let model = unpack_standardised(x, self.0.settings.frame);
        if self.0.collapses(&model) {
            return Ok(f64::INFINITY);
        }
        let sums = self.shares(|range| {
            let mut sums = Sums::zero();
            for i in range {
                let f = model.correct(&self.0.standard.apply(&self.0.readings.values[i]));
                let residual = self.0.misfit(&f, i) / self.0.frozen.charged(i);
                sums.cost += 0.5 * self.0.settings.loss.rho(residual * residual).0;
            }
            sums
        });
        Ok(sums.cost)
    }
}
