//! Maximum likelihood for a sum of noise terms with known spectral shapes, from independent spectral ordinates.
//!
//! An ordinate is a squared coefficient `c²` of expectation `v = Σ_k p_k basis_k` (`p_k ≥ 0`, the squared noise terms),
//! chi-square distributed; neighbouring ones are averaged in bins. Deterministic columns `X`, a straight line in time
//! first, add `X s` to the coefficients themselves; `s` is integrated out with a flat prior.
//!
//! All terms stay in the model, for the most likely strengths ([`fit`]) and for the interval of each ([`invert`]).

use crate::error::{Error, Result};

mod marginal;
mod profile;

pub use marginal::{Point, fit};
pub use profile::{Inversion, LineMixture, Statement, invert};

/// Averages of ordinates over bins, and the contribution of each noise term of unit strength to them.
#[derive(Debug, Clone)]
pub struct Bins {
    /// Ordinates (degrees of freedom) in each bin.
    pub count: Vec<f64>,
    /// Mean of `c²`.
    pub power: Vec<f64>,
    /// For each column the mean of `c x`, `x` its coefficient.
    pub cross: Vec<Vec<f64>>,
    /// For each pair of columns, row by row, the mean of `x x'`.
    pub square: Vec<Vec<f64>>,
    /// For each term the expectation of `c²` at unit strength.
    pub basis: Vec<Vec<f64>>,
}

impl Bins {
    /// Checks that all lengths agree and all values can be expectations.
    ///
    /// # Errors
    /// `BadInput` naming what is wrong.
    pub fn check(&self) -> Result<()> {
        let n = self.count.len();
        let rows = [&self.cross, &self.square, &self.basis];
        if n == 0
            || self.power.len() != n
            || rows.iter().any(|r| r.iter().any(|row| row.len() != n))
            || self.square.len() != self.cross.len().pow(2)
        {
            return Err(Error::bad_input(
                "every spectral bin needs a count, a power and a value of each column and term",
            ));
        }
        if self
            .basis
            .iter()
            .flatten()
            .any(|&v| !(v.is_finite() && v > 0.0))
        {
            return Err(Error::bad_input(
                "every term must have a positive expectation in every bin",
            ));
        }
        if self.power.iter().any(|v| !v.is_finite()) || self.power.iter().all(|&v| v <= 0.0) {
            return Err(Error::not_determined(
                "the spectrum is zero everywhere: the channel does not change",
            ));
        }
        Ok(())
    }

    fn expectation(&self, strength: &[f64]) -> Vec<f64> {
        let mut v = vec![0.0; self.count.len()];
        for (basis, &p) in self.basis.iter().zip(strength) {
            if p > 0.0 {
                v.iter_mut().zip(basis).for_each(|(v, b)| *v += p * b);
            }
        }
        v
    }
}

/// Strength of the term alone below which a tenth of the bins lie.
fn first_guess(bins: &Bins, k: usize) -> f64 {
    let mut ratio: Vec<f64> = bins
        .power
        .iter()
        .zip(&bins.basis[k])
        .map(|(p, b)| p / b)
        .filter(|r| *r > 0.0)
        .collect();
    ratio.sort_unstable_by(f64::total_cmp);
    ratio.get(ratio.len() / 10).copied().unwrap_or(1.0)
}
