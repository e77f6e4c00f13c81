//! Bindings of rotations.

use nalgebra::Matrix3;
use numpy::{
    PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::rows3;
use crate::rotation;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(rotation_from_vector, module)?)?;
    module.add_function(wrap_pyfunction!(vector_from_rotation, module)?)?;
    Ok(())
}

#[pyfunction]
fn rotation_from_vector<'py>(
    py: Python<'py>,
    vectors: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let vectors = rows3("vectors", &vectors)?;
    let n = vectors.len();
    let flat = super::run(py, || {
        Ok(vectors
            .iter()
            .flat_map(|v| rotation::exp(v).transpose().as_slice().to_vec())
            .collect::<Vec<f64>>())
    })?;
    flat.to_pyarray(py).reshape([n, 3, 3])
}

#[pyfunction]
fn vector_from_rotation<'py>(
    py: Python<'py>,
    rotations: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let shape = rotations.shape().to_vec();
    if shape[1] != 3 || shape[2] != 3 {
        return Err(PyValueError::new_err(format!(
            "rotations must have shape (n, 3, 3), got {shape:?}"
        )));
    }
    let owned: Vec<f64> = rotations.as_array().iter().copied().collect();
    let flat = super::run(py, || {
        Ok(owned
            .chunks_exact(9)
            .flat_map(|m| {
                rotation::log(&Matrix3::from_row_slice(m))
                    .as_slice()
                    .to_vec()
            })
            .collect::<Vec<f64>>())
    })?;
    flat.to_pyarray(py).reshape([shape[0], 3])
}
