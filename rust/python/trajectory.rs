//! Attitude through moves across the seam.

use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::prelude::*;

use super::rotation::rows3;
use crate::trajectory;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(attitude_in_moves, module)?)?;
    Ok(())
}

#[pyfunction]
fn attitude_in_moves<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    moves: Vec<(usize, usize)>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let time_s: Vec<f64> = time_s.as_array().iter().copied().collect();
    let rate = rows3("rate", &rate)?;
    let flat = super::run(py, || {
        let attitudes = trajectory::attitude_in_moves(&time_s, &rate, &moves)?;
        Ok(attitudes
            .iter()
            .flat_map(|c| c.transpose().as_slice().to_vec())
            .collect::<Vec<f64>>())
    })?;
    let n = flat.len() / 9;
    flat.to_pyarray(py).reshape([n, 3, 3])
}
