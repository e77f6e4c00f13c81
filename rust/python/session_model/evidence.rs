//! Bindings of the evidence of hypotheses.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyReadonlyArray3, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::{AllStrengths, Bounds, all_strengths, distortion, sizes_fit, strengths_of, within_of};
use crate::error::Result;
use crate::python::arrays::matrix;
use crate::python::run_long;
use crate::session_model::candidate_gains::CandidateGains;
use crate::session_model::fit::Fit;
use crate::session_model::hypothesis::Hypothesis;
use crate::session_model::{Distortion, Session, Strengths};

type Array3<'py> = PyReadonlyArray3<'py, f64>;
/// Columns of force and rate of further effects, and their prior sizes.
pub(super) type Candidate<'py> = (Option<Array3<'py>>, Option<Array3<'py>>, Vec<f64>);
/// Log-evidence, strengths, parameters and their covariance.
pub(super) type Answer<'py> = (
    f64,
    AllStrengths,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// Gains `(scales, strengths)`, parameters and their covariance at the first strengths.
pub(super) type Glance<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// Every hypothesis at its most likely noise strengths.
pub(super) fn tuned<'py>(
    of: (&Arc<Session>, &Arc<Fit>),
    py: Python<'py>,
    hypotheses: &[Candidate<'py>],
    strengths: Vec<AllStrengths>,
    within: Bounds,
) -> PyResult<Vec<Answer<'py>>> {
    let starts: Vec<Strengths> = strengths.into_iter().map(strengths_of).collect();
    let within = within_of(within);
    let found = each(of, py, hypotheses, move |one| one.tuned(&starts, &within))?;
    let lent = found.iter().map(|one| {
        Ok((
            one.log_evidence,
            all_strengths(&one.strengths),
            one.estimate.as_slice().to_pyarray(py),
            matrix(py, &one.covariance)?,
        ))
    });
    lent.collect()
}

/// Gain of every candidate, or of each of the `parts` of each, at each of the given strengths (11.19).
pub(super) fn seen<'py>(
    of: (&Arc<Session>, &Arc<Fit>),
    py: Python<'py>,
    candidates: &[Candidate<'py>],
    scales: Vec<f64>,
    strengths: Vec<AllStrengths>,
    parts: Option<Vec<Vec<Vec<usize>>>>,
) -> PyResult<Vec<Glance<'py>>> {
    let at: Vec<Strengths> = strengths.into_iter().map(strengths_of).collect();
    let asked = columns_of(of.0, candidates)?;
    let parts = parts.unwrap_or_else(|| {
        let whole = asked
            .iter()
            .map(|(_, sizes)| vec![(0..sizes.len()).collect()]);
        whole.collect()
    });
    let is_there = |((_, sizes), parts): (&(_, Vec<f64>), &Vec<Vec<usize>>)| {
        parts.iter().flatten().all(|&i| i < sizes.len())
    };
    if parts.len() != asked.len() || !asked.iter().zip(&parts).all(is_there) {
        return Err(PyValueError::new_err(
            "a part names a column that is not there",
        ));
    }
    let (session, fit) = (Arc::clone(of.0), Arc::clone(of.1));
    let found = run_long(py, || {
        let gains = CandidateGains::of(&fit, &at)?;
        let each = asked
            .par_iter()
            .zip(&parts)
            .map(|((effects, sizes), parts)| {
                let columns =
                    session.columns(&fit.state, &fit.groups, &fit.weights, &fit.passed, effects)?;
                gains.of_candidates(&columns, sizes, &scales, parts)
            });
        each.collect::<Result<Vec<_>>>()
    })?;
    let lent = found.iter().flatten().map(|one| {
        Ok((
            matrix(py, &one.gain)?,
            one.estimate.as_slice().to_pyarray(py),
            matrix(py, &one.covariance)?,
        ))
    });
    lent.collect()
}

fn columns_of(
    session: &Session,
    hypotheses: &[Candidate<'_>],
) -> PyResult<Vec<(Distortion, Vec<f64>)>> {
    let each = hypotheses.iter().map(|(force, rate, sizes)| {
        let effects = distortion(force.as_ref(), rate.as_ref(), session)?;
        sizes_fit(sizes, effects.k)?;
        Ok((effects, sizes.clone()))
    });
    each.collect()
}

/// Evaluates `ask` for every hypothesis, in parallel.
fn each<T: Send + 'static>(
    of: (&Arc<Session>, &Arc<Fit>),
    py: Python<'_>,
    hypotheses: &[Candidate<'_>],
    ask: impl Fn(Hypothesis) -> Result<T> + Send + Sync + 'static,
) -> PyResult<Vec<T>> {
    let asked = columns_of(of.0, hypotheses)?;
    let (session, fit) = (Arc::clone(of.0), Arc::clone(of.1));
    run_long(py, || {
        let each = asked.par_iter().map(|(effects, sizes)| {
            let columns =
                session.columns(&fit.state, &fit.groups, &fit.weights, &fit.passed, effects)?;
            ask(Hypothesis::of(&fit, &columns, sizes)?)
        });
        each.collect::<Result<Vec<_>>>()
    })
}
