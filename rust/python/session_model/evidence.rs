//! The evidence of hypotheses across the seam.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray3, ToPyArray};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::{AllStrengths, Corners, all_strengths, distortion, sizes_fit, strengths_of};
use crate::error::Result;
use crate::python::arrays::matrix;
use crate::python::run_long;
use crate::session_model::fit::Fit;
use crate::session_model::hypothesis::Hypothesis;
use crate::session_model::strength_search::Within;
use crate::session_model::{Session, Strengths};

type Array3<'py> = PyReadonlyArray3<'py, f64>;
/// Columns of force and rate of further effects, and their sizes beforehand.
pub(super) type Asked<'py> = (Option<Array3<'py>>, Option<Array3<'py>>, Vec<f64>);
/// Log-evidence, strengths, parameters and their covariance.
pub(super) type Answer<'py> = (
    f64,
    AllStrengths,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// Every hypothesis at the strengths that make it likeliest.
pub(super) fn tuned<'py>(
    of: (&Arc<Session>, &Arc<Fit>),
    py: Python<'py>,
    hypotheses: &[Asked<'py>],
    strengths: Vec<AllStrengths>,
    within: (Corners, Corners, Corners),
) -> PyResult<Vec<Answer<'py>>> {
    let starts: Vec<Strengths> = strengths.into_iter().map(strengths_of).collect();
    let ((a, b), (c, d), (e, f)) = within;
    let within = Within {
        corner_s: [a, b],
        scatter: [c, d],
        excess: [e, f],
    };
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

/// Every hypothesis at each of some strengths.
pub(super) fn at_each<'py>(
    of: (&Arc<Session>, &Arc<Fit>),
    py: Python<'py>,
    hypotheses: &[Asked<'py>],
    strengths: Vec<AllStrengths>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let at: Vec<Strengths> = strengths.into_iter().map(strengths_of).collect();
    let n = at.len();
    let found = each(of, py, hypotheses, move |one| Ok(one.at_each(&at)))?;
    let flat: Vec<f64> = found.concat();
    flat.to_pyarray(py).reshape([found.len(), n])
}

/// What is asked of every hypothesis, side by side.
fn each<T: Send + 'static>(
    of: (&Arc<Session>, &Arc<Fit>),
    py: Python<'_>,
    hypotheses: &[Asked<'_>],
    ask: impl Fn(&Hypothesis) -> Result<T> + Send + Sync + 'static,
) -> PyResult<Vec<T>> {
    let n_points = of.0.n_points();
    let mut asked = Vec::with_capacity(hypotheses.len());
    for (force, rate, sizes) in hypotheses {
        let effects = distortion(force.as_ref(), rate.as_ref(), n_points)?;
        sizes_fit(sizes, effects.k)?;
        asked.push((effects, sizes.clone()));
    }
    let (session, fit) = (Arc::clone(of.0), Arc::clone(of.1));
    run_long(py, || {
        let each = asked.par_iter().map(|(effects, sizes)| {
            let columns =
                session.columns(&fit.state, &fit.groups, &fit.weights, &fit.passed, effects)?;
            ask(&Hypothesis::of(&session, &fit, &columns, sizes)?)
        });
        each.collect::<Result<Vec<_>>>()
    })
}
