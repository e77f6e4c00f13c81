"""Unusual but legal texts: what they state is obeyed; read whole or rejected with what to do, never half."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

import test_read_in_silence as texts
import trihedron
from hand_made_sessions import motion
from test_read import HEADER, assert_same, codes, readings, text_module, write
from trihedron.read import ReadError, read_recording
from trihedron.read.names import clock_said, known_unit, parse_name
from trihedron.records import Severity
from trihedron.units import AccelerationUnit

ROWS = 3000
T, FORCE, RATE = motion(50.0, 7)
NAMES = "ax,ay,az,gx,gy,gz"
OF_THE_RATE = ("# ODR = 50 Hz", "# fs=50 Hz", "% sample_rate_hz: 50", "// Output rate: 0.05 kHz")


@pytest.mark.parametrize(
    ("header", "end"), [("t,ax,ay,az,gx,gy,gz,note,label\n", ",,"), ("t,ax,ay,az,gx,gy,gz,,\n", ",,"), ("", ",,,")]
)
def test_columns_that_are_empty_throughout_leave_the_names_of_the_others_alone(tmp_path, header, end):
    table = readings(ROWS)
    recording = read_recording(write(tmp_path / "log.csv", table, header=header, end=end))
    assert_same(recording, table)
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported
    assert not header or "columns-assumed" not in codes(recording)


@pytest.mark.parametrize(("at", "n_extra"), [(300, 2), (2900, 0)])
def test_a_remark_here_and_there_in_the_last_column_is_no_damage(tmp_path, monkeypatch, at, n_extra):
    monkeypatch.setattr(text_module, "BLOCK_BYTES", 1 << 16)
    table = readings(ROWS)
    path = write(tmp_path / "log.csv", table, header=HEADER.strip() + ",sat,note" + "\n", end=",7,")
    lines = path.read_text().splitlines()
    for k in range(1 + n_extra):
        lines[at + 10 * k] += f"pose {k}"
    path.write_text("\n".join(lines) + "\n")
    recording = read_recording(path)
    assert_same(recording, table)
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported
    (left,) = [f for f in recording.findings if f.code == "column-left-out"]
    assert "pose 0" in left.seen
    np.testing.assert_array_equal(recording.auxiliary["sat"], np.full(ROWS, 7.0))


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), (" ", ".")])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_typeset_minus_is_a_minus(tmp_path, separator, decimal, encoding, monkeypatch):
    if encoding == "utf-8":  # a log in UTF-16 is read in one block
        monkeypatch.setattr(text_module, "BLOCK_BYTES", 1 << 16)
    table = readings(ROWS)
    path = write(tmp_path / "log.csv", table, HEADER.replace(",", separator), separator, decimal)
    path.write_bytes(path.read_text().replace("-", "\u2212").encode(encoding))
    recording = read_recording(path)
    assert_same(recording, table)
    assert recording.rows_in_file == recording.rows_read == ROWS


@pytest.mark.parametrize("encoding", ["utf-8", "cp1251"])
@pytest.mark.parametrize(("unknown", "at"), [("толчок_{}", 1), ("вращ_{}", 4)])
def test_names_nobody_knows_are_asked_for_instead_of_half_a_log_being_read(tmp_path, encoding, unknown, at):
    known = ["время", *(f"уск_{a}" for a in "xyz"), *(f"гиро_{a}" for a in "xyz")]
    names = [unknown.format("xyz"[i - at]) if at <= i < at + 3 else n for i, n in enumerate(known)]
    path = write(tmp_path / "log.csv", readings(ROWS), header=";".join(names) + "\n", separator=";")
    path.write_bytes(path.read_text().encode(encoding))
    if encoding == "cp1251":
        with pytest.raises(ReadError, match=r"no accelerometer and no gyro columns recognised.*--columns"):
            read_recording(path)
    else:
        recording = read_recording(path)
        sensors = {"accelerometer": recording.accelerometer, "gyroscope": recording.gyroscope}
        missing = "accelerometer" if at == 1 else "gyroscope"
        assert [name for name, triad in sensors.items() if triad is None] == [missing]
        assert {name for name in recording.auxiliary if name in names} == set(names[at : at + 3])
    assert_same(read_recording(path, columns="t,ax,ay,az,gx,gy,gz"), readings(ROWS))


@pytest.mark.parametrize("name", ["laufend", "Uhr", "такт"])
def test_a_log_without_a_known_clock_is_not_given_a_rate_while_a_column_runs_like_one(tmp_path, name):
    path = write(tmp_path / "log.csv", readings(ROWS), header=HEADER.replace("t,", f"{name},", 1))
    with pytest.raises(ReadError, match=rf"'{name}' grows from row to row as a time does.*--columns time=1"):
        read_recording(path)
    assert_same(read_recording(path, columns="time=1"), readings(ROWS))
    assert read_recording(path, rate_hz=50.0).rate_hz == 50.0
    assert read_recording(path, columns="time=none").rate_hz == 100.0


def in_turn(tmp_path, every: int, extra: str = ""):
    """A log of one sensor in each row, the gyro's timestamps 2 ms behind; or of the gyro in every ``every``-th row."""
    table = readings(ROWS)
    rows = []
    for i, (t, *values) in enumerate(table.tolist()):
        acc, gyr = (",".join(map(repr, values[k : k + 3])) for k in (0, 3))
        if every == 1:
            rows += [f"{t:.6f},{acc},,,{extra}", f"{t + 0.002:.6f},,,,{gyr}{extra}"]
        else:
            rows.append(f"{t:.6f},{acc},{gyr if i % every == 0 else ',,'}{extra}")
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    return path, table


def test_rows_of_two_sensors_in_turn_are_two_logs_joined_on_their_stamps(tmp_path):
    path, table = in_turn(tmp_path, 1)
    recording = read_recording(path)
    assert recording.rows_in_file == 2 * ROWS
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported
    # The first acceleration lies before the first rate.
    np.testing.assert_array_equal(recording.accelerometer, table[1:, 1:4])
    # The gyro 8 ms before and 2 ms behind: linear interpolation, to the rounding of timestamps in a settled clock.
    expected = 0.2 * table[:-1, 4:] + 0.8 * table[1:, 4:]
    np.testing.assert_allclose(recording.gyroscope, expected, rtol=0, atol=1e-9)
    only = read_recording(gyroscope_path=path)
    assert only.accelerometer is None
    np.testing.assert_array_equal(only.gyroscope, table[:, 4:])


def test_rows_in_turn_without_a_time_are_refused_and_lost_readings_stay_lost(tmp_path):
    path, table = in_turn(tmp_path, 1)
    with pytest.raises(ReadError, match="in turn, and no column contains the time"):
        read_recording(path, columns="time=none", rate_hz=100.0)
    lost = table.copy()
    lost[np.random.default_rng(3).random(ROWS) < 0.3, 4:] = np.nan
    recording = read_recording(write(tmp_path / "lost.csv", lost))
    np.testing.assert_array_equal(recording.gyroscope, lost[:, 4:])


def test_rows_are_put_in_order_and_arrays_of_the_caller_stay_as_they_were():
    # Rows of which some stand up to five places late.
    rng, ordered = np.random.default_rng(0), readings(ROWS)
    given = ordered[np.argsort(np.arange(ROWS) + np.where(rng.random(ROWS) < 1e-2, 5.5, 0.0), kind="stable")]
    force, rate = np.ascontiguousarray(given[:, 1:4]), np.ascontiguousarray(given[:, 4:])
    before = force.copy(), rate.copy()
    recording = trihedron.read({"t": given[:, 0].copy(), "acc": force, "gyr": rate})
    np.testing.assert_array_equal(force, before[0])
    np.testing.assert_array_equal(rate, before[1])
    np.testing.assert_array_equal(recording.accelerometer, ordered[:, 1:4])


def stated(path, clock, names, remark="", force=FORCE, rate=RATE):
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
    clock = np.rint(T * per_s).astype(int) if per_s > 1 else T * per_s
    recording = read_recording(stated(tmp_path / "log.csv", clock, f"{name},{NAMES}", remark))
    # Ticks of 62.5 us round the time to 3e-3 of a step.
    assert recording.rate_hz == pytest.approx(50.0, rel=1e-3)
    assert not doubts(recording)
    # Of other times nothing is said.
    assert not any(clock_said(*said) for said in (("start time", "5 s"), ("exposure time", "ms"), ("time", "25 us")))


@pytest.mark.parametrize("remark", [*OF_THE_RATE, "# fs = 4 g", "# baud rate: 115200", "# i2c frequency: 400000"])
def test_a_remark_about_the_rate_is_known_by_its_words_and_a_full_scale_is_none(tmp_path, remark):
    recording = read_recording(stated(tmp_path / "log.csv", range(len(T)), f"n,{NAMES}", remark + "\n"))
    assert ("rate-assumed" in doubts(recording)) == (remark not in OF_THE_RATE)
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
    log = stated(tmp_path / "log.csv", clock, f"secs,nsecs,{NAMES}\n-,-,m/s^2,m/s^2,m/s^2,rad/s,rad/s,rad/s")
    recording = read_recording(log)
    np.testing.assert_allclose(recording.time_s, T, atol=1e-9)
    assert recording.start_epoch_s == 1730650831


def test_a_column_t_that_falls_is_no_clock(tmp_path):
    warm = np.round(27.0 + np.random.default_rng(1).normal(0.0, 0.02, len(T)), 2)
    log = stated(tmp_path / "log.csv", warm, f"T,{NAMES}", "# fs=50 Hz\n")
    recording = read_recording(log)
    assert recording.rate_hz == pytest.approx(50.0)
    np.testing.assert_allclose(recording.temperature_degc, warm)


def test_a_column_that_changes_where_the_clock_goes_back_identifies_devices(tmp_path):
    clock = [f"{wrist},{t:.4f}" for wrist in ("left", "right") for t in T]
    force, rate = np.concatenate([FORCE, 1.01 * FORCE]), np.concatenate([RATE, RATE])
    log = stated(tmp_path / "log.csv", clock, f"wrist,t,{NAMES}", "", force, rate)
    with pytest.raises(ReadError, match="'wrist' identifies 2 devices: left"):
        read_recording(log)
    assert len(read_recording(log, instance="right").time_s) == len(T)


def test_mg_and_gal_that_nothing_states_are_a_warning_where_both_are_near(tmp_path):
    for length, unit in ((981.0, AccelerationUnit.CM_S2), (1003.0, AccelerationUnit.MG)):
        read = FORCE * length / np.median(np.linalg.norm(FORCE, axis=1))
        log = stated(tmp_path / "log.csv", T, f"t,{NAMES}", "", read)
        recording = read_recording(log)
        assert recording.accelerometer_unit is unit
        assert ("unit-assumed" in doubts(recording)) == (unit is AccelerationUnit.CM_S2)


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
        with pytest.raises(ReadError, match=r"identify 2 devices: A, B; .*--instance 'A'"):
            read_recording(log)


@pytest.mark.parametrize("with_rates", [False, True])
def test_columns_called_g_that_are_gravity_in_every_pose_are_a_force_and_no_gyro(tmp_path, with_rates):
    force = np.round(FORCE / 9.80665, 4)
    names = "t,gx,gy,gz," + ("rotX,rotY,rotZ" if with_rates else "mx,my,mz")
    recording = read_recording(texts.written(tmp_path / "log.csv", *texts.table(T, force, RATE), header=names))
    np.testing.assert_allclose(recording.accelerometer, force, atol=1e-6)
    assert (recording.gyroscope is not None) == with_rates
    assert "columns-assumed" in doubts(recording)
    # A gyro of the same names turns the gravity of the accelerometer, or has no length that every pose has.
    assert "columns-assumed" not in doubts(read_recording(stated(tmp_path / "both.csv", T, f"t,{NAMES}")))


def test_a_clock_whose_name_two_other_clocks_contradict_is_in_the_unit_that_they_show(tmp_path):
    # As librealsense names the microseconds of a camera.
    ms = np.rint(1000.0 * T).astype(int)
    clocks = [f"{1000 * t},{1709294400000 + t},{1709294400003 + t}" for t in ms]
    names = f"HW Timestamp (ms),Backend Timestamp (ms),Host Timestamp (ms),{NAMES}"
    recording = read_recording(stated(tmp_path / "log.csv", clocks, names))
    assert recording.rate_hz == pytest.approx(50.0, rel=1e-6)
    assert "2 other clocks" in next(f.seen for f in recording.findings if f.code == "time-unit-detected")
    assert read_recording(tmp_path / "log.csv", time_unit="ms").rate_hz == pytest.approx(0.05, rel=1e-6)
