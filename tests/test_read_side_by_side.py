"""Dates in prints of labelled values; devices whose columns stand side by side in one row."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from test_read_in_silence import motion, table, written
from trihedron.read import ReadError, read_recording
from trihedron.read.devices import _devices


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
    columns = [*table(t, force, rate), *table(t, 2.0 * force, -rate)[1:]]
    log = written(tmp_path / "log.csv", *columns, header=",".join(["t", *names]))
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
