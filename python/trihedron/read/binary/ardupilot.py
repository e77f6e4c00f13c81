"""ArduPilot DataFlash logs (.bin), read by pymavlink: IMU messages, or the raw ACC and GYR."""

import contextlib
import io
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.errors import InputError
from trihedron.read.errors import errors_of_library, file_sha256, stderr_without
from trihedron.read.onboard import Parameters, said_of
from trihedron.read.streams import Stream, choice_note, missing_package, pick
from trihedron.read.table import Options, StatedClock, Table
from trihedron.records import Finding

STARTS = (b"\xa3\x95",)
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


def read(path: Path, options: Options) -> tuple[Table, ...]:
    """IMU messages of one instance, or with topic ``ACC`` its raw accelerometer and gyro, each with its own timestamps.

    Raises ``ReadError`` when pymavlink is not installed, the log is damaged, or contains several IMUs and none is
    chosen.
    """
    try:
        from pymavlink import DFReader
    except ImportError:
        raise missing_package(path, "an ArduPilot .bin log", "pymavlink") from None
    messages: dict[tuple[str, str], _Messages] = {}
    held = Parameters(_PARAMETERS)
    # pymavlink prints problems on stderr; damaged bytes that it skipped become a finding.
    said = io.StringIO()
    # Created before it is initialised, so that its file can be closed when initialising fails.
    log: Any = DFReader.DFReader_binary.__new__(DFReader.DFReader_binary)
    damage = errors_of_library(path, "pymavlink cannot read this log ({}); copy it again")
    try:
        # Its C code prints a line for each damaged byte.
        silent = stderr_without(b"")
        with damage, contextlib.redirect_stderr(said), contextlib.redirect_stdout(said), silent:
            log.__init__(str(path))
            while (message := log.recv_match(type=_TYPES)) is not None:
                if message.get_type() == "PARM":
                    held.note(message.Name, message.Value, has_readings=bool(messages))
                else:
                    _keep(message, messages)
    finally:
        for name in ("data_map", "filehandle"):
            # A memory map that pymavlink still uses cannot be closed; it is freed with the reader.
            with contextlib.suppress(AttributeError, BufferError):
                getattr(log, name).close()
    streams = [Stream(word, len(messages[word, i].rows), i) for word, i in sorted(messages)]
    imu = [s for s in streams if s.topic == "IMU"]
    raw = [s for s in streams if s.topic == "ACC" and ("GYR", s.instance) in messages]
    streams = imu + raw
    offered = streams if options.topic is not None or not imu else imu
    taken = pick(path, offered, options, "this log")
    # Readings of every message, ACC and GYR included, are logged after offset, scale and rotation to the board's axes.
    onboard = held.onboard("ardupilot", (int(taken.instance),) * 2, "body")
    notes = (*choice_note("log", taken, streams), *_skipped(said.getvalue()), *said_of(onboard))
    common = Table(path, None, (), file_sha256(path), onboard=onboard, is_chosen=True)
    first = replace(_filled(common, messages[taken.topic, taken.instance]), findings=notes)
    if taken.topic == "IMU":
        return (first,)
    second = _filled(common, messages["GYR", taken.instance])
    return replace(first, sensor="accelerometer"), replace(second, sensor="gyroscope")


def _skipped(said: str) -> tuple[Finding, ...]:
    skips = [int(n) for n in re.findall(r"Skipped (\d+) bad bytes", said)]
    if not skips:
        return ()
    return (Finding.of("samples-lost", "bytes-skipped", bytes=sum(skips), count=len(skips)),)


@dataclass(frozen=True)
class _Messages:
    """Messages of one type and instance: the fields kept, the timestamp first, its unit, and their values."""

    fields: tuple[str, ...]
    unit: str
    rows: list[list[float]]


def _keep(message: Any, messages: dict[tuple[str, str], _Messages]) -> None:
    """Append a message's fields to the rows of its type and instance; IMU2 of older logs is instance 1."""
    word, number = re.fullmatch(r"([A-Z]+)(\d?)", message.get_type()).groups()  # type: ignore[union-attr]
    fields = message.to_dict()
    instance = str(fields.get("I", int(number or 1) - 1))
    held = messages.get((word, instance))
    if held is None:
        timestamp, unit = next(((s, u) for s, u in _TIMESTAMPS if s in fields), ("", ""))
        if not timestamp:
            raise InputError(f"{message.get_type()} has no timestamp")
        names = (timestamp, *(name for name in _FIELDS[word] if name in fields))
        held = messages[word, instance] = _Messages(names, unit, [])
    held.rows.append([float(fields[name]) for name in held.fields])


def _filled(table: Table, messages: _Messages) -> Table:
    """The table with names and columns of the messages."""
    labels = [f"{messages.fields[0]} [{messages.unit}]"]
    for name in messages.fields[1:]:
        unit = _UNITS.get(name[:3])
        labels.append(f"{name} [{unit}]" if unit else {"T": "temperature", "Temp": "temperature"}.get(name, name))
    columns = tuple(np.array(messages.rows).T.copy())
    return replace(table, names=tuple(labels), columns=columns, clock=StatedClock(time=0, unit=messages.unit))
