//! Cross-validation: blocks of rows predicted from the others, by the same factors (docs/model-session.md, 11.15).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::chain::{Chain, Rows};
use super::ends::Ends;
use super::fit::{Fit, gradient};
use super::move_rows::prior_of;
use super::predict::{N_DOMAINS, domain_of};
use crate::error::Result;

/// Ridge of the training rows: the unknowns of the pose left out keep a weak prior, the same for every model compared.
const TRAINING_RIDGE: f64 = 1e-9;
/// Directions of a fold whose predicted variance is above this many noise variances are undetermined by the training
/// rows. Biases that scatter by a thousand times the error of a pose's mean are still predicted, with a large variance:
/// the likelihood of a model that needs so much scatter is lower for it.
const OPEN: f64 = 1e7;

/// Cross-validated prediction of blocks of rows.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// `(folds, domains)` innovation χ².
    pub chi2: Vec<[f64; N_DOMAINS]>,
    /// `(folds)` log-determinant of the predicted covariance, up to a constant of the readings.
    pub log_det: Vec<f64>,
    /// `(domains)` number of directions predicted.
    pub n_rows: [f64; N_DOMAINS],
    /// `(rows)` whitened innovations.
    pub residual: Vec<f64>,
    /// `(rows)` innovations in units of each row's own noise alone.
    pub innovation: Vec<f64>,
}

impl Fit {
    /// Predicts every fold's rows from the others (blocked cross-validation). A fold is a list of groups.
    ///
    /// # Errors
    /// When the remaining rows determine nothing.
    pub fn held_out(&self, folds: &[Vec<usize>]) -> Result<HeldOut> {
        let layout = self.layout();
        let firsts = self.first_rows();
        let side = gradient(layout, &self.groups);
        let ends = Ends::of(&self.chain, &side, TRAINING_RIDGE)?;
        let parts: Vec<Result<FoldPart>> = folds
            .par_iter()
            .map(|fold| self.predicted(fold, &side, &ends))
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

    /// Predicts one fold's rows from the others: only its own poses and the border, the rest eliminated from both ends.
    fn predicted(&self, fold: &[usize], side: &DMatrix<f64>, ends: &Ends) -> Result<FoldPart> {
        let mut groups: Vec<Rows> = fold.iter().map(|&g| self.groups[g].rows.clone()).collect();
        let tails: Vec<f64> = fold
            .iter()
            .map(|&g| self.tail_of(&self.groups[g]))
            .collect();
        let poses = groups.iter().filter_map(|rows| {
            let last = |pose| pose + usize::from(rows.next.ncols() > 0);
            rows.pose.map(|pose| (pose, last(pose)))
        });
        let (first, last) = poses.fold((usize::MAX, 0), |(a, b), (from, to)| {
            (a.min(from), b.max(to))
        });
        let first = first.min(last);
        for pose in groups.iter_mut().filter_map(|rows| rows.pose.as_mut()) {
            *pose -= first;
        }
        let mut train = ends.between(&self.chain, first, last);
        let layout = train.layout;
        train.add_scaled(&Chain::of(layout, &groups), -1.0);
        let factor = train.factor(0.0, Some(&ends.scale_between(layout, first)))?;
        let n: usize = groups.iter().map(Rows::len).sum();
        let mut jacobian_t = DMatrix::zeros(layout.n(), n);
        let mut residual = DVector::zeros(n);
        let mut at = 0;
        let mut own = DMatrix::zeros(layout.n(), 1);
        for (rows, tail) in groups.iter().zip(&tails) {
            let r = rows.len();
            let mut part = DMatrix::zeros(layout.n(), r);
            rows.add_transposed(layout, &DMatrix::identity(r, r), &mut part);
            own += &part * &rows.residual;
            // Predicted are the readings, without the weight that their residuals gave them.
            jacobian_t.columns_mut(at, r).copy_from(&(part / *tail));
            residual
                .rows_mut(at, r)
                .copy_from(&(&rows.residual / *tail));
            at += r;
        }
        // The training optimum is one linear step from that of all rows.
        let others = ends.side_between(side, layout, first, last) - own;
        let solved = factor.solve(&jacobian_t);
        let mut spread = DMatrix::zeros(n, n);
        let mut at = 0;
        for (rows, tail) in groups.iter().zip(&tails) {
            spread
                .rows_mut(at, rows.len())
                .copy_from(&(rows.times(layout, &solved) / *tail));
            at += rows.len();
        }
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
        // Rows are whitened by noise that may differ between models: predictions are compared in the rows' own units.
        let without_tail = |(&g, tail): (&usize, &f64)| {
            let group = &self.groups[g];
            group.log_weight - group.rows.len() as f64 * tail.ln() - prior_of(tail * tail)
        };
        let mut log_det = -2.0 * fold.iter().zip(&tails).map(without_tail).sum::<f64>();
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
    }
}

struct FoldPart {
    whitened: DVector<f64>,
    plain: DVector<f64>,
    share: DVector<f64>,
    log_det: f64,
}
