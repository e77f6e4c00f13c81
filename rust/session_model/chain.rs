//! Normal equations of a chain of poses with a border of the unknowns that all share: block-tridiagonal, solved in time
//! linear in the number of poses (docs/model-session.md, equations 11.9-11.13).
//!
//! Unknowns are ordered border first, then pose after pose. Poses are eliminated forward, the border is solved in what
//! remains (its Schur complement), and the poses are substituted back.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::blocks::{add_gram, add_product, forward, mirror, solve};
use super::factor::Factor;
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
    /// Rows whose derivatives are zero so far.
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

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.residual.is_empty()
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

    /// `J x` of one step `x` `(n)`.
    #[must_use]
    pub fn image(&self, layout: Layout, x: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(self.len());
        if self.border.ncols() > 0 {
            out.gemv(1.0, &self.border, &x.rows(0, layout.border), 1.0);
        }
        if let Some(pose) = self.pose {
            out.gemv(1.0, &self.here, &x.rows(layout.at(pose), layout.pose), 1.0);
            if self.next.ncols() > 0 {
                out.gemv(
                    1.0,
                    &self.next,
                    &x.rows(layout.at(pose + 1), layout.pose),
                    1.0,
                );
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
    pub(super) corner: DMatrix<f64>,
    pub(super) border: Vec<DMatrix<f64>>,
    pub(super) diagonal: Vec<DMatrix<f64>>,
    pub(super) next: Vec<DMatrix<f64>>,
}

impl Chain {
    /// A chain without rows.
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

    /// Normal equations of all these rows.
    pub fn of<'a>(layout: Layout, rows: impl IntoIterator<Item = &'a Rows>) -> Self {
        let mut chain = Self::zeros(layout);
        chain.add_all(rows);
        chain
    }

    /// Normal equations of rows without border derivatives.
    pub fn of_poses<'a>(layout: Layout, rows: impl IntoIterator<Item = &'a Rows>) -> Self {
        let mut chain = Self::zeros(layout);
        chain.corner = DMatrix::zeros(0, 0);
        chain.border.clear();
        chain.add_all(rows);
        chain
    }

    fn add_all<'a>(&mut self, rows: impl IntoIterator<Item = &'a Rows>) {
        for part in rows {
            self.add(part);
        }
        self.mirror();
    }

    /// Adds rows; of symmetric blocks only the lower triangle.
    fn add(&mut self, rows: &Rows) {
        let has_border = rows.border.ncols() > 0;
        let add_own = |out: &mut DMatrix<f64>, block: &DMatrix<f64>| {
            add_gram(out, 1.0, block.transpose().as_slice(), block.ncols());
        };
        if has_border {
            add_own(&mut self.corner, &rows.border);
        }
        let Some(pose) = rows.pose else { return };
        add_own(&mut self.diagonal[pose], &rows.here);
        if has_border {
            add_product(&mut self.border[pose], 1.0, &rows.here, &rows.border);
        }
        if rows.next.ncols() > 0 {
            add_own(&mut self.diagonal[pose + 1], &rows.next);
            add_product(&mut self.next[pose], 1.0, &rows.here, &rows.next);
            if has_border {
                add_product(&mut self.border[pose + 1], 1.0, &rows.next, &rows.border);
            }
        }
    }

    /// Completes symmetric blocks whose lower triangle was added to.
    pub(super) fn mirror(&mut self) {
        mirror(&mut self.corner);
        self.diagonal.iter_mut().for_each(mirror);
    }

    /// Adds `factor` times another chain of the same layout.
    pub fn add_scaled(&mut self, other: &Self, factor: f64) {
        if other.corner.nrows() > 0 {
            self.corner += &other.corner * factor;
        }
        let pairs = [
            (&mut self.border, &other.border),
            (&mut self.diagonal, &other.diagonal),
            (&mut self.next, &other.next),
        ];
        for (mine, theirs) in pairs {
            for (a, b) in mine.iter_mut().zip(theirs) {
                a.zip_apply(b, |a, b| *a += b * factor);
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
        let scale = scale.cloned().unwrap_or_else(|| lengths(&self.diagonal()));
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
                let along = solve(&diagonal[i - 1], &coupling);
                add_product(&mut block, -1.0, &coupling, &along);
                add_product(&mut edge, -1.0, &along, &border[i - 1]);
                gain.push(along);
            }
            let half = block.cholesky().ok_or_else(indefinite)?;
            add_gram(&mut schur, -1.0, &forward(&half, &edge), layout.border);
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

pub(super) fn indefinite() -> Error {
    Error::not_determined(
        "the normal equations of the session are not positive definite: a noise figure is missing or zero",
    )
}

/// Lengths of columns from the diagonal of `JᵀJ`; a zero column gets length one.
pub(super) fn lengths(diagonal: &DVector<f64>) -> DVector<f64> {
    diagonal.map(|value| {
        let length = value.max(0.0).sqrt();
        if length > 0.0 && length.is_finite() {
            length
        } else {
            1.0
        }
    })
}

pub(super) fn scaled(
    matrix: &DMatrix<f64>,
    left: &DVector<f64>,
    right: &DVector<f64>,
) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        matrix[(i, j)] * left[i] * right[j]
    })
}

pub(super) fn add_ridge(matrix: &mut DMatrix<f64>, ridge: f64) {
    for i in 0..matrix.nrows() {
        matrix[(i, i)] += ridge;
    }
}
