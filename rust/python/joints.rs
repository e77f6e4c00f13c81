//! Joints of a motion, and the law of its noise, across the seam.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::flat1;
use crate::halves::halves;
use crate::joints::{self, Contrasts, FREE, HALF, Limits};
use crate::noise_law;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(motion_joints, module)?)?;
    module.add_function(wrap_pyfunction!(halves_of, module)?)?;
    module.add_function(wrap_pyfunction!(mean_noise_law, module)?)
}

type Flags<'py> = Bound<'py, PyArray1<bool>>;

/// Which inner steps of a motion would show a lost sample, are one sample too long, one too short, `(n - 9,)` each.
#[pyfunction]
#[pyo3(signature = (readings, contrasts, *, nearby, sharp, part, whole, left, mirrored))]
#[expect(clippy::too_many_arguments, reason = "limits by name")]
fn motion_joints<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray2<'py, f64>,
    contrasts: PyReadonlyArray3<'py, f64>,
    nearby: usize,
    sharp: f64,
    part: (f64, f64),
    whole: (f64, f64),
    left: f64,
    mirrored: f64,
) -> PyResult<(Flags<'py>, Flags<'py>, Flags<'py>)> {
    if contrasts.shape() != [3, FREE, 2 * HALF] {
        return Err(PyValueError::new_err(format!(
            "contrasts must have shape (3, {FREE}, {}), got {:?}",
            2 * HALF,
            contrasts.shape()
        )));
    }
    if nearby.is_multiple_of(2) {
        return Err(PyValueError::new_err(format!(
            "nearby must be odd, got {nearby}"
        )));
    }
    let weights = contrasts.as_array();
    let of = |c: usize| -> Contrasts {
        std::array::from_fn(|i| std::array::from_fn(|j| weights[[c, i, j]]))
    };
    let contrasts = [of(0), of(1), of(2)];
    let channels = readings.shape()[1];
    let flat: Vec<f64> = readings.as_array().iter().copied().collect();
    let limits = Limits {
        nearby,
        sharp,
        part,
        whole,
        left,
        mirrored,
    };
    let found = super::run(py, || joints::joints(&flat, channels, &contrasts, &limits))?;
    Ok((
        PyArray1::from_vec(py, found.is_sharp),
        PyArray1::from_vec(py, found.is_long),
        PyArray1::from_vec(py, found.is_short),
    ))
}

/// Deviance and non-negative terms of a choice of columns of the law of a mean's variance.
#[pyfunction]
fn mean_noise_law(
    py: Python<'_>,
    design: PyReadonlyArray2<'_, f64>,
    seen: PyReadonlyArray1<'_, f64>,
    n: PyReadonlyArray1<'_, f64>,
    chosen: Vec<usize>,
) -> PyResult<(f64, [f64; 3])> {
    let design = super::arrays::flat3("design", &design)?;
    let (seen, n) = (flat1(&seen), flat1(&n));
    let found = super::run(py, || {
        noise_law::law(super::arrays::as_rows(&design), &seen, &n, &chosen)
    })?;
    Ok((found.deviance, found.terms))
}

/// Halved squared differences `(k, channels)` of the means of halves of stretches `(s, 2)` of `blocks` `(m, channels)`,
/// blocks in a half, depth and stretch `(k,)` of each.
#[pyfunction]
#[allow(clippy::type_complexity)]
fn halves_of<'py>(
    py: Python<'py>,
    blocks: PyReadonlyArray2<'py, f64>,
    stretches: PyReadonlyArray2<'py, i64>,
) -> PyResult<(
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
)> {
    let (n, channels) = (blocks.shape()[0], blocks.shape()[1]);
    let within = |first: i64, last: i64| {
        let (first, last) = (usize::try_from(first).ok()?, usize::try_from(last).ok()?);
        (first <= last && last <= n).then_some((first, last))
    };
    let pairs = stretches.as_array();
    let limits: Option<Vec<_>> = pairs
        .rows()
        .into_iter()
        .map(|row| within(*row.first()?, *row.get(1)?))
        .collect();
    let limits = limits.filter(|_| pairs.ncols() == 2).ok_or_else(|| {
        PyValueError::new_err(format!("stretches must lie within the {n} blocks"))
    })?;
    let values: Vec<f64> = blocks.as_array().iter().copied().collect();
    let found = super::run(py, || Ok(halves(&values, channels, &limits)))?;
    let k = found.size.len();
    Ok((
        found.square.to_pyarray(py).reshape([k, channels])?,
        found.size.to_pyarray(py),
        found.depth.to_pyarray(py),
        found.stretch.to_pyarray(py),
    ))
}
