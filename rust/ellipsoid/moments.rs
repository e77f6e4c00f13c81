//! Sums of products of the quadric's nine columns: all that the linear fits need, for any number of readings.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use nalgebra::{SMatrix, SVector, Vector3};
use rayon::prelude::*;

use super::{Quadric, Standardisation, quadric};
use crate::simd::{Instructions, fma, for_each_instruction_set};

const LANES: usize = 8;
const COLUMNS: usize = 9;
const GRAM: usize = COLUMNS * (COLUMNS + 1) / 2;
type Row = [f64; LANES];
/// Readings per share; shares are summed in order.
const SHARE: usize = 16_384;

/// Smallest pivot, with unit diagonal, at which the sums determine the coefficients to ten digits.
const SMALLEST_PIVOT: f64 = 1e-5;

/// `HᵀH` and `Hᵀ1` of the rows `[x² y² z² 2xy 2xz 2yz 2x 2y 2z]` of standardised readings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moments {
    gram: SMatrix<f64, COLUMNS, COLUMNS>,
    sum: SVector<f64, COLUMNS>,
    n: f64,
}

#[repr(align(64))]
struct Sums {
    gram: [Row; GRAM],
    sum: [Row; COLUMNS],
}

impl Moments {
    pub(crate) fn of(readings: &[Vector3<f64>], standard: &Standardisation) -> Self {
        let instructions = Instructions::detect();
        let share = |values: &[Vector3<f64>]| {
            let mut sums = Sums {
                gram: [[0.0; LANES]; GRAM],
                sum: [[0.0; LANES]; COLUMNS],
            };
            add(instructions, values, standard, &mut sums);
            sums.total(values.len())
        };
        if readings.len() <= SHARE {
            return share(readings);
        }
        let parts: Vec<Self> = readings.par_chunks(SHARE).map(share).collect();
        parts
            .into_iter()
            .reduce(|a, b| Self {
                gram: a.gram + b.gram,
                sum: a.sum + b.sum,
                n: a.n + b.n,
            })
            .unwrap_or_else(|| share(&[]))
    }

    /// Least squares on the quadric's coefficients; `None` where the sums leave too few digits.
    pub(crate) fn quadric(&self) -> Option<Quadric> {
        if self.n < COLUMNS as f64 {
            return None;
        }
        solve(&self.gram, &self.sum).map(|x| quadric(x.as_slice()))
    }

    /// Centre and radius of the sphere through the readings; `None` as above.
    pub(crate) fn sphere(&self) -> Option<(Vector3<f64>, f64)> {
        let mut gram = SMatrix::<f64, 4, 4>::zeros();
        let mut target = SVector::<f64, 4>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                gram[(i, j)] = self.gram[(6 + i, 6 + j)];
                target[i] += self.gram[(6 + i, j)];
            }
            gram[(i, 3)] = self.sum[6 + i];
            gram[(3, i)] = self.sum[6 + i];
            target[3] += self.sum[i];
        }
        gram[(3, 3)] = self.n;
        let x = solve(&gram, &target)?;
        let centre = Vector3::new(x[0], x[1], x[2]);
        let squared = x[3] + centre.norm_squared();
        (squared > 0.0).then(|| (centre, squared.sqrt()))
    }
}

/// `A⁻¹ b` of normal equations that are far from singular.
fn solve<const N: usize>(a: &SMatrix<f64, N, N>, b: &SVector<f64, N>) -> Option<SVector<f64, N>> {
    let scale = SVector::<f64, N>::from_fn(|i, _| a[(i, i)].sqrt());
    let unit = SMatrix::<f64, N, N>::from_fn(|i, j| a[(i, j)] / (scale[i] * scale[j]));
    let factor = unit.cholesky()?;
    let is_sound = (0..N).all(|k| factor.l_dirty()[(k, k)].powi(2) >= SMALLEST_PIVOT);
    is_sound.then(|| factor.solve(&b.component_div(&scale)).component_div(&scale))
}

impl Sums {
    fn total(&self, n: usize) -> Moments {
        let mut gram = SMatrix::zeros();
        let mut entry = 0;
        for i in 0..COLUMNS {
            for j in 0..=i {
                gram[(i, j)] = self.gram[entry].iter().sum();
                gram[(j, i)] = gram[(i, j)];
                entry += 1;
            }
        }
        Moments {
            gram,
            sum: SVector::from_fn(|i, _| self.sum[i].iter().sum()),
            n: n as f64,
        }
    }
}

for_each_instruction_set! {
    fn add(values: &[Vector3<f64>], standard: &Standardisation, sums: &mut Sums) = add_lanes
}

#[inline(always)]
fn add_lanes<const FUSED: bool>(
    values: &[Vector3<f64>],
    standard: &Standardisation,
    sums: &mut Sums,
) {
    let scale = 1.0 / standard.size;
    let (mut u, mut rows) = ([[0.0; LANES]; 3], [[0.0; LANES]; COLUMNS]);
    for values in values.chunks(LANES) {
        // Lanes without a reading hold a row of zeros, which adds nothing.
        let mut weight = [0.0; LANES];
        weight[..values.len()].fill(1.0);
        for l in 0..LANES {
            let a = &values[l.min(values.len() - 1)];
            for c in 0..3 {
                u[c][l] = a[c];
            }
        }
        for l in 0..LANES {
            let x = (u[0][l] - standard.centre[0]) * scale * weight[l];
            let y = (u[1][l] - standard.centre[1]) * scale * weight[l];
            let z = (u[2][l] - standard.centre[2]) * scale * weight[l];
            rows[0][l] = x * x;
            rows[1][l] = y * y;
            rows[2][l] = z * z;
            rows[3][l] = 2.0 * x * y;
            rows[4][l] = 2.0 * x * z;
            rows[5][l] = 2.0 * y * z;
            rows[6][l] = 2.0 * x;
            rows[7][l] = 2.0 * y;
            rows[8][l] = 2.0 * z;
        }
        let mut entry = 0;
        for i in 0..COLUMNS {
            let a = &rows[i];
            for l in 0..LANES {
                sums.sum[i][l] += a[l];
            }
            for b in &rows[..=i] {
                let sum = &mut sums.gram[entry];
                for l in 0..LANES {
                    sum[l] = fma::<FUSED>(a[l], b[l], sum[l]);
                }
                entry += 1;
            }
        }
    }
}
