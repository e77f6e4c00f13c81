//! Binding of the bias process: scatter, walk and drift.

use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::bias_process::{Readings, Strengths};
use crate::error::Error;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(bias_process_grams, module)?)?;
    Ok(())
}

type Grams<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray3<f64>>);

/// `(log_det (g,), gram (g, c, c))` of `columns` `(n, c)`, reading first, under every row of `strengths` `(g, 5)`.
///
/// A row of strengths: scatter, walk, drift, slope, factor on `variance` `(n,)`. `direction` is `(n, k)`.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn bias_process_grams<'py>(
    py: Python<'py>,
    columns: PyReadonlyArray2<'py, f64>,
    variance: PyReadonlyArray1<'py, f64>,
    time: PyReadonlyArray1<'py, f64>,
    length: PyReadonlyArray1<'py, f64>,
    pose: PyReadonlyArray1<'py, i64>,
    direction: PyReadonlyArray2<'py, f64>,
    strengths: PyReadonlyArray2<'py, f64>,
) -> PyResult<Grams<'py>> {
    let c = columns.shape()[1];
    let readings = Readings {
        rows: columns.as_array().iter().copied().collect(),
        columns: c,
        variance: variance.as_array().to_vec(),
        time: time.as_array().to_vec(),
        length: length.as_array().to_vec(),
        pose: pose.as_array().to_vec(),
        direction: direction.as_array().iter().copied().collect(),
    };
    let width = strengths.shape()[1];
    let flat: Vec<f64> = strengths.as_array().iter().copied().collect();
    let (log_det, gram) = super::run(py, || {
        readings.check()?;
        if width != 5 || flat.iter().any(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(Error::bad_input(
                "strengths are rows of five finite numbers that are not negative",
            ));
        }
        let found: Vec<_> = flat
            .par_chunks(5)
            .map(|row| {
                readings.whitened(Strengths {
                    scatter: row[0],
                    walk: row[1],
                    drift: row[2],
                    slope: row[3],
                    noise: row[4],
                })
            })
            .collect();
        let log_det: Vec<f64> = found.iter().map(|one| one.log_det).collect();
        let gram: Vec<f64> = found.into_iter().flat_map(|one| one.gram).collect();
        Ok((log_det, gram))
    })?;
    let n = log_det.len();
    Ok((
        log_det.to_pyarray(py),
        gram.to_pyarray(py).reshape([n, c, c])?,
    ))
}
