"""Logs of one or two orientations, and poses that are shaken by a line."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron
from diagnosed_session import simulated
from trihedron.records import Recording
from trihedron.report.diagnosis import diagnosis_report

DEG = np.pi / 180.0


def still(n, rate_hz, seed, force=(0.3, -0.2, 9.79)):
    rng = np.random.default_rng(seed)
    t = np.arange(n) / rate_hz
    accelerometer = np.array(force) + rng.normal(0.0, 0.02, (n, 3))
    gyroscope = rng.normal(0.0, 0.05 * DEG, (n, 3)) + np.array([0.3, -0.2, 0.1]) * DEG
    return t, accelerometer, gyroscope


def chamber(seed, hysteresis=0.0):
    """Up from -10 to 60 °C and back, at 1 Hz in 80 min: the gyro's bias follows, lagging if there is hysteresis."""
    n, rate_hz = 4800, 1.0
    t, accelerometer, gyroscope = still(n, rate_hz, seed)
    u = t / t[-1]
    heat = 25.0 - 35.0 * np.cos(2.0 * np.pi * u)
    own = np.array([0.01, -0.03, 0.004]) * DEG
    gyroscope += (heat - 25.0)[:, None] * own + hysteresis * np.sign(np.gradient(heat))[:, None] * np.array([1, 0, 0])
    return Recording.from_arrays(t, accelerometer, gyroscope, temperature_degc=np.round(heat, 1)), own


def test_a_static_log_of_a_healthy_sensor_is_not_testable_and_nothing_is_named():
    d = trihedron.diagnose(Recording.from_arrays(*still(15000, 100.0, 41)), gravity_m_s2=9.8)
    assert d.verdict == "not-testable"
    assert d.effects == ()
    assert {t.domain for t in d.domains} >= {"static-gyro", "static-accel", "within-static"}
    assert not any(t.disagrees for t in d.remaining)
    document = diagnosis_report(d)
    assert "`trihedron allan LOG`" in document.next_step


def test_a_chamber_log_of_one_pose_tells_zeros_against_temperature():
    log, own = chamber(43)
    d = trihedron.diagnose(log, gravity_m_s2=9.8)
    assert [e.id for e in d.effects] == ["gyro-thermal-bias"]
    said = {p.name: p for p in d.effects[0].parameters}
    for axis, true in zip("xyz", own, strict=True):
        p = said[f"bias_per_kelvin_{axis}"]
        # Four standard errors: three axes.
        assert abs(p.value - true) < 4.0 * p.std
        assert p.std < 0.1 * np.abs(own).max()
    static = next(t for t in d.domains if t.domain == "static-gyro")
    after = next(t for t in d.remaining if t.domain == "static-gyro")
    assert after.rms < 0.1 * static.rms


def test_branches_that_differ_while_heating_and_cooling_are_stated_in_degrees_per_second():
    log, _ = chamber(45, hysteresis=0.2 * DEG)
    d = trihedron.diagnose(log, gravity_m_s2=9.8)
    effect = next(e for e in d.effects if e.id == "gyro-thermal-bias")
    said = {p.name: p.value for p in effect.parameters}
    told = abs(said.get("half_gap_x", 0.0)) + 0.5 * abs(said.get("branch_difference_x", 0.0))
    assert told == pytest.approx(0.2 * DEG, rel=0.25)


@pytest.mark.parametrize(("unit", "lsb"), [("counts", 1e-4), ("rad/s", 1e-9)])
def test_a_warm_up_is_a_curve_in_counts_as_in_si(unit, lsb):
    """The size of a count is unknown: its drift is neither implausible nor a walk for it."""
    t, accelerometer, gyroscope = still(30000, 10.0, 49)
    gyroscope[:, 1] += 0.007 * np.exp(-t / 350.0)
    readings = np.rint(gyroscope / lsb) * (1.0 if unit == "counts" else lsb)
    log = Recording.from_arrays(t, accelerometer, readings, gyroscope_unit=unit)
    d = trihedron.diagnose(log, gravity_m_s2=9.8)
    (effect,) = d.effects
    assert effect.id == "gyro-bias-drift"
    spans = {p.name: p.value for p in effect.parameters}
    assert spans["range_y"] == pytest.approx(70.0 if unit == "counts" else 0.007, rel=0.1)
    held = next(one for one in effect.held_out if one.domain == "static-gyro")
    assert held.rms_after < 0.1 * held.rms_before
    assert not any(one.disagrees for one in d.remaining)


def test_a_hum_in_a_static_log_is_named():
    t, accelerometer, gyroscope = still(15000, 100.0, 47)
    gyroscope[:, 0] += 0.04 * DEG * np.sin(2.0 * np.pi * 17.3 * t)
    d = trihedron.diagnose(Recording.from_arrays(t, accelerometer, gyroscope), gravity_m_s2=9.8)
    assert [e.id for e in d.effects] == ["periodic-interference"]
    assert d.effects[0].parameters[0].value == pytest.approx(17.3, abs=1e-3)


@pytest.mark.parametrize(("lasts_s", "is_for_noise"), [(6, False), (30, True)])
def test_only_a_log_long_enough_for_noise_is_sent_to_allan(lasts_s, is_for_noise):
    log = Recording.from_arrays(*still(100 * lasts_s, 100.0, 42))
    advice = [" ".join(one.action for one in trihedron.check(log).findings)]
    advice.append(diagnosis_report(trihedron.diagnose(log, gravity_m_s2=9.8)).next_step)
    assert ["allan" in one for one in advice] == [is_for_noise] * 2


def test_a_log_in_motion_names_nothing():
    t, accelerometer, gyroscope = still(6000, 100.0, 48)
    moving = (t > 5.0) & (t < 55.0)
    angle = 1.2 * np.sin(0.7 * (t - 5.0)) * moving
    accelerometer[:, 0] += 9.8 * np.sin(angle)
    accelerometer[:, 2] += 9.8 * (np.cos(angle) - 1.0)
    gyroscope[:, 1] += np.gradient(angle, t)
    d = trihedron.diagnose(Recording.from_arrays(t, accelerometer, gyroscope), gravity_m_s2=9.8)
    assert d.verdict == "not-testable"
    assert d.effects == ()


@pytest.mark.parametrize(
    ("seed", "shaken_share", "gain", "rate_line", "named"),
    # 0.005 of a mean square of 1.1²/2 m²/s⁴ is 3 mm/s², of 0.8²/2 half of that.
    [(1, 0.35, 0.005, 0.0, "vibration-rectification"), (4, 0.0, 0.0, 3e-3, "periodic-interference")],
)
def test_an_offset_of_shaken_poses_is_rectification_and_a_line_interference(seed, shaken_share, gain, rate_line, named):
    """In a share of the poses 1 m/s² of shaking with ``gain`` times its square, a line in rates.

    The truth's own poses are shaken from end to end, at a frequency that is no whole number of cycles of any.
    """
    recording, truth = simulated(seed=seed, n_poses=18, grade="tactical")
    rng = np.random.default_rng(seed)
    force, rate, t = recording.accelerometer.copy(), recording.gyroscope.copy(), recording.time_s
    rests = [part for part in truth.segments if part.kind == "pose"]
    f = rng.uniform(0.12, 0.35) * recording.rate_hz
    for k in rng.choice(len(rests), round(shaken_share * len(rests)), replace=False):
        here = slice(rests[k].start, rests[k].stop)
        shake = np.sin(2.0 * np.pi * f * t[here] + rng.uniform(0.0, 6.3))[:, None] * np.array([1.1, -0.8, 0.9])
        force[here] += (shake + gain * shake**2) @ np.linalg.inv(np.asarray(truth.accelerometer_S)).T
    rate += rate_line * np.outer(np.sin(2.0 * np.pi * f * t), np.linalg.solve(truth.gyroscope_S, np.ones(3)))
    log = replace(recording, accelerometer=force, gyroscope=rate)
    found = trihedron.diagnose(log, gravity_m_s2=truth.gravity_m_s2)
    assert [effect.id for effect in found.effects] == [named]
