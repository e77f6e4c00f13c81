//! Poses, moves and a state of the unknowns, each arranged once and passed as one object.

use std::sync::Arc;

use nalgebra::{DVector, Vector3};
use numpy::{
    PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::python::arrays::{matrix3, rows3, samples, stack3, vector3};
use crate::session_model::gaps::find_gaps;
use crate::session_model::moves::Move;
use crate::session_model::{State, StaticMeans};

type Array1<'py> = PyReadonlyArray1<'py, f64>;
type Array2<'py> = PyReadonlyArray2<'py, f64>;
type Array3<'py> = PyReadonlyArray3<'py, f64>;

/// Means of the static poses.
#[pyclass(frozen, module = "trihedron._core")]
pub(super) struct SessionPoses {
    pub time_s: Vec<f64>,
    pub force: StaticMeans,
    pub rate: Option<StaticMeans>,
}

#[pymethods]
impl SessionPoses {
    /// `time_s` `(h,)`, means and standard errors `(h, 3)`, densities `(3,)`: raw and centred; `force_along`:
    /// directions `(h, 3)` and the standard errors `(h,)` of the means along them, NaN where those of the axes apply.
    #[new]
    #[pyo3(signature = (*, time_s, force, force_sigma, force_density, rate, rate_sigma, rate_density, force_along=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        time_s: Array1<'_>,
        force: Array2<'_>,
        force_sigma: Array2<'_>,
        force_density: Array1<'_>,
        rate: Option<Array2<'_>>,
        rate_sigma: Option<Array2<'_>>,
        rate_density: Option<Array1<'_>>,
        force_along: Option<(Array2<'_>, Array1<'_>)>,
    ) -> PyResult<Self> {
        type Along<'a> = Option<(&'a [Vector3<f64>], &'a [f64])>;
        let at_rest =
            |mean: &Array2<'_>, sigma: &Array2<'_>, density: &Array1<'_>, along: Along<'_>| {
                let (mean, sigma) = (rows3("pose means", mean)?, rows3("pose sigmas", sigma)?);
                StaticMeans::of(mean, sigma, vector3("density", density)?, along)
                    .map_err(|error| PyValueError::new_err(error.to_string()))
            };
        let along = force_along
            .as_ref()
            .map(|(up, error)| Ok::<_, PyErr>((rows3("verticals", up)?, samples(error))))
            .transpose()?;
        let along = along
            .as_ref()
            .map(|(up, error)| (up.as_slice(), error.as_slice()));
        Ok(Self {
            time_s: samples(&time_s),
            force: at_rest(&force, &force_sigma, &force_density, along)?,
            rate: match (&rate, &rate_sigma, &rate_density) {
                (Some(mean), Some(sigma), Some(density)) => {
                    Some(at_rest(mean, sigma, density, None)?)
                }
                _ => None,
            },
        })
    }

    /// `(h, 3, 3)` matrices that whiten an error of the accelerometer's means, raw.
    fn force_white<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        stack3(py, self.force.white.iter().copied())
    }
}

/// Samples of the moves between poses.
#[pyclass(frozen, module = "trihedron._core")]
pub(super) struct SessionMoves {
    pub moves: Arc<Vec<Move>>,
}

#[pymethods]
impl SessionMoves {
    /// `pose_time_s` `(h,)`; whole recording `time_s` `(n,)`, `force`, `rate` `(n, 3)` raw and centred; `ranges`
    /// `(m, 2)` of samples, the pose `before` `(m,)` each, `unresolved` `(m, 4, 3)` variances of their integrals: of force
    /// and rate by motion faster than the samples, then by anything else beside white noise. `leans` `(h, 2, 3)` are the
    /// changes of the vertical from the mean of every pose to its beginning and to its end.
    #[new]
    #[pyo3(signature = (*, pose_time_s, time_s, force, rate, ranges, before, unresolved, leans))]
    #[expect(clippy::too_many_arguments, reason = "a session's moves by name")]
    fn new(
        pose_time_s: Array1<'_>,
        time_s: Array1<'_>,
        force: Array2<'_>,
        rate: Option<Array2<'_>>,
        ranges: PyReadonlyArray2<'_, i64>,
        before: PyReadonlyArray1<'_, i64>,
        unresolved: Array3<'_>,
        leans: Array3<'_>,
    ) -> PyResult<Self> {
        let mut moves = moves_of(
            &samples(&time_s),
            &samples(&pose_time_s),
            &force,
            rate.as_ref(),
            &ranges,
            &before,
            &unresolved,
        )?;
        let h = pose_time_s.as_array().len();
        if leans.shape() != [h, 2, 3] {
            return Err(PyValueError::new_err(format!(
                "leans must have shape ({h}, 2, 3)"
            )));
        }
        let leans = leans.as_array();
        let leaning = |pose: usize, end: usize| Vector3::from_fn(|i, _| leans[[pose, end, i]]);
        for one in &mut moves {
            one.leans = [leaning(one.before, 1), leaning(one.before + 1, 0)];
        }
        Ok(Self {
            moves: Arc::new(moves),
        })
    }
}

/// Values of all unknowns.
#[pyclass(frozen, module = "trihedron._core")]
pub(super) struct SessionState {
    pub state: State,
}

#[pymethods]
impl SessionState {
    /// `S_a`, `b_a`, `S_w` on centred readings; vertical and both biases of every pose, raw, `(h, 3)`; effects `(k,)`.
    #[new]
    #[pyo3(signature = (*, force_scale, force_bias, rate_scale, up, pose_rate_bias, pose_force_bias, effect))]
    fn new(
        force_scale: Array2<'_>,
        force_bias: Array1<'_>,
        rate_scale: Array2<'_>,
        up: Array2<'_>,
        pose_rate_bias: Array2<'_>,
        pose_force_bias: Array2<'_>,
        effect: Array1<'_>,
    ) -> PyResult<Self> {
        let up = rows3("up", &up)?;
        let h = up.len();
        let state = State {
            force_scale: matrix3("force_scale", &force_scale)?,
            force_bias: vector3("force_bias", &force_bias)?,
            rate_scale: matrix3("rate_scale", &rate_scale)?,
            up,
            pose_rate_bias: rows3("pose_rate_bias", &pose_rate_bias)?,
            pose_force_bias: rows3("pose_force_bias", &pose_force_bias)?,
            own: [vec![Vector3::zeros(); h], vec![Vector3::zeros(); h]],
            effect: DVector::from_vec(samples(&effect)),
        };
        if [state.pose_rate_bias.len(), state.pose_force_bias.len()] != [h; 2] {
            return Err(PyValueError::new_err(format!(
                "the state needs one bias of each sensor for each of {h} poses"
            )));
        }
        Ok(Self { state })
    }
}

fn moves_of(
    time_s: &[f64],
    pose_time_s: &[f64],
    force: &Array2<'_>,
    rate: Option<&Array2<'_>>,
    ranges: &PyReadonlyArray2<'_, i64>,
    before: &PyReadonlyArray1<'_, i64>,
    unresolved: &Array3<'_>,
) -> PyResult<Vec<Move>> {
    let m = ranges.shape()[0];
    if m == 0 {
        return Ok(Vec::new());
    }
    if ranges.shape()[1] != 2 || before.as_array().len() != m || unresolved.shape() != [m, 4, 3] {
        return Err(PyValueError::new_err(format!(
            "{m} moves need ranges ({m}, 2), poses ({m},) and unresolved variances ({m}, 4, 3)"
        )));
    }
    let Some(rate) = rate else {
        return Err(PyValueError::new_err("moves need a gyro"));
    };
    let n = time_s.len();
    if force.shape() != [n, 3] || rate.shape() != [n, 3] {
        return Err(PyValueError::new_err(format!(
            "force and rate must have shape ({n}, 3)"
        )));
    }
    let (force, rate) = (force.as_array(), rate.as_array());
    let rows = |of: &numpy::ndarray::ArrayView2<'_, f64>, start: usize, stop: usize| {
        (start..stop)
            .map(|k| Vector3::new(of[[k, 0]], of[[k, 1]], of[[k, 2]]))
            .collect::<Vec<_>>()
    };
    let (ranges, before, unresolved) =
        (ranges.as_array(), before.as_array(), unresolved.as_array());
    let index = |value: i64| {
        usize::try_from(value)
            .map_err(|_| PyValueError::new_err(format!("{value} is not an index")))
    };
    let mut out = Vec::with_capacity(m);
    let mut first_point = 0;
    for k in 0..m {
        let (start, stop, pose) = (
            index(ranges[[k, 0]])?,
            index(ranges[[k, 1]])?,
            index(before[k])?,
        );
        if start + 2 > stop || stop > n {
            return Err(PyValueError::new_err(format!(
                "move {k} covers samples {start}..{stop} of {}",
                time_s.len()
            )));
        }
        if pose + 1 >= pose_time_s.len() {
            return Err(PyValueError::new_err(format!(
                "move {k} begins in pose {pose} and there is none after it"
            )));
        }
        let extra = [0, 1, 2, 3].map(|s| Vector3::from_fn(|i, _| unresolved[[k, s, i]]));
        out.push(Move::new(
            pose,
            &time_s[start..stop],
            rows(&rate, start, stop),
            rows(&force, start, stop),
            [pose_time_s[pose], pose_time_s[pose + 1]],
            extra,
            first_point,
        ));
        first_point += stop - start;
    }
    find_gaps(&mut out);
    Ok(out)
}
