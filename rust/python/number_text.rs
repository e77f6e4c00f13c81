//! Tables of numbers in text across the seam.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::number_text;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(plain_table, module)?)
}

/// The columns of a plain table of numbers, or nothing where the text is anything else.
#[pyfunction]
fn plain_table<'py>(
    py: Python<'py>,
    text: &[u8],
    separator: u8,
    n_columns: usize,
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    if n_columns == 0 {
        return Ok(None);
    }
    let found = super::run(py, || {
        Ok(number_text::plain_table(text, separator, n_columns))
    })?;
    found
        .map(|flat| {
            let rows = flat.len() / n_columns;
            PyArray1::from_vec(py, flat).reshape([n_columns, rows])
        })
        .transpose()
}
