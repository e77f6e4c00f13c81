//! Variance of a mean against its length: three terms, fitted to variances at several lengths.

use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

/// Iterations of reweighting by the model.
const ROUNDS: usize = 5;
/// Lower bound of the model variance, as a part of the largest variance; it scales with length as the first term.
const LEAST: f64 = 1e-3;

/// Deviance and terms for one choice of columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terms {
    /// `Σ n (s/v - 1 - ln(s/v))`.
    pub deviance: f64,
    /// Non-negative; zero where not chosen.
    pub terms: [f64; 3],
}

/// Non-negative terms of the chosen columns, fitted to variances `seen` with `n` degrees of freedom each.
///
/// Least squares weighted by the model of the iteration before (five iterations): Fisher scoring for the deviance.
///
/// # Errors
/// `BadInput` when lengths differ, or there are fewer variances than chosen columns.
pub fn terms(design: &[[f64; 3]], seen: &[f64], n: &[f64], chosen: &[usize]) -> Result<Terms> {
    if design.len() != seen.len() || n.len() != seen.len() || seen.len() < chosen.len() {
        return Err(Error::bad_input(
            "mean noise needs a variance for each of its terms",
        ));
    }
    if chosen.iter().any(|&c| c > 2) || chosen.is_empty() {
        return Err(Error::bad_input("the terms of mean noise are 0, 1 and 2"));
    }
    let largest = seen.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least: Vec<f64> = design
        .iter()
        .map(|row| LEAST * largest * row[0] / design[0][0])
        .collect();
    let mut model: Vec<f64> = seen
        .iter()
        .zip(&least)
        .map(|(s, l)| s.max(100.0 * l))
        .collect();
    let mut terms = [0.0; 3];
    for _ in 0..ROUNDS {
        let weight: Vec<f64> = n.iter().zip(&model).map(|(n, m)| n.sqrt() / m).collect();
        terms = non_negative(design, seen, &weight, chosen);
        for ((model, row), least) in model.iter_mut().zip(design).zip(&least) {
            let sum: f64 = row.iter().zip(&terms).map(|(d, t)| d * t).sum();
            *model = sum.max(*least);
        }
    }
    let deviance = seen
        .iter()
        .zip(n)
        .zip(model.iter().zip(&least))
        .map(|((s, n), (m, l))| {
            let ratio = s.max(LEAST * l) / m;
            n * (ratio - 1.0 - ratio.ln())
        })
        .sum();
    Ok(Terms { deviance, terms })
}

/// Non-negative weighted least squares of at most three columns: the best of all sets of columns whose free solution
/// has no negative term. Only one set fulfils the conditions of the optimum, so that the best one is that optimum.
fn non_negative(design: &[[f64; 3]], seen: &[f64], weight: &[f64], chosen: &[usize]) -> [f64; 3] {
    let side = DVector::from_iterator(seen.len(), seen.iter().zip(weight).map(|(s, w)| s * w));
    let mut best = (side.norm_squared(), [0.0; 3]);
    for set in 1..1_usize << chosen.len() {
        let columns: Vec<usize> = (0..chosen.len())
            .filter(|k| set >> k & 1 == 1)
            .map(|k| chosen[k])
            .collect();
        let rows = DMatrix::from_fn(seen.len(), columns.len(), |i, j| {
            design[i][columns[j]] * weight[i]
        });
        let factor = rows.clone().qr();
        let mut turned = side.clone();
        factor.q_tr_mul(&mut turned);
        let Some(solution) = factor
            .unpack_r()
            .solve_upper_triangular(&turned.rows(0, columns.len()).clone_owned())
        else {
            continue;
        };
        if solution.iter().any(|t| t.is_nan() || *t < 0.0) {
            continue;
        }
        let left = (&rows * &solution - &side).norm_squared();
        if left < best.0 {
            best = (left, [0.0; 3]);
            for (column, value) in columns.iter().zip(&solution) {
                best.1[*column] = *value;
            }
        }
    }
    best.1
}
