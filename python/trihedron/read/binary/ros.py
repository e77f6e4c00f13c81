"""ROS 1 bags, ROS 2 bags (folder, .db3, .mcap): messages of type sensor_msgs/Imu, read by rosbags."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.devices import Choice
from trihedron.read.errors import ReadError, errors_of_library, file_sha256, first_bytes
from trihedron.read.streams import Stream, choice_note, missing_package, pick
from trihedron.read.table import Table
from trihedron.records.progress import Progress

_SUFFIXES = {b"#ROSBAG": ".bag", b"\x89MCAP": ".mcap", b"SQLite ": ".db3"}
STARTS = tuple(_SUFFIXES)
_IMU = "sensor_msgs/msg/Imu"
_NAMES = ("stamp.secs", "stamp.nsecs", *(f"linear_acceleration.{x} [m/s^2]" for x in "xyz"))
_ALL_NAMES = (*_NAMES, *(f"angular_velocity.{x} [rad/s]" for x in "xyz"), "received")


def read(path: Path, choice: Choice, progress: Progress | None) -> tuple[Table, ...]:
    """The messages of one topic, or of an accelerometer's and a gyro's topic, with the timestamps of their headers.

    Raises ``ReadError`` when rosbags is not installed, the bag is damaged, or it is ambiguous which topic to read.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise missing_package(path, "a ROS bag or MCAP file", "rosbags") from None
    # rosbags recognises the format by the ending of the name, which may be another one; a folder has none.
    first = b"" if path.is_dir() else first_bytes(path, 7)
    suffix = next((suffix for start, suffix in _SUFFIXES.items() if first.startswith(start)), "")
    with tempfile.TemporaryDirectory() as folder:
        named = path
        if suffix and path.suffix != suffix:
            named = Path(folder) / f"bag{suffix}"
            named.symlink_to(path.absolute())
        with (
            errors_of_library(path, "rosbags cannot read this bag ({}); reindex or copy it again"),
            AnyReader([named], default_typestore=get_typestore(Stores.LATEST)) as reader,
        ):
            return _tables(path, reader, choice, progress)


def _tables(path: Path, reader: Any, choice: Choice, progress: Progress | None) -> tuple[Table, ...]:
    counts: dict[str, int] = {}
    others: list[str] = []
    for connection in reader.connections:
        if connection.msgtype == _IMU:
            counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
        else:
            others.append(f"{connection.topic} [{connection.msgtype}]")
    streams = [Stream(topic, count) for topic, count in sorted(counts.items())]
    if not streams:
        raise ReadError(
            f"{path}: no topic of type sensor_msgs/Imu in this bag; there are {', '.join(others[:12]) or '0 messages'}."
        )
    sha256 = file_sha256(path) if path.is_file() else ""
    pair = _pair(streams) if choice.topic is None else None
    if pair is not None:
        acc, gyr = (_table(path, reader, s, streams, sha256, progress) for s in pair)
        return _without(acc, "accelerometer", "angular"), _without(gyr, "gyroscope", "linear")
    return (_table(path, reader, pick(path, streams, choice, "this bag"), streams, sha256, progress),)


def _pair(streams: list[Stream]) -> tuple[Stream, Stream] | None:
    """Two topics of a camera that logs each sensor separately, such as RealSense's /camera/accel and /camera/gyro."""
    acc = [s for s in streams if "acc" in s.topic.lower() and "gyr" not in s.topic.lower() and s.count]
    gyr = [s for s in streams if "gyr" in s.topic.lower() and "acc" not in s.topic.lower() and s.count]
    return (acc[0], gyr[0]) if len(acc) == len(gyr) == 1 and len([s for s in streams if s.count]) == 2 else None


def _without(table: Table, sensor: Any, dropped: str) -> Table:
    pairs = zip(table.names or (), table.columns, strict=True)
    names, columns = zip(*(pair for pair in pairs if not pair[0].startswith(dropped)), strict=True)
    return replace(table, sensor=sensor, names=names, columns=columns)


def _table(
    path: Path, reader: Any, stream: Stream, streams: list[Stream], sha256: str, progress: Progress | None
) -> Table:
    wanted = [c for c in reader.connections if c.topic == stream.topic and c.msgtype == _IMU]
    rows: FloatArray = np.empty((stream.count, len(_ALL_NAMES)))
    n = 0
    start = None
    for connection, received, raw in reader.messages(connections=wanted):
        message = reader.deserialize(raw, connection.msgtype)
        stamp, a, w = message.header.stamp, message.linear_acceleration, message.angular_velocity
        start = received if start is None else start
        values = (stamp.sec, stamp.nanosec, a.x, a.y, a.z, w.x, w.y, w.z, (received - start) * 1e-9)
        if n == len(rows):
            rows = np.concatenate([rows, np.empty_like(rows)])
        rows[n] = values
        n += 1
        if progress is not None and n % 20000 == 0:
            progress(n / stream.count, f"reading {stream.topic}: {n} messages")
    if n < stream.count:
        raise ReadError(f"{path}: the index of this bag promises {stream.count} messages on {stream.topic}, {n} came.")
    if n == 0:
        raise ReadError(f"{path}: 0 messages on {stream.topic}; the sensor was not recorded.")
    rows = rows[:n]
    names, columns = list(_ALL_NAMES), [np.ascontiguousarray(rows[:, k]) for k in range(len(_ALL_NAMES))]
    if not np.any(rows[:, 0] != 0) and not np.any(rows[:, 1] != 0):
        # No timestamps in the headers: those of the recording program are used.
        names, columns = ["time [s]", *names[2:8]], [columns[8], *columns[2:8]]
    return Table(
        path, tuple(names), tuple(columns), sha256, findings=choice_note("bag", stream, streams), is_chosen=True
    )
