//! Normal equations of a chain of poses with a border of what all share: block-tridiagonal, solved in time linear in
//! the number of poses (docs/model-session.md, equations 11.9-11.13).
//!
//! Unknowns are ordered border first, then pose after pose. Poses are eliminated forward, the border is solved in what
//! remains (its Schur complement), and the poses are substituted back.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::error::{Error, Result};

/// Sizes of the unknowns: border, one pose, number of poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Unknowns that all poses share.
    pub border: usize,
    /// Unknowns of one pose.
    pub pose: usize,
    /// Poses.
    pub n_poses: usize,
}

impl Layout {
    /// All unknowns.
    #[must_use]
    pub fn n(self) -> usize {
        self.border + self.pose * self.n_poses
    }

    /// First unknown of a pose.
    #[must_use]
    pub fn at(self, pose: usize) -> usize {
        self.border + self.pose * pose
    }
}

/// Rows that involve the border and one pose, or that pose and the next.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Whitened residuals `(r)`.
    pub residual: DVector<f64>,
    /// `(r, border)`; no columns where the border does not enter.
    pub border: DMatrix<f64>,
    /// The pose, unless the rows belong to the border alone.
    pub pose: Option<usize>,
    /// `(r, pose)` with respect to it.
    pub here: DMatrix<f64>,
    /// `(r, pose)` with respect to the next one; no columns where it does not enter.
    pub next: DMatrix<f64>,
}

impl Rows {
    /// Rows without any derivative yet.
    #[must_use]
    pub fn new(residual: DVector<f64>, layout: Layout, pose: usize) -> Self {
        let r = residual.len();
        Self {
            residual,
            border: DMatrix::zeros(r, layout.border),
            pose: Some(pose),
            here: DMatrix::zeros(r, layout.pose),
            next: DMatrix::zeros(r, 0),
        }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.residual.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.residual.is_empty()
    }

    /// Everything times a factor.
    pub fn scale_mut(&mut self, factor: f64) {
        self.residual *= factor;
        self.border *= factor;
        self.here *= factor;
        self.next *= factor;
    }

    /// `J x` for columns `x` `(n, k)`.
    #[must_use]
    pub fn times(&self, layout: Layout, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.len(), x.ncols());
        if self.border.ncols() > 0 {
            out += &self.border * x.rows(0, layout.border);
        }
        if let Some(pose) = self.pose {
            out += &self.here * x.rows(layout.at(pose), layout.pose);
            if self.next.ncols() > 0 {
                out += &self.next * x.rows(layout.at(pose + 1), layout.pose);
            }
        }
        out
    }

    /// Adds `Jᵀ y` for `y` `(r, k)`.
    pub fn add_transposed(&self, layout: Layout, y: &DMatrix<f64>, out: &mut DMatrix<f64>) {
        if self.border.ncols() > 0 {
            let mut part = out.rows_mut(0, layout.border);
            part.gemm_tr(1.0, &self.border, y, 1.0);
        }
        if let Some(pose) = self.pose {
            let mut part = out.rows_mut(layout.at(pose), layout.pose);
            part.gemm_tr(1.0, &self.here, y, 1.0);
            if self.next.ncols() > 0 {
                let mut part = out.rows_mut(layout.at(pose + 1), layout.pose);
                part.gemm_tr(1.0, &self.next, y, 1.0);
            }
        }
    }
}

/// `JᵀJ` in blocks.
#[derive(Debug, Clone)]
pub struct Chain {
    /// Sizes.
    pub layout: Layout,
    corner: DMatrix<f64>,
    border: Vec<DMatrix<f64>>,
    diagonal: Vec<DMatrix<f64>>,
    next: Vec<DMatrix<f64>>,
}

impl Chain {
    /// No rows yet.
    #[must_use]
    pub fn zeros(layout: Layout) -> Self {
        let Layout {
            border,
            pose,
            n_poses,
        } = layout;
        Self {
            layout,
            corner: DMatrix::zeros(border, border),
            border: vec![DMatrix::zeros(pose, border); n_poses],
            diagonal: vec![DMatrix::zeros(pose, pose); n_poses],
            next: vec![DMatrix::zeros(pose, pose); n_poses.saturating_sub(1)],
        }
    }

    /// Of all these rows.
    pub fn of<'a>(layout: Layout, rows: impl IntoIterator<Item = &'a Rows>) -> Self {
        let mut chain = Self::zeros(layout);
        for part in rows {
            chain.add(part);
        }
        chain
    }

    fn add(&mut self, rows: &Rows) {
        let has_border = rows.border.ncols() > 0;
        if has_border {
            self.corner.gemm_tr(1.0, &rows.border, &rows.border, 1.0);
        }
        let Some(pose) = rows.pose else { return };
        self.diagonal[pose].gemm_tr(1.0, &rows.here, &rows.here, 1.0);
        if has_border {
            self.border[pose].gemm_tr(1.0, &rows.here, &rows.border, 1.0);
        }
        if rows.next.ncols() > 0 {
            self.diagonal[pose + 1].gemm_tr(1.0, &rows.next, &rows.next, 1.0);
            self.next[pose].gemm_tr(1.0, &rows.here, &rows.next, 1.0);
            if has_border {
                self.border[pose + 1].gemm_tr(1.0, &rows.next, &rows.border, 1.0);
            }
        }
    }

    /// Adds `factor` times another chain of the same layout.
    pub fn add_scaled(&mut self, other: &Self, factor: f64) {
        self.corner += &other.corner * factor;
        let pairs = [
            (&mut self.border, &other.border),
            (&mut self.diagonal, &other.diagonal),
            (&mut self.next, &other.next),
        ];
        for (mine, theirs) in pairs {
            for (a, b) in mine.iter_mut().zip(theirs) {
                *a += b * factor;
            }
        }
    }

    /// `diag(JᵀJ)` `(n)`.
    #[must_use]
    pub fn diagonal(&self) -> DVector<f64> {
        let mut out = DVector::zeros(self.layout.n());
        out.rows_mut(0, self.layout.border)
            .copy_from(&self.corner.diagonal());
        for (i, block) in self.diagonal.iter().enumerate() {
            out.rows_mut(self.layout.at(i), self.layout.pose)
                .copy_from(&block.diagonal());
        }
        out
    }

    /// Factors `D⁻¹ JᵀJ D⁻¹ + ridge`, `D` the lengths of the columns, or those given.
    ///
    /// # Errors
    /// When the matrix is not positive definite.
    pub fn factor(&self, ridge: f64, scale: Option<&DVector<f64>>) -> Result<Factor> {
        let layout = self.layout;
        let scale = scale.cloned().unwrap_or_else(|| {
            self.diagonal().map(|value| {
                let length = value.max(0.0).sqrt();
                if length > 0.0 && length.is_finite() {
                    length
                } else {
                    1.0
                }
            })
        });
        let d_border = scale.rows(0, layout.border).map(f64::recip);
        let mut schur = scaled(&self.corner, &d_border, &d_border);
        add_ridge(&mut schur, ridge);
        let mut diagonal: Vec<Cholesky<f64, Dyn>> = Vec::with_capacity(layout.n_poses);
        let mut border: Vec<DMatrix<f64>> = Vec::with_capacity(layout.n_poses);
        let mut gain: Vec<DMatrix<f64>> = Vec::with_capacity(layout.n_poses);
        for i in 0..layout.n_poses {
            let d = scale.rows(layout.at(i), layout.pose).map(f64::recip);
            let mut block = scaled(&self.diagonal[i], &d, &d);
            add_ridge(&mut block, ridge);
            let mut edge = scaled(&self.border[i], &d, &d_border);
            if i > 0 {
                let before = scale.rows(layout.at(i - 1), layout.pose).map(f64::recip);
                let coupling = scaled(&self.next[i - 1], &before, &d);
                // W = D⁻¹E of the pose before.
                let along = diagonal[i - 1].solve(&coupling);
                block.gemm_tr(-1.0, &coupling, &along, 1.0);
                edge.gemm_tr(-1.0, &along, &border[i - 1], 1.0);
                gain.push(along);
            }
            let half = block.cholesky().ok_or_else(|| {
                Error::not_determined(
                    "the normal equations of the session are not positive definite: a noise figure is missing or zero",
                )
            })?;
            let inner = half.solve(&edge);
            schur.gemm_tr(-1.0, &edge, &inner, 1.0);
            diagonal.push(half);
            border.push(edge);
        }
        let corner = if layout.border > 0 {
            schur
                .cholesky()
                .ok_or_else(|| Error::not_determined("the session leaves its model undetermined"))?
        } else {
            DMatrix::identity(0, 0)
                .cholesky()
                .ok_or_else(|| Error::bad_input("a chain without a border could not be factored"))?
        };
        Ok(Factor {
            layout,
            scale,
            corner,
            border,
            diagonal,
            gain,
        })
    }
}

fn scaled(matrix: &DMatrix<f64>, left: &DVector<f64>, right: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        matrix[(i, j)] * left[i] * right[j]
    })
}

fn add_ridge(matrix: &mut DMatrix<f64>, ridge: f64) {
    for i in 0..matrix.nrows() {
        matrix[(i, i)] += ridge;
    }
}

/// A factored chain.
#[derive(Debug, Clone)]
pub struct Factor {
    layout: Layout,
    scale: DVector<f64>,
    corner: Cholesky<f64, Dyn>,
    /// Border rows of every pose after elimination of the poses before.
    border: Vec<DMatrix<f64>>,
    diagonal: Vec<Cholesky<f64, Dyn>>,
    /// `W_i = D_i⁻¹ E_i`.
    gain: Vec<DMatrix<f64>>,
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

    fn solve_scaled(&self, x: &mut DMatrix<f64>, n_border: usize) {
        let layout = self.layout;
        let mut corner = x.rows(0, n_border).into_owned();
        let mut parts: Vec<DMatrix<f64>> = Vec::with_capacity(layout.n_poses);
        for i in 0..layout.n_poses {
            let mut y = x.rows(layout.at(i), layout.pose).into_owned();
            if i > 0 {
                y.gemm_tr(-1.0, &self.gain[i - 1], &parts[i - 1], 1.0);
            }
            parts.push(y);
        }
        // Forward parts hold y_i; the border loses Bᵢᵀ Dᵢ⁻¹ yᵢ.
        let solved: Vec<DMatrix<f64>> = parts
            .iter()
            .zip(&self.diagonal)
            .map(|(y, half)| half.solve(y))
            .collect();
        for (edge, z) in self.border.iter().zip(&solved) {
            corner.gemm_tr(-1.0, edge, z, 1.0);
        }
        if n_border > 0 {
            self.corner.solve_mut(&mut corner);
            x.rows_mut(0, n_border).copy_from(&corner);
        }
        let mut after: Option<DMatrix<f64>> = None;
        for i in (0..layout.n_poses).rev() {
            let mut z = solved[i].clone();
            if n_border > 0 {
                z -= self.diagonal[i].solve(&(&self.border[i] * &corner));
            }
            if let Some(next) = &after {
                z -= &self.gain[i] * next;
            }
            x.rows_mut(layout.at(i), layout.pose).copy_from(&z);
            after = Some(z);
        }
    }

    /// `ln det JᵀJ` over the poses alone: the border is held.
    #[must_use]
    pub fn log_det_poses(&self) -> f64 {
        let inner: f64 = self.diagonal.iter().map(log_det).sum();
        inner + 2.0 * sum_ln(&self.scale.as_slice()[self.layout.border..])
    }

    /// `ln det JᵀJ` over everything.
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
            let mut x = self.diagonal[i].solve(&self.border[i]);
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

/// Covariances that one backward pass gives.
#[derive(Debug, Clone)]
pub struct Marginals {
    layout: Layout,
    /// Of the border.
    pub corner: DMatrix<f64>,
    /// Of every pose (rows) with the border (columns).
    pub border: Vec<DMatrix<f64>>,
    /// Of every pose.
    pub own: Vec<DMatrix<f64>>,
    /// Of every pose (rows) with the next (columns).
    pub next: Vec<DMatrix<f64>>,
}

impl Marginals {
    /// `diag(J C Jᵀ)` of some rows: the share of each that the fit used up.
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
