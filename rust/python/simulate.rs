//! Bindings of the simulation.

use nalgebra::Vector3;
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::as_rows;
use crate::error::Result as KernelResult;
use crate::simulate::Sample;
use crate::simulate::mechanism::{self, Bridge};
use crate::simulate::motion::{self, Harmonic, Place, Replay, Segment};
use crate::simulate::noise::{self, Keys, Terms};
use crate::simulate::sampling::{self, Adc};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(simulate_motion, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_noise, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_project, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_force_at_places, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_second_order, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_first_order, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_bridge, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_play, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_creep, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_resample, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_convert, module)?)?;
    Ok(())
}

/// Rows of an `(n, columns)` array.
fn table(name: &str, array: &PyReadonlyArray2<'_, f64>, columns: usize) -> PyResult<Vec<Vec<f64>>> {
    if array.shape()[1] != columns {
        return Err(PyValueError::new_err(format!(
            "{name} must have {columns} columns, got {}",
            array.shape()[1]
        )));
    }
    let view = array.as_array();
    Ok(view
        .rows()
        .into_iter()
        .map(|r| r.iter().copied().collect())
        .collect())
}

/// Owned channels of an `(n, 3)` array.
fn channels(name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Sample>> {
    if array.shape()[1] != 3 {
        return Err(PyValueError::new_err(format!(
            "{name} must have shape (n, 3), got ({}, {})",
            array.shape()[0],
            array.shape()[1]
        )));
    }
    // `as_slice` also succeeds on a Fortran-ordered array, whose memory runs down the columns.
    if array.is_c_contiguous()
        && let Ok(flat) = array.as_slice()
    {
        return Ok(as_rows(flat).to_vec());
    }
    let view = array.as_array();
    Ok(view
        .rows()
        .into_iter()
        .map(|r| [r[0], r[1], r[2]])
        .collect())
}

fn to_array(py: Python<'_>, samples: Vec<Sample>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let n = samples.len();
    samples.into_flattened().into_pyarray(py).reshape([n, 3])
}

/// Run one stage on its own copy of a signal.
fn stage<'py>(
    py: Python<'py>,
    signal: &PyReadonlyArray2<'py, f64>,
    act: impl FnOnce(&mut Vec<Sample>) -> KernelResult<()> + Send,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut samples = channels("signal", signal)?;
    let samples = super::run_long(py, move || {
        act(&mut samples)?;
        Ok(samples)
    })?;
    to_array(py, samples)
}

fn vector3(v: &[f64]) -> Vector3<f64> {
    Vector3::new(v[0], v[1], v[2])
}

/// Index of the segment named in the first column of another table's row.
fn owner(row: &[f64], n: usize) -> PyResult<usize> {
    (0..n)
        .find(|&k| (k as f64 - row[0]).abs() < 0.5)
        .ok_or_else(|| {
            PyValueError::new_err(format!("a row names segment {}, which is absent", row[0]))
        })
}

fn attach(
    segments: &mut [Segment],
    rows: &[Vec<f64>],
    list: fn(&mut Segment) -> &mut Vec<Harmonic>,
) -> PyResult<()> {
    for row in rows {
        let k = owner(row, segments.len())?;
        list(&mut segments[k]).push(Harmonic {
            amplitude: vector3(&row[1..4]),
            frequency: row[4],
            phase: row[5],
        });
    }
    Ok(())
}

fn attach_replays(segments: &mut [Segment], rows: &[Vec<f64>]) -> PyResult<()> {
    for knots in rows.chunk_by(|a, b| a[0].total_cmp(&b[0]).is_eq()) {
        let k = owner(&knots[0], segments.len())?;
        let rate = knots.iter().map(|r| vector3(&r[1..4])).collect();
        let acceleration = knots.iter().map(|r| vector3(&r[4..7])).collect();
        let segment = &mut segments[k];
        let replay = Replay::new(segment.attitude, segment.duration, rate, acceleration)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        segment.replay = Some(replay);
    }
    Ok(())
}

type Track<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

#[pyfunction]
#[allow(clippy::too_many_arguments)] // The tables of one motion and its place.
fn simulate_motion<'py>(
    py: Python<'py>,
    segments: PyReadonlyArray2<'py, f64>,
    wobble: PyReadonlyArray2<'py, f64>,
    shake: PyReadonlyArray2<'py, f64>,
    replay: PyReadonlyArray2<'py, f64>,
    time_s: PyReadonlyArray1<'py, f64>,
    gravity_m_s2: f64,
    earth_rate_rad_s: [f64; 3],
) -> PyResult<Track<'py>> {
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
            replay: None,
        })
        .collect();
    attach(&mut parts, &table("wobble", &wobble, 6)?, |s| &mut s.wobble)?;
    attach(&mut parts, &table("shake", &shake, 6)?, |s| &mut s.shake)?;
    attach_replays(&mut parts, &table("replay", &replay, 7)?)?;
    let times: Vec<f64> = time_s.as_array().iter().copied().collect();
    let place = Place {
        gravity: gravity_m_s2,
        earth_rate: Vector3::from(earth_rate_rad_s),
    };
    let n = times.len();
    let track = super::run_long(py, || motion::evaluate(&parts, &place, &times))?;
    Ok((
        track.attitude.into_pyarray(py).reshape([n, 4])?,
        track.rate.into_pyarray(py).reshape([n, 3])?,
        track.rate_change.into_pyarray(py).reshape([n, 3])?,
        track.specific_force.into_pyarray(py).reshape([n, 3])?,
    ))
}

#[pyfunction]
fn simulate_noise(
    py: Python<'_>,
    n: usize,
    dt_s: f64,
    terms: [[f64; 5]; 3],
    keys: [[u64; 4]; 3],
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let terms = terms.map(|t| Terms {
        quantisation: t[0],
        white: t[1],
        flicker: t[2],
        walk: t[3],
        ramp: t[4],
    });
    let keys = keys.map(|k| Keys {
        quantisation: k[0],
        white: k[1],
        flicker: k[2],
        walk: k[3],
    });
    let out = super::run_long(py, || noise::three_axes(n, dt_s, &terms, &keys))?;
    out.into_pyarray(py).reshape([n, 3])
}

#[pyfunction]
fn simulate_project<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    directions: [Sample; 3],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let signal = channels("signal", &signal)?;
    let out = super::run_long(py, || Ok(mechanism::project(&signal, &directions)))?;
    to_array(py, out)
}

#[pyfunction]
fn simulate_force_at_places<'py>(
    py: Python<'py>,
    force: PyReadonlyArray2<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    rate_change: PyReadonlyArray2<'py, f64>,
    places: [Sample; 3],
    directions: [Sample; 3],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (force, rate, change) = (
        channels("force", &force)?,
        channels("rate", &rate)?,
        channels("rate_change", &rate_change)?,
    );
    let out = super::run_long(py, || {
        Ok(mechanism::force_at_places(
            &force,
            &rate,
            &change,
            &places,
            &directions,
        ))
    })?;
    to_array(py, out)
}

#[pyfunction]
fn simulate_second_order<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    dt_s: f64,
    frequency_hz: Sample,
    quality: Sample,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    stage(py, &signal, |s| {
        mechanism::second_order(s, dt_s, &frequency_hz, &quality)
    })
}

#[pyfunction]
fn simulate_first_order<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    dt_s: f64,
    tau_s: Sample,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    stage(py, &signal, |s| mechanism::first_order(s, dt_s, &tau_s))
}

#[pyfunction]
fn simulate_bridge<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    deflection: Sample,
    second: Sample,
    third: Sample,
    mismatch: Sample,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let bridge = Bridge {
        deflection,
        second,
        third,
        mismatch,
    };
    stage(py, &signal, |s| bridge.respond(s))
}

#[pyfunction]
fn simulate_play<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    width: Sample,
    offset: Sample,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    stage(py, &signal, |s| mechanism::play(s, &width, &offset))
}

#[pyfunction]
fn simulate_creep<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    dt_s: f64,
    fraction: Sample,
    tau_s: Sample,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    stage(py, &signal, |s| {
        mechanism::creep(s, dt_s, &fraction, &tau_s)
    })
}

#[pyfunction]
fn simulate_resample<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    start_s: f64,
    dt_s: f64,
    time_s: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let signal = channels("signal", &signal)?;
    let times: Vec<f64> = time_s.as_array().iter().copied().collect();
    let out = super::run_long(py, || sampling::resample(&signal, start_s, dt_s, &times))?;
    to_array(py, out)
}

#[pyfunction]
#[allow(clippy::too_many_arguments)] // The ADC's data sheet.
fn simulate_convert<'py>(
    py: Python<'py>,
    signal: PyReadonlyArray2<'py, f64>,
    lsb: f64,
    low: f64,
    high: f64,
    dead_band: f64,
    bias: Sample,
    missing_every: u32,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let adc = Adc {
        lsb,
        low,
        high,
        dead_band,
        bias,
        missing_every,
    };
    stage(py, &signal, |s| adc.convert(s))
}
