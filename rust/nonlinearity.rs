//! Nonlinear axes of an accelerometer as parameters with a prior, marginalised (docs/model-session.md, 11.12c).

use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, Vector3};

use crate::error::{Error, Result};
use crate::log_sum::log_sum;
use crate::order_statistics::median;
use crate::sensor_model::LOWER;

/// Nonlinearity at 1 g, of |g|: data sheets of consumer accelerometers state 0.1 to 0.5 % of a range of ±2 g or more,
/// of which a parabola has a quarter at half the range.
const DATA_SHEET: f64 = 1e-3;
/// Degrees of freedom of the half-t prior of the strength: finite variance, and tails that allow many times the scale.
const TAIL_DOF: f64 = 4.0;
/// Strengths, of |g|, four a decade, from what no pose shows on.
const LEAST_STRENGTH: f64 = 1e-5;
const N_STRENGTHS: i32 = 17;
/// Shapes: quadratic, cubic, and a scale that differs between the directions of an axis.
const N_SHAPES: usize = 3;
/// Bias scatters beside them in a fit of lengths alone: none, then two an octave about the noise of a pose.
const N_SCATTERS: i32 = 18;
/// One coefficient of every shape for every axis.
pub const N_COEFFICIENTS: usize = 3 * N_SHAPES;
/// Prior standard deviation of all coefficients while their rows are collected, of |g|.
pub const COLLECTED: f64 = 1e-2;

/// `(3, N_COEFFICIENTS)` change of a force `x`, both in units of |g|, by each shape of each axis.
///
/// What lengths of gravity in all directions would attribute to S and b is subtracted: those are the best linear
/// approximation over all directions by definition, and only what single poses attribute otherwise is an error.
#[must_use]
pub fn columns(x: &Vector3<f64>) -> SMatrix<f64, 3, N_COEFFICIENTS> {
    let mut out = SMatrix::<f64, 3, N_COEFFICIENTS>::zeros();
    for axis in 0..3 {
        let u = x[axis];
        let along = [
            u * u - 0.6,
            u * u * u - 6.0 / 7.0 * u,
            u * u.abs() - 15.0 / 16.0 * u,
        ];
        for (shape, of_all) in [0.0, 3.0 / 35.0, 1.0 / 16.0].into_iter().enumerate() {
            let mut column = out.column_mut(3 * shape + axis);
            column.copy_from(&(x * of_all));
            column[axis] += along[shape];
        }
    }
    out
}

/// The coefficients beside a fit: their information and its product with their estimate, without prior, and what each
/// shifts some parameters by, `(parameters, N_COEFFICIENTS)`.
pub struct Beside {
    /// Information of the coefficients.
    pub information: DMatrix<f64>,
    /// Its product with their estimate.
    pub slope: DVector<f64>,
    /// Shift of the parameters by each coefficient.
    pub shift: DMatrix<f64>,
}

/// The errors of parameters by a nonlinearity of unknown shape and strength.
pub struct Marginal {
    /// Log-evidence against none.
    pub gain: f64,
    /// The same of each shape.
    pub of_shapes: [f64; N_SHAPES],
    /// Mean error.
    pub mean: DVector<f64>,
    /// Second moment of the errors.
    pub second: DMatrix<f64>,
}

impl Beside {
    /// Integrates over shapes, strengths and coefficients.
    ///
    /// # Errors
    /// When the information is not finite.
    pub fn marginal(&self) -> Result<Marginal> {
        let n = self.shift.nrows();
        let mut each = Vec::with_capacity(N_SHAPES * N_STRENGTHS as usize);
        for shape in 0..N_SHAPES {
            let first = 3 * shape;
            let information = self.information.view((first, first), (3, 3));
            let slope = self.slope.rows(first, 3);
            for (strength, prior) in strengths() {
                let inner = DMatrix::identity(3, 3) + information * (strength * strength);
                let half = Cholesky::new(inner)
                    .ok_or_else(|| Error::not_determined("a nonlinearity is not finite"))?;
                let variance = half.inverse() * (strength * strength);
                let mean = &variance * slope;
                let log_det: f64 = half.l_dirty().diagonal().map(f64::ln).sum();
                each.push((
                    prior + 0.5 * slope.dot(&mean) - log_det,
                    first,
                    mean,
                    variance,
                ));
            }
        }
        let mut out = Marginal {
            gain: log_sum(each.iter().map(|one| one.0)),
            of_shapes: [0.0; N_SHAPES],
            mean: DVector::zeros(n),
            second: DMatrix::zeros(n, n),
        };
        for shape in 0..N_SHAPES {
            let (mut mean, mut second) = (DVector::zeros(3), DMatrix::zeros(3, 3));
            let mut share = 0.0;
            for (gain, _, at, variance) in each.iter().filter(|one| one.1 == 3 * shape) {
                let weight = (gain - out.gain).exp();
                share += weight;
                mean += at * weight;
                second += (variance + at * at.transpose()) * weight;
            }
            out.of_shapes[shape] = out.gain + (share * N_SHAPES as f64).ln();
            let shift = self.shift.columns(3 * shape, 3);
            out.mean += shift * mean;
            out.second += shift * second * shift.transpose();
        }
        Ok(out)
    }
}

/// Strengths and the logarithm of their prior probabilities, which sum to one over all shapes.
fn strengths() -> Vec<(f64, f64)> {
    let density = |strength: f64| {
        let tail = (strength / DATA_SHEET).powi(2) / TAIL_DOF;
        strength.ln() - 0.5 * (TAIL_DOF + 1.0) * tail.ln_1p()
    };
    let all = (0..N_STRENGTHS).map(|i| LEAST_STRENGTH * 10f64.powf(f64::from(i) / 4.0));
    let total: f64 = all.clone().map(|one| density(one).exp()).sum();
    all.map(|one| (one, density(one) - (total * N_SHAPES as f64).ln()))
        .collect()
}

/// Errors of a fit of lengths of gravity: of the lower triangle of S, relative, row by row, and of b in units of |g|.
pub struct OfLengths {
    /// Second moment `(9, 9)`.
    pub second: DMatrix<f64>,
    /// Log-odds of each shape of nonlinear axes against none.
    pub log_odds: [f64; N_SHAPES],
    /// Mean `(9)` beside nonlinear axes.
    pub mean: DVector<f64>,
}

/// Errors of a fit of lengths of gravity from unit verticals, residuals of the lengths and their noise, by |g|.
/// Biases may scatter from pose to pose by any amount, axes be nonlinear beside each (11.12b, 11.12c); `prior` is the
/// standard deviation of the parameters beforehand, if any.
///
/// # Errors
/// When the poses do not determine nine parameters.
pub fn of_lengths(
    up: &[Vector3<f64>],
    residual: &[f64],
    sigma: &[f64],
    prior: Option<f64>,
) -> Result<OfLengths> {
    let design = DMatrix::from_fn(up.len(), 9, |i, c| match LOWER.get(c) {
        Some(&(j, k)) => up[i][j] * up[i][k],
        None => up[i][c - LOWER.len()],
    });
    let bends = DMatrix::from_fn(up.len(), N_COEFFICIENTS, |i, c| {
        up[i].dot(&columns(&up[i]).column(c))
    });
    let residual = DVector::from_column_slice(residual);
    let usual = median(&mut sigma.to_vec());
    let known = prior.map_or(0.0, |sigma| sigma.powi(-2));
    let mut at_fit = None;
    let (mut found, mut plain) = (Vec::new(), Vec::new());
    for i in 0..N_SCATTERS {
        let scatter = match i {
            0 => 0.0,
            _ => usual * 2f64.powf(0.5 * f64::from(i) - 2.5),
        };
        let white =
            DVector::from_iterator(sigma.len(), sigma.iter().map(|s| s.hypot(scatter).recip()));
        let by = |of: &DMatrix<f64>| {
            DMatrix::from_fn(of.nrows(), of.ncols(), |r, c| of[(r, c)] * white[r])
        };
        let (x, b, r) = (by(&design), by(&bends), residual.component_mul(&white));
        let half = Cholesky::new(x.tr_mul(&x) + DMatrix::identity(9, 9) * known)
            .ok_or_else(|| Error::not_determined("the poses do not determine nine parameters"))?;
        // At the noise of an anchored fit this is balanced by the prior.
        let pull = x.tr_mul(&r);
        let balanced = at_fit.get_or_insert_with(|| &pull * f64::from(u8::from(prior.is_some())));
        let pull = &pull - &*balanced;
        let step = half.solve(&pull);
        let shift = -half.solve(&x.tr_mul(&b));
        let left = &b + &x * &shift;
        let beside = Beside {
            information: b.tr_mul(&left),
            slope: b.tr_mul(&(&r - &x * &step)),
            shift,
        };
        let log_det: f64 = half.l_dirty().diagonal().map(f64::ln).sum();
        let beforehand = if i == 0 {
            0.0
        } else {
            -f64::from(N_SCATTERS - 1).ln()
        };
        let explained = step.dot(&pull);
        let alone = white.map(f64::ln).sum() - log_det - 0.5 * (r.norm_squared() - explained);
        let with_bends = beside.marginal()?;
        let cross = &step * with_bends.mean.transpose();
        let second = half.inverse()
            + &step * step.transpose()
            + &cross
            + cross.transpose()
            + &with_bends.second;
        plain.push(beforehand + alone);
        found.push((beforehand + alone + with_bends.gain, second, with_bends));
    }
    let log_odds = std::array::from_fn(|shape| {
        let each = plain.iter().zip(&found);
        let beside = each.map(|(alone, (_, _, bends))| alone + bends.of_shapes[shape]);
        log_sum(beside) - log_sum(plain.iter().copied())
    });
    let whole = log_sum(found.iter().map(|one| one.0));
    let each = found.iter();
    let mean = each
        .map(|(log, _, bends)| &bends.mean * (log - whole).exp())
        .sum();
    let seconds: Vec<_> = found
        .into_iter()
        .map(|(log, second, _)| (log, second))
        .collect();
    Ok(OfLengths {
        second: by_evidence(&seconds),
        log_odds,
        mean,
    })
}

/// Mean of second moments, each with the logarithm of its evidence.
#[must_use]
pub fn by_evidence(found: &[(f64, DMatrix<f64>)]) -> DMatrix<f64> {
    let whole = log_sum(found.iter().map(|one| one.0));
    found
        .iter()
        .map(|(log, second)| second * (log - whole).exp())
        .sum()
}
