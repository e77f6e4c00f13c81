//! The joint model of a session: derivatives against differences, one end whatever the start.

use nalgebra::{DMatrix, DVector};
use trihedron::session_model::chain::Layout;
use trihedron::session_model::fit::{Extent, Fit, fit};
use trihedron::session_model::move_rows::Weights;
use trihedron::session_model::rows::Group;
use trihedron::session_model::strength_search::Within;
use trihedron::session_model::strengths::tune;
use trihedron::session_model::{Distortion, Session, State, Strengths};

use super::made_session::{Uniform, made as made_of};

const N_POSES: usize = 7;

fn made(scatter: bool) -> (Session, State) {
    made_of(N_POSES, 61, scatter)
}

const STRENGTHS: Strengths = Strengths {
    corner_s: [40.0, 40.0],
    scatter: [1.0; 4],
    between: [0.6, 0.6],
    excess: [1.0, 1.0],
};

/// Groups of rows at a state, the moves with the weights that another one gives them.
fn groups(
    session: &Session,
    state: &State,
    weighed_at: &State,
    effects: &Distortion,
) -> Vec<Group> {
    let planes = session.planes(weighed_at);
    let before = session.pass(weighed_at, effects, &planes);
    let weights = Weights::of(&before, &STRENGTHS).expect("weights");
    let passed = session.pass(state, effects, &planes);
    let found = session.groups(state, &STRENGTHS, effects, &weights, &passed);
    found.expect("rows")
}

fn residuals(
    session: &Session,
    state: &State,
    weighed_at: &State,
    effects: &Distortion,
) -> DVector<f64> {
    let rows = |group: &Group| group.rows.residual.as_slice().to_vec();
    let groups = groups(session, state, weighed_at, effects);
    DVector::from_vec(groups.iter().flat_map(rows).collect())
}

fn jacobian(session: &Session, state: &State, effects: &Distortion) -> DMatrix<f64> {
    let groups = groups(session, state, state, effects);
    let layout = session.layout(effects.k);
    let n: usize = groups.iter().map(|group| group.rows.len()).sum();
    let mut out = DMatrix::zeros(n, layout.n());
    let mut at = 0;
    for group in &groups {
        let r = group.rows.len();
        let mut part = DMatrix::zeros(layout.n(), r);
        group
            .rows
            .add_transposed(layout, &DMatrix::identity(r, r), &mut part);
        out.rows_mut(at, r).copy_from(&part.transpose());
        at += r;
    }
    out
}

fn effects(session: &Session) -> Distortion {
    let mut random = Uniform(11);
    let n = session.n_points() * 3 * 2;
    Distortion {
        force: Some((0..n).map(|_| random.next()).collect()),
        rate: Some((0..n).map(|_| 0.1 * random.next()).collect()),
        k: 2,
        sizes: Vec::new(),
    }
}

/// A state some way from the truth, so that residuals are far from zero.
fn beside(state: &State, layout: Layout, k: usize) -> State {
    let mut random = Uniform(5);
    let mut state = state.clone();
    state.effect = DVector::from_element(k, 0.01);
    let mut step = DVector::from_fn(layout.n(), |_, _| 3e-3 * random.next());
    for j in 9..18 {
        step[j] *= 0.03;
    }
    for j in 18..18 + k {
        step[j] = 0.0;
    }
    state.moved(&step, layout)
}

#[test]
fn derivatives_are_those_of_the_residuals_away_from_the_truth() {
    for scatter in [false, true] {
        let (session, truth) = made(scatter);
        let effects = effects(&session);
        let layout = session.layout(2);
        let state = beside(&truth, layout, 2);
        let analytic = jacobian(&session, &state, &effects);
        for j in 0..layout.n() {
            // Steps that move the rows by about a tenth of a standard error: quadratic terms and rounding balance.
            let size = 0.1 / analytic.column(j).norm().max(1e-12);
            let mut step = DVector::zeros(layout.n());
            step[j] = size;
            let ahead = residuals(&session, &state.moved(&step, layout), &state, &effects);
            let behind = residuals(&session, &state.moved(&-step, layout), &state, &effects);
            let numeric = (ahead - behind) / (2.0 * size);
            let error =
                (&numeric - analytic.column(j)).norm() / analytic.column(j).norm().max(1e-12);
            assert!(error < 2e-5, "unknown {j}: {error}");
        }
    }
}

/// Cost of a fit, at the weights of its own end.
fn chi2_of(session: &Session, found: &Fit) -> f64 {
    residuals(session, &found.state, &found.state, &Distortion::default()).norm_squared()
}

#[test]
fn rows_that_miss_by_a_thousand_errors_end_in_one_place_whatever_the_start() {
    let (mut session, truth) = made(false);
    session.noise.rate_density *= 1e-5;
    session.noise.force_density *= 1e-5;
    let none = Distortion::default();
    let exact = residuals(&session, &truth, &truth, &none);
    assert!(exact.amax() > 1e3, "{}", exact.amax());
    let near = fit(&session, truth.clone(), STRENGTHS, &none, Extent::default()).expect("fit");
    let start = beside(&truth, session.layout(0), 0);
    let far = fit(&session, start, STRENGTHS, &none, Extent::default()).expect("fit");
    assert!(near.stop.is_converged() && far.stop.is_converged());
    // A rough descent of a dozen, and a few that polish: renewed weights must not begin it again each time.
    assert!(far.iterations < 60, "{}", far.iterations);
    // Steps end at a thousandth of the spread that rows show: two ends differ by less than that in every row together.
    let (one, other) = (chi2_of(&session, &near), chi2_of(&session, &far));
    assert!((one - other).abs() < 1e-4 * one, "{one} {other}");
    // The weights of moves follow the residuals where these end: a thousandth of their spread, no less.
    let parted = (near.state.rate_scale - far.state.rate_scale).norm();
    assert!(parted < 1e-3 * truth.rate_scale.norm(), "{parted}");
}

#[test]
fn strengths_are_sought_within_bounds_and_only_raise_the_likelihood() {
    let (session, truth) = made(true);
    let none = Distortion::default();
    let given = fit(&session, truth.clone(), STRENGTHS, &none, Extent::default()).expect("fit");
    let within = Within {
        corner_s: [50.0, 50.0],
        scatter: [2.0, 0.5],
        excess: [1.0, 1.0],
    };
    let tuned = |within: &Within| {
        tune(
            &session,
            truth.clone(),
            STRENGTHS,
            &none,
            within,
            Extent::default(),
        )
        .expect("fit")
    };
    let (free, bound) = (tuned(&Within::ANYTHING), tuned(&within));
    // A search ends where a pass gains less than a tenth.
    assert!(free.log_marginal() > given.log_marginal() - 0.1);
    assert!(free.log_marginal() > bound.log_marginal() - 0.1);
    let found = bound.strengths;
    assert!(found.corner_s.iter().all(|corner| *corner >= 50.0 - 1e-9));
    assert!(found.scatter[0] <= 2.0 + 1e-9 && found.scatter[1..].iter().all(|s| *s <= 0.5 + 1e-9));
    assert!(found.excess.iter().all(|excess| *excess <= 1.0 + 1e-9));
}
