"""Units and column order recognised by what the readings can only be, and said to be a guess where they are one."""

import math

import numpy as np
import pytest

from test_read import HEADER, codes, finding, write
from trihedron.channel_facts.quiet import is_integer
from trihedron.read import read_recording
from trihedron.records import FindingCode, Severity
from trihedron.units import AccelerationUnit, RateUnit

RATE_HZ = 100.0


def session(n_poses=6, turn_s=1.0):
    """time [s] (n,), specific force [m/s^2] (n, 3), rate [rad/s] (n, 3): 2 s holds joined by random turns."""
    rng = np.random.default_rng(3)
    f = np.array([0.0, 0.0, 9.81])
    force, rate = [], []
    for _ in range(n_poses):
        force += [f] * 200
        rate += [np.zeros(3)] * 200
        axis = np.cross(f, rng.standard_normal(3))
        axis /= np.linalg.norm(axis)
        steps = int(turn_s * RATE_HZ)
        angles = np.diff(rng.uniform(1.0, 2.0) * 0.5 * (1 - np.cos(np.linspace(0, math.pi, steps + 1))))
        for angle in angles:
            # Gravity's direction in the body turns against the body.
            f = f * math.cos(angle) - np.cross(axis, f) * math.sin(angle)
            force.append(f)
            rate.append(axis * angle * RATE_HZ)
    force, rate = np.array(force), np.array(rate)
    force = force + 0.01 * rng.standard_normal(force.shape)
    rate = rate + 0.01 + 0.001 * rng.standard_normal(rate.shape)
    return np.arange(len(force)) / RATE_HZ, force, rate


def saved(path, time_s, force, rate, header=HEADER):
    return write(path, np.round(np.column_stack([time_s, force, rate]), 9), header)


@pytest.mark.parametrize(
    ("scale", "unit"),
    [(1.0, AccelerationUnit.M_S2), (1 / 9.80665, AccelerationUnit.G), (1000 / 9.80665, AccelerationUnit.MG)],
)
def test_the_accelerometer_unit_is_told_by_gravity(tmp_path, scale, unit):
    time_s, force, rate = session()
    recording = read_recording(saved(tmp_path / "log.csv", time_s, force * scale, rate))
    assert recording.accelerometer_unit is unit
    assert finding(recording, FindingCode.TIME_UNIT_DETECTED)
    shown = unit.value.replace("^2", "²")
    assert any(shown in f.seen for f in recording.findings if f.code is FindingCode.UNIT_DETECTED)


@pytest.mark.parametrize(
    ("scale", "unit"), [(1.0, RateUnit.RAD_S), (180 / math.pi, RateUnit.DEG_S), (1000.0, RateUnit.MRAD_S)]
)
@pytest.mark.parametrize("turn_s", [0.7, 6.0])
def test_the_gyro_unit_is_told_by_turning_gravity(tmp_path, scale, unit, turn_s):
    time_s, force, rate = session(turn_s=turn_s)
    recording = read_recording(saved(tmp_path / "log.csv", time_s, force, rate * scale))
    assert recording.gyroscope_unit is unit
    assert FindingCode.UNIT_ASSUMED not in codes(recording)


def test_the_gyro_unit_depends_on_no_order_of_axes_and_one_that_contradicts_gravity_is_serious(tmp_path):
    time_s, force, rate = session()
    turned = np.column_stack([-rate[:, 2], rate[:, 0], -rate[:, 1]])
    assert read_recording(saved(tmp_path / "log.csv", time_s, force, turned)).gyroscope_unit is RateUnit.RAD_S
    path = saved(tmp_path / "log.csv", time_s, force, rate, "t,ax,ay,az,gx_dps,gy_dps,gz_dps\n")
    recording = read_recording(path)
    # As the header says; but the contradiction is reported.
    assert recording.gyroscope_unit is RateUnit.DEG_S
    assert finding(recording, FindingCode.UNIT_CONTRADICTED).severity is Severity.SERIOUS


@pytest.mark.parametrize("names", ["t,gx,gy,gz,ax,ay,az", "t [s],gx [rad/s],gy [rad/s],gz [rad/s],ax [m/s^2],ay,az"])
def test_a_header_that_exchanges_the_sensors_is_named_with_the_columns_to_give(tmp_path, names):
    time_s, force, rate = session()
    path = saved(tmp_path / "log.csv", time_s, force, rate, f"{names}\n")
    (found,) = [f for f in read_recording(path).findings if f.code is FindingCode.SENSORS_EXCHANGED]
    assert found.severity is Severity.SERIOUS
    recording = read_recording(path, columns=found.action.split("--columns ")[1].rstrip("."))
    np.testing.assert_allclose(recording.accelerometer, force, atol=1e-5)
    assert FindingCode.SENSORS_EXCHANGED not in {f.code for f in recording.findings}


def test_a_still_log_leaves_the_gyro_unit_a_guess_and_one_without_gravity_is_serious(tmp_path):
    time_s, force, rate = session(n_poses=1, turn_s=0.0)
    recording = read_recording(saved(tmp_path / "log.csv", time_s, force, rate))
    assert finding(recording, FindingCode.UNIT_ASSUMED).severity is Severity.WARNING
    noise = 0.02 * np.random.default_rng(5).standard_normal((len(time_s), 3))
    recording = read_recording(saved(tmp_path / "log.csv", time_s, noise, rate))
    assert finding(recording, FindingCode.GRAVITY_MISSING).severity is Severity.SERIOUS


def test_whole_numbers_are_counts(tmp_path):
    time_s, force, rate = session()
    recording = read_recording(
        saved(tmp_path / "log.csv", time_s, np.rint(force * 400 + 32768), np.rint(rate * 5000 + 32768))
    )
    assert recording.accelerometer_unit is AccelerationUnit.COUNTS
    assert recording.gyroscope_unit is RateUnit.COUNTS


@pytest.mark.parametrize("gyro_first", [False, True])
@pytest.mark.parametrize("n_poses", [1, 6])
def test_six_columns_without_names_are_put_in_order_by_gravity(tmp_path, gyro_first, n_poses):
    _, force, rate = session(n_poses=n_poses)
    pair = [rate, force] if gyro_first else [force, rate]
    recording = read_recording(write(tmp_path / "log.txt", np.column_stack(pair), "", separator=" "), rate_hz=RATE_HZ)
    np.testing.assert_array_equal(recording.accelerometer, force)
    np.testing.assert_array_equal(recording.gyroscope, rate)
    assert finding(recording, FindingCode.COLUMNS_ASSUMED).severity is (
        Severity.WARNING if gyro_first else Severity.NOTE
    )


def test_an_undecidable_order_is_said_to_be_a_guess(tmp_path):
    noise = np.random.default_rng(6).standard_normal((500, 6))
    recording = read_recording(write(tmp_path / "log.txt", noise, "", separator=" "), rate_hz=RATE_HZ)
    assert finding(recording, FindingCode.COLUMNS_ASSUMED).severity is Severity.SERIOUS


def test_whole_numbers_are_told_wherever_the_one_that_is_none_stands():
    """In pieces as all at once: an odd number in the last row of a piece or the first of the next is seen."""
    for n in (1, 2047, 2048, 2049, 5000):
        counts = np.arange(3.0 * n).reshape(n, 3)
        assert is_integer(counts)
        for row in {0, n // 2, n - 1, min(2048, n - 1)}:
            for odd, whole in ((0.5, False), (np.nan, True), (np.inf, True)):
                changed = counts.copy()
                changed[row, 1] = odd
                assert is_integer(changed) is whole
    assert not is_integer(np.full((5000, 3), np.nan))
