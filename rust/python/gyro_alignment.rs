//! Gyro alignment across the seam.

use nalgebra::{DMatrix, Matrix3, Vector3};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::{dmatrix, matrix, matrix3, of3, rows3, samples, vector3, vectors};
use super::poisson::{RateNoise, ranges};
use crate::gauss_newton::Loss;
use crate::gyro_alignment::{Alignment, Fit, Link, Model, Pose, Settings, fit};
use crate::poisson::{PreparedMove, RateModel, prepare_all};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<AlignmentPoses>()?;
    module.add_class::<AlignmentAccelerometer>()?;
    module.add_class::<Moves>()?;
    module.add_class::<AlignmentFit>()?;
    Ok(())
}

/// The moves of a recording, prepared once for many fits.
#[pyclass(frozen, module = "trihedron._core")]
struct Moves {
    links: Vec<Link>,
    moves: Vec<PreparedMove>,
}

/// What was read at rest: means of both sensors with variances, and how biases walk between poses.
#[pyclass(frozen, module = "trihedron._core")]
struct AlignmentPoses {
    poses: Vec<Pose>,
    var_bias_walk: Vector3<f64>,
}

#[pymethods]
impl AlignmentPoses {
    #[new]
    #[pyo3(signature = (*, reading, var_reading, bias, var_bias, var_bias_walk))]
    fn new(
        reading: PyReadonlyArray2<'_, f64>,
        var_reading: PyReadonlyArray2<'_, f64>,
        bias: PyReadonlyArray2<'_, f64>,
        var_bias: PyReadonlyArray2<'_, f64>,
        var_bias_walk: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let reading = rows3("reading", &reading)?;
        let var_reading = rows3("var_reading", &var_reading)?;
        let bias = rows3("bias", &bias)?;
        let var_bias = rows3("var_bias", &var_bias)?;
        let n = reading.len();
        same_length(
            n,
            &[
                ("var_reading", var_reading.len()),
                ("bias", bias.len()),
                ("var_bias", var_bias.len()),
            ],
        )?;
        Ok(Self {
            poses: (0..n)
                .map(|h| Pose {
                    reading: reading[h],
                    var_reading: var_reading[h],
                    bias: bias[h],
                    var_bias: var_bias[h],
                })
                .collect(),
            var_bias_walk: vector3("var_bias_walk", &var_bias_walk)?,
        })
    }
}

/// S and b of the accelerometer, the directions in which they may follow, and whether they are given.
#[pyclass(frozen, module = "trihedron._core")]
struct AlignmentAccelerometer {
    scale: Matrix3<f64>,
    bias: Vector3<f64>,
    basis: DMatrix<f64>,
    is_given: bool,
}

#[pymethods]
impl AlignmentAccelerometer {
    #[new]
    fn new(
        scale: PyReadonlyArray2<'_, f64>,
        bias: PyReadonlyArray1<'_, f64>,
        basis: PyReadonlyArray2<'_, f64>,
        is_given: bool,
    ) -> PyResult<Self> {
        Ok(Self {
            scale: matrix3("scale", &scale)?,
            bias: vector3("bias", &bias)?,
            basis: dmatrix(&basis),
            is_given,
        })
    }
}

/// Where the alignment ended.
#[pyclass(frozen, get_all, module = "trihedron._core")]
struct AlignmentFit {
    accelerometer_scale: Py<PyArray2<f64>>,
    accelerometer_bias: Py<PyArray1<f64>>,
    gyroscope_scale: Py<PyArray2<f64>>,
    chi2: f64,
    dof: usize,
    rank: usize,
    singular_values: Py<PyArray1<f64>>,
    directions: Py<PyArray2<f64>>,
    weights: Py<PyArray1<f64>>,
    mahalanobis: Py<PyArray1<f64>>,
    residuals: Py<PyArray2<f64>>,
    cov_residuals: Py<PyArray3<f64>>,
    predicted: Py<PyArray2<f64>>,
    iterations: usize,
    is_converged: bool,
    stopped_because: &'static str,
}

fn as_links(array: &PyReadonlyArray2<'_, i64>) -> PyResult<Vec<Link>> {
    if array.shape()[1] != 2 {
        return Err(PyValueError::new_err(format!(
            "links must have shape (m, 2), got ({}, {})",
            array.shape()[0],
            array.shape()[1]
        )));
    }
    let index = |value: i64| {
        usize::try_from(value)
            .map_err(|_| PyValueError::new_err(format!("pose {value} does not exist")))
    };
    array
        .as_array()
        .rows()
        .into_iter()
        .map(|row| {
            Ok(Link {
                before: index(row[0])?,
                after: index(row[1])?,
            })
        })
        .collect()
}

fn same_length(n: usize, pieces: &[(&str, usize)]) -> PyResult<()> {
    for (name, length) in pieces {
        if *length != n {
            return Err(PyValueError::new_err(format!(
                "{name} has {length} rows where {n} are needed"
            )));
        }
    }
    Ok(())
}

#[pymethods]
impl Moves {
    #[new]
    #[pyo3(signature = (time_s, gyroscope, edges, anchors_s, links, rate_degree, var_extra=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        time_s: PyReadonlyArray1<'_, f64>,
        gyroscope: PyReadonlyArray2<'_, f64>,
        edges: PyReadonlyArray2<'_, i64>,
        anchors_s: PyReadonlyArray2<'_, f64>,
        links: PyReadonlyArray2<'_, i64>,
        rate_degree: u8,
        var_extra: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<Self> {
        let time_s = samples(&time_s);
        let raw = rows3("gyroscope", &gyroscope)?;
        let var_extra = var_extra
            .map(|array| rows3("var_extra", &array))
            .transpose()?;
        let ranges = ranges(&edges, &anchors_s)?;
        let links = as_links(&links)?;
        same_length(ranges.len(), &[("links", links.len())])?;
        let moves = super::run(py, || {
            let model = RateModel::of_degree(rate_degree)?;
            prepare_all(&time_s, &raw, var_extra.as_deref(), &ranges, model)
        })?;
        Ok(Self { links, moves })
    }

    /// `∫ w' dt` of every move, (m, 3), raw unit · s.
    fn raw_angles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat: Vec<f64> = self
            .moves
            .iter()
            .flat_map(|one| one.raw_angle().as_slice().to_vec())
            .collect();
        flat.to_pyarray(py).reshape([self.moves.len(), 3])
    }

    /// Integrated time of every move, (m,), s.
    fn durations_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let durations: Vec<f64> = self.moves.iter().map(PreparedMove::duration_s).collect();
        durations.to_pyarray(py)
    }

    #[pyo3(signature = (*, poses, noise, accelerometer, gravity_m_s2, used, starts, loss_scale, is_near=false,
        offset_white=None))]
    #[allow(clippy::too_many_arguments)]
    fn align(
        &self,
        py: Python<'_>,
        poses: &AlignmentPoses,
        noise: &RateNoise,
        accelerometer: &AlignmentAccelerometer,
        gravity_m_s2: f64,
        used: PyReadonlyArray1<'_, bool>,
        starts: PyReadonlyArray3<'_, f64>,
        loss_scale: Option<f64>,
        is_near: bool,
        offset_white: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<AlignmentFit> {
        if starts.shape()[1..] != [3, 3] {
            return Err(PyValueError::new_err(format!(
                "starts must have shape (k, 3, 3), got {:?}",
                starts.shape()
            )));
        }
        let problem = Alignment {
            poses: poses.poses.clone(),
            links: self.links.clone(),
            moves: self.moves.clone(),
            used: samples(&used),
            gravity: gravity_m_s2,
            noise: noise.0,
            var_bias_walk: poses.var_bias_walk,
            accelerometer_basis: accelerometer.basis.clone(),
            is_accelerometer_given: accelerometer.is_given,
            is_offset_free: offset_white.is_some(),
            offset_white: offset_white.map_or_else(|| DMatrix::zeros(0, 3), |rows| dmatrix(&rows)),
        };
        let base = Model {
            accelerometer_scale: accelerometer.scale,
            accelerometer_bias: accelerometer.bias,
            gyroscope_scale: Matrix3::identity(),
            rate_offset: Vector3::zeros(),
            followed: nalgebra::DVector::zeros(accelerometer.basis.ncols()),
        };
        let starts: Vec<Model> = starts
            .as_array()
            .outer_iter()
            .map(|start| Model {
                gyroscope_scale: Matrix3::from_fn(|i, j| start[[i, j]]),
                ..base.clone()
            })
            .collect();
        let settings = Settings {
            loss: loss_scale.map_or(Loss::Linear, |scale| Loss::Cauchy { scale }),
            is_near,
            ..Settings::default()
        };
        let found = super::run_long(py, || fit(&problem, &starts, &settings))?;
        export(py, &found)
    }
}

fn export(py: Python<'_>, found: &Fit) -> PyResult<AlignmentFit> {
    let m = found.residuals.len();
    let cov: Vec<f64> = found
        .cov_residuals
        .iter()
        .flat_map(|matrix| matrix.as_slice().to_vec())
        .collect();
    Ok(AlignmentFit {
        accelerometer_scale: of3(py, &found.model.accelerometer_scale)?.unbind(),
        accelerometer_bias: found
            .model
            .accelerometer_bias
            .as_slice()
            .to_pyarray(py)
            .unbind(),
        gyroscope_scale: of3(py, &found.model.gyroscope_scale)?.unbind(),
        chi2: found.chi2,
        dof: found.dof,
        rank: found.certainty.rank,
        singular_values: found
            .certainty
            .singular_values
            .as_slice()
            .to_pyarray(py)
            .unbind(),
        directions: matrix(py, &found.certainty.directions)?.unbind(),
        weights: found.weights.to_pyarray(py).unbind(),
        mahalanobis: found.mahalanobis.to_pyarray(py).unbind(),
        residuals: vectors(py, &found.residuals)?.unbind(),
        cov_residuals: cov.to_pyarray(py).reshape([m, 3, 3])?.unbind(),
        predicted: vectors(py, &found.predicted)?.unbind(),
        iterations: found.iterations,
        is_converged: found.is_converged,
        stopped_because: found.stopped_because,
    })
}
