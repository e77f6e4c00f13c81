//! Bindings of a fitted session.

use std::sync::{Arc, OnceLock};

use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, ToPyArray,
};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::evidence::{Answer, Candidate, Glance, seen, tuned};
use super::read_out::{
    Blocks, Path, Rows, Shares, flagged, labels, moves, path, shares_of, stacked,
};
use super::{AllStrengths, Bounds, all_strengths, distortion};
use crate::error::Result;
use crate::python::arrays::{matrix, of3, stack3, vector3, vectors};
use crate::python::{run, run_long};
use crate::session_model::fit::Fit;
use crate::session_model::move_rows::Weights;
use crate::session_model::{Session, Strengths};

type Array3<'py> = PyReadonlyArray3<'py, f64>;
/// `S_a`, `b_a`, `S_w`, covariance.
type Rest<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// A session at its optimum.
#[pyclass(frozen, module = "trihedron._core")]
pub(super) struct SessionFit {
    pub session: Arc<Session>,
    pub fit: Arc<Fit>,
    /// Leverage of every row, computed at the first request.
    leverage: OnceLock<Vec<f64>>,
}

impl SessionFit {
    pub fn new(session: Arc<Session>, fit: Fit) -> Self {
        Self {
            session,
            fit: Arc::new(fit),
            leverage: OnceLock::new(),
        }
    }
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

    /// `b_a` with one bias for the session.
    #[getter]
    fn session_force_bias<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.fit
            .state
            .session_force_bias()
            .as_slice()
            .to_pyarray(py)
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
    fn pose_rate_bias<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.fit.state.pose_rate_bias)
    }

    #[getter]
    fn pose_force_bias<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.fit.state.pose_force_bias)
    }

    #[getter]
    fn effect<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.fit.state.effect.as_slice().to_pyarray(py)
    }

    /// Corner times, s; scatter of either bias in its unit (accelerometer, gyro by axis); departure of a bias from the
    /// line between poses, in units of its scatter; excess of moves.
    #[getter]
    fn strengths(&self) -> AllStrengths {
        all_strengths(&self.fit.strengths)
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
    fn is_converged(&self) -> bool {
        self.fit.stop.is_converged()
    }

    #[getter]
    fn stopped_because(&self) -> &'static str {
        self.fit.stop.name()
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.fit.iterations
    }

    /// `(rows,)` whitened residuals, of moves without the weights of heavy tails.
    #[getter]
    fn residual<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.fit.residual().to_pyarray(py)
    }

    /// `(rows, 4)` domain, segment, channel and process of every row.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        labels(py, &self.fit)
    }

    /// `(points, 3)` corrected rate and force, minus gravity propagated by the gyro from the start of each move;
    /// `(points, 3, 3)` rotation since the move began.
    fn path<'py>(&self, py: Python<'py>) -> PyResult<Path<'py>> {
        path(py, &self.session, &self.fit)
    }

    /// `(points, 3, 3)` local level (z up, any azimuth) → body; NaN but for the vertical where no chain of moves leads.
    fn attitude<'py>(&self, py: Python<'py>) -> PyResult<Blocks<'py>> {
        stack3(py, self.session.attitude(&self.fit).into_iter())
    }

    /// `(moves, 5)` residuals of moves in SI and `(moves, 5, 5)` their noise.
    fn moves<'py>(&self, py: Python<'py>) -> PyResult<(Rows<'py>, Blocks<'py>)> {
        moves(py, &self.fit)
    }

    /// `(moves,)` weight of every move's residuals by heavy tails, at most 1.
    #[getter]
    fn tails<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.fit.weights.tail.as_slice().to_pyarray(py)
    }

    /// `(moves, 5, 5)` whitening of the moves' residuals, without the weights of heavy tails.
    fn whitening<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let weights = &self.fit.weights;
        let each = weights.white.iter().zip(&weights.tail);
        let flat: Vec<f64> = each
            .flat_map(|(white, tail)| (white.transpose() / tail.sqrt()).as_slice().to_vec())
            .collect();
        flat.to_pyarray(py).reshape([weights.white.len(), 5, 5])
    }

    /// `(moves, 5)` residuals of the moves, whitened by the noise that was predicted for them before it was widened.
    fn moves_over_predicted<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let strengths = Strengths {
            excess: [1.0; 2],
            ..self.fit.strengths
        };
        let passed = &self.fit.passed;
        let weights = run(py, || Weights::gaussian(passed, &strengths))?;
        let each = passed.iter().zip(&weights.white);
        let flat: Vec<f64> = each
            .flat_map(|(one, white)| (white * one.carried.residual).as_slice().to_vec())
            .collect();
        flat.to_pyarray(py).reshape([passed.len(), 5])
    }

    /// `(rows, k)` whitened change of every row per parameter of further effects.
    fn columns<'py>(
        &self,
        py: Python<'py>,
        force: Option<Array3<'py>>,
        rate: Option<Array3<'py>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let effects = distortion(force.as_ref(), rate.as_ref(), &self.session)?;
        let fit = Arc::clone(&self.fit);
        let session = Arc::clone(&self.session);
        // Takes tenths of a millisecond: a thread of its own would take longer to start.
        let parts = run(py, || {
            session.columns(&fit.state, &fit.groups, &fit.weights, &fit.passed, &effects)
        })?;
        stacked(py, &parts, effects.k)
    }

    /// Log-evidence of every hypothesis (force, rate, prior sizes of further effects), all but noise strengths
    /// integrated out; these are searched from the best of those given, `within` shortest corner times, largest scatter
    /// and largest excess. With it the strengths, the parameters one linear step from this fit, and their covariance.
    fn evidence<'py>(
        &self,
        py: Python<'py>,
        hypotheses: Vec<Candidate<'py>>,
        strengths: Vec<AllStrengths>,
        within: Bounds,
    ) -> PyResult<Vec<Answer<'py>>> {
        tuned(
            (&self.session, &self.fit),
            py,
            &hypotheses,
            strengths,
            within,
        )
    }

    /// Gain of every candidate in log-evidence at each of the `strengths`, over the fit without it at the first of
    /// them, its prior sizes times each of the `scales`:
    /// `(scales, strengths)`; its parameters and their covariance at the first strengths and their best scale. With
    /// `parts` of each candidate (indices of columns), the gain of each part instead, candidate after candidate.
    #[pyo3(signature = (candidates, scales, strengths, parts=None))]
    fn candidate_gains<'py>(
        &self,
        py: Python<'py>,
        candidates: Vec<Candidate<'py>>,
        scales: Vec<f64>,
        strengths: Vec<AllStrengths>,
        parts: Option<Vec<Vec<Vec<usize>>>>,
    ) -> PyResult<Vec<Glance<'py>>> {
        seen(
            (&self.session, &self.fit),
            py,
            &candidates,
            scales,
            strengths,
            parts,
        )
    }

    /// Log-evidence `(k,)` of every share of lost samples, change of the gyro's `S` `(k, 9)` and its covariance
    /// `(k, 9, 9)`; `None` where none is likelier than every share.
    fn lost_samples<'py>(
        &self,
        py: Python<'py>,
        shares: Vec<f64>,
    ) -> PyResult<Option<Shares<'py>>> {
        let fit = Arc::clone(&self.fit);
        let Some(found) = run_long(py, || fit.lost_samples(&shares))? else {
            return Ok(None);
        };
        Ok(Some(shares_of(py, &found)?))
    }

    /// `(rows,)` leverage of every row.
    fn leverage<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (fit, known) = (&self.fit, &self.leverage);
        Ok(run(py, || Ok(known.get_or_init(|| fit.leverage())))?.to_pyarray(py))
    }

    /// Cross-validation of folds of rows, `(folds, rows)` flags: χ² `(folds, 4)`, log-determinants `(folds,)`,
    /// directions `(4,)`, innovations `(rows,)` whitened, and in units of each row's own noise.
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
        let lists = flagged(&self.fit, &folds)?;
        let fit = Arc::clone(&self.fit);
        let out = run_long(py, || fit.held_out(&lists))?;
        let flat: Vec<f64> = out.chi2.iter().flatten().copied().collect();
        Ok((
            flat.to_pyarray(py).reshape([out.chi2.len(), 4])?,
            out.log_det.to_pyarray(py),
            out.n_rows.to_pyarray(py),
            out.residual.to_pyarray(py),
            out.innovation.to_pyarray(py),
        ))
    }

    /// Covariance of the parameters that all poses share: both linear models (18), then effects.
    fn border_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.fit.border_covariance())
    }

    /// `(24, 24)` covariance of `(S_a, b_a, S_w, b_w)` on raw readings centred at two origins, and `b_w` `(3,)`, with
    /// one bias of either sensor for the session.
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
        let (fit, session) = (Arc::clone(&self.fit), Arc::clone(&self.session));
        let (covariance, bias) = run_long(py, || fit.linear_covariance(&session, &origins))?;
        Ok((matrix(py, &covariance)?, bias.as_slice().to_pyarray(py)))
    }

    /// The fit without the rows flagged, for every fold `(folds, rows)`: `S_a`, `b_a`, `S_w` on centred readings, and
    /// the `(12, 12)` covariance of `(S_a, b_a)` on raw ones.
    fn without<'py>(
        &self,
        py: Python<'py>,
        folds: PyReadonlyArray2<'py, bool>,
        force_origin: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Vec<Rest<'py>>> {
        let lists = flagged(&self.fit, &folds)?;
        let origin = vector3("force_origin", &force_origin)?;
        let fit = Arc::clone(&self.fit);
        let found = run_long(py, || {
            let each = lists.par_iter().map(|groups| fit.without(groups, &origin));
            each.collect::<Result<Vec<_>>>()
        })?;
        let lent = found.iter().map(|(state, covariance)| {
            Ok((
                of3(py, &state.force_scale)?,
                state.session_force_bias().as_slice().to_pyarray(py),
                of3(py, &state.rate_scale)?,
                matrix(py, covariance)?,
            ))
        });
        lent.collect()
    }

    /// `(rows, unknowns)` the Jacobian in full, border first. For tests.
    fn jacobian<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.fit.jacobian())
    }
}
