//! Binding of block statistics.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

use super::arrays::flat3;
use crate::stillness;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(block_statistics, module)?)
}

type BlockArrays<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u32>>,
);

#[pyfunction]
fn block_statistics<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    length: usize,
) -> PyResult<BlockArrays<'py>> {
    let readings = flat3("readings", &readings)?;
    let blocks = super::run(py, || stillness::block_statistics(&readings, length))?;
    let shape = [blocks.count.len(), 3];
    let stack = |rows: Vec<[f64; 3]>| {
        PyArray1::from_vec(py, bytemuck::cast_vec::<[f64; 3], f64>(rows)).reshape(shape)
    };
    Ok((
        stack(blocks.mean)?,
        stack(blocks.variance)?,
        PyArray1::from_vec(py, blocks.count),
    ))
}
