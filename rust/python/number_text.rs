//! Tables of numbers in text across the seam.

use numpy::PyUntypedArrayMethods;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadwriteArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::number_text::{self, Block};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(plain_table, module)?)?;
    module.add_function(wrap_pyfunction!(plain_table_into, module)?)
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
    let rows = text.split(|&b| b == b'\n').count();
    let found = super::run(py, || {
        let mut columns = vec![vec![0.0; rows]; n_columns];
        let places: Vec<(usize, usize)> = (0..n_columns).map(|i| (i, 0)).collect();
        let blocks = columns
            .iter_mut()
            .map(|rows| Block { rows, width: 1 })
            .collect();
        let done = number_text::plain_table(text, separator, &places, blocks);
        Ok(done.is_read.then(|| {
            columns
                .into_iter()
                .flat_map(|column| column.into_iter().take(done.rows))
                .collect::<Vec<f64>>()
        }))
    })?;
    found
        .map(|flat| {
            let rows = flat.len() / n_columns;
            PyArray1::from_vec(py, flat).reshape([n_columns, rows])
        })
        .transpose()
}

/// `(lines, whether they were read)`: a plain table of numbers, written to `blocks` `(rows, width)`; column `i` goes to
/// `places[i]`, a block and a number of its rows.
#[pyfunction]
fn plain_table_into(
    py: Python<'_>,
    text: PyReadonlyArray1<'_, u8>,
    separator: u8,
    places: Vec<(usize, usize)>,
    mut blocks: Vec<PyReadwriteArray2<'_, f64>>,
) -> PyResult<(usize, bool)> {
    let refused = || PyValueError::new_err("text and blocks must be contiguous arrays");
    let text = text.as_slice().map_err(|_| refused())?;
    let mut lent = Vec::with_capacity(blocks.len());
    for block in &mut blocks {
        let width = block.shape()[1];
        if !block.is_c_contiguous() {
            return Err(refused());
        }
        let rows = block.as_slice_mut().map_err(|_| refused())?;
        lent.push(Block { rows, width });
    }
    let done = super::run(py, || {
        Ok(number_text::plain_table(text, separator, &places, lent))
    })?;
    Ok((done.rows, done.is_read))
}
