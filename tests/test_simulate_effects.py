"""Every effect of the catalogue does what its mechanism says, at the stated size, and nothing else."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from trihedron.simulate import EFFECT_IDS, Scenario, hand_session, simulate, table_turns, with_effect
from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.motion.attitude import attitude_with_up
from trihedron.simulate.motion.steps import Motion, MoveTo, Pose, Turn, Vibrate
from trihedron.simulate.scenario import Environment, Temperature

IDEAL = Scenario(hand_session(8, pose_s=1.0, first_pose_s=2.0, arm_m=0.1), "ideal")


def both(effect_id, base=IDEAL, **size):
    scenario = with_effect(base, effect_id, **size)
    recording, truth = simulate(scenario, seed=5)
    assert effect_id in truth.effects
    return recording, truth


def shaken(frequency_hz, duration_s, size=1.0):
    """Along z, after half a second of rest."""
    return Motion((Pose(0.5), Vibrate((0, 0, 1), size, frequency_hz, duration_s, fade=0.05)))


# Readings of the ideal instrument with one effect, from the truth alone.
STATIC = {
    "accel-quadratic": (
        {"k2": (1e-4, -2e-4, 0.0)},
        lambda f, w, _t: (f + np.array([1e-4, -2e-4, 0.0]) * f**2, w),
        # Fourth order and up: 5 K2³ f⁴ with f up to 25 m/s².
        2e-5,
    ),
    "accel-cubic": (
        {"k3": (1e-5, -1e-5, 0.0)},
        lambda f, w, _t: (f + np.array([1e-5, -1e-5, 0.0]) * f**3, w),
        # The bridge's fifth order ξ⁴/16 f = K3² f⁵, the suspension's three times that.
        3e-10 * 25.0**5,
    ),
    "accel-scale-asymmetry": (
        {"asymmetry": (1e-3, 0.0, -2e-3)},
        lambda f, w, _t: (f + np.array([1e-3, 0.0, -2e-3]) * np.abs(f), w),
        1e-12,
    ),
    "gyro-g-sensitivity": (
        {"matrix": [[1e-3, 0, 2e-4], [0, -1e-3, 0], [0, 5e-4, 0]]},
        lambda f, w, _t: (f, w + f @ np.array([[1e-3, 0, 2e-4], [0, -1e-3, 0], [0, 5e-4, 0]]).T),
        1e-12,
    ),
    "gyro-scale-nonlinearity": (
        {"c2": (1e-3, 0.0, 0.0), "c3": (0.0, 1e-3, -1e-4), "asymmetry": (0.0, 0.0, 1e-3)},
        lambda f, w, _t: (
            f,
            (w + np.array([1e-3, 0, 0]) * w**2 + np.array([0, 1e-3, -1e-4]) * w**3)
            * (1.0 + np.array([0, 0, 1e-3]) * np.sign(w)),
        ),
        # Next order for |ω| < 5: the bridge's c3² ω⁵ and the suspension's 5 c2³ ω⁴, 5 c2 c3 ω⁴.
        1e-6 * 5.0**5,
    ),
    "axis-handedness": ({"sensor": "gyroscope", "axis": 2}, lambda f, w, _t: (f, w * [1, -1, 1]), 1e-12),
    "gyro-saturation": ({"limit": 1.5}, lambda f, w, _t: (f, np.clip(w, -1.5, 1.5)), 1e-12),
    "accel-saturation": ({"limit": 8.0}, lambda f, w, _t: (np.clip(f, -8, 8), w), 1e-12),
    "accel-bias-drift": (
        {"amplitude": (0.05, 0.0, -0.02), "tau_s": 7.0},
        lambda f, w, _t: (f + np.exp(-_t / 7.0)[:, None] * [0.05, 0, -0.02], w),
        1e-12,
    ),
    "gyro-bias-drift": (
        {"amplitude": (0.005, 0.0, -0.02), "tau_s": 7.0, "change": (0.0, 0.03, 0.01), "length_s": 40.0},
        lambda f, w, t: (
            f,
            w + np.exp(-t / 7.0)[:, None] * [0.005, 0, -0.02] + (t / 40.0 - 0.5)[:, None] * [0, 0.03, 0.01],
        ),
        1e-12,
    ),
    "periodic-interference": (
        {"sensor": "gyroscope", "frequency_hz": 131.0, "amplitude": (0.0, 0.01, 0.0)},
        lambda f, w, _t: (f, w + np.sin(2 * np.pi * 131.0 * _t)[:, None] * [0, 0.01, 0]),
        1e-12,
    ),
}


@pytest.mark.parametrize("effect_id", list(STATIC))
def test_an_effect_of_the_readout_has_its_closed_form(effect_id):
    size, closed_form, tolerance = STATIC[effect_id]
    recording, truth = both(effect_id, **size)
    f, w = closed_form(truth.specific_force_m_s2, truth.angular_rate_rad_s, truth.accelerometer_time_s)
    assert np.abs(recording.accelerometer - f).max() < tolerance
    assert np.abs(recording.gyroscope - w).max() < tolerance
    changed = recording.accelerometer if effect_id.startswith("accel") else recording.gyroscope
    plain = truth.specific_force_m_s2 if effect_id.startswith("accel") else truth.angular_rate_rad_s
    assert (np.linalg.det(truth.gyroscope_S) < 0.0) == (effect_id == "axis-handedness")
    # Far above the tolerance: the test would fail without the effect.
    assert np.abs(changed - plain).max() > 3.0 * tolerance


@pytest.mark.parametrize(("prefix", "sensor"), [("accel", "accelerometer"), ("gyro", "gyroscope")])
@pytest.mark.parametrize("kind", ["bias", "scale"])
def test_temperature_acts_linearly_and_quadratically_and_is_logged_on_request(prefix, sensor, kind):
    size = {"per_k": (1e-3, 0.0, -2e-3), "per_k2": (1e-5, 0.0, 0.0), "warm_up_k": 15.0, "warm_up_tau_s": 8.0}
    recording, truth = both(f"{prefix}-thermal-{kind}", **size)
    k = truth.temperature_degc - 25.0
    assert k[-1] > 10.0
    change = k[:, None] * [1e-3, 0, -2e-3] + (k**2)[:, None] * [1e-5, 0, 0]
    plain = truth.specific_force_m_s2 if prefix == "accel" else truth.angular_rate_rad_s
    want = plain + change if kind == "bias" else plain * (1 + change)
    assert np.abs(getattr(recording, sensor) - want).max() < 1e-12
    # Logged in steps of 0.01 K.
    assert np.abs(recording.temperature_degc - truth.temperature_degc).max() <= 0.005 + 1e-9
    hidden, _ = both(f"{prefix}-thermal-{kind}", **size, logged=False)
    assert hidden.temperature_degc is None
    assert np.array_equal(getattr(hidden, sensor), getattr(recording, sensor))


def test_a_softer_spring_and_a_wider_gap_lower_the_scale():
    warm = Environment(temperature=Temperature(start_degc=35.0))
    mass = replace(Accelerometer().mass, spring_per_k=(1e-4, 0, 0), gap_per_k=(0, 2e-4, 0))
    recording, truth = simulate(replace(IDEAL, accelerometer=Accelerometer(mass=mass), environment=warm))
    assert truth.effects["accel-thermal-scale"]["mechanism_per_k"] == (-1e-4, -2e-4, 0)
    want = truth.specific_force_m_s2 / [1.001, 1.002, 1.0]
    assert np.abs(recording.accelerometer - want).max() < 1e-12


def test_a_lever_arm_adds_the_euler_and_centripetal_terms():
    arm = (0.05, -0.02, 0.08)
    recording, truth = both("lever-arm", arm_m=arm)
    w = truth.angular_rate_rad_s
    extra = recording.accelerometer - truth.specific_force_m_s2
    want = np.cross(np.gradient(w, truth.accelerometer_time_s, axis=0), arm) + np.cross(w, np.cross(w, arm))
    # Differences over two 10 ms steps: h²/6 times a third derivative of about 1e4 s⁻⁴ · 0.1 m = 2 % of the peak.
    assert np.abs(extra - want)[2:-2].max() < 0.05 * np.abs(want).max()
    assert np.abs(want).max() > 0.1


def test_the_size_effect_reads_each_axis_at_its_own_place():
    places = ((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, -0.015))
    mixed, truth = both("accel-size-effect", places_m=places)
    for axis, place in enumerate(places):
        alone, _ = both("lever-arm", arm_m=place)
        assert np.abs(mixed.accelerometer[:, axis] - alone.accelerometer[:, axis]).max() < 1e-12
    for pose in truth.poses:
        assert np.abs((mixed.accelerometer - truth.specific_force_m_s2)[pose.start + 1 : pose.stop - 1]).max() < 1e-12


def test_a_time_offset_reads_the_gyro_later_under_the_same_stamp():
    recording, truth = both("accel-gyro-time-offset", offset_s=0.0037)
    assert np.allclose(truth.gyroscope_time_s - recording.time_s, 0.0037, rtol=0, atol=1e-12)
    assert np.abs(recording.gyroscope - truth.angular_rate_rad_s).max() < 1e-12
    plain, _ = simulate(IDEAL, seed=5)
    assert np.array_equal(plain.accelerometer, recording.accelerometer)
    assert np.abs(plain.gyroscope - recording.gyroscope).max() > 0.01


def test_a_lag_delays_a_steady_turn_by_its_time_constant():
    turn = Scenario(Motion((Pose(1.0), Turn((0, 0, 1), 360.0, 4.0, ramp=0.4), Pose(1.0))))
    recording, truth = both("sensor-lag", base=turn, sensor="gyroscope", lag_s=0.02)
    # Where the rate changes slowly the lagged rate is the rate 20 ms ago, up to τ² ω''.
    t = recording.time_s
    then = np.interp(t - 0.02, t, truth.angular_rate_rad_s[:, 2])
    assert np.abs(recording.gyroscope[:, 2] - then).max() < 0.02**2 * 4.0
    assert np.abs(recording.gyroscope[:, 2] - truth.angular_rate_rad_s[:, 2]).max() > 0.02
    area = np.trapezoid(recording.gyroscope[:, 2], t)
    # What a lag delays it does not lose.
    assert abs(area - 2.0 * np.pi) < 1e-6


def test_a_butterworth_filter_is_3_db_down_at_its_corner_and_stops_what_would_alias():
    for frequency, order in ((8.0, 2), (8.0, 3), (8.0, 4)):
        base = Scenario(shaken(frequency, 20.0))
        recording, _ = both("sensor-lag", base=base, sensor="accelerometer", cutoff_hz=8.0, order=order)
        inside = recording.accelerometer[500:1800, 2]
        # 8 Hz over 13 s is a whole number of periods; 8 fine steps per sample leave sinc² 1e-4.
        assert abs(inside.std() - np.sqrt(0.5)) < 1e-3, order
    alias = Scenario(shaken(95.0, 10.0))
    plain, _ = simulate(alias)
    filtered, _ = both("sensor-lag", base=alias, sensor="accelerometer", cutoff_hz=20.0, order=4)
    assert plain.accelerometer[200:900, 2].std() > 0.9
    assert filtered.accelerometer[200:900, 2].std() < 0.01


def test_hysteresis_leaves_an_offset_with_the_sign_of_the_way_it_came():
    there_and_back = Motion(
        (Pose(2.0), MoveTo((1, 0, 0), 2.0), Pose(2.0), MoveTo((1, 0, 1), 2.0), Pose(2.0)),
        start=attitude_with_up((0.0, 0.0, 1.0)),
    )
    recording, truth = both("accel-hysteresis", base=Scenario(there_and_back), offset_m_s2=0.02, width_m_s2=1.0)
    error = recording.accelerometer - truth.specific_force_m_s2
    middle = [(h.start + h.stop) // 2 for h in truth.poses]
    assert np.abs(error[middle[0]]).max() == 0.0
    # x rose from 0 to g: it lags below; z fell: it lags above. Then x falls and z rises by more than twice the play.
    assert np.allclose(error[middle[1]], [-0.02, 0.0, 0.02], atol=1e-12)
    assert np.allclose(error[middle[2]], [0.02, 0.0, -0.02], atol=1e-12)


def test_creep_decays_after_a_turn_with_its_time_constant():
    turned = Motion((Pose(2.0), MoveTo((1, 0, 0), 0.1), Pose(30.0)), start=attitude_with_up((0.0, 0.0, 1.0)))
    recording, truth = both("accel-hysteresis", base=Scenario(turned), creep_fraction=1e-3, creep_tau_s=8.0)
    error = (recording.accelerometer - truth.specific_force_m_s2)[:, 0]
    pose = truth.poses[1]
    t = recording.time_s[pose.start : pose.stop] - 2.05
    # The move lasts 0.1 s about its middle: second order in 0.1/8.
    assert np.abs(error[pose.start : pose.stop] + 1e-3 * truth.gravity_m_s2 * np.exp(-t / 8.0)).max() < 1e-5


@pytest.mark.parametrize(("sensor", "axis", "kind"), [("gyroscope", 0, Gyroscope), ("accelerometer", 2, Accelerometer)])
def test_vibration_rectifies_into_an_offset_and_rest_does_not(sensor, axis, kind):
    motion = Motion((Pose(3.0), Vibrate((0, 0, 1), 2.0, 30.0, 10.0), Pose(3.0)))
    recording, _ = simulate(Scenario(motion, **{sensor: kind(rectification=tuple(1e-3 * np.eye(3)[axis]))}))
    readings = getattr(recording, sensor)[:, axis]
    still = readings[50:250].mean()
    assert np.abs(readings[50:250] - still).max() < 1e-9
    # k times the mean square, high-passed at 5 Hz: power gain r²/(1+r²) at r = 6.
    assert abs((readings[400:1200].mean() - still) / (1e-3 * 4.0 * 36.0 / 37.0) - 1.0) < 0.01
    _, truth = both("vibration-rectification", sensor="gyroscope", coefficient=1e-3)
    assert any(s.kind == "vibration" for s in truth.segments)


def test_lost_samples_vanish_and_stamps_made_anew_hide_it():
    shown, truth = both("dropped-samples", losses=[(3.0, 7)], restamped=False)
    hidden, again = both("dropped-samples", losses=[(3.0, 7)])
    plain, _ = simulate(IDEAL, seed=5)
    assert plain.n_samples - shown.n_samples == 7
    assert np.isclose(np.diff(shown.time_s).max(), 0.08)
    assert np.allclose(np.diff(hidden.time_s), 0.01)
    assert np.array_equal(shown.accelerometer, hidden.accelerometer)
    assert np.array_equal(truth.kept, again.kept)
    assert np.diff(truth.kept).max() == 8
    random, _ = both("dropped-samples", probability=0.02, restamped=True)
    expected = 0.02 * plain.n_samples
    assert abs(plain.n_samples - random.n_samples - expected) < 4.0 * np.sqrt(expected)


def test_jitter_moves_the_instants_and_a_clock_error_the_stamps():
    _, truth = both("timing-jitter", jitter_s=5e-4)
    error = truth.accelerometer_time_s - np.arange(len(truth.accelerometer_time_s)) / 100.0
    assert abs(error.std() / 5e-4 - 1.0) < 4.0 / np.sqrt(2.0 * len(error))
    fast, truth = both("timing-jitter", rate_error=2e-3)
    assert np.allclose(fast.time_s[1:] / truth.accelerometer_time_s[1:], 1.002)
    shown, truth = both("timing-jitter", jitter_s=5e-4, shown=True)
    assert np.allclose(shown.time_s, truth.accelerometer_time_s - truth.accelerometer_time_s[0], atol=1e-12)


def test_the_earth_turns_with_the_attitude():
    _, truth = both("earth-rate", latitude_deg=60.0, heading_deg=30.0)
    at = [pose.start + 1 for pose in truth.poses]
    rate, up = truth.angular_rate_rad_s[at], truth.specific_force_m_s2[at] / truth.gravity_m_s2
    assert np.allclose(np.linalg.norm(rate, axis=1), 7.292115e-5)
    assert np.allclose((rate * up).sum(axis=1), 7.292115e-5 * np.sin(np.pi / 3.0))


def test_a_coarse_converter_rounds_and_a_ratiometric_one_follows_its_supply():
    coarse, truth = both("quantisation", sensor="accelerometer", lsb=0.25)
    assert np.abs(coarse.accelerometer - np.round(truth.specific_force_m_s2 / 0.25) * 0.25).max() == 0.0
    offset = replace(IDEAL, accelerometer=Accelerometer(b=(1.0, -2.0, 0.5)))
    sagging, truth = both("supply-sensitivity", base=offset, sensor="accelerometer", sag_v=0.3, sag_tau_s=5.0)
    raw = truth.specific_force_m_s2 - [1.0, -2.0, 0.5]
    assert np.abs(sagging.accelerometer - raw * (truth.supply_v / 3.3)[:, None]).max() < 1e-12
    assert np.abs(sagging.supply_v - truth.supply_v).max() <= 0.0005 + 1e-9


def test_a_pushed_pose_moves_and_comes_back():
    recording, truth = both("disturbed-pose", poses=[2], tilt_deg=1.0)
    (push,) = [s for s in truth.segments if s.kind == "disturbance"]
    assert np.abs(recording.accelerometer[push.start - 2] - recording.accelerometer[push.stop + 2]).max() < 1e-12
    assert np.ptp(recording.accelerometer[push.start : push.stop], axis=0).max() > 0.05
    assert truth.effects["disturbed-pose"]["poses"] == (2,)


def test_turn_errors_and_table_tilt_stay_out_of_what_is_stated():
    base = Scenario(table_turns((90.0, -90.0)))
    recording, truth = both("turn-angle-error", base=base, errors_deg=[1.0, -0.5])
    turns = [s for s in truth.segments if s.kind == "turn"]
    for turn, stated in zip(turns, [91.0, -90.5] * 3, strict=True):
        assert np.isclose(np.degrees(turn.turn_rad), stated)
        swept = np.trapezoid(recording.gyroscope[turn.start - 1 : turn.stop + 1] @ turn.axis, dx=0.01)
        assert np.isclose(np.degrees(swept), stated, atol=1e-3)
    tilted, truth = both("table-tilt", base=base, tilt_deg=(0.5, -0.3))
    lean_of_face = np.degrees(np.arccos(np.max(np.abs(tilted.accelerometer[0])) / truth.gravity_m_s2))
    assert np.isclose(lean_of_face, np.hypot(0.5, 0.3), atol=1e-3)


@pytest.mark.parametrize(
    ("effect_id", "sensor"), [("accel-bias-repeatability", "accelerometer"), ("gyro-bias-repeatability", "gyroscope")]
)
def test_scattered_zeros_are_constant_in_a_pose_and_drawn_anew_after_a_move(effect_id, sensor):
    base = Scenario(hand_session(40, pose_s=1.0))
    sigma = np.array([0.01, 0.02, 0.04])
    recording, truth = both(effect_id, base=base, sigma=tuple(sigma))
    clean, _ = simulate(base, seed=5)
    added = getattr(recording, sensor) - getattr(clean, sensor)
    poses = [added[s.start : s.stop] for s in truth.segments if s.kind == "pose"]
    assert max(np.ptp(part, axis=0).max() for part in poses) < 1e-12
    zeros = np.array([part[0] for part in poses])
    # 40 draws: their deviation is uncertain by 11 %; four of these.
    assert np.all(np.abs(np.log(zeros.std(axis=0) / sigma)) < 0.45)
    assert np.abs(np.diff(added, axis=0)).max() < 0.02  # goes over within the move, no step
    assert truth.effects[effect_id]["sigma"] == tuple(sigma)


def test_every_effect_id_is_exercised_here():
    text = Path(__file__).read_text(encoding="utf-8")
    thermal = {f"{p}-thermal-{k}" for p in ("accel", "gyro") for k in ("bias", "scale")}
    assert all(f'"{effect_id}"' in text for effect_id in set(EFFECT_IDS) - thermal)


@pytest.mark.parametrize(
    ("effect_id", "size", "words"),
    [
        ("accel-cubed", {}, "no effect is called 'accel-cubed'"),
        ("accel-cubic", {"k9": 1.0}, "has no 'k9'; it takes k3"),
        ("accel-bias-drift", {"tau_s": 3.0}, "a drift needs an amplitude that dies away, or a change"),
        ("accel-bias-drift", {"change": 0.1, "length_s": 0.0}, "positive tau_s and length_s"),
        ("accel-cubic", {"k3": 0.1}, "hits its stop"),
        ("accel-quadratic", {"k2": (1.0, 2.0)}, "three numbers"),
    ],
)
def test_a_wrong_question_is_answered_in_one_sentence(effect_id, size, words):
    with pytest.raises(ValueError, match=words):
        simulate(with_effect(IDEAL, effect_id, **size))
