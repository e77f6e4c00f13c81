//! Binding of the attitude integration.

use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{as_rows, flat1, flat3};
use crate::attitude::{Form, IDENTITY, Samples};
use crate::poisson::RateModel;

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(integrate_rate, module)?)
}

/// Attitude from a rate. Forms: 0 matrices, 1 quaternions `x y z w`, 2 rotation vectors.
#[pyfunction]
fn integrate_rate<'py>(
    py: Python<'py>,
    time_s: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    rate_degree: u8,
    form: u8,
    is_last_only: bool,
    initial: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let form = match form {
        0 => Form::Matrix,
        1 => Form::Quaternion,
        2 => Form::Vector,
        _ => {
            return Err(PyValueError::new_err(format!(
                "there is no form number {form} of an attitude"
            )));
        }
    };
    let initial = match initial {
        None => IDENTITY,
        Some(q) => unit(&flat1(&q))?,
    };
    let rate = flat3("rate", &rate)?;
    let time_s = flat1(&time_s);
    let model =
        RateModel::of_degree(rate_degree).map_err(|e| PyValueError::new_err(e.to_string()))?;
    let inner: &[usize] = match form {
        Form::Matrix => &[3, 3],
        Form::Quaternion => &[4],
        Form::Vector => &[3],
    };
    if is_last_only {
        let flat = super::run(py, || {
            Samples::new(&time_s, as_rows(&rate), model)?.last_from(initial, form)
        })?;
        return PyArray1::from_vec(py, flat).reshape(inner);
    }
    let mut shape = vec![time_s.len()];
    shape.extend(inner);
    // Memory from NumPy, which requests large pages: without them page faults take half of the time.
    let out = PyArrayDyn::<f64>::zeros(py, shape, false);
    {
        let mut lent = out.readwrite();
        let all = lent.as_slice_mut()?;
        super::run(py, || {
            Samples::new(&time_s, as_rows(&rate), model)?.all(initial, form, all)
        })?;
    }
    Ok(out)
}

/// Quaternion `x y z w` of length one to rounding → unit `w x y z`.
fn unit(q: &[f64]) -> PyResult<[f64; 4]> {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    match q {
        &[x, y, z, w] if (length - 1.0).abs() < 1e-6 => Ok([w, x, y, z].map(|c| c / length)),
        _ => Err(PyValueError::new_err(
            "the initial attitude must be a quaternion x y z w of unit length",
        )),
    }
}
