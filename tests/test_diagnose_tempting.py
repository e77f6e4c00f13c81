"""Tempting wrong answers: the recording holds A and B would almost do. Right is A, or both with what separates them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

import trihedron
from confidence import design
from confidence.motion import Step, attitude, move
from confidence.sensor import read_out, recorded
from confidence.sessions import directions
from diagnosed_session import unit_of
from trihedron.diagnose.effects.timing_jitter import common_time_variance
from trihedron.diagnose.session.observations import observe
from trihedron.probability import SURE
from trihedron.simulate import Environment, Temperature, hand_session, simulate, with_effect

WARMING = Environment(temperature=Temperature(warm_up_k=12.0, warm_up_tau_s=120.0, logged=True))


def session(grade="mpu", seed=1, n_poses=20, pose_s=3.5, move_s=2.0):
    motion = hand_session(n_poses, pose_s=pose_s, move_s=move_s, first_pose_s=10.0, layout=seed)
    return unit_of(motion, seed, grade, is_wide=grade == "mpu")


def diagnosed(scenario, seed=1, **how):
    recording, truth = simulate(scenario, seed)
    return trihedron.diagnose(recording, gravity_m_s2=truth.gravity_m_s2, **how)


def assert_not_taken_in(diagnosis, right):
    """The first answer is ``right``, or names it beside itself together with an experiment."""
    assert diagnosis.verdict == "missing-physics"
    first = diagnosis.effects[0]
    if first.id != right:
        assert right in first.confounded_with, f"said {first.id}, confounded with {first.confounded_with}"
        assert first.separating_experiment


# Name → (grade, environment, what the recording holds, its size), with the one that would almost do in the name. The
# first two are in every run. A square and not a modulus: tests/test_search.py.
MECHANISMS = {
    "bias with the temperature, not with time": (
        "mpu", WARMING, "accel-thermal-bias", {"per_k": (0.009, -0.008, 0.01), "warm_up_tau_s": 120.0},
    ),
    "jitter, not a lag": ("mpu", None, "timing-jitter", {"jitter_s": 1e-3}),
    "a modulus, not a square": ("mpu", None, "accel-scale-asymmetry", {"asymmetry": (1.5e-3, -2e-3, 1.5e-3)}),
    "a cube, not a range limit": ("mpu", None, "accel-cubic", {"k3": (3e-5, 4e-5, 3e-5)}),
    "force on the gyro, not the Earth": (
        "tactical", None, "gyro-g-sensitivity",
        {"matrix": ((7e-6, 0.0, 2e-6), (0.0, -7e-6, 0.0), (-3e-6, 0.0, 7e-6))},
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if k < 2 else pytest.mark.slow) for k, name in enumerate(MECHANISMS)]
)
def test_it_is(name):
    grade, environment, effect, size = MECHANISMS[name]
    scenario = session(grade)
    if environment is not None:
        scenario = replace(scenario, environment=environment)
    found = diagnosed(with_effect(scenario, effect, **size))
    assert_not_taken_in(found, effect)
    # Its evidence is in the samples, where no other has any.
    assert effect != "timing-jitter" or found.effects[0].id == effect


def low_pass(values, dt_s, tau_s):
    keep = np.exp(-dt_s / tau_s)
    return lfilter([1.0 - keep], [1.0, -keep], values - values[0]) + values[0]


@pytest.mark.parametrize(
    ("lag_s", "seed"),
    [(20.0, 1), *(pytest.param(*o, marks=pytest.mark.slow) for o in ((-20.0, 2), (8.0, 3), (35.0, 4)))],
)
def test_a_bias_follows_the_temperature_of_the_die_and_a_thermometer_beside_it_lags(lag_s, seed):
    recording, truth = simulate(session("mpu", seed), seed)
    own, t = np.array([5e-4, -4e-4, 6e-4]), recording.time_s - recording.time_s[0]
    logged = 30.0 - 12.0 * np.exp(-t / 40.0) + 1.5 * np.sin(2.0 * np.pi * t / 70.0)
    late = low_pass(logged, 1.0 / recording.rate_hz, abs(lag_s))
    die, logged = (logged, late) if lag_s > 0.0 else (late, logged)
    per_raw = np.linalg.solve(truth.gyroscope_S, own)
    read = recording.gyroscope + (die - die[0])[:, None] * per_raw
    found = trihedron.diagnose(
        replace(recording, gyroscope=read, temperature_degc=np.round(16.0 * logged) / 16.0),
        gravity_m_s2=truth.gravity_m_s2,
    )
    assert_not_taken_in(found, "gyro-thermal-bias")
    effect = found.effects[0]
    # A drift explains more than the temperature as it was logged.
    assert (effect.id, effect.model["variant"]) == ("gyro-thermal-bias", "linear, lag")
    numbers = {one.name: one for one in effect.parameters}
    for name, true in (
        ("thermometer_lag", lag_s),
        *((f"bias_per_kelvin_{a}", v) for a, v in zip("xyz", own, strict=True)),
    ):
        assert abs(numbers[name].value - true) < 4.0 * numbers[name].std


@pytest.mark.parametrize(
    ("variant", "size"),
    [
        ("play", {"offset_m_s2": (0.015, 0.02, 0.015), "width_m_s2": 2.0}),
        ("creep", {"creep_fraction": (4e-3, 5e-3, 4e-3), "creep_tau_s": 6.0}),
    ],
)
def test_play_and_creep_are_told_apart(variant, size):
    scenario = with_effect(session(n_poses=14, pose_s=6.0), "accel-hysteresis", **size)
    first = diagnosed(scenario).effects[0]
    assert first.id == "accel-hysteresis"
    assert first.model["variant"] == variant


class Machine:
    """Numbers of a machine in place of those of a hand: no sway, no tremor, no push."""

    def normal(self, size):
        return np.zeros(size)

    def uniform(self, low, _high, size=None):
        return np.full(size, low) if size else 1.0


def test_a_table_at_a_constant_rate_is_at_no_range_limit_though_moves_disagree():
    rng = np.random.default_rng(2)
    first, *others = (attitude(up, rng.uniform(0.0, 6.28)) for up in directions(14, rng))
    steps = [Step(4.0)] + [step for to in others for step in (Step(5.0, to=to, law="table"), Step(4.0))]
    motion, per = move(steps, first, Machine(), 100.0)
    force, rate, rate_hz, truth = read_out(motion, per, rng)
    quadratic = 4e-4 * (force @ truth.S_f.T + truth.b_f) ** 2
    force = force + np.round(np.linalg.solve(truth.S_f, quadratic.T).T)
    found = trihedron.diagnose(recorded(force, rate, rate_hz), gravity_m_s2=9.80665)
    # The Earth turns below the machine, and may show.
    assert {one.id for one in found.effects} - {"earth-rate"} == {"accel-quadratic"}


def test_a_gyro_whose_moves_are_all_beyond_its_range_is_not_extended():
    result = trihedron.calibrate(
        simulate(with_effect(session(n_poses=14), "gyro-saturation", limit=0.8), 1)[0], gravity_m_s2=9.80665
    )
    known = trihedron.extend(result).calibration
    assert not known.is_trustworthy
    assert np.array_equal(known.gyroscope.S, result.gyroscope.S)


def test_large_effects_of_both_sensors_are_found_and_a_drift_is_no_temperature():
    warming = replace(session(seed=2, n_poses=15), environment=WARMING)
    bent = with_effect(warming, "gyro-scale-nonlinearity", c3=(6e-3, 5e-3, 4e-3))
    found = diagnosed(with_effect(bent, "accel-bias-drift", amplitude=(0.28, 0.29, -0.37), tau_s=70.0))
    assert {one.id for one in found.effects} == {"gyro-scale-nonlinearity", "accel-bias-drift"}


def test_a_bias_that_follows_the_rate_of_temperature_on_each_axis_by_a_factor_of_its_own_is_no_drift():
    made, truth = simulate(session(n_poses=15), 1)
    cycle = 28.0 + 4.0 * np.sin(2.0 * np.pi * made.time_s / 90.0)
    bias = np.outer(cycle - 28.0, (2e-4, -1e-4, 3e-4)) + np.outer(np.gradient(cycle, made.time_s), (-0.02, 0.015, 0.02))
    rate = made.gyroscope + np.round(np.linalg.solve(truth.gyroscope_S, bias.T).T)
    found = trihedron.diagnose(replace(made, gyroscope=rate, temperature_degc=cycle), gravity_m_s2=truth.gravity_m_s2)
    assert [(one.id, one.model["variant"]) for one in found.effects] == [("gyro-thermal-bias", "linear, rate")]


def test_the_earth_is_no_force_on_the_gyro_where_clipped_moves_break_the_chain_of_headings():
    # Its vertical part along gravity is an isotropic g-sensitivity; its horizontal part needs headings.
    turning = with_effect(session("tactical", n_poses=16), "earth-rate", latitude_deg=55.0, heading_deg=40.0)
    found = {one.id for one in diagnosed(with_effect(turning, "gyro-saturation", limit=2.2)).effects}
    assert "earth-rate" in found
    assert "gyro-g-sensitivity" not in found


def test_at_a_stated_latitude_the_vertical_part_of_earth_rate_is_no_force_on_the_gyro():
    scenario = with_effect(session("tactical"), "gyro-g-sensitivity", matrix=np.diag([2e-5, -3e-5, 1e-5]))
    recording, truth = simulate(with_effect(scenario, "earth-rate", latitude_deg=65.0, heading_deg=40.0), 1)
    # The place of a log is known by its latitude, |g| here by the scenario.
    found = trihedron.diagnose(recording.with_same_readings(latitude_deg=65.0), gravity_m_s2=truth.gravity_m_s2)
    effects = {effect.id: {p.name: p for p in effect.parameters} for effect in found.effects}
    assert set(effects) == {"gyro-g-sensitivity", "earth-rate"}
    for name, size in (("G_xx", 2e-5), ("G_yy", -3e-5), ("G_zz", 1e-5)):
        parameter = effects["gyro-g-sensitivity"][name]
        assert abs(parameter.value - size) < 3.0 * parameter.std
        assert parameter.std < 2e-6


def test_a_gyro_that_does_not_read_the_earth_has_no_g_sensitivity_at_a_stated_latitude():
    recording, truth = simulate(session("tactical", n_poses=14), 1)
    found = trihedron.diagnose(recording.with_same_readings(latitude_deg=65.0), gravity_m_s2=truth.gravity_m_s2)
    assert [effect.id for effect in found.effects] == ["earth-rate"]
    assert "stated_vertical" in {p.name for p in found.effects[0].parameters}


def test_a_wrong_scale_is_not_lost_samples():
    scenario = session()
    known = trihedron.calibrate(simulate(scenario, 1)[0], gravity_m_s2=9.80665).calibration
    # A part whose gyro scale has moved by half a per cent since it was calibrated: every fast turn ends too far.
    wrong = replace(known, gyroscope=replace(known.gyroscope, S=1.005 * known.gyroscope.S))
    found = diagnosed(scenario, seed=2, calibration=wrong)
    assert found.verdict != "consistent"
    assert not {"dropped-samples", "timing-jitter"} & {effect.id for effect in found.effects}


def test_one_bad_pose_is_one_bad_pose():
    scenario = session(n_poses=14)
    recording, truth = simulate(scenario, 1)
    pose = [s for s in truth.segments if s.kind == "pose"][9]
    # A steady push in one pose, eight times the noise of its mean, seen by no gyro.
    push = np.zeros_like(recording.accelerometer)
    push[pose.start : pose.stop] = np.linalg.solve(truth.accelerometer_S, (0.03, -0.05, 0.04))
    pushed = replace(recording, accelerometer=recording.accelerometer + np.round(push))
    found = trihedron.diagnose(pushed, gravity_m_s2=truth.gravity_m_s2)
    assert_not_taken_in(found, "disturbed-pose")
    poses = [p.value for e in found.effects if e.id == "disturbed-pose" for p in e.parameters if p.name == "pose"]
    # The tenth, as reports count.
    assert poses == [10.0]


def test_the_curvature_of_quick_motion_is_not_jitter():
    # Both sensors saw a common time error of 0.4 ms, 7 of its standard errors; no level of the design is an effect.
    levels = {"grade": "industrial", "rate_hz": 50.0, "move_s": 1.2, "path": "axis by axis", "tremor_deg_s": 0.0}
    made = design.session(0, **levels)
    recording = recorded(made.force, made.rate, made.rate_hz, made.time_s)
    found = trihedron.diagnose(recording, gravity_m_s2=design.G)
    assert "timing-jitter" not in {effect.id for effect in found.effects}


def z_of_jitter(force, rate, made, is_kept=slice(None)):
    recording = recorded(force[is_kept], rate[is_kept], made.rate_hz, made.time_s[is_kept])
    value, sigma, _ = common_time_variance(observe(recording, trihedron.segment(recording)))
    return value / sigma


@pytest.mark.parametrize("seed", range(3))
def test_lost_rows_and_outliers_are_not_jitter(seed):
    made, rng = design.session(seed), np.random.default_rng(seed)
    n = len(made.time_s)
    assert z_of_jitter(made.force, made.rate, made, rng.random(n) > 0.05) < SURE
    struck = rng.random((n, 1)) < 0.005
    force, rate = (
        np.round(x + struck * 0.2 * np.abs(x).max() * rng.normal(size=(n, 3))) for x in (made.force, made.rate)
    )
    assert z_of_jitter(force, rate, made) < SURE


def test_jitter_is_seen_beside_lost_rows():
    made, rng = design.session(0), np.random.default_rng(0)
    n = len(made.time_s)
    at = made.time_s + 5e-4 * rng.standard_normal(n)
    force, rate = (CubicSpline(made.time_s, x)(at) for x in (made.force, made.rate))
    assert z_of_jitter(force, rate, made, rng.random(n) > 0.03) > SURE
    # Where the timestamps have it too, samples are at their timestamps.
    assert z_of_jitter(force, rate, replace(made, time_s=at)) < SURE
