"""Logs laid out as makers' programs write them, and logs that are no table: JSON, labels, messages, folders."""

import json

import numpy as np
import pytest

from formats.table import LAYOUTS, read_layout, verdict
from makers.structured import documents, drive
from test_read_in_silence import motion
from trihedron.read import ReadError, read_recording
from trihedron.records import Severity


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
