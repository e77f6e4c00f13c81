//! `NumPy` arrays in the form that kernels need, and back: borrowed where they are contiguous, copied otherwise.

use std::borrow::Cow;

use nalgebra::{DMatrix, Matrix3, Vector3};
use numpy::{
    PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The numbers of an `(n, 3)` array, row by row.
pub(super) fn flat3<'a>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, f64>,
) -> PyResult<Cow<'a, [f64]>> {
    if array.shape()[1] != 3 {
        return Err(PyValueError::new_err(format!(
            "{name} must have shape (n, 3), got ({}, {})",
            array.shape()[0],
            array.shape()[1]
        )));
    }
    // `as_slice` also succeeds on a Fortran-ordered array, whose memory runs down the columns.
    Ok(match array.as_slice() {
        Ok(flat) if array.is_c_contiguous() => Cow::Borrowed(flat),
        _ => Cow::Owned(array.as_array().iter().copied().collect()),
    })
}

/// The values of an `(n, c)` array, row by row.
pub(super) fn flat2<'a, T: numpy::Element + Copy>(
    array: &'a PyReadonlyArray2<'_, T>,
) -> Cow<'a, [T]> {
    match array.as_slice() {
        Ok(flat) if array.is_c_contiguous() => Cow::Borrowed(flat),
        _ => Cow::Owned(array.as_array().iter().copied().collect()),
    }
}

/// The same numbers as rows.
pub(super) fn as_rows(flat: &[f64]) -> &[[f64; 3]] {
    flat.as_chunks::<3>().0
}

/// The same numbers as vectors.
pub(super) fn as_vectors(flat: &[f64]) -> &[Vector3<f64>] {
    bytemuck::cast_slice(flat)
}

/// The numbers of an `(n,)` array.
pub(super) fn flat1<'a, T: numpy::Element + Copy>(
    array: &'a PyReadonlyArray1<'_, T>,
) -> Cow<'a, [T]> {
    match array.as_slice() {
        Ok(flat) => Cow::Borrowed(flat),
        Err(_) => Cow::Owned(array.as_array().iter().copied().collect()),
    }
}

/// Owned rows of an `(n, 3)` array of any strides.
pub(super) fn rows3(name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Vector3<f64>>> {
    Ok(as_vectors(&flat3(name, array)?).to_vec())
}

/// Owned 3-vector of a `(3,)` array.
pub(super) fn vector3(name: &str, array: &PyReadonlyArray1<'_, f64>) -> PyResult<Vector3<f64>> {
    let view = array.as_array();
    if view.len() != 3 {
        return Err(PyValueError::new_err(format!(
            "{name} must have shape (3,), got ({},)",
            view.len()
        )));
    }
    Ok(Vector3::new(view[0], view[1], view[2]))
}

/// Owned matrix of a `(3, 3)` array.
pub(super) fn matrix3(name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Matrix3<f64>> {
    if array.shape() != [3, 3] {
        return Err(PyValueError::new_err(format!(
            "{name} must have shape (3, 3), got ({}, {})",
            array.shape()[0],
            array.shape()[1]
        )));
    }
    let view = array.as_array();
    Ok(Matrix3::from_fn(|i, j| view[[i, j]]))
}

/// Owned samples of an `(n,)` array of any stride.
pub(super) fn samples<T: numpy::Element + Copy>(array: &PyReadonlyArray1<'_, T>) -> Vec<T> {
    flat1(array).into_owned()
}

/// Numbers row by row as rows of `n`.
pub(super) fn rows<'py>(
    py: Python<'py>,
    flat: &[f64],
    n: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    flat.to_pyarray(py).reshape([flat.len() / n, n])
}

/// Owned `(3, 3)` matrices of an `(n, 3, 3)` array of any strides.
pub(super) fn matrices3(
    name: &str,
    array: &PyReadonlyArray3<'_, f64>,
) -> PyResult<Vec<Matrix3<f64>>> {
    let shape = array.shape();
    if shape[1] != 3 || shape[2] != 3 {
        return Err(PyValueError::new_err(format!(
            "{name} must have shape (n, 3, 3), got {shape:?}"
        )));
    }
    let flat: Vec<f64> = array.as_array().iter().copied().collect();
    Ok(flat.chunks_exact(9).map(Matrix3::from_row_slice).collect())
}

pub(super) fn matrix<'py>(
    py: Python<'py>,
    value: &DMatrix<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    value
        .transpose()
        .as_slice()
        .to_pyarray(py)
        .reshape([value.nrows(), value.ncols()])
}

pub(super) fn vectors<'py>(
    py: Python<'py>,
    values: &[Vector3<f64>],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = values.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
    flat.to_pyarray(py).reshape([values.len(), 3])
}

pub(super) fn of3<'py>(
    py: Python<'py>,
    value: &Matrix3<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    value.transpose().as_slice().to_pyarray(py).reshape([3, 3])
}

pub(super) fn dmatrix(array: &PyReadonlyArray2<'_, f64>) -> DMatrix<f64> {
    let view = array.as_array();
    DMatrix::from_fn(array.shape()[0], array.shape()[1], |i, j| view[[i, j]])
}

/// Matrices as an `(m, 3, 3)` array.
pub(super) fn stack3(
    py: Python<'_>,
    matrices: impl ExactSizeIterator<Item = Matrix3<f64>>,
) -> PyResult<Bound<'_, PyArray3<f64>>> {
    let m = matrices.len();
    let flat: Vec<f64> = matrices
        .flat_map(|matrix| matrix.transpose().as_slice().to_vec())
        .collect();
    flat.to_pyarray(py).reshape([m, 3, 3])
}
