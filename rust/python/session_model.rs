//! The joint model of a session across the seam.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::poisson::{matrix3, samples, vector3};
use super::rotation::rows3;
use crate::session_model::fit::{Fit, fit, tune};
use crate::session_model::moves::{Move, MoveNoise};
use crate::session_model::predict::domain_of;
use crate::session_model::{AtRest, Distortion, N_MODEL, Prior, Session, State, Strengths};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<SessionModel>()?;
    module.add_class::<SessionFit>()?;
    Ok(())
}

/// What was read in a session, arranged once for many fits.
#[pyclass(frozen, module = "trihedron._core")]
struct SessionModel {
    session: Arc<Session>,
}

/// A session at its optimum.
#[pyclass(frozen, module = "trihedron._core")]
struct SessionFit {
    session: Arc<Session>,
    fit: Arc<Fit>,
}

type Array2<'py> = PyReadonlyArray2<'py, f64>;
type Array3<'py> = PyReadonlyArray3<'py, f64>;

/// `(points, 3, k)` arrays of two sensors as one distortion.
fn distortion(
    force: Option<&Array3<'_>>,
    rate: Option<&Array3<'_>>,
    n_points: usize,
) -> PyResult<Distortion> {
    let flat = |name: &str, array: Option<&Array3<'_>>| -> PyResult<Option<(Vec<f64>, usize)>> {
        let Some(array) = array else { return Ok(None) };
        let shape = array.shape();
        if shape[0] != n_points || shape[1] != 3 {
            return Err(PyValueError::new_err(format!(
                "{name} must have shape ({n_points}, 3, k), got ({}, {}, {})",
                shape[0], shape[1], shape[2]
            )));
        }
        Ok(Some((array.as_array().iter().copied().collect(), shape[2])))
    };
    let force = flat("force", force)?;
    let rate = flat("rate", rate)?;
    let k = force
        .as_ref()
        .or(rate.as_ref())
        .map_or(0, |(_, columns)| *columns);
    if let (Some((_, a)), Some((_, b))) = (&force, &rate)
        && a != b
    {
        return Err(PyValueError::new_err(format!(
            "an effect has {a} columns of force and {b} of rate: they must be the same parameters"
        )));
    }
    Ok(Distortion {
        force: force.map(|(values, _)| values).filter(|_| k > 0),
        rate: rate.map(|(values, _)| values).filter(|_| k > 0),
        k,
    })
}

#[pymethods]
impl SessionModel {
    #[new]
    #[pyo3(signature = (*, gravity_m_s2, hold_time_s, hold_force, hold_force_sigma, force_density, hold_rate,
        hold_rate_sigma, rate_density, time_s, force, rate, ranges, before, unresolved, jitter_s, nominal_step_s,
        inflation, prior, is_prior_weak, scatter))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        gravity_m_s2: f64,
        hold_time_s: PyReadonlyArray1<'_, f64>,
        hold_force: Array2<'_>,
        hold_force_sigma: Array2<'_>,
        force_density: PyReadonlyArray1<'_, f64>,
        hold_rate: Option<Array2<'_>>,
        hold_rate_sigma: Option<Array2<'_>>,
        rate_density: Option<PyReadonlyArray1<'_, f64>>,
        time_s: PyReadonlyArray1<'_, f64>,
        force: Array2<'_>,
        rate: Option<Array2<'_>>,
        ranges: PyReadonlyArray2<'_, i64>,
        before: PyReadonlyArray1<'_, i64>,
        unresolved: Array3<'_>,
        jitter_s: f64,
        nominal_step_s: f64,
        inflation: (f64, f64),
        prior: Option<(PyReadonlyArray1<'_, f64>, Array2<'_>)>,
        is_prior_weak: bool,
        scatter: Option<Array2<'_>>,
    ) -> PyResult<Self> {
        let at_rest = |mean: &Array2<'_>,
                       sigma: &Array2<'_>,
                       density: &PyReadonlyArray1<'_, f64>|
         -> PyResult<AtRest> {
            Ok(AtRest {
                mean: rows3("hold means", mean)?,
                sigma: rows3("hold sigmas", sigma)?,
                density: vector3("density", density)?,
            })
        };
        let of_rate = match (&hold_rate, &hold_rate_sigma, &rate_density) {
            (Some(mean), Some(sigma), Some(density)) => Some(at_rest(mean, sigma, density)?),
            _ => None,
        };
        let prior = prior
            .map(|(mean, covariance)| prior_of(&mean, &covariance, is_prior_weak))
            .transpose()?;
        let scatter = scatter
            .map(|array| {
                let rows = rows3("scatter", &array)?;
                match rows.as_slice() {
                    [a, b] => Ok([*a, *b]),
                    _ => Err(PyValueError::new_err("scatter must have shape (2, 3)")),
                }
            })
            .transpose()?;
        let time_s = samples(&time_s);
        let hold_time_s = samples(&hold_time_s);
        let moves = moves_of(
            &time_s,
            &hold_time_s,
            &force,
            rate.as_ref(),
            &ranges,
            &before,
            &unresolved,
        )?;
        let zero = Vector3::zeros();
        let of_force = at_rest(&hold_force, &hold_force_sigma, &force_density)?;
        let noise = MoveNoise {
            force_density: of_force.density,
            rate_density: of_rate.as_ref().map_or(zero, |rate: &AtRest| rate.density),
            jitter_s,
            nominal_step_s,
            inflation: [inflation.0, inflation.1],
        };
        let session = Session {
            gravity: gravity_m_s2,
            time_s: hold_time_s,
            force: of_force,
            rate: of_rate,
            moves,
            noise,
            prior,
            scatter,
        };
        super::run(py, || session.check())?;
        Ok(Self {
            session: Arc::new(session),
        })
    }

    /// Fits from a state; `corners_s` and `scatter` are chosen by marginal likelihood when `is_tuned`.
    #[pyo3(signature = (*, force_scale, force_bias, rate_scale, up, rate_zero, force_zero, effect, corners_s, scatter,
        force_effect, rate_effect, is_tuned))]
    #[allow(clippy::too_many_arguments)]
    fn fit(
        &self,
        py: Python<'_>,
        force_scale: Array2<'_>,
        force_bias: PyReadonlyArray1<'_, f64>,
        rate_scale: Array2<'_>,
        up: Array2<'_>,
        rate_zero: Array2<'_>,
        force_zero: Array2<'_>,
        effect: PyReadonlyArray1<'_, f64>,
        corners_s: (f64, f64),
        scatter: (f64, f64),
        force_effect: Option<Array3<'_>>,
        rate_effect: Option<Array3<'_>>,
        is_tuned: bool,
    ) -> PyResult<SessionFit> {
        let state = self.state(
            &force_scale,
            &force_bias,
            &rate_scale,
            [&up, &rate_zero, &force_zero],
            samples(&effect),
        )?;
        let effects = distortion(
            force_effect.as_ref(),
            rate_effect.as_ref(),
            self.session.n_points(),
        )?;
        if state.effect.len() != effects.k {
            return Err(PyValueError::new_err(format!(
                "{} effect parameters came with {} columns",
                state.effect.len(),
                effects.k
            )));
        }
        let strengths = Strengths {
            corner_s: [corners_s.0, corners_s.1],
            scatter: [scatter.0, scatter.1],
        };
        let session = Arc::clone(&self.session);
        let found = super::run_long(py, || {
            if is_tuned {
                tune(&session, state, strengths, &effects)
            } else {
                fit(&session, state, strengths, &effects)
            }
        })?;
        Ok(SessionFit {
            session: Arc::clone(&self.session),
            fit: Arc::new(found),
        })
    }

    /// `(moves, 5)` whitened residuals of the moves at a state, nothing fitted.
    #[pyo3(signature = (*, force_scale, force_bias, rate_scale, up, rate_zero, force_zero))]
    #[allow(clippy::too_many_arguments)]
    fn move_residuals<'py>(
        &self,
        py: Python<'py>,
        force_scale: Array2<'py>,
        force_bias: PyReadonlyArray1<'py, f64>,
        rate_scale: Array2<'py>,
        up: Array2<'py>,
        rate_zero: Array2<'py>,
        force_zero: Array2<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let state = self.state(
            &force_scale,
            &force_bias,
            &rate_scale,
            [&up, &rate_zero, &force_zero],
            Vec::new(),
        )?;
        let session = Arc::clone(&self.session);
        let (weights, passed) = super::run(py, || session.weigh(&state, &Distortion::default()))?;
        let flat: Vec<f64> = weights
            .white
            .iter()
            .zip(&passed)
            .flat_map(|(white, one)| (white * one.carried.residual).as_slice().to_vec())
            .collect();
        flat.to_pyarray(py).reshape([passed.len(), 5])
    }
}

impl SessionModel {
    fn state(
        &self,
        force_scale: &Array2<'_>,
        force_bias: &PyReadonlyArray1<'_, f64>,
        rate_scale: &Array2<'_>,
        of_poses: [&Array2<'_>; 3],
        effect: Vec<f64>,
    ) -> PyResult<State> {
        let h = self.session.n_poses();
        let [up, rate_zero, force_zero] = of_poses;
        let state = State {
            force_scale: matrix3("force_scale", force_scale)?,
            force_bias: vector3("force_bias", force_bias)?,
            rate_scale: matrix3("rate_scale", rate_scale)?,
            up: rows3("up", up)?,
            rate_zero: rows3("rate_zero", rate_zero)?,
            force_zero: rows3("force_zero", force_zero)?,
            own: [vec![Vector3::zeros(); h], vec![Vector3::zeros(); h]],
            effect: DVector::from_vec(effect),
        };
        if [
            state.up.len(),
            state.rate_zero.len(),
            state.force_zero.len(),
        ] != [h; 3]
        {
            return Err(PyValueError::new_err(format!(
                "the state needs one vertical and one zero of each sensor for each of {h} poses"
            )));
        }
        Ok(state)
    }
}

fn prior_of(
    mean: &PyReadonlyArray1<'_, f64>,
    covariance: &Array2<'_>,
    is_weak: bool,
) -> PyResult<Prior> {
    if mean.as_array().len() != N_MODEL || covariance.shape() != [N_MODEL, N_MODEL] {
        return Err(PyValueError::new_err(
            "a prior has 18 values and an (18, 18) covariance",
        ));
    }
    let view = covariance.as_array();
    let matrix = SMatrix::<f64, N_MODEL, N_MODEL>::from_fn(|i, j| view[[i, j]]);
    // Counts and m/s² spread the variances over many decades: scaled to a unit diagonal first.
    let size = matrix.diagonal().map(f64::sqrt);
    let scaled = SMatrix::<f64, N_MODEL, N_MODEL>::from_fn(|i, j| {
        matrix[(i, j)] / (size[i] * size[j]) + if i == j { 1e-13 } else { 0.0 }
    });
    let half = scaled
        .cholesky()
        .and_then(|half| half.l().try_inverse())
        .ok_or_else(|| {
            PyValueError::new_err(
                "the covariance of the given calibration is not positive definite",
            )
        })?;
    let white = SMatrix::from_fn(|i, j| half[(i, j)] / size[j]);
    let values = mean.as_array();
    Ok(Prior {
        mean: nalgebra::SVector::from_fn(|i, _| values[i]),
        white,
        is_weak,
    })
}

fn moves_of(
    time_s: &[f64],
    hold_time_s: &[f64],
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
    if ranges.shape()[1] != 2 || before.as_array().len() != m || unresolved.shape() != [m, 2, 3] {
        return Err(PyValueError::new_err(format!(
            "{m} moves need ranges ({m}, 2), holds ({m},) and unresolved variances ({m}, 2, 3)"
        )));
    }
    let Some(rate) = rate else {
        return Err(PyValueError::new_err("moves need a gyro"));
    };
    let (force, rate) = (rows3("force", force)?, rows3("rate", rate)?);
    let (ranges, before, unresolved) =
        (ranges.as_array(), before.as_array(), unresolved.as_array());
    let index = |value: i64| {
        usize::try_from(value)
            .map_err(|_| PyValueError::new_err(format!("{value} is not an index")))
    };
    let mut out = Vec::with_capacity(m);
    let mut first_point = 0;
    for k in 0..m {
        let (start, stop, hold) = (
            index(ranges[[k, 0]])?,
            index(ranges[[k, 1]])?,
            index(before[k])?,
        );
        if start + 2 > stop || stop > time_s.len() || stop > force.len() || stop > rate.len() {
            return Err(PyValueError::new_err(format!(
                "move {k} covers samples {start}..{stop} of {}",
                time_s.len()
            )));
        }
        if hold + 1 >= hold_time_s.len() {
            return Err(PyValueError::new_err(format!(
                "move {k} begins in pose {hold} and there is none after it"
            )));
        }
        let extra = [0, 1].map(|s| Vector3::from_fn(|i, _| unresolved[[k, s, i]]));
        out.push(Move::new(
            hold,
            &time_s[start..stop],
            rate[start..stop].to_vec(),
            force[start..stop].to_vec(),
            [hold_time_s[hold], hold_time_s[hold + 1]],
            extra,
            first_point,
        ));
        first_point += stop - start;
    }
    Ok(out)
}

fn matrix<'py>(py: Python<'py>, value: &DMatrix<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    value
        .transpose()
        .as_slice()
        .to_pyarray(py)
        .reshape([value.nrows(), value.ncols()])
}

fn vectors<'py>(py: Python<'py>, values: &[Vector3<f64>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = values.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
    flat.to_pyarray(py).reshape([values.len(), 3])
}

fn of3<'py>(py: Python<'py>, value: &Matrix3<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    value.transpose().as_slice().to_pyarray(py).reshape([3, 3])
}

fn dmatrix(array: &Array2<'_>) -> DMatrix<f64> {
    let view = array.as_array();
    DMatrix::from_fn(array.shape()[0], array.shape()[1], |i, j| view[[i, j]])
}

#[pymethods]
impl SessionFit {
    #[getter]
    fn force_scale<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of3(py, &self.fit.state.force_scale)
    }

    #[getter]
    fn force_bias<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.fit.state.force_bias.as_slice().to_pyarray(py)
    }

    #[getter]
    fn rate_scale<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of3(py, &self.fit.state.rate_scale)
    }

    #[getter]
    fn up<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.fit.state.up)
    }

    #[getter]
    fn rate_zero<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.fit.state.rate_zero)
    }

    #[getter]
    fn force_zero<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.fit.state.force_zero)
    }

    #[getter]
    fn effect<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.fit.state.effect.as_slice().to_pyarray(py)
    }

    #[getter]
    fn corners_s(&self) -> (f64, f64) {
        let [a, b] = self.fit.strengths.corner_s;
        (a, b)
    }

    #[getter]
    fn scatter(&self) -> (f64, f64) {
        let [a, b] = self.fit.strengths.scatter;
        (a, b)
    }

    #[getter]
    fn is_walk_at_edge(&self) -> (bool, bool) {
        let [a, b] = self.fit.is_walk_at_edge();
        (a, b)
    }

    #[getter]
    fn chi2(&self) -> f64 {
        self.fit.chi2()
    }

    #[getter]
    fn log_marginal(&self) -> f64 {
        self.fit.log_marginal()
    }

    #[getter]
    fn log_profile(&self) -> f64 {
        self.fit.log_profile()
    }

    #[getter]
    fn is_converged(&self) -> bool {
        self.fit.stop.is_converged()
    }

    #[getter]
    fn stopped_because(&self) -> &'static str {
        self.fit.stop.in_words()
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.fit.iterations
    }

    /// `(undamped step in standard errors of all rows, orthogonality of the residual)` where it stopped.
    #[getter]
    fn convergence(&self) -> (f64, f64) {
        (self.fit.step, self.fit.gradient)
    }

    /// `(rows,)` whitened residuals.
    #[getter]
    fn residual<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let flat: Vec<f64> = self
            .fit
            .groups
            .iter()
            .flat_map(|group| group.rows.residual.as_slice().to_vec())
            .collect();
        flat.to_pyarray(py)
    }

    /// `(rows, 4)` domain, segment, channel and process of every row.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let mut flat: Vec<i64> = Vec::new();
        for group in &self.fit.groups {
            for r in 0..group.rows.len() {
                let domain = domain_of(group, r);
                let channel = match domain {
                    crate::session_model::rows::Domain::Dynamics => r - 2,
                    _ => r % 3,
                };
                flat.extend([
                    domain as i64,
                    i64::try_from(group.segment).unwrap_or(i64::MAX),
                    i64::try_from(channel).unwrap_or(i64::MAX),
                    group.kind as i64,
                ]);
            }
        }
        let n = flat.len() / 4;
        flat.to_pyarray(py).reshape([n, 4])
    }

    /// `(points, 3)` corrected rate and force, `(move samples, 3, 3)` attitude since each move began.
    #[allow(clippy::type_complexity)]
    fn path<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray3<f64>>,
    )> {
        let h = self.session.n_poses();
        let mut rate = vec![Vector3::zeros(); h];
        let mut force: Vec<Vector3<f64>> = self
            .fit
            .state
            .up
            .iter()
            .map(|up| up * self.session.gravity)
            .collect();
        let mut attitude: Vec<f64> = Vec::new();
        for one in &self.fit.passed {
            rate.extend_from_slice(&one.carried.rate);
            force.extend_from_slice(&one.carried.force);
            for turn in &one.carried.attitude {
                attitude.extend_from_slice(turn.transpose().as_slice());
            }
        }
        let n = attitude.len() / 9;
        Ok((
            vectors(py, &rate)?,
            vectors(py, &force)?,
            attitude.to_pyarray(py).reshape([n, 3, 3])?,
        ))
    }

    /// `(moves, 5)` residuals of moves in SI and `(moves, 5, 5)` their noise.
    #[allow(clippy::type_complexity)]
    fn moves<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
        let m = self.fit.passed.len();
        let residual: Vec<f64> = self
            .fit
            .passed
            .iter()
            .flat_map(|one| one.carried.residual.as_slice().to_vec())
            .collect();
        let covariance: Vec<f64> = self
            .fit
            .move_covariance()
            .iter()
            .flat_map(|cov| cov.as_slice().to_vec())
            .collect();
        Ok((
            residual.to_pyarray(py).reshape([m, 5])?,
            covariance.to_pyarray(py).reshape([m, 5, 5])?,
        ))
    }

    /// `(moves, 5, 5)` whitening of the moves' residuals.
    fn whitening<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let flat: Vec<f64> = self
            .fit
            .weights
            .white
            .iter()
            .flat_map(|white| white.transpose().as_slice().to_vec())
            .collect();
        flat.to_pyarray(py)
            .reshape([self.fit.weights.white.len(), 5, 5])
    }

    /// `(rows, k)` whitened change of every row per parameter of further effects.
    fn columns<'py>(
        &self,
        py: Python<'py>,
        force: Option<Array3<'py>>,
        rate: Option<Array3<'py>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let effects = distortion(force.as_ref(), rate.as_ref(), self.session.n_points())?;
        let fit = Arc::clone(&self.fit);
        let session = Arc::clone(&self.session);
        let parts = super::run_long(py, || {
            session.columns(&fit.state, &fit.groups, &fit.weights, &fit.passed, &effects)
        })?;
        let n = self.fit.n_rows();
        let mut flat = Vec::with_capacity(n * effects.k);
        for part in &parts {
            flat.extend_from_slice(part.transpose().as_slice());
        }
        flat.to_pyarray(py).reshape([n, effects.k])
    }

    /// Columns `(rows, k)` minus what the unknowns of the fit can imitate.
    fn project<'py>(
        &self,
        py: Python<'py>,
        columns: Array2<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        if columns.shape()[0] != self.fit.n_rows() {
            return Err(PyValueError::new_err(format!(
                "columns must have {} rows, got {}",
                self.fit.n_rows(),
                columns.shape()[0]
            )));
        }
        let columns = dmatrix(&columns);
        let fit = Arc::clone(&self.fit);
        let out = super::run(py, || Ok(fit.project(&columns)))?;
        matrix(py, &out)
    }

    /// `(rows,)` share of every row that the fit used up.
    fn leverage<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let fit = Arc::clone(&self.fit);
        Ok(super::run(py, || Ok(fit.leverage()))?.to_pyarray(py))
    }

    /// Held-out prediction of folds of rows, `(folds, rows)` flags: χ² `(folds, 4)`, log-determinants `(folds,)`,
    /// directions `(4,)`, innovations `(rows,)` whitened, and over each row's own noise.
    #[allow(clippy::type_complexity)]
    fn held_out<'py>(
        &self,
        py: Python<'py>,
        folds: PyReadonlyArray2<'py, bool>,
    ) -> PyResult<(
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<f64>>,
    )> {
        if folds.shape()[1] != self.fit.n_rows() {
            return Err(PyValueError::new_err(
                "folds must have one flag for every row",
            ));
        }
        let view = folds.as_array();
        let firsts = self.fit.first_rows();
        let lists: Vec<Vec<usize>> = view
            .rows()
            .into_iter()
            .map(|row| (0..firsts.len()).filter(|&g| row[firsts[g]]).collect())
            .collect();
        let fit = Arc::clone(&self.fit);
        let out = super::run_long(py, || fit.held_out(&lists))?;
        let flat: Vec<f64> = out.chi2.iter().flatten().copied().collect();
        Ok((
            flat.to_pyarray(py).reshape([out.chi2.len(), 4])?,
            out.log_det.to_pyarray(py),
            out.n_rows.to_pyarray(py),
            out.residual.to_pyarray(py),
            out.innovation.to_pyarray(py),
        ))
    }

    /// Covariance of what all poses share: both linear models (18), then effects.
    fn border_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.fit.border_covariance())
    }

    /// `(24, 24)` covariance of `(S_a, b_a, S_w, b_w)` on raw readings centred at two origins, and `b_w` `(3,)` with one
    /// zero for the session.
    #[allow(clippy::type_complexity)]
    fn linear_covariance<'py>(
        &self,
        py: Python<'py>,
        force_origin: PyReadonlyArray1<'py, f64>,
        rate_origin: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
        let origins = [
            vector3("force_origin", &force_origin)?,
            vector3("rate_origin", &rate_origin)?,
        ];
        let (covariance, bias) = self.fit.linear_covariance(&self.session, &origins);
        Ok((matrix(py, &covariance)?, bias.as_slice().to_pyarray(py)))
    }

    /// `(rows, unknowns)` the Jacobian in full: border, then pose after pose. For tests and small sessions.
    fn jacobian<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let layout = self.fit.layout();
        let mut out = DMatrix::zeros(self.fit.n_rows(), layout.n());
        for (group, first) in self.fit.groups.iter().zip(self.fit.first_rows()) {
            let rows = group.rows.len();
            let mut part = DMatrix::zeros(layout.n(), rows);
            group
                .rows
                .add_transposed(layout, &DMatrix::identity(rows, rows), &mut part);
            out.rows_mut(first, rows).copy_from(&part.transpose());
        }
        matrix(py, &out)
    }
}
