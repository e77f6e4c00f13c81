//! Arrays of `NumPy` as the kernels want them: lent where they lie in one piece, copied where they do not.

use std::borrow::Cow;

use nalgebra::Vector3;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
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
