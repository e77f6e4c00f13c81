//! Rows and motion of a fitted session as arrays.

use nalgebra::DMatrix;
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::python::arrays::{stack3, vectors};
use crate::session_model::Session;
use crate::session_model::fit::Fit;
use crate::session_model::lost_samples::{N_RATE, Share};
use crate::session_model::predict::domain_of;
use crate::session_model::rows::Domain;

pub(super) type Rows<'py> = Bound<'py, PyArray2<f64>>;
pub(super) type Blocks<'py> = Bound<'py, PyArray3<f64>>;
/// Log-evidence, change of the gyro's `S` and its covariance, share after share.
pub(super) type Shares<'py> = (Bound<'py, PyArray1<f64>>, Rows<'py>, Blocks<'py>);

/// `(rows, 4)` domain, segment, channel and process of every row.
pub(super) fn labels<'py>(py: Python<'py>, fit: &Fit) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let mut flat: Vec<i64> = Vec::new();
    for group in &fit.groups {
        for r in 0..group.rows.len() {
            let domain = domain_of(group, r);
            let channel = match domain {
                Domain::Dynamics => r - 2,
                _ => r % 3,
            };
            flat.extend([
                domain as i64,
                i64::try_from(group.segment).unwrap_or(i64::MAX),
                i64::try_from(channel).unwrap_or(i64::MAX),
                group.kind as i64,
            ]);
        }
    }
    let n = flat.len() / 4;
    flat.to_pyarray(py).reshape([n, 4])
}

/// Rate, force, minus gravity propagated by the gyro `(points, 3)`; rotation since the move began `(points, 3, 3)`.
pub(super) type Path<'py> = (Rows<'py>, Rows<'py>, Rows<'py>, Blocks<'py>);

pub(super) fn path<'py>(py: Python<'py>, session: &Session, fit: &Fit) -> PyResult<Path<'py>> {
    let one = session.path(fit);
    Ok((
        vectors(py, &one.rate)?,
        vectors(py, &one.force)?,
        vectors(py, &one.gravity)?,
        stack3(py, one.turned.into_iter())?,
    ))
}

/// `(moves, 5)` residuals of moves in SI and `(moves, 5, 5)` their noise covariance.
pub(super) fn moves<'py>(py: Python<'py>, fit: &Fit) -> PyResult<(Rows<'py>, Blocks<'py>)> {
    let m = fit.passed.len();
    let residual: Vec<f64> = fit
        .passed
        .iter()
        .flat_map(|one| one.carried.residual.as_slice().to_vec())
        .collect();
    let covariance: Vec<f64> = fit
        .move_covariance()
        .iter()
        .flat_map(|cov| cov.as_slice().to_vec())
        .collect();
    Ok((
        residual.to_pyarray(py).reshape([m, 5])?,
        covariance.to_pyarray(py).reshape([m, 5, 5])?,
    ))
}

/// The groups of rows flagged in every fold `(folds, rows)`.
pub(super) fn flagged(fit: &Fit, folds: &PyReadonlyArray2<'_, bool>) -> PyResult<Vec<Vec<usize>>> {
    if folds.shape()[1] != fit.n_rows() {
        return Err(PyValueError::new_err(
            "folds must have one flag for every row",
        ));
    }
    let firsts = fit.first_rows();
    let rows = folds.as_array();
    let groups = rows
        .rows()
        .into_iter()
        .map(|row| (0..firsts.len()).filter(|&g| row[firsts[g]]).collect());
    Ok(groups.collect())
}

/// Rows of `k` columns, block after block, as one array.
pub(super) fn stacked<'py>(
    py: Python<'py>,
    parts: &[DMatrix<f64>],
    k: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = parts
        .iter()
        .flat_map(|part| part.transpose().as_slice().to_vec())
        .collect();
    let n: usize = parts.iter().map(DMatrix::nrows).sum();
    flat.to_pyarray(py).reshape([n, k])
}

/// Every share of lost samples.
pub(super) fn shares_of<'py>(py: Python<'py>, found: &[Share]) -> PyResult<Shares<'py>> {
    let k = found.len();
    let evidence: Vec<f64> = found.iter().map(|one| one.log_evidence).collect();
    let steps = found.iter().flat_map(|one| one.step.as_slice().to_vec());
    let step: Vec<f64> = steps.collect();
    let blocks = found
        .iter()
        .flat_map(|one| one.covariance.as_slice().to_vec());
    let covariance: Vec<f64> = blocks.collect();
    Ok((
        evidence.to_pyarray(py),
        step.to_pyarray(py).reshape([k, N_RATE])?,
        covariance.to_pyarray(py).reshape([k, N_RATE, N_RATE])?,
    ))
}
