//! Motion in the means of blocks across the seam.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat3};
use crate::block_motion::{self, UNKNOWNS, Windows};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(first_clean, module)?)?;
    module.add_function(wrap_pyfunction!(band_power, module)?)?;
    module.add_function(wrap_pyfunction!(share_of_gyroscope, module)?)
}

fn wrong(what: &str) -> PyErr {
    PyValueError::new_err(what.to_owned())
}

/// First of `most + 1` rows of `off` `(n, c)` from which no stretch of `sizes` `(k,)` departs by its `variances` `(k, c)`.
#[pyfunction]
fn first_clean(
    py: Python<'_>,
    off: PyReadonlyArray2<'_, f64>,
    most: usize,
    sizes: Vec<usize>,
    variances: PyReadonlyArray2<'_, f64>,
    limit: f64,
) -> PyResult<Option<usize>> {
    let channels = off.shape()[1];
    if channels == 0 || variances.shape() != [sizes.len(), channels] || most > off.shape()[0] {
        return Err(wrong(
            "off (n, c) and variances (k, c) of k sizes do not fit",
        ));
    }
    let off: Vec<f64> = off.as_array().iter().copied().collect();
    let variances: Vec<f64> = variances.as_array().iter().copied().collect();
    super::run(py, || {
        Ok(block_motion::first_clean(
            &off, channels, most, &sizes, &variances, limit,
        ))
    })
}

/// Sums `(r, 3)` of the squared output of five taps over ranges `(r, 2)` of rows, two less at either end.
#[pyfunction]
fn band_power<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    taps: [f64; 5],
    ranges: PyReadonlyArray2<'py, i64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let n = readings.shape()[0];
    let outside = || {
        wrong(&format!(
            "ranges must be start, stop within {n} rows, (r, 2)"
        ))
    };
    if ranges.shape()[1] != 2 {
        return Err(outside());
    }
    let mut inside = Vec::with_capacity(ranges.shape()[0]);
    for row in ranges.as_array().rows() {
        let start = usize::try_from(row[0]).map_err(|_| outside())?;
        let stop = usize::try_from(row[1]).map_err(|_| outside())?;
        if start > stop || stop > n {
            return Err(outside());
        }
        inside.push([start, stop]);
    }
    let flat = flat3("readings", &readings)?;
    let found = super::run(py, || {
        Ok(block_motion::band_power(as_rows(&flat), taps, &inside))
    })?;
    PyArray1::from_vec(py, bytemuck::cast_vec::<[f64; 3], f64>(found)).reshape([inside.len(), 3])
}

/// `(12,)` by which the gyro foretells the changes of windows best, in units of `scale`.
#[pyfunction]
fn share_of_gyroscope(
    py: Python<'_>,
    change: PyReadonlyArray2<'_, f64>,
    mean: PyReadonlyArray2<'_, f64>,
    rate: PyReadonlyArray2<'_, f64>,
    scale: [f64; 3],
) -> PyResult<[f64; UNKNOWNS]> {
    if mean.shape()[0] != change.shape()[0] || rate.shape()[0] != change.shape()[0] {
        return Err(wrong("change, mean and rate are of the same windows"));
    }
    let (change, mean, rate) = (
        flat3("change", &change)?,
        flat3("mean", &mean)?,
        flat3("rate", &rate)?,
    );
    let windows = Windows {
        change: as_rows(&change),
        mean: as_rows(&mean),
        rate: as_rows(&rate),
    };
    super::run(py, || Ok(windows.share(scale)))
}
