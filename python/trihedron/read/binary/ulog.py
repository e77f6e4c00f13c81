"""PX4 ULog, read by pyulog: raw sensor_accel and sensor_gyro of one instance, or sensor_combined.

PX4's batches of raw samples (sensor_accel_fifo, sensor_gyro_fifo) become one row per sample.

Such a message contains up to 32 samples of each axis in counts, the LSB, the interval dt between samples and the
timestamp t of its last one: sample s of n was taken at t - (n - 1 - s) dt.
"""

import contextlib
import io
import re
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.read.errors import ReadError, errors_of_library, file_sha256
from trihedron.read.onboard import Parameters, said_of
from trihedron.read.streams import Stream, choice_note, missing_package, pick
from trihedron.read.table import Options, StatedClock, Table
from trihedron.records import Finding, Onboard
from trihedron.records.onboard import Stage

STARTS = (b"ULog",)
SUFFIX = "_fifo"


def expanded(data: dict[str, Any]) -> dict[str, FloatArray] | None:
    """All samples in order: ``timestamp_sample`` [µs] and X, Y, Z in SI, each (n,); None where fields are missing."""
    present = {"timestamp_sample", "dt", "scale", "samples"} <= set(data)
    width = sum(f"x[{k}]" in data for k in range(256))
    if not present or not width or any(f"{axis}[{width - 1}]" not in data for axis in AXES):
        return None
    counts = np.clip(np.asarray(data["samples"], dtype=np.int64), 0, width)
    message = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(message)) - np.repeat(np.cumsum(counts) - counts, counts)
    stamp = np.asarray(data["timestamp_sample"], dtype=np.float64)
    step = np.asarray(data["dt"], dtype=np.float64)
    scale = np.asarray(data["scale"], dtype=np.float64)
    out = {"timestamp_sample": stamp[message] - (counts[message] - 1 - place) * step[message]}
    for axis in AXES:
        block = np.column_stack([data[f"{axis}[{k}]"] for k in range(width)]).astype(np.float64)
        out[axis] = block[message, place] * scale[message]
    return out


_RAW = "sensor_accel"
_COMBINED = "sensor_combined"
_GYRO = "sensor_gyro"
_TOPICS = [_RAW, _GYRO, _RAW + SUFFIX, _GYRO + SUFFIX, _COMBINED, "sensor_selection"]
_PARAMETERS = re.compile(r"(CAL|TC)_(ACC|GYRO|A|G)(\d|_)|SENS_BOARD_|SENS_EN_THERMAL")
_SENSORS: dict[str, Any] = {_RAW: ("accelerometer", "acc", "m/s^2"), _GYRO: ("gyroscope", "gyr", "rad/s")}
"""Topic → sensor, and word and unit in the names of its columns."""
_SKIP = {"timestamp", "timestamp_sample"}


def read(path: Path, options: Options) -> tuple[Table, ...]:
    """The accelerometer's and the gyro's table of one instance, or the one table of ``sensor_combined``.

    Raw topics are read if they were logged at full rate (at least half as many rows as ``sensor_combined``), else
    batches of raw samples (``sensor_accel_fifo``) if there are any.

    Raises ``ReadError`` when pyulog is not installed, the log is damaged, or contains several IMUs and none is chosen.
    """
    try:
        from pyulog import ULog
    except ImportError:
        raise missing_package(path, "a PX4 ULog", "pyulog") from None
    _check_definitions(path)
    # pyulog prints messages on stdout, which is reserved for results.
    quiet = contextlib.redirect_stdout(io.StringIO())
    # The stream is opened here, because pyulog leaves its own open when it fails.
    with errors_of_library(path, "pyulog cannot read this log ({}); copy it again"), quiet, path.open("rb") as stream:
        log = ULog(stream, _TOPICS)
    data = _unrolled(log)
    counts = {key: len(columns[_timestamp(columns)]) for key, columns in data.items()}
    combined = counts.get((_COMBINED, 0), 0)
    raw, batches = (_pairs(counts, suffix) for suffix in ("", SUFFIX))
    streams = raw + batches + ([Stream(_COMBINED, combined)] if (_COMBINED, 0) in counts else [])
    offered = streams
    if options.topic is None:
        full = [s for s in raw if s.count >= 0.5 * combined]
        offered = full or batches or [s for s in streams if s.topic == _COMBINED] or raw
        if options.instance is not None and not any(s.instance == options.instance for s in offered):
            offered = streams
    taken = pick(path, offered, options, "this log")
    onboard = _onboard(log, taken.topic, int(taken.instance or 0))
    findings = (*choice_note("log", taken, streams), *_losses(log), *said_of(onboard))
    clock = StatedClock(time=0, unit="us")
    common = Table(path, None, (), file_sha256(path), clock=clock, onboard=onboard, is_chosen=True)
    if taken.topic == _COMBINED:
        return (replace(_filled(common, data[(_COMBINED, 0)], ""), findings=findings),)
    i = int(taken.instance)
    first = _filled(common, data[(taken.topic, i)], _RAW)
    second = _filled(common, data[(taken.topic.replace(_RAW, _GYRO), i)], _GYRO)
    return replace(first, findings=findings), second


def _unrolled(log: Any) -> dict[tuple[str, int], dict[str, Any]]:
    """Columns of every topic and instance; batches of samples as rows."""
    data = {(d.name, d.multi_id): d.data for d in log.data_list}
    for key in [key for key in data if key[0].endswith(SUFFIX)]:
        rows = expanded(data.pop(key))
        if rows is not None:
            data[key] = rows
    return data


def _pairs(counts: dict[tuple[str, int], int], suffix: str) -> list[Stream]:
    """Streams of accelerometers for which the gyro of the same number was logged too."""
    return [
        Stream(_RAW + suffix, n, str(i))
        for (name, i), n in sorted(counts.items())
        if name == _RAW + suffix and counts.get((_GYRO + suffix, i), 0)
    ]


def _check_definitions(path: Path) -> None:
    """Check the messages before the data: if they are damaged near the end of a file, pyulog never returns.

    Each has a size (16 bits), a type and that many bytes, from byte 16 on to the first subscription or log message.
    """
    with path.open("rb") as stream:
        size = stream.seek(0, io.SEEK_END)
        at = stream.seek(16)
        while len(head := stream.read(3)) == 3:
            length, kind = struct.unpack("<Hc", head)
            if kind in b"ALC":
                return
            at += 3 + length
            if kind not in b"BFIMPQ" or at > size:
                raise ReadError(f"{path}: the definitions of this ULog are damaged before byte {at}; copy it again.")
            stream.seek(at)
    raise ReadError(f"{path}: this ULog ends before its first message; 0 messages were logged.")


def _filled(table: Table, data: dict[str, Any], topic: str) -> Table:
    # The timestamp of the sample if the log has it; `timestamp` is that of publishing the message.
    timestamp = _timestamp(data)
    names, columns = ["timestamp [us]"], [np.asarray(data[timestamp], dtype=np.float64)]
    sensor, word, unit = _SENSORS.get(topic, (None, "", ""))
    for name, values in data.items():
        if name not in _SKIP and np.asarray(values).dtype.kind in "iufb":
            names.append(f"{word}_{name} [{unit}]" if sensor and name in AXES else name)
            columns.append(np.asarray(values, dtype=np.float64))
    return replace(table, names=tuple(names), columns=tuple(columns), sensor=sensor)


def _onboard(log: Any, topic: str, instance: int) -> Onboard | None:
    """The on-board corrections of a topic's readings, from the parameters and the device id of the sensor.

    Before firmware 1.11 drivers corrected ``sensor_accel`` themselves; such logs also contain counts (``x_raw``).
    ``sensor_combined`` contains readings that are corrected and rotated to the board's axes.
    """
    columns = {(d.name, d.multi_id): d.data for d in log.data_list}
    own = columns.get((topic, instance), {})
    held = Parameters(_PARAMETERS)
    for name, value in log.initial_parameters.items():
        held.note(name, value, has_readings=False)
    first = float(min((data["timestamp"][0] for data in columns.values() if len(data["timestamp"])), default=0.0))
    for timestamp, name, value in log.changed_parameters:
        held.note(name, value, has_readings=timestamp > first)
    numbers = []
    for word, device in (("ACC", "accel_device_id"), ("GYRO", "gyro_device_id")):
        other = columns.get((topic.replace("accel", "gyro"), instance), {}) if word == "GYRO" else own
        known = other.get("device_id", columns.get(("sensor_selection", 0), {}).get(device, ()))
        wanted = known[0] if len(known) else held.values.get(f"CAL_{word}_PRIME", -1)
        numbers.append(next((i for i in range(4) if held.values.get(f"CAL_{word}{i}_ID", 0) == wanted), instance))
    stage: Stage = "body" if topic == _COMBINED else "corrected" if "x_raw" in own else "raw"
    return held.onboard("px4", (numbers[0], numbers[1]), stage)


def _timestamp(data: dict[str, Any]) -> str:
    return "timestamp_sample" if "timestamp_sample" in data else "timestamp"


def _losses(log: Any) -> tuple[Finding, ...]:
    out = [Finding.of("samples-lost", "damaged")] if log.file_corruption else []
    if log.dropouts:
        lost_s = sum(drop.duration for drop in log.dropouts) / 1e3
        out.append(Finding.of("samples-lost", "dropouts", count=len(log.dropouts), lost_s=lost_s))
    return tuple(out)
