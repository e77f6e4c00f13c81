"""What a text states of its clock, its units and its devices, in the many ways that people and programs write it."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

import test_read_in_silence as texts
import trihedron
from hand_made_sessions import motion
from trihedron.read import ReadError, read_recording
from trihedron.read.devices import _devices
from trihedron.read.names import clock_said, known_unit, parse_name
from trihedron.records import FindingCode, Severity
from trihedron.units import AccelerationUnit

T, FORCE, RATE = motion(50.0, 7)
NAMES = "ax,ay,az,gx,gy,gz"


def written(path, clock, names, remark="", force=FORCE, rate=RATE):
    return texts.written(path, *texts.table(clock, force, rate), header=names, remark=remark)


def doubts(recording):
    return {f.code for f in recording.findings if f.severity is not Severity.NOTE}


@pytest.mark.parametrize(
    ("remark", "name", "per_s"),
    [
        ("# 1 tick = 39.0625 us\n", "ticks", 25600.0),
        ("// time in ticks of 1/32768 s\n", "ticks", 32768.0),
        ("% tick: 62.5 us\n", "t", 16000.0),
        ("# timestamp unit: us\n", "timestamp", 1e6),
        ("", "ticks_25 us", 40000.0),
        ("", "ticks / 62.5 us", 16000.0),
        ("", "ticks (1/32768 s)", 32768.0),
        ("", "Zeit (h)", 1 / 3600),
    ],
)
def test_the_size_of_a_tick_is_taken_from_where_it_is_stated(tmp_path, remark, name, per_s):
    recording = read_recording(
        written(
            tmp_path / "log.csv", np.rint(T * per_s).astype(int) if per_s > 1 else T * per_s, f"{name},{NAMES}", remark
        )
    )
    # Ticks of 62.5 us round the time to 3e-3 of a step.
    assert recording.rate_hz == pytest.approx(50.0, rel=1e-3)
    assert not doubts(recording)
    # Of other times nothing is said.
    assert not any(clock_said(*said) for said in (("start time", "5 s"), ("exposure time", "ms"), ("time", "25 us")))


OF_THE_RATE = ("# ODR = 50 Hz", "# fs=50 Hz", "% sample_rate_hz: 50", "// Output rate: 0.05 kHz")


@pytest.mark.parametrize("remark", [*OF_THE_RATE, "# fs = 4 g", "# baud rate: 115200", "# i2c frequency: 400000"])
def test_a_remark_about_the_rate_is_known_by_its_words_and_a_full_scale_is_none(tmp_path, remark):
    recording = read_recording(written(tmp_path / "log.csv", range(len(T)), f"n,{NAMES}", remark + "\n"))
    assert (FindingCode.RATE_ASSUMED in doubts(recording)) == (remark not in OF_THE_RATE)
    assert remark not in OF_THE_RATE or recording.rate_hz == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("sensor", "text", "unit"),
    [
        ("accelerometer", "m.s^-2", "m/s^2"),
        ("accelerometer", "g's", "g"),
        ("accelerometer", "milli-g", "mg"),
        ("gyroscope", "º/s", "deg/s"),
        ("gyroscope", "rad s-1", "rad/s"),
        ("gyroscope", "millidps", "mdeg/s"),
        ("gyroscope", "r/min", "rpm"),
        ("gyroscope", "furlongs", ""),
    ],
)
def test_a_unit_is_known_alike_in_names_remarks_and_options(sensor, text, unit):
    assert known_unit(sensor, text) == unit
    if unit:
        stem = "acc_x" if sensor == "accelerometer" else "gyr_x"
        assert {parse_name(stem + form.format(text)).unit for form in (" [{}]", " ({})", "_{}", " / {}")} == {unit}


def test_a_converters_name_with_a_unit_is_in_that_unit_and_no_counts_of_microdegrees():
    names = {"gyroADC[0] dps": "deg/s", "gyroADC[0]": "counts", "gyro_x [microdps]": "microdps"}
    assert {name: parse_name(name).unit for name in names} == names


def test_whole_seconds_and_nanoseconds_belong_together_above_a_row_of_units(tmp_path):
    clock = [f"{1730650831 + int(t)},{round(t % 1 * 1e9)}" for t in T]
    log = written(tmp_path / "log.csv", clock, f"secs,nsecs,{NAMES}\n-,-,m/s^2,m/s^2,m/s^2,rad/s,rad/s,rad/s")
    recording = read_recording(log)
    np.testing.assert_allclose(recording.time_s, T, atol=1e-9)
    assert recording.start_epoch_s == 1730650831


def test_a_column_t_that_falls_is_no_clock(tmp_path):
    warm = np.round(27.0 + np.random.default_rng(1).normal(0.0, 0.02, len(T)), 2)
    log = written(tmp_path / "log.csv", warm, f"T,{NAMES}", "# fs=50 Hz\n")
    recording = read_recording(log)
    assert recording.rate_hz == pytest.approx(50.0)
    np.testing.assert_allclose(recording.temperature_degc, warm)


def test_a_column_that_changes_where_the_clock_goes_back_identifies_devices(tmp_path):
    one = [f"left,{t:.4f}" for t in T]
    force, rate = np.concatenate([FORCE, 1.01 * FORCE]), np.concatenate([RATE, RATE])
    log = written(
        tmp_path / "log.csv", [*one, *(r.replace("left", "right") for r in one)], f"wrist,t,{NAMES}", "", force, rate
    )
    with pytest.raises(ReadError, match="'wrist' identifies 2 devices: left"):
        read_recording(log)
    assert len(read_recording(log, instance="right").time_s) == len(T)


def test_mg_and_gal_that_nothing_states_are_a_warning_where_both_are_near(tmp_path):
    for length, unit in ((981.0, AccelerationUnit.CM_S2), (1003.0, AccelerationUnit.MG)):
        read = FORCE * length / np.median(np.linalg.norm(FORCE, axis=1))
        log = written(tmp_path / "log.csv", T, f"t,{NAMES}", "", read)
        recording = read_recording(log)
        assert recording.accelerometer_unit is unit
        assert (FindingCode.UNIT_ASSUMED in doubts(recording)) == (unit is AccelerationUnit.CM_S2)


def test_an_array_with_its_own_clock_is_a_clock_and_three_readings():
    recording = trihedron.read({"acce": np.c_[1e3 + T, FORCE], "gyro": np.c_[1e3 + T, RATE]})
    assert recording.rate_hz == pytest.approx(50.0)
    np.testing.assert_allclose(recording.accelerometer, FORCE)


@pytest.mark.parametrize(
    ("form", "line"),
    [("%Y/%m/%d", "time: {}, {}"), ("%d/%m/%Y", "{} {}"), ("%d.%m.%Y", "[{}] {}"), ("%Y-%m-%d", "{} {}")],
)
def test_a_date_before_or_among_labels_is_a_clock_however_it_is_written(tmp_path, form, line):
    t, force, rate = motion(n_poses=3)
    names = ("ax", "ay", "az", "gx", "gy", "gz")
    start = datetime(2024, 3, 13, 23, 59, 58)
    lines = []
    for x, row in zip(t, np.hstack([force, rate]), strict=True):
        stamp = (start + timedelta(milliseconds=round(1000 * float(x)))).strftime(f"{form} %H:%M:%S.%f")[:-3]
        lines.append(line.format(stamp, ", ".join(f"{name}: {v:.6f}" for name, v in zip(names, row, strict=True))))
    (tmp_path / "log.txt").write_text("\n".join(lines) + "\n")
    recording = read_recording(tmp_path / "log.txt")
    np.testing.assert_allclose(recording.time_s, t, atol=2e-3)
    assert recording.start_epoch_s == pytest.approx(start.replace(tzinfo=UTC).timestamp(), abs=1e-2)
    np.testing.assert_allclose(recording.gyroscope, rate, atol=1e-6)


@pytest.mark.parametrize(
    ("form", "devices"),
    [("{d}_{c}", ("A", "B")), ("{c}_{d}", ("left", "right")), ("{d} {c}", ("imu0", "imu1")), ("{c}_{d}", ("1", "2"))],
)
def test_devices_side_by_side_are_identified_by_the_names_of_their_columns(tmp_path, form, devices):
    t, force, rate = motion(n_poses=3)
    names = [form.format(d=d, c=c) for d in devices for c in ("ax", "ay", "az", "gx", "gy", "gz")]
    columns = [*texts.table(t, force, rate), *texts.table(t, 2.0 * force, -rate)[1:]]
    log = texts.written(tmp_path / "log.csv", *columns, header=",".join(["t", *names]))
    for device, factor, sign in zip(devices, (1.0, 2.0), (1.0, -1.0), strict=True):
        recording = read_recording(log, instance=device)
        np.testing.assert_allclose(recording.accelerometer, factor * force, atol=1e-5)
        np.testing.assert_allclose(recording.gyroscope, sign * rate, atol=1e-5)
        assert not recording.auxiliary
    if devices[0] == "A" and form.startswith("{d}"):
        with pytest.raises(ReadError, match=r"identify 2 devices: A, B; .*--instance A"):
            read_recording(log)


def test_sensors_and_axes_before_an_underscore_are_no_devices():
    assert not _devices(("t", "acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"))
    assert not _devices(("t", "acc1", "acc2", "acc3", "gyr1", "gyr2", "gyr3"))
    assert not _devices(("t", "x_acc", "y_acc", "z_acc", "x_gyro", "y_gyro", "z_gyro"))
