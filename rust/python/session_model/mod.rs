//! Bindings of the joint model of a session.

mod evidence;
mod fit;
mod poses;
mod read_out;

use std::sync::Arc;

use nalgebra::{SMatrix, Vector3};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::arrays::rows3;
use crate::session_model::fit::{Extent, fit};
use crate::session_model::moves::MoveNoise;
use crate::session_model::strength_search::Within;
use crate::session_model::strengths::tune;
use crate::session_model::{Distortion, N_MODEL, Prior, Session, Strengths};
use fit::SessionFit;
use poses::{SessionMoves, SessionPoses, SessionState};

type Array2<'py> = PyReadonlyArray2<'py, f64>;
type Array3<'py> = PyReadonlyArray3<'py, f64>;
/// A value for the accelerometer and one for the gyro.
type Pair = (f64, f64);
/// Corner times s, scatter, departure from the line between poses, excess of moves: accelerometer and gyro (gravity and
/// velocity) each, scatter of the gyro by axis.
type AllStrengths = (Pair, (f64, f64, f64, f64), Pair, Pair);
/// Shortest corner times s, largest scatter, largest excess of moves.
type Bounds = (Pair, Pair, Pair);

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<SessionPoses>()?;
    module.add_class::<SessionMoves>()?;
    module.add_class::<SessionState>()?;
    module.add_class::<SessionModel>()?;
    module.add_class::<SessionFit>()?;
    Ok(())
}

/// Readings of a session, arranged once for many fits.
#[pyclass(frozen, module = "trihedron._core")]
struct SessionModel {
    session: Arc<Session>,
}

/// `(points, 3, k)` arrays of two sensors as one distortion.
fn distortion(
    force: Option<&Array3<'_>>,
    rate: Option<&Array3<'_>>,
    session: &Session,
) -> PyResult<Distortion> {
    let n_points = session.n_points();
    let flat = |name: &str, array: Option<&Array3<'_>>| -> PyResult<Option<(Vec<f64>, usize)>> {
        let Some(array) = array else { return Ok(None) };
        let shape = array.shape();
        if ![n_points, n_points + session.n_poses()].contains(&shape[0]) || shape[1] != 3 {
            return Err(PyValueError::new_err(format!(
                "{name} must have shape ({n_points}, 3, k), got ({}, {}, {})",
                shape[0], shape[1], shape[2]
            )));
        }
        let values = match array.as_slice() {
            Ok(flat) if array.is_c_contiguous() => flat.to_vec(),
            _ => array.as_array().iter().copied().collect(),
        };
        Ok(Some((values, shape[2])))
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
        sizes: Vec::new(),
    })
}

fn strengths_of(given: AllStrengths) -> Strengths {
    Strengths {
        corner_s: given.0.into(),
        scatter: given.1.into(),
        between: given.2.into(),
        excess: given.3.into(),
    }
}

fn all_strengths(given: &Strengths) -> AllStrengths {
    (
        given.corner_s.into(),
        given.scatter.into(),
        given.between.into(),
        given.excess.into(),
    )
}

fn within_of(given: Bounds) -> Within {
    Within {
        corner_s: given.0.into(),
        scatter: given.1.into(),
        excess: given.2.into(),
    }
}

fn sizes_fit(sizes: &[f64], k: usize) -> PyResult<()> {
    if sizes.len() == k && sizes.iter().all(|size| *size > 0.0) {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{k} effect parameters need as many positive sizes, got {}",
        sizes.len()
    )))
}

#[pymethods]
impl SessionModel {
    /// `gravity`: |g| m/s², rotation of the Earth about the vertical rad/s (0 where no latitude is known). `noise`:
    /// jitter of the sample instants s, usual step s. `prior`: mean `(18,)`, covariance `(18, 18)`, whether it is weak.
    /// `scatter`: `(2, 3)` raw, the scatter of strength one, and the strength of the accelerometer's scatter that is
    /// expected from its noise inside poses, 0 where there is none.
    #[new]
    #[pyo3(signature = (*, gravity, poses, moves, noise, prior, scatter))]
    fn new(
        py: Python<'_>,
        gravity: Pair,
        poses: &SessionPoses,
        moves: &SessionMoves,
        noise: Pair,
        prior: Option<(PyReadonlyArray1<'_, f64>, Array2<'_>, bool)>,
        scatter: (Array2<'_>, f64),
    ) -> PyResult<Self> {
        let prior = prior
            .map(|(mean, covariance, is_weak)| prior_of(&mean, &covariance, is_weak))
            .transpose()?;
        let [force_unit, rate_unit] = rows3("scatter", &scatter.0)?[..] else {
            return Err(PyValueError::new_err("scatter must have shape (2, 3)"));
        };
        let (jitter_s, nominal_step_s) = noise;
        let noise = MoveNoise {
            force_density: poses.force.density,
            rate_density: poses
                .rate
                .as_ref()
                .map_or_else(Vector3::zeros, |rate| rate.density),
            jitter_s,
            nominal_step_s,
        };
        let session = Session {
            gravity: gravity.0,
            earth_up: gravity.1,
            time_s: poses.time_s.clone(),
            force: poses.force.clone(),
            rate: poses.rate.clone(),
            moves: Arc::clone(&moves.moves),
            noise,
            prior,
            scatter: Some([force_unit, rate_unit]),
            expected_scatter: scatter.1,
        };
        super::run(py, || session.check())?;
        Ok(Self {
            session: Arc::new(session),
        })
    }

    /// Fits from a state, at the `strengths` given, or at the most likely ones from there `within` some bounds; `is_near`
    /// where it is that of a fit, `is_rough` where a search of further unknowns follows.
    #[expect(
        clippy::too_many_arguments,
        reason = "named, and a thin seam: each is one array of the caller"
    )]
    #[pyo3(signature = (*, state, strengths, force_effect, rate_effect, within=None, sizes=None, is_near=false, is_rough=false))]
    fn fit(
        &self,
        py: Python<'_>,
        state: &SessionState,
        strengths: AllStrengths,
        force_effect: Option<Array3<'_>>,
        rate_effect: Option<Array3<'_>>,
        within: Option<Bounds>,
        sizes: Option<Vec<f64>>,
        is_near: bool,
        is_rough: bool,
    ) -> PyResult<SessionFit> {
        let start = self.checked(state)?;
        let mut effects = distortion(force_effect.as_ref(), rate_effect.as_ref(), &self.session)?;
        if start.effect.len() != effects.k {
            return Err(PyValueError::new_err(format!(
                "{} effect parameters came with {} columns",
                start.effect.len(),
                effects.k
            )));
        }
        if let Some(sizes) = sizes {
            sizes_fit(&sizes, effects.k)?;
            effects.sizes = sizes;
        }
        let strengths = strengths_of(strengths);
        let extent = Extent { is_near, is_rough };
        let session = Arc::clone(&self.session);
        let found = super::run_long(py, || match within {
            Some(within) => tune(
                &session,
                start,
                strengths,
                &effects,
                &within_of(within),
                extent,
            ),
            None => fit(&session, start, strengths, &effects, extent),
        })?;
        Ok(SessionFit::new(Arc::clone(&self.session), found))
    }
}

impl SessionModel {
    fn checked(&self, state: &SessionState) -> PyResult<crate::session_model::State> {
        let h = self.session.n_poses();
        if state.state.up.len() != h {
            return Err(PyValueError::new_err(format!(
                "the state needs one vertical for each of {h} poses, got {}",
                state.state.up.len()
            )));
        }
        Ok(state.state.clone())
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
