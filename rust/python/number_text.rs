//! Bindings of tables of numbers in text.

use std::alloc::{self, Layout};

use numpy::PyUntypedArrayMethods;
use numpy::ndarray::Array2;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadwriteArray2};
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;

use crate::number_text::{self, Block};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(plain_table, module)?)?;
    module.add_function(wrap_pyfunction!(new_array, module)?)?;
    module.add_function(wrap_pyfunction!(plain_table_into, module)?)
}

/// The columns of a plain table of numbers, or `None` where the text is anything else.
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

/// Zeros `(rows, width)` whose memory is committed in small pages, when it is written to.
///
/// `NumPy`'s own arrays request huge pages, which a shared machine may first have to free: that took half of the time
/// of reading a long log.
#[pyfunction]
fn new_array(py: Python<'_>, rows: usize, width: usize) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let refused =
        || PyMemoryError::new_err(format!("no memory for {rows} rows of {width} numbers"));
    let count = rows.checked_mul(width).ok_or_else(refused)?;
    let layout = Layout::array::<f64>(count).map_err(|_| refused())?;
    let flat = if count == 0 {
        Vec::new()
    } else {
        // SAFETY: the layout has a size; zero bytes are numbers; and it is that of the Vec which frees the memory.
        unsafe {
            let first = alloc::alloc_zeroed(layout);
            if first.is_null() {
                return Err(refused());
            }
            #[expect(clippy::cast_ptr_alignment, reason = "the layout is that of f64")]
            let first = first.cast::<f64>();
            #[expect(
                clippy::same_length_and_capacity,
                reason = "all of it is written: zeros"
            )]
            let all = Vec::from_raw_parts(first, count, count);
            all
        }
    };
    let array = Array2::from_shape_vec((rows, width), flat).map_err(|_| refused())?;
    Ok(PyArray2::from_owned_array(py, array))
}

/// `(lines, whether all were read)`: writes a plain table of numbers to `blocks` `(rows, width)`; column `i` goes to
/// `places[i]`, a block and a column of it.
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
