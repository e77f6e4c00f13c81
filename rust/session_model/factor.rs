//! A factored chain: solutions, determinants, and covariances in one backward pass (docs/model-session.md, 11.9-11.13).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::blocks::{add_gram, add_product, forward, mirror, solve};
use super::chain::{Layout, Rows, scaled};

/// A factored chain.
#[derive(Debug, Clone)]
pub struct Factor {
    pub(super) layout: Layout,
    pub(super) scale: DVector<f64>,
    pub(super) corner: Cholesky<f64, Dyn>,
    /// Border rows of every pose after elimination of the poses before.
    pub(super) border: Vec<DMatrix<f64>>,
    pub(super) diagonal: Vec<Cholesky<f64, Dyn>>,
    /// `W_i = D_i⁻¹ E_i`.
    pub(super) gain: Vec<DMatrix<f64>>,
}

impl Factor {
    /// `(JᵀJ)⁻¹ rhs` for columns `(n, k)`.
    #[must_use]
    pub fn solve(&self, rhs: &DMatrix<f64>) -> DMatrix<f64> {
        let layout = self.layout;
        let mut x = rhs.clone();
        for (mut row, d) in x.row_iter_mut().zip(self.scale.iter()) {
            row /= *d;
        }
        self.solve_scaled(&mut x, layout.border);
        for (mut row, d) in x.row_iter_mut().zip(self.scale.iter()) {
            row /= *d;
        }
        x
    }

    /// `sideᵀ (JᵀJ)⁻¹ side` for columns `(n, k)`: a forward pass, through the poses only for those that involve them.
    #[must_use]
    pub fn inner(&self, side: &DMatrix<f64>) -> DMatrix<f64> {
        let layout = self.layout;
        let (nb, k) = (layout.border, side.ncols());
        let mut x = side.clone();
        for mut column in x.column_iter_mut() {
            column.component_div_assign(&self.scale);
        }
        let touches = |c: &usize| x.column(*c).iter().skip(nb).any(|value| *value != 0.0);
        let of_poses: Vec<usize> = (0..k).filter(touches).collect();
        let n_poses = of_poses.len();
        let picked = x.select_columns(&of_poses);
        let mut corner = picked.rows(0, nb).into_owned();
        let mut along = DMatrix::zeros(n_poses, n_poses);
        let mut before: Option<DMatrix<f64>> = None;
        for i in 0..if n_poses > 0 { layout.n_poses } else { 0 } {
            let mut y = picked.rows(layout.at(i), layout.pose).into_owned();
            if let Some(before) = &before {
                add_product(&mut y, -1.0, &self.gain[i - 1], before);
            }
            let z = solve(&self.diagonal[i], &y);
            add_product(&mut corner, -1.0, &self.border[i], &z);
            add_product(&mut along, 1.0, &y, &z);
            before = Some(y);
        }
        let mut edge = x.rows(0, nb).into_owned();
        for (from, to) in of_poses.iter().enumerate() {
            edge.set_column(*to, &corner.column(from));
        }
        let mut out = DMatrix::zeros(k, k);
        add_gram(&mut out, 1.0, &forward(&self.corner, &edge), k);
        for (i, row) in of_poses.iter().enumerate() {
            for (j, column) in of_poses.iter().enumerate() {
                out[(*row, *column)] += 0.5 * (along[(i, j)] + along[(j, i)]);
            }
        }
        mirror(&mut out);
        out
    }

    fn solve_scaled(&self, x: &mut DMatrix<f64>, n_border: usize) {
        let layout = self.layout;
        let mut corner = x.rows(0, n_border).into_owned();
        let mut parts: Vec<DMatrix<f64>> = Vec::with_capacity(layout.n_poses);
        for i in 0..layout.n_poses {
            let mut y = x.rows(layout.at(i), layout.pose).into_owned();
            if i > 0 {
                add_product(&mut y, -1.0, &self.gain[i - 1], &parts[i - 1]);
            }
            parts.push(y);
        }
        // Forward parts are y_i; Bᵢᵀ Dᵢ⁻¹ yᵢ is subtracted from the border.
        let solved: Vec<DMatrix<f64>> = parts
            .iter()
            .zip(&self.diagonal)
            .map(|(y, half)| solve(half, y))
            .collect();
        for (edge, z) in self.border.iter().zip(&solved) {
            add_product(&mut corner, -1.0, edge, z);
        }
        if n_border > 0 {
            self.corner.solve_mut(&mut corner);
            x.rows_mut(0, n_border).copy_from(&corner);
        }
        let mut after: Option<DMatrix<f64>> = None;
        for i in (0..layout.n_poses).rev() {
            let mut z = solved[i].clone();
            if n_border > 0 {
                z -= solve(&self.diagonal[i], &(&self.border[i] * &corner));
            }
            if let Some(next) = &after {
                z -= &self.gain[i] * next;
            }
            x.rows_mut(layout.at(i), layout.pose).copy_from(&z);
            after = Some(z);
        }
    }

    /// `ln det JᵀJ` over the poses alone, for a fixed border.
    #[must_use]
    pub fn log_det_poses(&self) -> f64 {
        let inner: f64 = self.diagonal.iter().map(log_det).sum();
        inner + 2.0 * sum_ln(&self.scale.as_slice()[self.layout.border..])
    }

    /// `ln det JᵀJ` over all unknowns.
    #[must_use]
    pub fn log_det(&self) -> f64 {
        self.log_det_poses()
            + log_det(&self.corner)
            + 2.0 * sum_ln(&self.scale.as_slice()[..self.layout.border])
    }

    /// Covariances of the border, of every pose, and between neighbours, in one backward pass.
    #[must_use]
    pub fn marginals(&self) -> Marginals {
        let layout = self.layout;
        let corner = self.corner.inverse();
        // Response of the poses to the border: X = K⁻¹B.
        let mut response: Vec<DMatrix<f64>> = vec![DMatrix::zeros(0, 0); layout.n_poses];
        let mut own: Vec<DMatrix<f64>> = vec![DMatrix::zeros(0, 0); layout.n_poses];
        let mut next: Vec<DMatrix<f64>> =
            vec![DMatrix::zeros(0, 0); layout.n_poses.saturating_sub(1)];
        for i in (0..layout.n_poses).rev() {
            let mut x = solve(&self.diagonal[i], &self.border[i]);
            let mut p = self.diagonal[i].inverse();
            if i + 1 < layout.n_poses {
                let gain = &self.gain[i];
                x -= gain * &response[i + 1];
                let across = gain * &own[i + 1];
                p += &across * gain.transpose();
                next[i] = -across;
            }
            response[i] = x;
            own[i] = p;
        }
        let d = |i: usize| self.scale.rows(layout.at(i), layout.pose).map(f64::recip);
        let d_border = self.scale.rows(0, layout.border).map(f64::recip);
        let with_border: Vec<DMatrix<f64>> = response.iter().map(|x| x * &corner).collect();
        for i in 0..layout.n_poses {
            own[i] += &with_border[i] * response[i].transpose();
            own[i] = scaled(&own[i], &d(i), &d(i));
            if i + 1 < layout.n_poses {
                next[i] += &with_border[i] * response[i + 1].transpose();
                next[i] = scaled(&next[i], &d(i), &d(i + 1));
            }
        }
        Marginals {
            layout,
            corner: scaled(&corner, &d_border, &d_border),
            border: (0..layout.n_poses)
                .map(|i| -scaled(&with_border[i], &d(i), &d_border))
                .collect(),
            own,
            next,
        }
    }
}

fn log_det(half: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * half
        .l_dirty()
        .diagonal()
        .iter()
        .map(|v| v.ln())
        .sum::<f64>()
}

fn sum_ln(values: &[f64]) -> f64 {
    values.iter().map(|v| v.ln()).sum()
}

/// Covariances from one backward pass.
#[derive(Debug, Clone)]
pub struct Marginals {
    layout: Layout,
    /// Covariance of the border.
    pub corner: DMatrix<f64>,
    /// Covariance of every pose (rows) with the border (columns).
    pub border: Vec<DMatrix<f64>>,
    /// Covariance of every pose.
    pub own: Vec<DMatrix<f64>>,
    /// Covariance of every pose (rows) with the next (columns).
    pub next: Vec<DMatrix<f64>>,
}

impl Marginals {
    /// Leverage of some rows, `diag(J C Jᵀ)`.
    #[must_use]
    pub fn leverage(&self, rows: &Rows) -> DVector<f64> {
        let mut image = DMatrix::zeros(rows.len(), 0);
        let mut jacobian = DMatrix::zeros(rows.len(), 0);
        let nb = rows.border.ncols();
        match rows.pose {
            None => {
                image = &rows.border * &self.corner;
                jacobian.clone_from(&rows.border);
            }
            Some(i) => {
                let with_next = rows.next.ncols() > 0;
                let n = nb + self.layout.pose * if with_next { 2 } else { 1 };
                let mut cov = DMatrix::zeros(n, n);
                let p = self.layout.pose;
                let parts = if with_next { 2 } else { 1 };
                for k in 0..parts {
                    let at = nb + k * p;
                    cov.view_mut((at, at), (p, p)).copy_from(&self.own[i + k]);
                    if nb > 0 {
                        cov.view_mut((at, 0), (p, nb))
                            .copy_from(&self.border[i + k]);
                        cov.view_mut((0, at), (nb, p))
                            .copy_from(&self.border[i + k].transpose());
                    }
                }
                if nb > 0 {
                    cov.view_mut((0, 0), (nb, nb)).copy_from(&self.corner);
                }
                if with_next {
                    cov.view_mut((nb, nb + p), (p, p)).copy_from(&self.next[i]);
                    cov.view_mut((nb + p, nb), (p, p))
                        .copy_from(&self.next[i].transpose());
                }
                jacobian = jacobian.resize(rows.len(), n, 0.0);
                if nb > 0 {
                    jacobian.columns_mut(0, nb).copy_from(&rows.border);
                }
                jacobian.columns_mut(nb, p).copy_from(&rows.here);
                if with_next {
                    jacobian.columns_mut(nb + p, p).copy_from(&rows.next);
                }
                image = image.resize(rows.len(), n, 0.0);
                image.gemm(1.0, &jacobian, &cov, 0.0);
            }
        }
        DVector::from_fn(rows.len(), |r, _| image.row(r).dot(&jacobian.row(r)))
    }
}
