//! Square-root-free factors `P = U D Uᵀ` of a covariance: Bierman's measurement update, Thornton's time update.
//!
//! Only the first `m` states change with time; the constants after them do not. With `U` upper triangular this order
//! leaves the constants' factor unchanged by the time update, which therefore costs `O(m³ + m n)` instead of `O(n³)`.
//! Source: Bierman, Factorization Methods for Discrete Sequential Estimation (1977), chapters V and VI.

use nalgebra::{DMatrix, DVector};

/// Number of states that is unknown at compile time.
const ANY: usize = 0;

/// Unit upper triangular `U` (by columns) and diagonal `D` of a covariance.
#[derive(Debug, Clone)]
pub struct Factors {
    n: usize,
    /// Column `j` starts at `j n`; the diagonal is one and everything below it zero.
    u: Vec<f64>,
    d: Vec<f64>,
}

impl Factors {
    /// Factors of a positive semidefinite matrix; pivots that rounding made negative count as zero.
    #[must_use]
    pub fn of(covariance: &DMatrix<f64>) -> Self {
        let n = covariance.nrows();
        let mut u = vec![0.0; n * n];
        let mut d = vec![0.0; n];
        for j in (0..n).rev() {
            for i in (0..=j).rev() {
                let mut rest = covariance[(i, j)];
                for k in j + 1..n {
                    rest -= u[k * n + i] * d[k] * u[k * n + j];
                }
                if i == j {
                    // A pivot below the rounding error of its own diagonal is zero.
                    let floor = 4.0 * f64::EPSILON * covariance[(j, j)].abs();
                    d[j] = if rest > floor { rest } else { 0.0 };
                    u[j * n + j] = 1.0;
                } else {
                    u[j * n + i] = if d[j] > 0.0 { rest / d[j] } else { 0.0 };
                }
            }
        }
        Self { n, u, d }
    }

    /// Factors of a diagonal covariance.
    #[must_use]
    pub fn diagonal(variances: &[f64]) -> Self {
        let n = variances.len();
        let mut u = vec![0.0; n * n];
        for j in 0..n {
            u[j * n + j] = 1.0;
        }
        Self {
            n,
            u,
            d: variances.to_vec(),
        }
    }

    /// `U D Uᵀ` of the states from `first` on.
    #[must_use]
    pub fn covariance_from(&self, first: usize) -> DMatrix<f64> {
        let n = self.n;
        DMatrix::from_fn(n - first, n - first, |r, c| {
            let (i, j) = (r + first, c + first);
            (i.max(j)..n)
                .map(|k| self.u[k * n + i] * self.d[k] * self.u[k * n + j])
                .sum()
        })
    }

    /// Variance of one state.
    #[must_use]
    pub fn variance(&self, i: usize) -> f64 {
        let n = self.n;
        (i..n)
            .map(|k| self.u[k * n + i].powi(2) * self.d[k])
            .sum::<f64>()
    }

    /// Variances of the last `K` states.
    #[must_use]
    pub fn last_variances<const K: usize>(&self) -> [f64; K] {
        let n = self.n;
        let mut out = [0.0; K];
        for (c, d) in self.d[n - K..].iter().enumerate() {
            let column = &self.u[(n - K + c) * n + n - K..][..K];
            for (out, u) in out.iter_mut().zip(column) {
                *out += u * u * d;
            }
        }
        out
    }

    /// `hᵀ P h`.
    #[must_use]
    pub fn variance_along(&self, h: &[f64]) -> f64 {
        self.u
            .chunks_exact(self.n.max(1))
            .zip(&self.d)
            .map(|(column, d)| {
                let f: f64 = column.iter().zip(h).map(|(u, h)| u * h).sum();
                f * f * d
            })
            .sum()
    }
}

/// Transition of the moving states over one step: `x ← Φ x + w`, `cov w = G diag(q) Gᵀ`.
#[derive(Debug, Clone)]
pub struct Transition {
    m: usize,
    /// `Φ` by rows.
    phi: Vec<f64>,
    noise: Factors,
}

impl Transition {
    /// From the transition matrix and the covariance of the driving noise.
    #[must_use]
    pub fn new(phi: &DMatrix<f64>, noise: &DMatrix<f64>) -> Self {
        let m = phi.nrows();
        Self {
            m,
            phi: phi.transpose().as_slice().to_vec(),
            noise: Factors::of(noise),
        }
    }

    /// `Φ`.
    #[must_use]
    pub fn phi(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.m, self.m, &self.phi)
    }
}

/// Innovation of one scalar measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted.
    pub value: f64,
    /// Its predicted variance `hᵀ P h + r`.
    pub variance: f64,
}

/// Estimate and factored covariance of a linear system with scalar measurements.
#[derive(Debug, Clone)]
pub struct UdFilter {
    /// Current estimate.
    pub x: Vec<f64>,
    /// Factored covariance of its error.
    pub factors: Factors,
    work: Vec<f64>,
}

impl UdFilter {
    /// Start from an estimate and the factors of its covariance.
    #[must_use]
    pub fn new(x: Vec<f64>, factors: Factors) -> Self {
        let n = x.len();
        Self {
            x,
            factors,
            work: vec![0.0; 2 * n + 2 * n * n + 2 * n],
        }
    }

    /// Number of states.
    #[must_use]
    pub fn n(&self) -> usize {
        self.x.len()
    }

    /// Measure `z = h·x + v`, `var v = r`: Bierman's update. The gain is left in [`Self::gain`].
    ///
    /// Every diagonal element is multiplied by a ratio in `[0, 1]`: the covariance stays positive semidefinite in
    /// finite arithmetic, whatever the ratio of prior to measurement variance.
    pub fn update(&mut self, h: &[f64], z: f64, r: f64) -> Innovation {
        let predicted: f64 = h.iter().zip(&self.x).map(|(h, x)| h * x).sum();
        self.update_with_innovation(h, z - predicted, r)
    }

    /// The same for a given innovation, such as an extended filter's from its non-linear prediction.
    pub fn update_with_innovation(&mut self, h: &[f64], innovation: f64, r: f64) -> Innovation {
        // The constants of an axis after up to four noise states: loop lengths known to the compiler.
        match self.x.len() {
            4 => self.update_of::<4>(h, innovation, r),
            5 => self.update_of::<5>(h, innovation, r),
            6 => self.update_of::<6>(h, innovation, r),
            7 => self.update_of::<7>(h, innovation, r),
            8 => self.update_of::<8>(h, innovation, r),
            _ => self.update_of::<ANY>(h, innovation, r),
        }
    }

    fn update_of<const N: usize>(&mut self, h: &[f64], innovation: f64, r: f64) -> Innovation {
        let n = if N == ANY { self.x.len() } else { N };
        let Factors { u, d, .. } = &mut self.factors;
        let (u, d, h, x) = (&mut u[..n * n], &mut d[..n], &h[..n], &mut self.x[..n]);
        let gain = &mut self.work[..n];
        let mut alpha = r;
        // A number too small to have a finite inverse is divided by instead.
        let inverse_of = |alpha: f64| (alpha >= f64::MIN_POSITIVE).then(|| alpha.recip());
        let over = |value: f64, alpha: f64, inverse: Option<f64>| {
            inverse.map_or(value / alpha, |one| value * one)
        };
        let mut inverse = inverse_of(alpha);
        for j in 0..n {
            let column = &mut u[j * n..j * n + n];
            let f: f64 = column[..j].iter().zip(h).map(|(u, h)| u * h).sum::<f64>() + h[j];
            let v = d[j] * f;
            let (before, inverse_before) = (alpha, inverse);
            alpha += f * v;
            gain[j] = v;
            if v == 0.0 {
                // This direction cannot change: its variance is zero already, or `h` does not measure it.
                continue;
            }
            // Without noise so far (`before == 0`) the gain's earlier entries are all zero and λ multiplies nothing.
            let lambda = if before > 0.0 {
                -over(f, before, inverse_before)
            } else {
                0.0
            };
            inverse = inverse_of(alpha);
            if alpha > 0.0 {
                d[j] *= over(before, alpha, inverse).min(1.0);
            }
            for i in 0..j {
                let old = column[i];
                column[i] = old + lambda * gain[i];
                gain[i] += v * old;
            }
        }
        if alpha > 0.0 {
            for (g, x) in gain.iter_mut().zip(x) {
                *g = over(*g, alpha, inverse);
                *x += *g * innovation;
            }
        } else {
            gain.fill(0.0);
        }
        Innovation {
            value: innovation,
            variance: alpha,
        }
    }

    /// Gain of the last measurement.
    #[must_use]
    pub fn gain(&self) -> &[f64] {
        &self.work[..self.x.len()]
    }

    /// Propagates the first `m` states: Thornton's update by modified weighted Gram-Schmidt.
    pub fn predict(&mut self, step: &Transition) {
        match step.m {
            1 => self.predict_of::<1>(step),
            2 => self.predict_of::<2>(step),
            3 => self.predict_of::<3>(step),
            4 => self.predict_of::<4>(step),
            _ => self.predict_of::<ANY>(step),
        }
    }

    fn predict_of<const M: usize>(&mut self, step: &Transition) {
        let (n, m) = (self.x.len(), if M == ANY { step.m } else { M });
        let Factors { u, d, .. } = &mut self.factors;
        let (rows, rest) = self.work.split_at_mut(2 * m * m);
        let (weights, moved) = rest.split_at_mut(2 * m);
        let width = 2 * m;
        // rows = [Φ U11 | G], weights = [D1 | q]
        let (phi, noise) = (&step.phi[..m * m], &step.noise);
        for i in 0..m {
            let phi = &phi[i * m..(i + 1) * m];
            for j in 0..m {
                rows[i * width + j] = (0..=j).map(|k| phi[k] * u[j * n + k]).sum();
                rows[i * width + m + j] = noise.u[j * m + i];
            }
            weights[i] = d[i];
            weights[m + i] = noise.d[i];
        }
        // U12 ← Φ U12 and x ← Φ x
        for j in m..n {
            for i in 0..m {
                let phi = &phi[i * m..(i + 1) * m];
                moved[i] = phi
                    .iter()
                    .zip(&u[j * n..j * n + m])
                    .map(|(p, u)| p * u)
                    .sum();
            }
            u[j * n..j * n + m].copy_from_slice(&moved[..m]);
        }
        for i in 0..m {
            let phi = &phi[i * m..(i + 1) * m];
            moved[i] = phi.iter().zip(&self.x).map(|(p, x)| p * x).sum();
        }
        self.x[..m].copy_from_slice(&moved[..m]);
        for j in (0..m).rev() {
            let (above, row) = rows.split_at_mut(j * width);
            let row = &mut row[..width];
            let length: f64 = row.iter().zip(&*weights).map(|(r, w)| w * r * r).sum();
            d[j] = length;
            for i in 0..j {
                let other = &mut above[i * width..(i + 1) * width];
                let share = if length > 0.0 {
                    other
                        .iter()
                        .zip(&*row)
                        .zip(&*weights)
                        .map(|((o, r), w)| o * r * w)
                        .sum::<f64>()
                        / length
                } else {
                    0.0
                };
                for (o, r) in other.iter_mut().zip(&*row) {
                    *o -= share * r;
                }
                u[j * n + i] = share;
            }
        }
    }

    /// Current estimate as a vector.
    #[must_use]
    pub fn estimate(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.x)
    }
}
