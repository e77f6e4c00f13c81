//! Cholesky factor of a symmetric banded matrix: covariances of chained residuals, in time linear in the chain.

use crate::error::{Error, Result};
use nalgebra::DMatrix;

/// A symmetric matrix of which only `|i − j| ≤ width` is not zero; the lower triangle is stored.
#[derive(Debug, Clone)]
pub struct Banded {
    n: usize,
    width: usize,
    // Row i holds columns i − width ..= i.
    rows: Vec<f64>,
}

impl Banded {
    /// The zero matrix.
    #[must_use]
    pub fn zeros(n: usize, width: usize) -> Self {
        let width = width.min(n.saturating_sub(1));
        Self {
            n,
            width,
            rows: vec![0.0; n * (width + 1)],
        }
    }

    fn at(&self, i: usize, j: usize) -> usize {
        i * (self.width + 1) + self.width + j - i
    }

    /// Adds to the element `(i, j)` with `i ≥ j`; outside the band nothing is stored and the sum must be zero.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        debug_assert!(i >= j && i - j <= self.width);
        let at = self.at(i, j);
        self.rows[at] += value;
    }

    /// The element `(i, j)`, either triangle.
    #[must_use]
    pub fn get(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        if i - j > self.width {
            0.0
        } else {
            self.rows[self.at(i, j)]
        }
    }

    /// The lower factor `L`, `L Lᵀ = self`.
    ///
    /// # Errors
    /// When the matrix is not positive definite.
    pub fn cholesky(mut self) -> Result<BandedCholesky> {
        for i in 0..self.n {
            let first = i.saturating_sub(self.width);
            for j in first..=i {
                let mut sum = self.rows[self.at(i, j)];
                for k in first.max(j.saturating_sub(self.width))..j {
                    sum -= self.rows[self.at(i, k)] * self.rows[self.at(j, k)];
                }
                let at = self.at(i, j);
                self.rows[at] = if i > j {
                    sum / self.rows[self.at(j, j)]
                } else if sum > 0.0 {
                    sum.sqrt()
                } else {
                    return Err(Error::not_determined(
                        "the covariance of the residuals is not positive definite: a noise figure is missing or zero",
                    ));
                };
            }
        }
        Ok(BandedCholesky(self))
    }
}

/// `L` of `L Lᵀ`.
#[derive(Debug, Clone)]
pub struct BandedCholesky(Banded);

impl BandedCholesky {
    /// Replaces every column `y` by `L⁻¹ y`.
    pub fn whiten(&self, columns: &mut DMatrix<f64>) {
        let band = &self.0;
        for mut column in columns.column_iter_mut() {
            for i in 0..band.n {
                let mut sum = column[i];
                for j in i.saturating_sub(band.width)..i {
                    sum -= band.rows[band.at(i, j)] * column[j];
                }
                column[i] = sum / band.rows[band.at(i, i)];
            }
        }
    }
}
