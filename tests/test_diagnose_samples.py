"""What samples show: lost rows, noise of another level, codes that never occur; and what a table or a supply does."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron
from diagnosed_session import diagnosed, simulated, unit_of
from trihedron.diagnose.bias_strengths import noise_bounds
from trihedron.diagnose.hypothesis import hypothesis
from trihedron.diagnose.residuals.within_poses import noise_changes
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.starting_point import start_state
from trihedron.simulate import hand_session, scenario_by_name, simulate, with_effect


def test_moves_across_lost_rows_are_as_uncertain_as_their_interpolation():
    motion = hand_session(20, pose_s=3.0, move_s=1.2, first_pose_s=6.0, layout=5)
    made, truth = simulate(unit_of(motion, 5, is_wide=True), 5)
    # Up to three rows at a time, in a dozen places of every move of a second or two.
    kept = np.random.default_rng(5).random(made.n_samples) > 0.08
    log = replace(
        made, time_s=made.time_s[kept], accelerometer=made.accelerometer[kept], gyroscope=made.gyroscope[kept],
        temperature_degc=None, supply_v=None,
    )  # fmt: skip
    found = trihedron.diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert found.verdict == "consistent"
    # Half as large again as noise at the most: with straight lines across some gaps it was two to four times.
    assert next(d for d in found.domains if d.domain == "moves").chi2_per_dof < 1.5


def test_the_bias_of_a_gyro_that_noise_does_not_dither_is_as_uncertain_as_its_lsb_leaves_it():
    made, truth = simulated(seed=2)
    coarse = replace(made, gyroscope=64.0 * np.round(made.gyroscope / 64.0))  # half a degree per second
    calibration = trihedron.calibrate(coarse, gravity_m_s2=truth.gravity_m_s2).calibration
    obs = observe(coarse, trihedron.segment(coarse), calibration.averaging)
    assert obs.undithered.all()
    fitted = hypothesis(obs, start_state(obs, calibration), None, within=noise_bounds(obs)).fitted
    covariance, bias = fitted.core.linear_covariance(obs.force_origin, obs.rate_origin)
    error = bias - unit_of(hand_session(24, layout=2), 2).gyroscope.b
    # With a rounding error of its own in every pose these were 3.8, 0.7 and 2.8 σ.
    assert (np.abs(error) < 2.5 * np.sqrt(np.diag(covariance)[-3:])).all()


def louder(log, sensor, where, factor, seed=0):
    """The log with white noise on a sensor, which is ``factor`` (n,) times as noisy where ``where`` (n,)."""
    segments = trihedron.segment(log)
    readings, sigma = getattr(log, sensor), getattr(segments, f"{sensor}_sigma")
    extra = np.sqrt(np.maximum(factor**2 - 1.0, 0.0))[:, None] * where[:, None] * sigma
    noise = extra * np.random.default_rng(seed).standard_normal(readings.shape)
    return replace(log, **{sensor: np.round(readings + noise)})


@pytest.mark.parametrize("sensor", ["accelerometer", "gyroscope"])
def test_noise_of_another_level_is_located_with_its_ratio(sensor):
    made, truth = simulated(seed=1, n_poses=20)
    share = made.time_s / made.time_s[-1]
    log = louder(made, sensor, (share > 0.4) & (share < 0.6), np.full(made.n_samples, 1.6))
    found = trihedron.diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert (found.verdict, found.effects) == ("unexplained", ())
    (where,) = [d.where for d in found.domains if d.disagrees]
    assert {channel[0] for channel in where.channels} == {sensor[0]}
    (relation,) = found.relations
    assert (relation.sensor, relation.depends_on) == (sensor, ("time",))
    # Of the readings, filter and rounding included, so a little below that of the white noise.
    assert [one.value for one in relation.coefficients] == pytest.approx([1.6] * 3, rel=0.1)
    # From pose to pose: a pose and a move beyond either end.
    spans = np.array(where.times_s)
    assert (spans.min(), spans.max()) == pytest.approx(tuple(made.time_s[-1] * np.array([0.4, 0.6])), abs=8.0)


def test_poses_each_with_a_noise_of_its_own_are_no_change():
    made, _ = simulated(seed=1, n_poses=21)
    rng, poses = np.random.default_rng(3), trihedron.segment(made).poses
    factor = np.ones(made.n_samples)
    # A hand holds eight poses of 21, among them neighbours, moves between them quiet.
    for pose in rng.choice(poses, 8, replace=False):
        factor[pose.start : pose.stop] = np.exp(rng.uniform(0.2, 1.5))
    logs = [louder(made, sensor, factor > 1.0, factor) for sensor in ("accelerometer", "gyroscope")]
    # Where one axis alone is dithered, the median of an odd number of poses is exactly usual.
    logs += [made, replace(made, gyroscope=made.gyroscope * [1.0, 0.0, 0.0])]
    for log in logs:
        assert noise_changes(observe(log, trihedron.segment(log))) == ()


def test_codes_that_never_occur_are_named_where_noise_spans_many():
    # Every eighth code, with noise of 65 LSB: eight poses have their readings on the same codes as another.
    found = diagnosed("quantisation", 4, 14, sensor="accelerometer", missing_every=8)
    assert [one.id for one in found.effects] == ["quantisation"]
    missing = [p.value for p in found.effects[0].parameters if p.name.startswith("missing_codes")]
    assert len(missing) >= 2
    # Some 500 codes of an axis have readings enough on both sides.
    assert min(missing) > 40
    assert diagnosed("", 4, 14).verdict == "consistent"


def test_a_supply_that_both_sensors_follow_is_one_effect():
    sagging = replace(scenario_by_name("hand-session"), motion=hand_session(15))
    for sensor in ("accelerometer", "gyroscope"):
        sagging = with_effect(sagging, "supply-sensitivity", sensor=sensor, sag_v=0.3, sag_tau_s=20.0)
    recording, truth = simulate(sagging, seed=3)
    (effect,) = trihedron.diagnose(recording, gravity_m_s2=truth.gravity_m_s2).effects
    scales = [one for one in effect.parameters if "_scale_" in one.name]
    assert len(scales) == 6
    assert all(abs(one.value - 1.0) < 3.5 * one.std for one in scales)


@pytest.mark.parametrize(
    ("scenario", "effect_id", "size", "said"),
    [
        ("table-turns", "table-tilt", {"tilt_deg": (0.1, 0.0)}, {"tilt": 0.1}),
        ("table-turns", "turn-angle-error", {"errors_deg": [0.0, 0.0, 0.5]}, {"error of move 3": 0.5}),
    ],
)  # fmt: skip
def test_a_table_is_named_with_its_size(scenario, effect_id, size, said):
    recording, truth = simulate(with_effect(scenario_by_name(scenario), effect_id, **size), seed=3)
    (effect,) = trihedron.diagnose(recording, gravity_m_s2=truth.gravity_m_s2).effects
    assert effect.id == effect_id
    found = {one.name: one for one in effect.parameters}
    for name, value in said.items():
        assert abs(found[name].value - value) < 3.0 * found[name].std


def test_a_pause_of_the_logger_inside_a_pose_is_no_misfit():
    made = simulate(scenario_by_name("hand-session"), 3)[0]
    pose = trihedron.segment(made).poses[9]
    middle = (pose.start + pose.stop) // 2
    late = made.time_s + 45.0 * (np.arange(made.n_samples) > middle)
    assert trihedron.diagnose(replace(made, time_s=late), gravity_m_s2=9.80665).verdict == "consistent"
