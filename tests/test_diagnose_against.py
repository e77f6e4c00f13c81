"""A given model held against a recording: numbers are distinguished from physics, in any frame."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron
from small_session import SCENARIO
from trihedron.cli import main
from trihedron.diagnose.against.fitted import FittedModel, FittedSensor
from trihedron.diagnose.against.numbers import compare_numbers
from trihedron.invariants import invariants, jacobian, rotation_vector, triad_jacobian, triad_rotation
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.profiles import profile_by_name

RNG = np.random.default_rng(5)


def sensor(rng):
    S = np.eye(3) + 0.05 * rng.standard_normal((3, 3))
    return 2e-3 * S, rng.standard_normal(3)


def fitted(S_a, b_a, S_g, b_g, sigma=1e-6):
    covariance = np.diag(np.r_[np.full(9, sigma), np.full(3, 1e-3), np.full(9, sigma), np.full(3, 1e-5)] ** 2)
    return FittedModel(FittedSensor(S_a, b_a, "counts"), FittedSensor(S_g, b_g, "counts"), covariance)


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


@pytest.fixture(scope="module")
def unit():
    profile = profile_by_name("mpu")
    accel, gyro = profile.unit(77)
    # The wider range, which hand moves do not leave.
    return profile, accel, replace(gyro, S=tuple(tuple(2.0 * v for v in row) for row in gyro.S))


def log(profile, accel, gyro, layout, seed, effect=None, **size):
    scenario = Scenario(hand_session(12, pose_s=2.5, layout=layout), "pair", accel, gyro, profile.clock)
    return simulate(scenario if effect is None else with_effect(scenario, effect, **size), seed)[0]


def test_a_zero_that_moved_since_the_calibration_is_a_number_and_no_drift(unit):
    profile, accel, gyro = unit
    known = trihedron.calibrate(log(profile, accel, gyro, 1, 1), gravity_m_s2=9.80665)
    moved = replace(gyro, b=(gyro.b[0], gyro.b[1], gyro.b[2] - np.radians(0.31)))
    found = trihedron.diagnose(log(profile, accel, moved, 2, 2), calibration=known)
    assert found.verdict == "parameters-differ"
    assert {p.id for p in found.parameters if p.significant} == {"gyro-bias"}
    z = next(p for p in found.parameters if p.id == "gyro-bias" and p.name == "z")
    # One fixed pair: 4 sigma of its own uncertainty, which must be below 0.02 °/s to be of use.
    assert abs(z.difference - np.radians(0.31)) < 4.0 * z.std
    assert z.std < np.radians(0.02)
    assert "gyro bias Z" in str(found)
    assert found.updated is not None


def test_an_effect_that_only_the_simulation_has_is_surplus(unit):
    profile, accel, gyro = unit
    simulated = log(profile, accel, gyro, 3, 3, "accel-quadratic", k2=(3e-4, -2e-4, 2e-4))
    found = trihedron.diagnose(log(profile, accel, gyro, 5, 5), against=simulated, gravity_m_s2=9.80665)
    assert found.verdict == "missing-physics"
    assert [(e.side, e.id) for e in found.effects] == [("model", "accel-quadratic")]
    assert not any(p.significant for p in found.parameters)
    assert "which the recording lacks" in " ".join(str(found).split())  # wherever its lines break


def test_improving_is_refused_where_it_would_overwrite_or_has_nothing_to_improve(tmp_path, capsys):
    given = tmp_path / "student.toml"
    given.write_text(SCENARIO)
    assert main(["diagnose", "log.csv", "--against", str(given), "--improved", str(given)]) == 1
    assert "overwrite" in capsys.readouterr().err
    assert main(["diagnose", "log.csv", "--against", "sim.csv", "--improved", str(given)]) == 1
    assert ".toml" in capsys.readouterr().err
