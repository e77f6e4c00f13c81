//! The likelihood of the strengths with the columns integrated out, and its maximum over non-negative strengths.
//!
//! Minimised is
//!
//! `M(p) = Σ n (ln v + (P − 2 s'C + s'S s)/v) + ln det A`, `A = Σ n S/v`, `s = A⁻¹ Σ n C/v`
//!
//! (a flat prior of the coefficients; docs/noise.md, eq. 15) by scoring: a step is a quadratic programme with the
//! Fisher information, solved exactly on every face of the positive quadrant, and shortened until `M` decreases.

use nalgebra::{DMatrix, DVector};

use super::{Bins, first_guess};
use crate::error::Result;

/// Decrease of the deviance below which a fit has converged.
const ARRIVED: f64 = 1e-7;
/// Most steps; a fit from a neighbour takes three, one from a rough guess about ten.
const MOST_STEPS: usize = 80;

/// Share of the information on a column that is added to it: columns may nearly be the same.
const RIDGE: f64 = 1e-10;

/// A point of the likelihood: strengths of all terms, the deviance there, the columns.
#[derive(Debug, Clone)]
pub struct Point {
    /// Strength of every term, zero for those not in the model.
    pub strength: Vec<f64>,
    /// `M` there.
    pub deviance: f64,
    /// The part `ln det A` of it, without which models with different columns can be compared.
    pub log_determinant: f64,
    /// Most likely coefficients of the columns.
    pub columns: Vec<f64>,
    /// Standard error of the first column's, infinite where no bin depends on it.
    pub sigma_slope: f64,
}

impl Point {
    /// Coefficient of the line, the first column; zero without one.
    #[must_use]
    pub fn slope(&self) -> f64 {
        self.columns.first().copied().unwrap_or(0.0)
    }
}

struct Value {
    v: Vec<f64>,
    deviance: f64,
    log_determinant: f64,
    /// Coefficients of the columns, and their covariance, zero for a column on which no bin depends.
    columns: DVector<f64>,
    covariance: DMatrix<f64>,
}

fn evaluate(bins: &Bins, strength: &[f64]) -> Value {
    let q = bins.cross.len();
    let v = bins.expectation(strength);
    let weight: Vec<f64> = bins.count.iter().zip(&v).map(|(n, v)| n / v).collect();
    let along = |values: &[f64]| -> f64 { weight.iter().zip(values).map(|(w, x)| w * x).sum() };
    let plain: f64 = bins.count.iter().zip(&v).map(|(n, v)| n * v.ln()).sum();
    let cross = DVector::from_fn(q, |i, _| along(&bins.cross[i]));
    let mut square = DMatrix::zeros(q, q);
    for i in 0..q {
        for j in 0..=i {
            square[(i, j)] = along(&bins.square[i * q + j]);
        }
    }
    square.fill_upper_triangle_with_lower_triangle();
    let mut deviance = plain + along(&bins.power);
    let mut log_determinant = 0.0;
    let mut covariance = DMatrix::zeros(q, q);
    let seen: Vec<usize> = (0..q).filter(|&i| square[(i, i)] > 0.0).collect();
    let scale: Vec<f64> = seen.iter().map(|&i| square[(i, i)].sqrt()).collect();
    let scaled = DMatrix::from_fn(seen.len(), seen.len(), |a, b| {
        let ridge = if a == b { RIDGE } else { 0.0 };
        square[(seen[a], seen[b])] / (scale[a] * scale[b]) + ridge
    });
    if let Some(solver) = scaled.cholesky() {
        let sizes: f64 = scale.iter().map(|s| s.ln()).sum();
        log_determinant = 2.0 * (solver.l().diagonal().map(f64::ln).sum() + sizes);
        let inverse = solver.inverse();
        for (a, &i) in seen.iter().enumerate() {
            for (b, &j) in seen.iter().enumerate() {
                covariance[(i, j)] = inverse[(a, b)] / (scale[a] * scale[b]);
            }
        }
    }
    let columns = &covariance * &cross;
    deviance += log_determinant - columns.dot(&cross);
    Value {
        v,
        deviance,
        log_determinant,
        columns,
        covariance,
    }
}

/// Power of every bin beside the columns, with the share of the power that these have absorbed.
fn residual(bins: &Bins, value: &Value) -> Vec<f64> {
    let q = bins.cross.len();
    let mut out = bins.power.clone();
    let mut add = |factor: f64, values: &[f64]| {
        out.iter_mut()
            .zip(values)
            .for_each(|(r, x)| *r += factor * x);
    };
    for i in 0..q {
        add(-2.0 * value.columns[i], &bins.cross[i]);
        for j in 0..=i {
            let product = value.columns[i] * value.columns[j] + value.covariance[(i, j)];
            let times = if i == j { 1.0 } else { 2.0 };
            add(times * product, &bins.square[i * q + j]);
        }
    }
    out
}

/// Half the gradient and half the expected second derivative with respect to the strengths of `free`.
fn derivatives(bins: &Bins, free: &[usize], value: &Value) -> (DVector<f64>, DMatrix<f64>) {
    let m = free.len();
    let mut gradient = DVector::zeros(m);
    let mut matrix = DMatrix::zeros(m, m);
    let residual = residual(bins, value);
    for b in 0..value.v.len() {
        let inverse = value.v[b].recip();
        let weight = 0.5 * bins.count[b] * inverse;
        let pull = weight * (1.0 - residual[b] * inverse);
        for i in 0..m {
            let share = bins.basis[free[i]][b];
            gradient[i] += pull * share;
            for j in 0..=i {
                matrix[(i, j)] += weight * inverse * share * bins.basis[free[j]][b];
            }
        }
    }
    matrix.fill_upper_triangle_with_lower_triangle();
    (gradient, matrix)
}

/// Minimises `½ y'Hy − r'y` over `y ≥ 0`, by trying every face of the quadrant, the interior first.
fn quadratic_programme(matrix: &DMatrix<f64>, pull: &DVector<f64>) -> DVector<f64> {
    let m = pull.len();
    let scale: Vec<f64> = (0..m)
        .map(|i| matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip())
        .collect();
    let mut best = (0.0, DVector::zeros(m));
    for face in (1..1_usize << m).rev() {
        let inside: Vec<usize> = (0..m).filter(|i| face >> i & 1 == 1).collect();
        let k = inside.len();
        let part = DMatrix::from_fn(k, k, |i, j| {
            let (a, b) = (inside[i], inside[j]);
            matrix[(a, b)] * scale[a] * scale[b] + if i == j { 1e-12 } else { 0.0 }
        });
        let right = DVector::from_fn(k, |i, _| pull[inside[i]] * scale[inside[i]]);
        let Some(solver) = part.cholesky() else {
            continue;
        };
        let y = solver.solve(&right);
        if y.iter().any(|&y| y.is_nan() || y <= 0.0) {
            continue;
        }
        let least = -0.5 * y.dot(&right);
        if least < best.0 {
            let mut whole = DVector::zeros(m);
            for (i, &at) in inside.iter().enumerate() {
                whole[at] = y[i] * scale[at];
            }
            best = (least, whole);
        }
        if k == m {
            break;
        }
    }
    best.1
}

/// The most likely strengths of `free`, from `start`; strengths that are not free keep their values.
pub(super) fn fit_from(bins: &Bins, free: &[usize], start: &[f64]) -> Point {
    let mut strength = start.to_vec();
    let mut value = evaluate(bins, &strength);
    for _ in 0..MOST_STEPS {
        if free.is_empty() {
            break;
        }
        let (gradient, matrix) = derivatives(bins, free, &value);
        let here = DVector::from_fn(free.len(), |i, _| strength[free[i]]);
        let target = quadratic_programme(&matrix, &(&matrix * &here - gradient));
        let mut length = 1.0;
        let mut gain = 0.0;
        for _ in 0..40 {
            let mut trial = strength.clone();
            for (i, &k) in free.iter().enumerate() {
                trial[k] = (here[i] + length * (target[i] - here[i])).max(0.0);
            }
            if trial.iter().any(|&p| p > 0.0) {
                let reached = evaluate(bins, &trial);
                if reached.deviance < value.deviance {
                    gain = value.deviance - reached.deviance;
                    (strength, value) = (trial, reached);
                    break;
                }
            }
            length *= 0.5;
        }
        if gain < ARRIVED {
            break;
        }
    }
    Point {
        strength,
        deviance: value.deviance,
        log_determinant: value.log_determinant,
        sigma_slope: match value.covariance.get((0, 0)) {
            Some(&variance) if variance > 0.0 => variance.sqrt(),
            _ => f64::INFINITY,
        },
        columns: value.columns.as_slice().to_vec(),
    }
}

/// The most likely strengths of the terms `free`, the others zero.
///
/// # Errors
/// As [`Bins::check`].
pub fn fit(bins: &Bins, free: &[usize]) -> Result<Point> {
    bins.check().map(|()| best(bins, free))
}

/// The most likely strengths of `free` from a guess of each; strengths that are not free are zero.
pub(super) fn best(bins: &Bins, free: &[usize]) -> Point {
    let mut start = vec![0.0; bins.basis.len()];
    for &k in free {
        start[k] = first_guess(bins, k);
    }
    fit_from(bins, free, &start)
}

/// Standard error of the strength `k`, the others free: the scale of a search along it.
pub(super) fn sigma(bins: &Bins, free: &[usize], k: usize, point: &Point) -> f64 {
    let (_, matrix) = derivatives(bins, free, &evaluate(bins, &point.strength));
    let place = free.iter().position(|&f| f == k);
    let Some(i) = place else { return 0.0 };
    let scaled = DMatrix::from_fn(free.len(), free.len(), |a, b| {
        matrix[(a, b)] / (matrix[(a, a)] * matrix[(b, b)]).sqrt() + if a == b { 1e-12 } else { 0.0 }
    });
    let variance = scaled.try_inverse().map_or(1.0, |inverse| inverse[(i, i)]);
    (variance.max(1.0) / matrix[(i, i)]).sqrt()
}
