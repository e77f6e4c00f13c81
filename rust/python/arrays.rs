//! Matrices of the kernels as arrays, and back.

use nalgebra::{DMatrix, Matrix3, Vector3};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray};
use pyo3::prelude::*;

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
