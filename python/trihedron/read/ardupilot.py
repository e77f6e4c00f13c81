"""ArduPilot DataFlash logs (.bin), read by pymavlink: IMU messages, or the raw ACC and GYR."""

import contextlib
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.errors import InputError
from trihedron.read.devices import Choice
from trihedron.read.errors import errors_of_library, file_sha256
from trihedron.read.onboard import Parameters, said_of
from trihedron.read.ros import Stream, choice_note, missing_package, pick
from trihedron.read.table import StatedClock, Table
from trihedron.records import Finding, FindingCode, Onboard

_PARAMETERS = re.compile(r"INS_(ACC|GYR|TCAL)|AHRS_(ORIENTATION|CUSTOM_)")
"""Parameters of the corrections that the board applies to readings (the INS library of ArduPilot)."""
_TYPES = ["PARM", "IMU", "IMU2", "IMU3", "ACC", "GYR", "ACC1", "ACC2", "ACC3", "GYR1", "GYR2", "GYR3"]
_TIMESTAMPS = (("SampleUS", "us"), ("TimeUS", "us"), ("TimeMS", "ms"))
_FIELDS = {
    "IMU": ("AccX", "AccY", "AccZ", "GyrX", "GyrY", "GyrZ", "T", "Temp"),
    "ACC": ("AccX", "AccY", "AccZ"),
    "GYR": ("GyrX", "GyrY", "GyrZ"),
}
_UNITS = {"Acc": "m/s^2", "Gyr": "rad/s"}


def read_dataflash(path: Path, choice: Choice) -> tuple[Table, ...]:
    """IMU messages of one instance, or with topic ``ACC`` its raw accelerometer and gyro, each with its own timestamps.

    Raises ``ReadError`` when pymavlink is not installed, the log is damaged, or contains several IMUs and none is
    chosen.
    """
    try:
        from pymavlink import DFReader
    except ImportError:
        raise missing_package(path, "an ArduPilot .bin log", "pymavlink") from None
    rows: dict[tuple[str, str], list[list[float]]] = {}
    names: dict[tuple[str, str], list[str]] = {}
    held = Parameters(_PARAMETERS)
    # pymavlink prints problems on stderr; damaged bytes that it skipped become a finding.
    said = io.StringIO()
    # Created before it is initialised, so that its file can be closed when initialising fails.
    log: Any = DFReader.DFReader_binary.__new__(DFReader.DFReader_binary)
    damage = errors_of_library(path, "pymavlink cannot read this log ({}); copy it again")
    try:
        with damage, contextlib.redirect_stderr(said), contextlib.redirect_stdout(said), _quiet():
            log.__init__(str(path))
            while (message := log.recv_match(type=_TYPES)) is not None:
                if message.get_type() == "PARM":
                    held.note(message.Name, message.Value, has_readings=bool(rows))
                else:
                    _keep(message, rows, names)
    finally:
        for name in ("data_map", "filehandle"):
            # A memory map that pymavlink still uses cannot be closed; it is freed with the reader.
            with contextlib.suppress(AttributeError, BufferError):
                getattr(log, name).close()
    imu = [Stream("IMU", len(r), i) for (t, i), r in sorted(rows.items()) if t == "IMU"]
    raw = [Stream("ACC", len(r), i) for (t, i), r in sorted(rows.items()) if t == "ACC" and ("GYR", i) in rows]
    streams = imu + raw
    offered = streams if choice.topic is not None or not imu else imu
    taken = pick(path, offered, choice, "this log")
    note = (*choice_note("log", taken, streams), *_skipped(said.getvalue()))
    sha256 = file_sha256(path)
    # Readings of every message, ACC and GYR included, are logged after offset, scale and rotation to the board's axes.
    onboard = held.onboard("ardupilot", (int(taken.instance),) * 2, "body")
    note = (*note, *said_of(onboard))
    if taken.topic == "IMU":
        return (_table(path, ("IMU", taken.instance), rows, names, sha256, onboard, note, None),)
    return (
        _table(path, ("ACC", taken.instance), rows, names, sha256, onboard, note, "accelerometer"),
        _table(path, ("GYR", taken.instance), rows, names, sha256, onboard, (), "gyroscope"),
    )


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Redirect file descriptor 2: pymavlink's C code prints to it directly, one line for each damaged byte."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(nowhere)
        os.close(kept)


def _skipped(said: str) -> tuple[Finding, ...]:
    skips = [int(n) for n in re.findall(r"Skipped (\d+) bad bytes", said)]
    if not skips:
        return ()
    return (Finding.of(FindingCode.SAMPLES_LOST, "bytes-skipped", bytes=sum(skips), count=len(skips)),)


def _keep(
    message: Any, rows: dict[tuple[str, str], list[list[float]]], names: dict[tuple[str, str], list[str]]
) -> None:
    """Append a message's fields to the rows of its type and instance; IMU2 of older logs is instance 1."""
    word, number = re.fullmatch(r"([A-Z]+)(\d?)", message.get_type()).groups()  # type: ignore[union-attr]
    fields = message.to_dict()
    instance = str(fields.get("I", int(number or 1) - 1))
    key = (word, instance)
    if key not in names:
        timestamp, unit = next(((s, u) for s, u in _TIMESTAMPS if s in fields), ("", ""))
        if not timestamp:
            raise InputError(f"{message.get_type()} has no timestamp")
        names[key] = [f"{timestamp} [{unit}]", *(name for name in _FIELDS[word] if name in fields)]
        rows[key] = []
    plain = [names[key][0].split(" ")[0], *names[key][1:]]
    rows[key].append([float(fields[name]) for name in plain])


def _table(
    path: Path,
    key: tuple[str, str],
    rows: dict[tuple[str, str], list[list[float]]],
    names: dict[tuple[str, str], list[str]],
    sha256: str,
    onboard: Onboard | None,
    findings: tuple[Finding, ...],
    sensor: Any,
) -> Table:
    values = np.array(rows[key])
    labels = []
    for name in names[key]:
        unit = _UNITS.get(name[:3])
        labels.append(f"{name} [{unit}]" if unit else {"T": "temperature", "Temp": "temperature"}.get(name, name))
    clock = StatedClock(time=0, unit="ms" if "[ms]" in labels[0] else "us")
    columns = tuple(np.ascontiguousarray(values[:, k]) for k in range(values.shape[1]))
    return Table(path, tuple(labels), columns, sha256, findings=findings, sensor=sensor, clock=clock, onboard=onboard)
