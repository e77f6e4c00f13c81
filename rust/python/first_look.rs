//! Bindings of levels, windows and running order statistics.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3};
use crate::{adc_grid as grid, before_adc as adc, first_look, levels, running};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(levels_of, module)?)?;
    module.add_function(wrap_pyfunction!(adc_grid, module)?)?;
    module.add_function(wrap_pyfunction!(before_adc, module)?)?;
    module.add_function(wrap_pyfunction!(window_statistics, module)?)?;
    module.add_function(wrap_pyfunction!(median_length, module)?)?;
    module.add_function(wrap_pyfunction!(block_mean_readings, module)?)?;
    module.add_function(wrap_pyfunction!(quickest_turns, module)?)?;
    module.add_function(wrap_pyfunction!(running_median, module)?)
}

/// Distinct finite values `(k,)`, ascending, and the number of finite readings.
#[pyfunction]
fn levels_of<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray1<'py, f64>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, usize)> {
    let flat = flat1(&readings);
    let (found, finite) = super::run(py, || Ok(levels::levels(&flat)))?;
    Ok((PyArray1::from_vec(py, found), finite))
}

/// The step (LSB) of the grid on which `levels` `(k,)`, ascending, of `n` readings lie.
#[pyfunction]
fn adc_grid(py: Python<'_>, levels: PyReadonlyArray1<'_, f64>, n: usize) -> PyResult<Option<f64>> {
    let levels = flat1(&levels);
    if !levels.is_sorted_by(|low, high| low < high) || levels.iter().any(|v| !v.is_finite()) {
        return Err(PyValueError::new_err("levels must be numbers and ascend"));
    }
    super::run(py, || Ok(grid::step(&levels, n)))
}

type WindowArrays<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// Mean and noise `(m, 3)` and spread `(m,)` of windows; `None` where a reading in them is not finite.
#[pyfunction]
fn window_statistics<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    starts: PyReadonlyArray1<'py, i64>,
    length: usize,
) -> PyResult<Option<WindowArrays<'py>>> {
    let flat = flat3("readings", &readings)?;
    let starts = places(&starts)?;
    let found = super::run(py, || {
        Ok(first_look::windows(as_rows(&flat), &starts, length))
    })?;
    let shape = [starts.len(), 3];
    let stack = |rows: Vec<[f64; 3]>| {
        PyArray1::from_vec(py, bytemuck::cast_vec::<[f64; 3], f64>(rows)).reshape(shape)
    };
    let Some(found) = found else {
        return Ok(None);
    };
    Ok(Some((
        stack(found.mean)?,
        stack(found.noise)?,
        found.spread.to_pyarray(py),
    )))
}

fn places(starts: &PyReadonlyArray1<'_, i64>) -> PyResult<Vec<usize>> {
    let starts = starts.as_array();
    let places: Result<Vec<usize>, _> = starts.iter().map(|&s| usize::try_from(s)).collect();
    places.map_err(|_| PyValueError::new_err("starts must not be negative"))
}

/// Median length of the readings (vectors) in windows, NaN excluded.
#[pyfunction]
fn median_length(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    starts: PyReadonlyArray1<'_, i64>,
    length: usize,
) -> PyResult<f64> {
    let flat = flat3("readings", &readings)?;
    let starts = places(&starts)?;
    super::run(py, || {
        Ok(first_look::median_length(as_rows(&flat), &starts, length))
    })?
    .ok_or_else(|| PyValueError::new_err("windows must lie in the readings"))
}

/// Means `(count, 3)` of the first blocks of `length` rows.
#[pyfunction]
fn block_mean_readings<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    length: usize,
    count: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat = flat3("readings", &readings)?;
    let means = super::run(py, || {
        Ok(first_look::block_means(as_rows(&flat), length, count))
    })?
    .ok_or_else(|| PyValueError::new_err("blocks must hold rows and lie in the readings"))?;
    PyArray1::from_vec(py, bytemuck::cast_vec::<[f64; 3], f64>(means)).reshape([count, 3])
}

/// Fewest rows in which a direction turns by `turn` [rad]: between two static stretches, and between any two.
#[pyfunction]
fn quickest_turns(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    side: usize,
    turn: f64,
) -> PyResult<(Option<usize>, Option<usize>)> {
    let flat = flat3("readings", &readings)?;
    super::run(py, || {
        Ok(first_look::quickest_turns(as_rows(&flat), side, turn))
    })
}

/// Median of the `size` (odd) numbers about each; beyond the ends the last number is repeated.
#[pyfunction]
fn running_median<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    size: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    if size.is_multiple_of(2) {
        return Err(PyValueError::new_err(format!(
            "a running median needs an odd size, got {size}"
        )));
    }
    let flat = flat1(&values);
    let found = super::run(py, || Ok(running::running_median(&flat, size)))?;
    Ok(PyArray1::from_vec(py, found))
}

type Means<'py> = (
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    f64,
);

/// Noise of one reading before the ADC, `(h,)` posterior less plain mean of every pose and its own standard deviation,
/// and the one that all means share, in steps; `values` `(n,)` are those of the poses, one after the other, `counts`
/// `(h,)` their numbers.
#[pyfunction]
fn before_adc<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    counts: Vec<usize>,
    step: f64,
) -> PyResult<Means<'py>> {
    let values = flat1(&values);
    let edges: Vec<usize> = std::iter::once(0)
        .chain(counts.iter().scan(0, |sum, n| {
            *sum += n;
            Some(*sum)
        }))
        .collect();
    let found = super::run(py, || adc::before_adc(&values, &edges, step))?;
    let own = PyArray1::from_vec(py, found.own);
    Ok((
        found.sigma,
        PyArray1::from_vec(py, found.shift),
        own,
        found.common,
    ))
}
