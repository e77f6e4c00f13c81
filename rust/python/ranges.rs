//! Bindings of means and noise over ranges of rows.

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat2, flat3, rows, vector3};
use crate::noise_change as changes;
use crate::ranges;
use crate::slow_noise;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(means_by_owner, module)?)?;
    module.add_function(wrap_pyfunction!(column_means, module)?)?;
    module.add_function(wrap_pyfunction!(block_differences, module)?)?;
    module.add_function(wrap_pyfunction!(half_changes, module)?)?;
    module.add_function(wrap_pyfunction!(flicker_scatter, module)?)?;
    module.add_function(wrap_pyfunction!(coloured_variance, module)?)?;
    module.add_function(wrap_pyfunction!(noise_change, module)?)
}

/// Ranges `(k, 2)` of `n` rows.
pub(super) fn ranges_within(
    given: &PyReadonlyArray2<'_, i64>,
    n: usize,
) -> PyResult<Vec<[usize; 2]>> {
    let wrong = || PyValueError::new_err(format!("ranges (k, 2) must lie within the {n} rows"));
    if given.shape()[1] != 2 {
        return Err(wrong());
    }
    let edge = |value: i64| {
        usize::try_from(value)
            .ok()
            .filter(|&value| value <= n)
            .ok_or_else(wrong)
    };
    given
        .as_array()
        .rows()
        .into_iter()
        .map(|row| {
            let (start, stop) = (edge(row[0])?, edge(row[1])?);
            if start <= stop {
                Ok([start, stop])
            } else {
                Err(wrong())
            }
        })
        .collect()
}

/// Owners `(k,)` of `k` ranges, each below `n`.
fn owners(given: &PyReadonlyArray1<'_, i64>, k: usize, n: usize) -> PyResult<Vec<usize>> {
    let owner: Vec<usize> = flat1(given)
        .iter()
        .filter_map(|&one| usize::try_from(one).ok().filter(|&one| one < n))
        .collect();
    if owner.len() == k && given.len() == k {
        Ok(owner)
    } else {
        Err(PyValueError::new_err("every range has one owner below n"))
    }
}

/// `(n, 3)` means of readings `(m, 3)` over ranges `(k, 2)` by `owner` `(k,)`, and the number of rows `(n,)` in each.
#[pyfunction]
#[allow(clippy::type_complexity)]
fn means_by_owner<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    ranges: PyReadonlyArray2<'py, i64>,
    owner: PyReadonlyArray1<'py, i64>,
    n: usize,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>)> {
    let readings = flat3("readings", &readings)?;
    let ranges = ranges_within(&ranges, readings.len() / 3)?;
    let owner = owners(&owner, ranges.len(), n)?;
    let (means, counts) = super::run(py, || {
        Ok(ranges::means_by_owner(
            as_rows(&readings),
            &ranges,
            &owner,
            n,
        ))
    })?;
    let counts = counts
        .into_iter()
        .filter_map(|k| i64::try_from(k).ok())
        .collect();
    Ok((
        rows(py, means.as_flattened(), 3)?,
        PyArray1::from_vec(py, counts),
    ))
}

/// `(n, c)` means of values `(m, c)` over ranges `(k, 2)` by `owner` `(k,)`; NaN values are excluded.
#[pyfunction]
fn column_means<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    ranges: PyReadonlyArray2<'py, i64>,
    owner: PyReadonlyArray1<'py, i64>,
    n: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let channels = values.shape()[1];
    if channels == 0 {
        return Err(PyValueError::new_err("values (m, c) need a column"));
    }
    let ranges = ranges_within(&ranges, values.shape()[0])?;
    let owner = owners(&owner, ranges.len(), n)?;
    let flat = flat2(&values);
    let means = super::run(py, || {
        Ok(ranges::column_means(&flat, channels, &ranges, &owner, n))
    })?;
    rows(py, &means, channels)
}

/// `(3,)` sums of squared differences between means of blocks of `length` rows, and the number of differences.
#[pyfunction]
fn block_differences(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    ranges: PyReadonlyArray2<'_, i64>,
    owner: PyReadonlyArray1<'_, i64>,
    length: usize,
) -> PyResult<([f64; 3], usize)> {
    let readings = flat3("readings", &readings)?;
    let ranges = ranges_within(&ranges, readings.len() / 3)?;
    let owner = owners(&owner, ranges.len(), usize::MAX)?;
    super::run(py, || {
        let rows = as_rows(&readings);
        Ok(ranges::block_differences(rows, &ranges, &owner, length))
    })
}

type Changed = (usize, usize, Vec<usize>, Vec<f64>, Vec<f64>, f64, f64);

/// First and last pose, axes, ratios of noise with their errors, score and share of the change of noise in readings
/// `(n, 3)` of which `least` is dithered; `poses`: ranges `(k, 2)`, the owner `(k,)` of each, and their number; `moves`:
/// ranges `(m, 2)`, and the poses before and after `(m, 2)`.
#[pyfunction]
fn noise_change(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    least: [f64; 3],
    poses: (PyReadonlyArray2<'_, i64>, PyReadonlyArray1<'_, i64>, usize),
    moves: (PyReadonlyArray2<'_, i64>, PyReadonlyArray2<'_, i64>),
    fewest: usize,
) -> PyResult<Option<Changed>> {
    let readings = flat3("readings", &readings)?;
    let ranges = ranges_within(&poses.0, readings.len() / 3)?;
    let owner = owners(&poses.1, ranges.len(), poses.2)?;
    let mut parts = vec![Vec::new(); poses.2];
    for (range, own) in ranges.into_iter().zip(owner) {
        parts[own].push(range);
    }
    let links = ranges_within(&moves.1, poses.2)?;
    let moves = ranges_within(&moves.0, readings.len() / 3)?;
    let moves: Vec<_> = moves.into_iter().zip(links).collect();
    let found = super::run(py, || {
        Ok(changes::noise_change(
            as_rows(&readings),
            least,
            &parts,
            &moves,
            fewest,
        ))
    })?;
    Ok(found.map(|c| (c.first, c.last, c.axes, c.ratio, c.sigma, c.score, c.share)))
}

/// `(k, 3)` mean over the second half of every range `(k, 2)` less that over the first.
#[pyfunction]
fn half_changes<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    ranges: PyReadonlyArray2<'py, i64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let readings = flat3("readings", &readings)?;
    let ranges = ranges_within(&ranges, readings.len() / 3)?;
    let found = super::run(py, || Ok(slow_noise::steps(as_rows(&readings), &ranges, 2)))?;
    rows(py, found.as_flattened(), 3)
}

/// Scatter of the biases of `poses` `(h, 2)` by flicker inside them, raw; along the verticals `up` `(h, 3)`, or the rms of
/// the axes. 0 with fewer usable poses than `fewest`.
#[pyfunction]
fn flicker_scatter(
    py: Python<'_>,
    readings: PyReadonlyArray2<'_, f64>,
    poses: PyReadonlyArray2<'_, i64>,
    up: Option<PyReadonlyArray2<'_, f64>>,
    fewest: usize,
) -> PyResult<f64> {
    let readings = flat3("readings", &readings)?;
    let poses = ranges_within(&poses, readings.len() / 3)?;
    let up = up.as_ref().map(|up| flat3("up", up)).transpose()?;
    if up.as_ref().is_some_and(|up| up.len() != 3 * poses.len()) {
        return Err(PyValueError::new_err("every pose has a vertical"));
    }
    super::run(py, || {
        let up = up.as_deref().map(as_rows);
        Ok(slow_noise::flicker_scatter(
            as_rows(&readings),
            &poses,
            up,
            fewest,
        ))
    })
}

/// Variance `(m, 3)`, (raw unit · s)², that slow noise adds to integrals over moves that last `moves_last` `(m,)` s: of
/// the `poses` `(h, 2)` and the standard errors `(h, 3)` of their means, white noise `density` `(3,)` per √Hz.
#[pyfunction]
fn coloured_variance<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    poses: (PyReadonlyArray2<'py, i64>, PyReadonlyArray2<'py, f64>),
    density: PyReadonlyArray1<'py, f64>,
    step_s: f64,
    moves_last: Vec<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (readings, sigma) = (flat3("readings", &readings)?, flat3("sigma", &poses.1)?);
    let poses = ranges_within(&poses.0, readings.len() / 3)?;
    if sigma.len() != 3 * poses.len() {
        return Err(PyValueError::new_err("every pose has a standard error"));
    }
    let density = vector3("density", &density)?.into();
    let found = super::run(py, || {
        let poses = (poses.as_slice(), as_rows(&sigma));
        Ok(slow_noise::coloured_variance(
            as_rows(&readings),
            poses,
            density,
            step_s,
            &moves_last,
        ))
    })?;
    rows(py, found.as_flattened(), 3)
}
