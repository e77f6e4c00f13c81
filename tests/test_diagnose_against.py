"""A given model held against a recording: numbers are distinguished from physics, in any frame."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron
from diagnosed_session import diagnosed, unit_of
from small_session import SCENARIO, G, made_once, rejected
from trihedron.api.diagnosing_with_simulation import gravity_of_scenario
from trihedron.cli import main
from trihedron.comparison.effects import compare_effects
from trihedron.comparison.fitted import FittedModel, FittedSensor, model_of_diagnosis
from trihedron.comparison.model import _with_shared_effects
from trihedron.comparison.parameters import compare_numbers
from trihedron.invariants import invariants, jacobian, rotation_vector, triad_jacobian, triad_rotation
from trihedron.records.diagnosis import AcceptedEffect, Candidate, EffectParameter, ParameterDifference
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.diagnosis_numbers import groups_in_short
from trihedron.report.document import Picture
from trihedron.simulate import Scenario, hand_session, scenario_by_name, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.profiles import profile_by_name

pytestmark = pytest.mark.usefixtures("without_corners")
RNG = np.random.default_rng(5)


def sensor(rng):
    S = np.eye(3) + 0.05 * rng.standard_normal((3, 3))
    return 2e-3 * S, rng.standard_normal(3)


def fitted(S_a, b_a, S_g, b_g, sigma=1e-6, units=("counts", "counts")):
    covariance = np.diag(np.r_[np.full(9, sigma), np.full(3, 1e-3), np.full(9, sigma), np.full(3, 1e-5)] ** 2)
    return FittedModel(FittedSensor(S_a, b_a, units[0]), FittedSensor(S_g, b_g, units[1]), covariance)


@pytest.mark.parametrize(("uncertain", "size"), [(1.0, "9.0"), (4.0, "5.0")])
def test_the_size_of_a_group_that_differs_is_that_of_a_component_that_clearly_does(uncertain, size):
    group = [
        ParameterDifference("gyro-bias", "gyroscope", axis, 0.0, rate, rate, std, "rad/s", 1e-3, True)
        for axis, rate, std in zip("xyz", np.radians((9.0, 5.0, 1.0)), np.radians((uncertain, 1.0, 1.0)), strict=True)
    ]
    assert groups_in_short(group) == [f"gyro bias by up to {size} °/s"]


@pytest.mark.parametrize(("seen", "is_surplus"), [(3.3e-5, False), (-0.4e-5, True)])
def test_what_the_simulation_has_is_surplus_where_the_recording_excludes_its_size(seen, is_surplus):
    def vertical(value, std):
        return (EffectParameter("vertical", value, std, "rad/s"), EffectParameter("north_azimuth", 90.0, 5.0, "deg"))

    given = AcceptedEffect("earth-rate", "", vertical(5.6e-5, 0.3e-5), 1e-9, 40.0, ())
    tried = Candidate("earth-rate", 0.9, True, size=vertical(seen, 1.5e-5))
    found = SimpleNamespace(effects=(), domains=(), remaining=(), candidates=(tried,))
    assert bool(compare_effects([given], found, alpha=0.01).surplus) is is_surplus


def test_a_row_that_the_recordings_best_shape_lacks_is_zero_there():
    def rows(*sizes):
        return tuple(EffectParameter(name, value, 4e-6, "(rad/s)/(m/s^2)") for name, value in sizes)

    given = AcceptedEffect("gyro-g-sensitivity", "", rows(("G_xy", 0.9e-5), ("G_zy", -3.4e-5)), 1e-9, 40.0, ())
    tried = Candidate("gyro-g-sensitivity", 0.4, True, size=rows(("G_xy", 0.1e-5)))
    found = SimpleNamespace(effects=(), domains=(), remaining=(), candidates=(tried,))
    assert compare_effects([given], found, alpha=0.01).surplus


def test_pushed_poses_faint_lines_and_the_arm_beside_a_calibration_are_no_physics_that_a_model_lacks():
    def effect(effect_id, share):
        size = EffectParameter("size", 0.01, 3e-4, "m/s^2")
        return AcceptedEffect(effect_id, "", (size,), 0.0, 99.0, (), share=share)

    def differ(given, *effects, tried=(), has_motion=True):
        found = SimpleNamespace(effects=effects, candidates=tried, domains=(), remaining=())
        return compare_effects(given, found, alpha=0.01, has_motion=has_motion).differ

    pushed, faint = effect("disturbed-pose", 0.7), effect("periodic-interference", 0.05)
    assert not differ([], pushed, faint)
    assert differ([], pushed, effect("periodic-interference", 0.25))
    assert differ([], pushed, effect("accel-cubic", 0.9))
    # A calibration states no motion whose arm could be another one.
    arm = effect("lever-arm", 0.9)
    assert differ([], arm)
    assert not differ([], arm, has_motion=False)
    assert differ([], arm, effect("accel-cubic", 0.1), has_motion=False)
    # What only the model has is no footnote of the recording.
    assert differ([faint], tried=[Candidate("periodic-interference", 0.4, True)])


def test_jacobians_agree_with_the_spread_of_perturbed_calibrations():
    S, b = sensor(RNG)
    S_g, _ = sensor(RNG)
    J, J_t = jacobian(S, b), triad_jacobian(S, S_g)
    for _ in range(20):
        step = np.r_[1e-7 * 2e-3 * RNG.standard_normal(9), 1e-7 * RNG.standard_normal(3)]
        moved = invariants(S + step[:9].reshape(3, 3), b + step[9:])
        # Second order of a relative step of 1e-7 is 1e-14; the accelerometer's bias is some hundred of its unit.
        assert np.allclose(moved.vector() - invariants(S, b).vector(), J @ step, rtol=1e-5, atol=1e-11)
        zero = np.zeros(3)
        here = triad_rotation(invariants(S, zero), invariants(S_g, zero))
        there = triad_rotation(invariants(S + step[:9].reshape(3, 3), zero), invariants(S_g, zero))
        assert np.allclose(rotation_vector(there @ here.T), J_t[:, :9] @ step[:9], rtol=1e-4, atol=1e-11)


@pytest.mark.parametrize("group", ["accel-bias", "accel-scale", "accel-misalignment", "gyro-bias", "gyro-scale",
                                   "gyro-misalignment", "triad-alignment", "gravity"])  # fmt: skip
def test_one_number_that_moves_leaks_into_no_other_group(group):
    (S_a, b_a), (S_g, b_g) = sensor(RNG), sensor(RNG)
    parts = {"accel": (S_a, b_a), "gyro": (S_g, b_g)}
    name = "accel" if group.startswith("accel") or group == "gravity" else "gyro"
    S, b = parts[name]
    M = np.linalg.inv(S)
    k, offset = np.linalg.norm(M, axis=1), -M @ b
    n = M / k[:, None]
    if group.endswith("bias"):
        offset = offset + k * np.array([1e-2, -2e-2, 3e-2])
    elif group.endswith("scale") or group == "gravity":
        factor = 1.0 + (2e-3 if group == "gravity" else np.array([1e-3, -2e-3, 3e-3]))
        k, offset = k * factor, offset * factor
    elif group == "triad-alignment":
        n = n @ Rotation.from_rotvec([2e-3, -1e-3, 3e-3]).as_matrix().T
    else:
        # Symmetric in the triad's own polar axes: the angles open, the triad as a whole stays.
        u, _, vt = np.linalg.svd(n)
        strain = np.array([[0.0, 1e-3, -2e-3], [1e-3, 0.0, 2e-3], [-2e-3, 2e-3, 0.0]])
        n = n @ (np.eye(3) + (u @ vt).T @ strain @ (u @ vt))
        n /= np.linalg.norm(n, axis=1, keepdims=True)
    S_new = np.linalg.inv(k[:, None] * n)
    parts[name] = (S_new, -S_new @ offset)
    U = Rotation.from_rotvec([0.01, 0.02, -0.01]).as_matrix()  # the other session has its own frame
    (A, a), (G, g) = parts["accel"], parts["gyro"]
    found = compare_numbers(fitted(S_a, b_a, S_g, b_g), fitted(U @ A, U @ a, U @ G, U @ g), alpha=0.01)
    said = {p.id for p in found.parameters if p.significant}
    if group.endswith("misalignment"):
        # Unit rows of a strained triad are not strained purely: second order in its angles turns the triad a little.
        said.discard("triad-alignment")
    assert said == {group}


@cache
def healthy():
    return diagnosed("", 3, 12)


def unit(seed):
    return unit_of(hand_session(12, pose_s=2.5, layout=seed), 77, is_wide=True)


def test_a_zero_that_moved_since_the_calibration_is_a_number_and_no_drift():
    known = trihedron.calibrate(simulate(unit(1), 1)[0], gravity_m_s2=9.80665)
    later = unit(2)
    moved = replace(later.gyroscope, b=tuple(later.gyroscope.b - np.radians([0.0, 0.0, 0.31])))
    found = trihedron.diagnose(simulate(replace(later, gyroscope=moved), 2)[0], calibration=known)
    assert found.verdict == "parameters-differ"
    assert {p.id for p in found.parameters if p.significant} == {"gyro-bias"}
    z = next(p for p in found.parameters if p.id == "gyro-bias" and p.name == "z")
    # One fixed pair: 4 sigma of its own uncertainty, which must be below 0.02 °/s to be of use.
    assert abs(z.difference - np.radians(0.31)) < 4.0 * z.std
    assert z.std < np.radians(0.02)
    assert found.updated is not None


def test_an_effect_that_only_the_simulation_has_is_surplus():
    simulated = simulate(with_effect(unit(3), "accel-quadratic", k2=(3e-4, -2e-4, 2e-4)), 3)[0]
    found = trihedron.diagnose(simulate(unit(5), 5)[0], against=simulated, gravity_m_s2=9.80665)
    assert found.verdict == "missing-physics"
    assert [(e.side, e.id) for e in found.effects] == [("model", "accel-quadratic")]
    assert not any(p.significant for p in found.parameters)


def test_residuals_under_effects_that_both_have_keep_the_names_of_their_rows():
    found = healthy()
    fewer = replace(found.residuals[0], names_before=("pose 1",))
    (row,) = _with_shared_effects(replace(found, residuals=(fewer,))).residuals
    assert row.names_before == row.names_after
    assert len(row.names_before) == len(row.before)


def test_misfit_that_stays_unexplained_widens_the_uncertainty_of_its_own_sensor():
    found = healthy()
    moves = next(test for test in found.remaining if test.domain == "moves")
    left = [replace(test, chi2_per_dof=9.0, disagrees=True) if test is moves else test for test in found.remaining]
    widened = replace(found, remaining=tuple(left))
    before, after = (np.sqrt(np.diag(model_of_diagnosis(one).covariance)) for one in (found, widened))
    of_gyro = np.repeat([False, True], 12)
    # Rounding alone: the widened covariance is the same one times 9.
    assert after[~of_gyro] == pytest.approx(before[~of_gyro], rel=1e-12)
    assert after[of_gyro] == pytest.approx(3.0 * before[of_gyro], rel=1e-12)


def test_a_reversed_gyro_axis_is_an_effect_and_no_other_bias_angle_or_alignment():
    found = healthy()
    sense = np.array([1.0, -1.0, 1.0])
    turned = np.concatenate([np.ones(12), np.tile(sense, 3), np.ones(3)])
    fit, signs = found.extended, zip("xyz", sense, strict=True)
    mirrored = replace(
        fit,
        gyroscope={**fit.gyroscope, "S": np.array(fit.gyroscope["S"]) * sense},
        covariance=np.array(fit.covariance) * np.outer(turned, turned),
    )
    parameters = tuple(EffectParameter(f"gyro_sign_{axis}", s, 0.0, "1") for axis, s in signs)
    handed = AcceptedEffect("axis-handedness", "", parameters, 0.0, 99.0, ())
    plain = model_of_diagnosis(found)
    seen = model_of_diagnosis(replace(found, extended=mirrored, effects=(handed,)))
    assert not any(p.significant for p in compare_numbers(plain, seen, alpha=0.01).parameters)
    assert np.array_equal(seen.covariance, plain.covariance)


def test_few_poses_of_another_unit_are_numbers_beside_an_ideal_simulation_and_no_physics():
    # Six poses of one half: what is open stays open, and the simulation's numbers are no knowledge of this unit's.
    recording, _ = simulate(unit_of(hand_session(9, pose_s=4.0, layout=11), 31), 3)
    profile = profile_by_name("mpu")
    plain = Scenario(hand_session(9, pose_s=4.0, layout=12), "data sheet", profile.accelerometer, profile.gyroscope)
    found = trihedron.diagnose(recording, against=simulate(plain, 4)[0], gravity_m_s2=9.80665)
    assert not [one.id for one in found.effects]
    assert found.parameters
    assert found.verdict == "parameters-differ"


def test_improving_is_refused_where_it_would_overwrite_or_has_nothing_to_improve(tmp_path, capsys):
    given = tmp_path / "student.toml"
    given.write_text(SCENARIO)
    asked = capsys, "diagnose", "log.csv", "--improved", given, "--against"
    assert "overwrite" in rejected(*asked, given)
    assert ".toml" in rejected(*asked, "sim.csv")


def test_a_simulated_log_that_is_none_or_holds_no_poses_is_refused(tmp_path, capsys):
    asked = capsys, "diagnose", made_once() / "log.csv", "--gravity", G, "--against"
    assert "no such file" in rejected(*asked, tmp_path / "absent.csv")
    belongs = "this is a trihedron calibration, no log; name it with --calibration"
    assert belongs in rejected(*asked, made_once() / "c.json")
    empty = tmp_path / "words.csv"
    empty.write_text("nothing,here\n")
    assert "words.csv" in rejected(*asked, empty)
    said = rejected(*asked, made_once() / "static.csv")
    assert "the simulated recording cannot be calibrated" in said
    assert "pose" in said


def test_a_gyro_that_one_side_lacks_is_said_in_the_verdict_and_found(tmp_path, capsys):
    log, bare = made_once() / "log.csv", tmp_path / "bare.csv"
    bare.write_text("\n".join(",".join(line.split(",")[:4]) for line in log.read_text().splitlines()) + "\n")
    for recording, model, lacks in ((log, bare, "the simulation has none"), (bare, log, "the recording has none")):
        assert main(["diagnose", str(recording), "--gravity", G, "--against", str(model), "--full"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "the gyro was not compared." in said
        assert lacks in said


def test_gravity_is_that_of_the_scenario_unless_given():
    """A simulation at the pole, and a log of it: with standard gravity on one side scales would differ by 0.3 %."""
    at_the_pole = replace(scenario_by_name("hand-session"), motion=hand_session(n_poses=9, pose_s=2.0, move_s=1.0))
    clock, world = replace(at_the_pole.clock, rate_hz=50.0), replace(at_the_pole.environment, gravity_m_s2=9.832)
    at_the_pole = replace(at_the_pole, clock=clock, environment=world)
    found = trihedron.diagnose(simulate(at_the_pole, 5)[0], against=at_the_pole)
    assert found.calibration.gravity_m_s2 == 9.832
    assert found.gravity_source == "that of the scenario"
    assert not [p for p in found.parameters if p.significant and p.id in ("accel-scale", "gravity")]
    assert gravity_of_scenario(scenario_by_name("hand-session")) is None
    # A gravity given for the log is another one: so are the readings.
    elsewhere = replace(at_the_pole, environment=replace(at_the_pole.environment, gravity_m_s2=9.81))
    log, _ = simulate(elsewhere, 5)
    differing = trihedron.diagnose(log, against=at_the_pole, gravity_m_s2=9.81).parameters
    (common,) = (p for p in differing if p.significant)
    assert common.id == "gravity"
    assert common.difference == pytest.approx(9.81 / 9.832 - 1.0, abs=4.0 * common.std)
    # Its readings are drawn over those of the log, which a reader looks for first.
    pictures = [b.name for s in diagnosis_report(found).sections for b in s.blocks if isinstance(b, Picture)]
    assert "traces" in pictures
