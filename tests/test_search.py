"""The one search by one evidence: what is named, what joins, what is swapped, what every candidate's row says."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import polars
import pytest
from scipy.signal import lfilter

import trihedron
from diagnosed_session import diagnosed, nearest_pose, simulated, with_scatter
from nuisance_trial.draw import G, draw
from trihedron.diagnose.accepted import Answer, tried_candidate
from trihedron.diagnose.candidates import Tried, as_fits_best, terms_of
from trihedron.diagnose.effects import by_id, catalogue
from trihedron.diagnose.effects.contract import PRIOR_SCALES
from trihedron.diagnose.hypothesis import Term, hypothesis
from trihedron.diagnose.search import threshold
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.starting_point import start_state
from trihedron.records import Finding, Severity
from trihedron.records.domains import DomainTest
from trihedron.segment import resegment, segment_recording
from trihedron.session.model import DYNAMICS, MOVES, core_state
from trihedron.session.noise import ANYTHING
from trihedron.simulate import diagnosed_sizes


@cache
def fitted(effect_id="", seed=3, n_poses=14, **size):
    """A session's hypothesis without effects, all strengths of its noise free."""
    recording, truth = simulated(effect_id, seed, n_poses, **size)
    segments = segment_recording(recording)
    calibration = trihedron.calibrate(recording, segments=segments, gravity_m_s2=truth.gravity_m_s2).calibration
    obs = observe(recording, resegment(recording, segments))
    return hypothesis(obs, start_state(obs, calibration), None)


def test_a_move_is_found_by_its_pose_whichever_moves_were_left_out_before():
    # Moves at the gyro's limit were numbered among all moves, and left out of those at no limit of the accelerometer.
    obs = fitted().obs
    begin_at = obs.move_poses[:, 0]
    left = obs.without_moves_from(begin_at[[0, 2, 4]].tolist())
    fewer = left.without_moves_from(begin_at[[4, 9]].tolist())
    assert set(left.move_ranges) - set(fewer.move_ranges) == {obs.move_ranges[9]}


@pytest.mark.parametrize("effect_id", ["accel-quadratic", "gyro-g-sensitivity", "accel-gyro-time-offset"])
def test_the_evidence_of_columns_is_that_of_the_linear_problem_written_out(effect_id):
    model = fitted()
    effect = next(one for one in catalogue() if one.id == effect_id)
    variant = effect.variants(model.context)[0]
    one = Term(effect, variant, effect.sizes(model.context, variant))
    core = model.fitted.core
    columns = (one.distortion.force, one.distortion.rate)
    asked = [(*columns, one.sizes.tolist())]
    ((seen, _, _),) = core.candidate_gains(asked, [1.0], [core.strengths])
    # What the fit's unknowns imitate is projected out; the rest is a Gaussian with a prior of the sizes.
    own = core.columns(*columns)
    J = core.jacobian()
    J = J / np.linalg.norm(J, axis=0)
    projected = (own - J @ np.linalg.lstsq(J, own, rcond=None)[0]) * one.sizes
    # A move's rows weigh as Student t noise of four degrees of freedom weighs five residuals.
    labels, weight = core.labels, np.ones(len(core.residual))
    for move in range(model.obs.n_moves):
        rows = np.isin(labels[:, 0], (MOVES, DYNAMICS)) & (labels[:, 1] == move) & (labels[:, 3] == 0)
        weight[rows] = min(9.0 / (4.0 + np.sum(core.residual[rows] ** 2)), 1.0)
    normal, gradient = projected.T @ projected, projected.T @ (np.sqrt(weight) * core.residual)
    inner = np.eye(len(normal)) + normal
    gain = 0.5 * gradient @ np.linalg.solve(inner, gradient) - 0.5 * np.linalg.slogdet(inner)[1]
    assert seen[0, 0] == pytest.approx(gain, abs=1e-4 * max(abs(gain), 1.0))
    # The strengths found with it, and what a look there says beside the plain session at the same strengths.
    ((tuned, strengths, value, covariance),) = core.evidence(asked, [core.strengths], ANYTHING)
    ((looked, at, spread),) = core.candidate_gains(asked, [1.0], [strengths])
    state = model.fitted.state
    session = model.obs.model(state.gravity, None)
    plain = session.fit(state=core_state(state), strengths=strengths, force_effect=None, rate_effect=None).log_marginal
    assert tuned - plain == pytest.approx(looked[0, 0], abs=0.05)  # moves are carried anew: second order
    # With the column the weights of moves are those of the residuals that it leaves: a look keeps the session's.
    np.testing.assert_allclose(at, value, atol=0.1 * np.sqrt(np.diag(covariance)).max())
    np.testing.assert_allclose(spread, covariance, atol=0.1 * np.diag(covariance).max())


def test_every_candidate_says_why_it_was_not_taken():
    said = diagnosed("accel-quadratic", 4, 14, k2=(6e-4, -6e-4, 6e-4)).to_dict()
    assert [effect["id"] for effect in said["effects"]] == ["accel-quadratic"]
    rows = {row["id"]: row for row in said["candidates"] if row["applicable"] and row["score"] is not None}
    # What bends axes as well would stand without it, and is needless beside it.
    assert rows["accel-scale-asymmetry"]["superseded_by"] == "accel-quadratic"
    assert rows["accel-scale-asymmetry"]["score"] < threshold(0.01)
    for row in rows.values():
        assert row["size"], row["id"]
        if row["id"] not in {effect["id"] for effect in said["effects"]}:
            assert row["limit95"] > 0.0, row["id"]


def test_the_time_in_which_poses_were_seen_to_settle_is_tried_beside_the_usual_ones():
    context, effect = fitted().context, by_id()["accel-hysteresis"]
    lasting = (("bias-settling", {"tau_s": 5.5}), ("pose-settling", {"poses": 1.0}))
    findings = tuple(Finding(code, Severity.NOTE, "", numbers=numbers) for code, numbers in lasting)
    told = replace(context.obs, segments=replace(context.obs.segments, findings=findings))
    usual, tried = (
        {one.shape["time_constant"] for one in effect.variants(given) if one.label == "creep"}
        for given in (context, replace(context, fitted=replace(context.fitted, obs=told)))
    )
    assert tried - usual == {(5.5, "s")}


@pytest.mark.parametrize(
    ("named", "is_explained"), [("earth-rate", False), ("lever-arm", False), ("gyro-g-sensitivity", True)]
)
def test_a_relation_beside_the_place_and_the_motion_alone_is_unexplained(named, is_explained):
    domain = DomainTest("static-gyro", 9.0, 60.0, 0.0, True)
    found = SimpleNamespace(related=SimpleNamespace(relations=(SimpleNamespace(score=20.0),)))
    gains = [(by_id()[named], 80.0, None)]
    answer = SimpleNamespace(
        domains=(domain,),
        remaining=(replace(domain, chi2_per_dof=1.0),),
        found=found,
        gains=gains,
        shares=[0.8],
        seen={},
        biases=(),
    )
    assert Answer.says_why.fget(answer) is is_explained


@pytest.mark.slow
def test_a_long_delay_is_a_delay_of_that_length():
    d = diagnosed("accel-gyro-time-offset", 4, 14, offset_s=0.04)
    first = d.effects[0]
    assert first.id == "accel-gyro-time-offset"
    # 40 ms were called 26 ms and a lag of -14 ms; half a millisecond is a twentieth of a sample.
    assert first.parameters[0].value == pytest.approx(0.04, abs=5e-4)
    # A simulation of what was found has it with its sign.
    assert diagnosed_sizes([first.to_dict()])[0] == [(first.id, {"offset_s": pytest.approx(0.04, abs=5e-4)})]
    assert not any(p.name.endswith("_lag") and p.value < 0.0 for e in d.effects for p in e.parameters)
    for effect in d.effects:  # nothing whose size is unknown
        assert any(abs(p.value) > p.std for p in effect.parameters), effect.id
        assert effect.share is None or 0.0 <= effect.share <= 1.0


@pytest.mark.slow
def test_a_strong_quadratic_of_a_gyro_is_no_cubic_as_well():
    """Columns of the readings, which contain the effect, gave a cubic of 8 σ beside it."""
    effects = diagnosed("gyro-scale-nonlinearity", 3, 16, c2=[0.0, 0.02, 0.0]).effects
    found = next(one for one in effects if one.id == "gyro-scale-nonlinearity")
    sizes = {one.name: one for one in found.parameters}
    # The simulated suspension's series goes on: fitted to its own readings the quadratic is 0.0198.
    assert abs(sizes["quadratic_y"].value - 0.0198) < 4.0 * sizes["quadratic_y"].std
    assert all(abs(one.value) < 4.0 * one.std for name, one in sizes.items() if name.startswith("cubic"))


def test_a_gyro_with_another_scale_in_either_sense_is_no_parabola():
    """Fitted by a quadratic and a cubic its S was 7 σ from the truth, and moves disagreed."""
    effects = diagnosed("gyro-scale-nonlinearity", 3, 16, asymmetry=[3e-3, 0.0, -3e-3]).effects
    assert effects[0].id == "gyro-scale-nonlinearity"
    # Asymmetries of 0.3 %, and a σ that resolves a tenth of them.
    for one, true in zip(effects[0].parameters, (3e-3, 0.0, -3e-3), strict=True):
        assert one.name.startswith("half_difference")
        assert one.std < 5e-4
        assert abs(one.value - true) < 4.0 * one.std
    assert diagnosed_sizes([effects[0].to_dict()])[0][0][1]["asymmetry"][0] == effects[0].parameters[0].value


def test_a_flaw_of_moves_is_not_swallowed_by_zeros_that_scatter():
    recording, truth = simulated("gyro-scale-nonlinearity", 3, 16, c3=(3e-3, -3e-3, 3e-3))
    moved = with_scatter(recording, truth.poses, 0.07 * 131.0)
    names = [effect.id for effect in trihedron.diagnose(moved, gravity_m_s2=truth.gravity_m_s2).effects]
    # The scatter may stray between poses as far as moves show: without its cost it explained the moves alone.
    assert names[0] == "gyro-scale-nonlinearity"
    assert "gyro-bias-repeatability" in names


def test_a_temperature_that_a_drift_explains_as_well_names_both(tmp_path):
    columns, _ = draw("gyro-thermal-bias", 9700200004, 0.5)
    polars.DataFrame(columns).write_csv(tmp_path / "log.csv")
    effects = {one.id: one for one in trihedron.diagnose(tmp_path / "log.csv", gravity_m_s2=G).effects}
    # At half its size a bias that follows 9 °C is known to three sigma: a walk of the bias does nearly as well.
    thermal = effects["gyro-thermal-bias"]
    assert thermal.confounded_with == ("gyro-bias-drift",)
    assert "temperature" in thermal.separating_experiment


def test_a_fitted_time_constant_pays_for_its_place_between_those_of_the_grid():
    """A temperature needs no time constant: without its price a warm-up of any fits noise better."""
    model, effect = fitted("gyro-bias-drift", amplitude=(0.01, -0.01, 0.01), tau_s=20.0), by_id()["gyro-bias-drift"]
    grid = [one for one in terms_of(model, effect, 0.0) if one.variant.label == "warm-up"]
    asked, warm_up = max(zip(model.with_added(grid), grid, strict=True), key=lambda one: one[0].log_evidence)
    found = as_fits_best(model, Tried(warm_up, 0.0, asked))
    ((tau_s, _),) = found.variant.shape.values()
    width = np.sqrt(2.0 * np.pi) * found.variant.shape_sigma / tau_s
    assert width < np.log(2.5)
    assert found.cost - warm_up.cost == pytest.approx(2.0 * np.log(np.log(2.5) / width))


def test_what_explains_poses_and_moves_is_named_before_a_line_and_this_before_a_scatter():
    recording, truth = simulated("accel-quadratic", 3, 16, k2=(6e-4, -6e-4, 6e-4))
    moved = with_scatter(recording, truth.poses, 0.07 * 131.0)
    line = 30.0 * np.sin(2.0 * np.pi * 11.3 * recording.time_s)
    shaken = replace(moved, gyroscope=moved.gyroscope + line[:, None])
    effects = trihedron.diagnose(shaken, gravity_m_s2=truth.gravity_m_s2).effects
    assert [one.id for one in effects] == ["accel-quadratic", "periodic-interference", "gyro-bias-repeatability"]
    # Shares of the misfit of poses and moves, and of the variance inside poses: the larger number says nothing.
    assert effects[1].share > effects[0].share


def test_an_effect_that_resembles_a_relation_is_no_name_for_it():
    """A gyro of which 0.4 % lag by a second: a delay of the other sensor explains most of it and leaves no relation."""
    recording, truth = simulated(seed=2, n_poses=16)
    rate_hz, lag_s = recording.rate_hz, 1.0
    share = 1.0 - np.exp(-1.0 / (lag_s * rate_hz))
    late = lfilter([share], [1.0, share - 1.0], recording.gyroscope - recording.gyroscope[0], axis=0)
    slow = recording.gyroscope + 0.004 * (late + recording.gyroscope[0] - recording.gyroscope)
    found = trihedron.diagnose(replace(recording, gyroscope=slow), gravity_m_s2=truth.gravity_m_s2)
    assert found.verdict == "unexplained"
    assert not found.effects
    assert found.relations[0].depends_on[0] == "decaying rotations about x"


def test_a_dead_band_is_measured():
    # Gyro readings within 60 counts of zero do not move; half-width to one count of 60.
    diagnosis = diagnosed("quantisation", 6, 14, sensor="gyroscope", dead_band=60.0)
    assert diagnosis.effects[0].id == "quantisation"
    scale = np.abs(np.diag(np.array(diagnosis.extended.gyroscope["S"])))
    for axis, name in enumerate("xyz"):
        found = [p.value for p in diagnosis.effects[0].parameters if p.name == f"dead_band_g{name}"]
        assert found
        assert abs(found[0] / scale[axis] - 60.0) < 2.0


def test_what_a_log_says_of_an_effect_does_not_depend_on_the_priors_tried_for_its_evidence():
    model = fitted()
    (effect,) = [one for one in catalogue() if one.id == "accel-size-effect"]
    (term,) = terms_of(model, effect, 0.0)
    (plain,), (best,) = (model.at_its_strengths([term], scales) for scales in ((1.0,), PRIOR_SCALES))
    assert best.log_evidence > plain.log_evidence
    np.testing.assert_allclose(best.covariance, plain.covariance, rtol=1e-6)
    # Hand moves hardly show millimetres: under a prior of a tenth of the data sheet the limit would be a fifth of it.
    limit = tried_candidate(Tried(term, 0.0, best), None, "").limit95
    assert limit > 0.5 * effect.size


@pytest.mark.parametrize("seed", [1, 3])
def test_a_drift_that_may_as_well_be_a_scatter_says_so(seed):
    recording, truth = simulated(seed=seed, n_poses=14)
    sigma = 0.012 / np.abs(np.diag(truth.accelerometer_S))
    own = sigma * np.random.default_rng(seed).normal(size=(14, 3))
    moved = recording.accelerometer + own[nearest_pose(truth.poses, recording.n_samples)]
    found = trihedron.diagnose(replace(recording, accelerometer=moved), gravity_m_s2=truth.gravity_m_s2)
    drifts = [one for one in found.effects if one.id == "accel-bias-drift"]
    assert all("accel-bias-repeatability" in one.confounded_with for one in drifts)
    (scatter,) = [one for one in found.candidates if one.id == "accel-bias-repeatability"]
    assert drifts or "accel-bias-repeatability" in {one.id for one in found.effects}
    assert scatter.limit95 is None or scatter.limit95 > 0.012
