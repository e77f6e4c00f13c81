//! Simulation across the seam.

use nalgebra::Vector3;
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::simulate::motion::{self, Harmonic, Place, Segment};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(simulate_motion, module)?)?;
    Ok(())
}

/// Rows of an `(n, columns)` array.
fn table(name: &str, array: &PyReadonlyArray2<'_, f64>, columns: usize) -> PyResult<Vec<Vec<f64>>> {
    let view = array.as_array();
    if view.ncols() != columns {
        return Err(PyValueError::new_err(format!(
            "{name} must have {columns} columns, got {}",
            view.ncols()
        )));
    }
    Ok(view
        .rows()
        .into_iter()
        .map(|r| r.iter().copied().collect())
        .collect())
}

fn vector3(v: &[f64]) -> Vector3<f64> {
    Vector3::new(v[0], v[1], v[2])
}

fn attach(
    segments: &mut [Segment],
    rows: &[Vec<f64>],
    list: fn(&mut Segment) -> &mut Vec<Harmonic>,
) -> PyResult<()> {
    for row in rows {
        let owner = segments
            .iter_mut()
            .enumerate()
            .find(|(k, _)| (*k as f64 - row[0]).abs() < 0.5)
            .ok_or_else(|| {
                PyValueError::new_err(format!("a harmonic names segment {}, absent", row[0]))
            })?;
        list(owner.1).push(Harmonic {
            amplitude: vector3(&row[1..4]),
            frequency: row[4],
            phase: row[5],
        });
    }
    Ok(())
}

type Interleaved<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

#[pyfunction]
fn simulate_motion<'py>(
    py: Python<'py>,
    segments: PyReadonlyArray2<'py, f64>,
    wobble: PyReadonlyArray2<'py, f64>,
    shake: PyReadonlyArray2<'py, f64>,
    time_s: PyReadonlyArray1<'py, f64>,
    gravity_m_s2: f64,
    earth_rate_rad_s: [f64; 3],
) -> PyResult<Interleaved<'py>> {
    let mut parts: Vec<Segment> = table("segments", &segments, 18)?
        .iter()
        .map(|r| Segment {
            start: r[0],
            duration: r[1],
            attitude: [r[2], r[3], r[4], r[5]],
            axis: vector3(&r[6..9]),
            angle: r[9],
            ramp: r[10],
            travel: vector3(&r[11..14]),
            arm: vector3(&r[14..17]),
            fade: r[17],
            wobble: Vec::new(),
            shake: Vec::new(),
        })
        .collect();
    attach(&mut parts, &table("wobble", &wobble, 6)?, |s| &mut s.wobble)?;
    attach(&mut parts, &table("shake", &shake, 6)?, |s| &mut s.shake)?;
    let times: Vec<f64> = time_s.as_array().iter().copied().collect();
    let place = Place {
        gravity: gravity_m_s2,
        earth_rate: Vector3::from(earth_rate_rad_s),
    };
    let n = times.len();
    let (q, w, a, f) = super::run(py, || {
        let states = motion::evaluate(&parts, &place, &times)?;
        let mut q = Vec::with_capacity(4 * n);
        let mut vectors = [const { Vec::new() }; 3];
        for v in &mut vectors {
            v.reserve_exact(3 * n);
        }
        for s in &states {
            q.extend_from_slice(&s.attitude);
            vectors[0].extend_from_slice(s.rate.as_slice());
            vectors[1].extend_from_slice(s.rate_change.as_slice());
            vectors[2].extend_from_slice(s.specific_force.as_slice());
        }
        let [w, a, f] = vectors;
        Ok((q, w, a, f))
    })?;
    Ok((
        q.to_pyarray(py).reshape([n, 4])?,
        w.to_pyarray(py).reshape([n, 3])?,
        a.to_pyarray(py).reshape([n, 3])?,
        f.to_pyarray(py).reshape([n, 3])?,
    ))
}
