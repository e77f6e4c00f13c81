//! Bindings of tables of numbers in text.

use std::alloc::{self, Layout};

use numpy::PyUntypedArrayMethods;
use numpy::ndarray::Array2;
use numpy::{PyArray2, PyReadonlyArray1, PyReadwriteArray2};
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;

use crate::number_text::{self, Block};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(new_array, module)?)?;
    module.add_function(wrap_pyfunction!(plain_table_into, module)?)
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
