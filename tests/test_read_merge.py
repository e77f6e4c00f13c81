"""Two clocks become one: nothing is made up in gaps; and logs whose rows are documents."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.table import LAYOUTS, read_layout, verdict
from hand_made_sessions import motion
from makers.structured import documents, drive
from trihedron.read import ReadError, read_recording
from trihedron.read.columns import Columns
from trihedron.read.merge import merge_sensors, resample
from trihedron.read.sensors import Sensors
from trihedron.read.table import Table
from trihedron.records import Sampling, Severity, TimestampKind


def merged_of(acc, acc_t, acc_start, gyr, gyr_t, gyr_start):
    """The merged sensors of readings on two clocks, and what was noted."""
    tables = Table(Path("a"), None, ()), Table(Path("b"), None, ())
    settled = {"sampling": Sampling(TimestampKind.EXACT)}
    one = Sensors(acc_t, acc_start, acc, None, tables[0], Columns(), None, 0, True, **settled)
    other = Sensors(gyr_t, gyr_start, None, gyr, tables[1], Columns(), None, 0, True, **settled)
    return merge_sensors(one, other)


def test_the_accelerometer_keeps_its_samples_and_a_ramp_is_interpolated_exactly():
    acc_t = np.arange(1000) / 100.0
    gyr_t = acc_t + 0.004
    acc = np.random.default_rng(1).standard_normal((1000, 3))
    gyr = np.column_stack([gyr_t, 2 * gyr_t, -gyr_t])
    merged = merged_of(acc, acc_t, 5.0, gyr, gyr_t - gyr_t[0], 5.004)
    assert merged.table.path == Path("a")
    # The first accelerometer sample is older than any gyro sample.
    np.testing.assert_array_equal(merged.accelerometer, acc[1:])
    # Linear interpolation is exact on a straight line up to rounding of 10.
    np.testing.assert_allclose(merged.gyroscope[:, 0], acc_t[1:], atol=1e-12)
    assert merged.start_s == pytest.approx(5.01)


def test_the_stated_noise_factor_is_what_interpolation_does_to_white_noise():
    rng = np.random.default_rng(2)
    n = 200_000
    gyr_t = np.arange(n) / 100.0
    acc_t = gyr_t[:-1] + rng.uniform(0.05, 0.95, n - 1) / 100.0
    gyr = rng.standard_normal((n, 3))
    merged = merged_of(np.zeros((n - 1, 3)), acc_t - acc_t[0], acc_t[0], gyr, gyr_t, 0.0)
    (finding,) = merged.findings
    # 3 n normal deviates: the relative sampling error of a variance is sqrt(2 / 3n) = 0.002 (correlation adds little).
    assert np.var(merged.gyroscope) == pytest.approx(finding.numbers["variance_factor"], rel=0.008)
    assert finding.numbers["variance_factor"] < 0.75


def test_same_ticks_are_taken_as_they_are():
    t = np.arange(500) / 100.0
    rng = np.random.default_rng(3)
    acc, gyr = rng.standard_normal((500, 3)), rng.standard_normal((500, 3))
    merged = merged_of(acc[3:], t[3:] - t[3], t[3], gyr[:-4], t[:-4] + 1e-5, 0.0)
    np.testing.assert_array_equal(merged.accelerometer, acc[3:-4])
    np.testing.assert_array_equal(merged.gyroscope, gyr[3:-4])
    assert merged.findings[0].numbers["variance_factor"] == 1.0


def test_nothing_is_made_up_in_a_gap():
    acc_t = np.arange(1000) / 100.0
    keep = (acc_t < 3.0) | (acc_t > 3.5)
    gyr_t = acc_t[keep] + 0.003
    merged = merged_of(np.ones((1000, 3)), acc_t, 0.0, np.ones((len(gyr_t), 3)), gyr_t - gyr_t[0], gyr_t[0])
    lost = np.isnan(merged.gyroscope).any(axis=1)
    times = merged.time_s + merged.start_s
    assert lost.sum() == pytest.approx(51, abs=2)
    assert 2.99 < times[lost].min() <= times[lost].max() < 3.52
    assert np.isfinite(merged.accelerometer).all()
    assert merged.findings[0].numbers["lost_rows"] == lost.sum()


def test_a_faster_gyro_keeps_its_samples_and_that_is_a_warning():
    acc_t, gyr_t = np.arange(200) / 50.0, np.arange(1600) / 400.0
    gyr = np.random.default_rng(4).standard_normal((1600, 3))
    merged = merged_of(np.column_stack([acc_t] * 3), acc_t, 0.0, gyr, gyr_t, 0.0)
    assert merged.table.path == Path("b")
    np.testing.assert_array_equal(merged.gyroscope, gyr[: len(merged.time_s)])
    np.testing.assert_allclose(merged.accelerometer[:, 0], merged.time_s, atol=1e-12)
    assert merged.findings[0].severity is Severity.WARNING
    assert merged.findings[0].code == "clocks-merged"


def test_files_of_one_clock_are_laid_side_by_side_with_what_else_they_hold(tmp_path):
    t, force, rate = motion(n_poses=3)
    warm = np.round(20.0 + 0.01 * np.arange(len(t)), 2)
    for name, head, columns in (("acc", "t,ax,ay,az,temp_C", (t, force, warm)), ("gyr", "t,gx,gy,gz", (t, rate))):
        np.savetxt(tmp_path / name, np.column_stack(columns), "%.17g", ",", header=head, comments="")
    recording = read_recording(accelerometer_path=tmp_path / "acc", gyroscope_path=tmp_path / "gyr")
    np.testing.assert_array_equal(recording.accelerometer, force)
    np.testing.assert_array_equal(recording.gyroscope, rate)
    np.testing.assert_array_equal(recording.temperature_degc, warm)
    assert recording.rows_read == recording.rows_in_file == 2 * len(t)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.floats(0.0, 2.0, allow_nan=False), min_size=2, max_size=40),
    st.lists(st.floats(-1.0, 3.0, allow_nan=False), min_size=1, max_size=40),
)
def test_interpolation_never_leaves_the_range_of_its_neighbours(source, target):
    time_s = np.sort(np.array(source))
    base_s = np.sort(np.array(target))
    values = np.random.default_rng(len(source)).standard_normal((len(time_s), 3))
    brought, factor = resample(time_s, base_s, values, 0.1)
    known = np.isfinite(brought).all(axis=1)
    assert np.all(brought[known] <= values.max(axis=0) + 1e-12)
    assert np.all(brought[known] >= values.min(axis=0) - 1e-12)
    assert np.all((factor[known] >= 0.5 - 1e-12) & (factor[known] <= 1.0))
    outside = (base_s < time_s[0] - 0.003) | (base_s > time_s[-1] + 0.003)
    assert not np.any(known & outside)


@pytest.mark.parametrize("separator", [" ", ","])
@pytest.mark.parametrize("labels", [("A", "G"), ("a", "w"), ("ACCEL", "ROT")])
def test_labels_of_a_letter_name_the_sensor_where_all_labels_do(tmp_path, labels, separator):
    t, force, rate = motion(n_poses=3)
    lines = []
    for k in range(len(t)):
        pair = [
            separator.join([f"{t[k]:.3f}", label, *(f"{x:.5f}" for x in values[k])])
            for label, values in zip(labels, (force, rate), strict=True)
        ]
        lines += pair if k % 3 else pair[::-1]
    (tmp_path / "log.txt").write_text("\n".join(lines) + "\n")
    recording = read_recording(tmp_path / "log.txt")
    np.testing.assert_allclose(recording.accelerometer, force, atol=1e-5)
    np.testing.assert_allclose(recording.gyroscope, rate, atol=1e-5)


def test_json_lines_lists_and_columns_are_read_alike(tmp_path):
    t, force, rate = motion(n_poses=3)
    made = documents(np.round(t, 3), force, rate)
    texts = {"lines": "\n".join(map(json.dumps, made["rows"])), **{k: json.dumps(v) for k, v in made.items()}}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        recording = read_recording(tmp_path / name)
        np.testing.assert_allclose(recording.accelerometer, force[: len(recording.time_s)], err_msg=name)
        np.testing.assert_allclose(recording.gyroscope, rate[: len(recording.time_s)], err_msg=name)
        assert recording.rate_hz == pytest.approx(100.0, rel=1e-3), name
    (tmp_path / "cut").write_text(texts["lines"][:-40])
    assert read_recording(tmp_path / "cut").rows_read >= len(t) - 1
    (tmp_path / "bad").write_text(texts["lines"].replace('{"t": 0.05,', "oops", 1))
    with pytest.raises(ReadError, match="line 6 is no JSON"):
        read_recording(tmp_path / "bad")


def test_sensorstream_rawimu_and_kitti_keep_every_reading(tmp_path):
    t, force, rate = motion(n_poses=3)
    lines, messages = [], []
    oxts = tmp_path / "drive" / "oxts"
    (oxts / "data").mkdir(parents=True)
    for place, text in drive(t, force, rate).items():
        (oxts / place).write_text(text)
    for k, (x, a, w) in enumerate(zip(t, force, rate, strict=True)):
        acc, gyr = (", ".join(f"{v:.4f}" for v in s) for s in (a, w))
        lines.append(f"{x:.3f}, 3, {acc}, 4, {gyr}" + (", 5, 1.0, 2.0, 3.0" if k % 2 else ""))
        c = np.rint(np.r_[a / 1e-3, w / 1e-4]).astype(int)
        counts = f"{c[2]},{-c[1]},{c[0]},{c[5]},{-c[4]},{c[3]}"
        messages.append(f"%RAWIMUSA,2105,{x:.3f};2105,{366000 + x:.9f},00000077,{counts}*b5c3d6f8")
    (tmp_path / "stream.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "rawimu.txt").write_text("\n".join([*messages[:50], "#BESTPOSA,COM1;x,y", *messages[50:]]) + "\n")
    stream = read_recording(tmp_path / "stream.csv")
    np.testing.assert_allclose(stream.gyroscope, rate, atol=1e-4)
    raw = read_recording(tmp_path / "rawimu.txt")
    np.testing.assert_allclose(raw.accelerometer * 1e-3, force, atol=1e-3)
    assert raw.rows_in_file == len(t) + 1
    folder = read_recording(tmp_path / "drive")
    np.testing.assert_allclose(folder.accelerometer, force)
    assert folder.rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(folder.time_s - folder.time_s[0], t - t[0], atol=1e-6)
    assert read_recording(oxts / "data").rows_read == folder.rows_read


@pytest.mark.parametrize(
    ("force", "rate"), [("加速度{}", "角速度{}"), ("Accel.{}", "Rot.{}"), ("Ускорение_{}", "Скорость_угловая_{}")]
)
def test_labels_in_every_script_are_read_and_none_takes_anothers_place(tmp_path, force, rate):
    t, *readings = motion(n_poses=3)
    names = ["t", *(name.format(a) for name in (force, rate) for a in "XYZ")]
    # Axis by axis, so that each label stands between another sensor's.
    order = [0, 1, 4, 2, 5, 3, 6]
    names, rows = [names[k] for k in order], np.column_stack([t, *readings])[:, order]
    log = tmp_path / "log.txt"
    log.write_text("\n".join(" ".join(f"{n}:{x:.6f}" for n, x in zip(names, row, strict=True)) for row in rows))
    recording = read_recording(log)
    np.testing.assert_allclose(recording.accelerometer, readings[0], atol=1e-5)
    np.testing.assert_allclose(recording.gyroscope, readings[1], atol=1e-5)


def test_long_rows_of_whole_numbers_beside_another_cell_are_judged_at_once(tmp_path):
    # Each cell of 8 digits that could be divided in eight ways, 30 of them: more ways than any reader has time for.
    row = "\t".join(["12345678"] * 30 + ["59,93"])
    (tmp_path / "log.txt").write_text("\n".join([row] * 20) + "\n")
    with pytest.raises(ReadError):
        read_recording(tmp_path / "log.txt")


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_log_of_this_maker_is_read_as_it_was_written(tmp_path, name):
    made = LAYOUTS[name]()
    recording = read_layout(made, tmp_path)
    assert verdict(made, recording) == "as written"
    assert not [f for f in recording.findings if f.severity is Severity.SERIOUS]
