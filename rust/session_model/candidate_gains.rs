//! Many candidates at a few strengths: the gain in evidence of each, added to a fit with everything else integrated
//! out, from its columns projected orthogonally to the fit's unknowns (docs/model-session.md, 11.19).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::Strengths;
use super::factor::Factor;
use super::fit::{Fit, RIDGE};
use super::hypothesis::{Hypothesis, unweighed};
use super::move_rows::Whitening;
use super::moves::N_MOVE;
use super::rows::{Group, Kind};
use crate::error::{Error, Result};

/// A fit at some strengths: factored normal equations, `Jᵀr`, the matrices from its moves' whitened rows to these
/// strengths, and the rows so transformed.
struct Look {
    factor: Factor,
    side: DMatrix<f64>,
    turned: Vec<DMatrix<f64>>,
    moves: Vec<Group>,
    /// Log-evidence of the fit there, relative to that at the first strengths.
    alone: f64,
}

/// A fit at several strengths.
pub struct CandidateGains<'a> {
    fit: &'a Fit,
    each: Vec<Look>,
}

/// Gain and estimate of a candidate.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Gain in log-evidence over the fit at the first strengths, `(scales, strengths)`; the prior sizes are a scale
    /// times those given.
    pub gain: DMatrix<f64>,
    /// Its parameters at the first strengths and their best scale, one linear step from the fit.
    pub estimate: DVector<f64>,
    /// Their covariance there.
    pub covariance: DMatrix<f64>,
}

impl<'a> CandidateGains<'a> {
    /// # Errors
    /// When nothing determines the session at some of the strengths.
    pub fn of(fit: &'a Fit, strengths: &[Strengths]) -> Result<Self> {
        let hypothesis = Hypothesis::of(fit, &[], &[])?;
        let back: Vec<Whitening> = fit
            .weights
            .white
            .iter()
            .map(unweighed)
            .collect::<Result<_>>()?;
        let alone = hypothesis.at_each(strengths);
        // Other strengths show what may be hidden by the fit's: no move has little weight there.
        let gaussian = Hypothesis::of(fit, &[], &[])?.without_tails();
        let look = |(k, at): (usize, &Strengths)| {
            let hypothesis = if k == 0 { &hypothesis } else { &gaussian };
            let (chain, side) = hypothesis.system(at)?;
            let white = hypothesis
                .whitenings(at)
                .ok_or_else(|| Error::not_determined("a move has no noise"))?;
            let turned: Vec<_> = white
                .iter()
                .zip(&back)
                .map(|(new, old)| new * old)
                .collect();
            let turned: Vec<_> = turned
                .iter()
                .map(|by| DMatrix::from_column_slice(N_MOVE, N_MOVE, by.as_slice()))
                .collect();
            let moves = fit.groups.iter().filter(|group| group.is_move());
            let moves = moves.map(|group| weighed(group, &turned[group.segment]));
            Ok(Look {
                factor: chain.factor(RIDGE, None)?,
                side,
                moves: moves.collect(),
                turned,
                alone: alone[k] - alone[0],
            })
        };
        Ok(Self {
            fit,
            each: strengths
                .iter()
                .enumerate()
                .map(look)
                .collect::<Result<_>>()?,
        })
    }

    /// Scores a candidate by its columns, whitened as the fit's rows are, group after group; its prior sizes are
    /// `sizes` times each scale. Every one of `parts` (indices of columns) is scored as a candidate by itself.
    ///
    /// # Errors
    /// When columns are not finite, or there are no strengths or scales.
    pub fn of_candidates(
        &self,
        columns: &[DMatrix<f64>],
        sizes: &[f64],
        scales: &[f64],
        parts: &[Vec<usize>],
    ) -> Result<Vec<Seen>> {
        let left = self.left(columns, sizes.len());
        let each = parts.iter().map(|part| {
            let of_part: Vec<Left> = left.iter().map(|whole| whole.of(part)).collect();
            let sizes = DVector::from_iterator(part.len(), part.iter().map(|&i| sizes[i]));
            judged(&of_part, &sizes, scales)
        });
        each.collect()
    }

    /// The projected columns of a candidate at each of the strengths.
    fn left(&self, columns: &[DMatrix<f64>], k: usize) -> Vec<Left> {
        let readings = || {
            let pairs = self.fit.groups.iter().zip(columns);
            pairs.filter(|(group, _)| group.kind == Kind::Reading)
        };
        let at_rest = self.sums(k, readings().filter(|(group, _)| !group.is_move()));
        let each = self.each.iter().map(|look| {
            let of_moves: Vec<DMatrix<f64>> = readings()
                .filter(|(group, _)| group.is_move())
                .map(|(group, own)| &look.turned[group.segment] * own)
                .collect();
            let sums = self.sums(k, look.moves.iter().zip(&of_moves));
            let (own, beside) = (at_rest.0.clone() + sums.0, at_rest.1.clone() + sums.1);
            let mut side = DMatrix::zeros(look.side.nrows(), k + 1);
            side.columns_mut(0, k).copy_from(&beside);
            side.column_mut(k).copy_from(&look.side.column(0));
            let imitated = look.factor.inner(&side);
            let normal = own.columns(0, k) - imitated.view((0, 0), (k, k));
            Left {
                alone: look.alone,
                normal: 0.5 * (&normal + normal.transpose()),
                slope: own.column(k) - imitated.view((0, k), (k, 1)).column(0),
            }
        });
        each.collect()
    }

    /// `CᵀC` followed by `Cᵀr`, and `JᵀC`.
    fn sums<'b>(
        &self,
        k: usize,
        rows: impl Iterator<Item = (&'b Group, &'b DMatrix<f64>)>,
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let layout = self.fit.layout();
        let mut own = DMatrix::zeros(k, k + 1);
        let mut beside = DMatrix::zeros(layout.n(), k);
        for (group, columns) in rows {
            own.columns_mut(0, k).gemm_tr(1.0, columns, columns, 1.0);
            own.column_mut(k)
                .gemv_tr(1.0, columns, &group.rows.residual, 1.0);
            group.rows.add_transposed(layout, columns, &mut beside);
        }
        (own, beside)
    }
}

/// Columns projected orthogonally to the unknowns of the fit, at some strengths: their products, and those with the
/// residual.
struct Left {
    alone: f64,
    normal: DMatrix<f64>,
    slope: DVector<f64>,
}

impl Left {
    /// Some of the columns.
    fn of(&self, part: &[usize]) -> Self {
        Self {
            alone: self.alone,
            normal: self.normal.select_rows(part).select_columns(part),
            slope: self.slope.select_rows(part),
        }
    }
}

/// Gain and estimate of columns, for their prior sizes times each scale.
fn judged(left: &[Left], sizes: &DVector<f64>, scales: &[f64]) -> Result<Seen> {
    let k = sizes.len();
    let mut gain = DMatrix::zeros(scales.len(), left.len());
    let mut first: Option<(f64, DVector<f64>, DMatrix<f64>)> = None;
    for (l, one) in left.iter().enumerate() {
        for (s, scale) in scales.iter().enumerate() {
            // In units of the prior sizes: the prior is one, with no term for its width.
            let d = sizes * *scale;
            let inner = DMatrix::from_fn(k, k, |i, j| {
                d[i] * d[j] * one.normal[(i, j)] + f64::from(i == j)
            });
            let slope = one.slope.component_mul(&d);
            let half = Cholesky::new(inner)
                .ok_or_else(|| Error::not_determined("a candidate's columns are not finite"))?;
            let step = half.solve(&slope);
            gain[(s, l)] =
                one.alone + 0.5 * slope.dot(&step) - half.l().diagonal().map(f64::ln).sum();
            if l == 0 && first.as_ref().is_none_or(|(best, ..)| gain[(s, l)] > *best) {
                let scaled = DMatrix::from_diagonal(&d);
                first = Some((
                    gain[(s, l)],
                    -step.component_mul(&d),
                    &scaled * half.inverse() * &scaled,
                ));
            }
        }
    }
    let (_, estimate, covariance) =
        first.ok_or_else(|| Error::bad_input("strengths or scales are missing"))?;
    Ok(Seen {
        gain,
        estimate,
        covariance,
    })
}

/// Rows of a move multiplied by a triangular matrix.
fn weighed(group: &Group, by: &DMatrix<f64>) -> Group {
    let mut group = group.clone();
    group.rows.residual = by * &group.rows.residual;
    group.rows.border = by * &group.rows.border;
    group.rows.here = by * &group.rows.here;
    group.rows.next = by * &group.rows.next;
    group
}
