//! A least-squares problem compressed at one point, its decomposition, and the covariance that it gives.

use nalgebra::{DMatrix, DVector};

/// The least-squares problem at one point, compressed: near it `F = const + ½|R δ + q|²`.
#[derive(Debug, Clone)]
pub struct Linear {
    /// `(k, p)` with `RᵀR = JᵀWJ`.
    pub r_factor: DMatrix<f64>,
    /// `(k)` with `Rᵀq = JᵀWr`.
    pub rhs: DVector<f64>,
    /// F of GN1.
    pub cost: f64,
    /// Number of residuals.
    pub n_residuals: usize,
}

impl Linear {
    /// From whitened residuals and Jacobian: an orthogonal compression when there are more rows than columns.
    #[must_use]
    pub fn from_rows(residuals: DVector<f64>, jacobian: DMatrix<f64>) -> Self {
        let (m, p) = jacobian.shape();
        let cost = 0.5 * residuals.norm_squared();
        if m <= p + 1 {
            return Self {
                r_factor: jacobian,
                rhs: residuals,
                cost,
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
            n_residuals: m,
        }
    }
}

/// Covariance, rank and directions of the parameters, from the Jacobian at the solution.
#[derive(Debug, Clone)]
pub struct Certainty {
    /// `(p, p)` for unit-variance residuals; over the determined directions only when `rank < p`.
    pub covariance: DMatrix<f64>,
    /// Number of directions determined.
    pub rank: usize,
    /// Singular values of the Jacobian with unit columns `(p,)`, largest first.
    pub singular_values: DVector<f64>,
    /// Column `k` is the unit direction, in scaled parameters, of singular value `k`.
    pub directions: DMatrix<f64>,
}

/// SVD of a Jacobian (or its R factor) scaled to unit columns: covariance, rank, weak directions.
#[must_use]
pub fn certainty(r_factor: &DMatrix<f64>, rank_tolerance: f64) -> Certainty {
    let p = r_factor.ncols();
    let scaled = Scaled::new(r_factor, &column_norms(r_factor), &DVector::zeros(0));
    let rank = scaled.rank(rank_tolerance);
    let mut covariance = DMatrix::zeros(p, p);
    for k in 0..rank {
        let direction = scaled.v.column(k).component_div(&scaled.d) / scaled.s[k];
        covariance += &direction * direction.transpose();
    }
    Certainty {
        covariance,
        rank,
        singular_values: scaled.s,
        directions: scaled.v,
    }
}

/// The compressed Jacobian in scaled parameters, decomposed once per linearisation.
pub(super) struct Scaled {
    pub(super) d: DVector<f64>,
    pub(super) s: DVector<f64>,
    v: DMatrix<f64>,
    uq: DVector<f64>,
}

impl Scaled {
    pub(super) fn new(r_factor: &DMatrix<f64>, d: &DVector<f64>, rhs: &DVector<f64>) -> Self {
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
    pub(super) fn step(&self, lambda: f64, rank_tolerance: f64) -> DVector<f64> {
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
pub(super) fn cosine(linear: &Linear) -> f64 {
    let gradient = linear.r_factor.transpose() * &linear.rhs;
    let norms = column_norms(&linear.r_factor);
    let size = (2.0 * linear.cost).sqrt();
    gradient
        .iter()
        .zip(norms.iter())
        .map(|(g, n)| g.abs() / n / size)
        .fold(0.0, f64::max)
}

pub(super) fn column_norms(matrix: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_fn(matrix.ncols(), |j, _| {
        positive_or_one(matrix.column(j).norm())
    })
}

pub(super) fn positive_or_one(value: f64) -> f64 {
    if value > 0.0 { value } else { 1.0 }
}
