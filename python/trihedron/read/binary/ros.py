"""ROS 1 bags, ROS 2 bags (folder, .db3, .mcap): messages of type sensor_msgs/Imu, read by rosbags."""

import tempfile
from array import array
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.read.columns import Sensor, sensor_of_file_name
from trihedron.read.errors import ReadError, errors_of_library, file_sha256, first_bytes
from trihedron.read.streams import Stream, choice_note, missing_package, pick
from trihedron.read.table import Options, Table
from trihedron.records import Progress

_SUFFIXES = {b"#ROSBAG": ".bag", b"\x89MCAP": ".mcap", b"SQLite ": ".db3"}
STARTS = tuple(_SUFFIXES)
_IMU = "sensor_msgs/msg/Imu"
_NAMES = (
    *("stamp.secs", "stamp.nsecs"),
    *(f"linear_acceleration.{x} [m/s^2]" for x in AXES),
    *(f"angular_velocity.{x} [rad/s]" for x in AXES),
    "received",
)


def read(path: Path, options: Options) -> tuple[Table, ...]:
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
            return _tables(path, reader, options)


def _tables(path: Path, reader: Any, options: Options) -> tuple[Table, ...]:
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
    taken = _pair(streams) if options.topic is None else {}
    taken = taken or {None: pick(path, streams, options, "this bag")}
    tables = []
    for sensor, stream in taken.items():
        names, columns = _columns(path, reader, stream, sensor, options.progress)
        note = choice_note("bag", stream, streams)
        tables.append(Table(path, names, columns, sha256, findings=note, sensor=sensor, is_chosen=True))
    return tuple(tables)


def _pair(streams: list[Stream]) -> dict[Sensor | None, Stream]:
    """Two topics of a camera that logs each sensor separately, such as RealSense's /camera/accel and /camera/gyro."""
    filled = [s for s in streams if s.count]
    found = {sensor_of_file_name(s.topic): s for s in sorted(filled, key=lambda s: sensor_of_file_name(s.topic) or "")}
    return found if len(filled) == len(found) == 2 and None not in found else {}


def _columns(
    path: Path, reader: Any, stream: Stream, sensor: Sensor | None, progress: Progress | None
) -> tuple[tuple[str, ...], tuple[FloatArray, ...]]:
    """Names and columns of the messages of a topic; only those of ``sensor``, if given."""
    wanted = [c for c in reader.connections if c.topic == stream.topic and c.msgtype == _IMU]
    cells = array("d")
    n, start = 0, None
    for connection, received, raw in reader.messages(connections=wanted):
        message = reader.deserialize(raw, connection.msgtype)
        stamp, a, w = message.header.stamp, message.linear_acceleration, message.angular_velocity
        start = received if start is None else start
        cells.extend((stamp.sec, stamp.nanosec, a.x, a.y, a.z, w.x, w.y, w.z, (received - start) * 1e-9))
        n += 1
        if progress is not None and n % 20000 == 0:
            progress(n / stream.count, f"reading {stream.topic}: {n} messages")
    if n < stream.count:
        raise ReadError(f"{path}: the index of this bag promises {stream.count} messages on {stream.topic}, {n} came.")
    if not n:
        raise ReadError(f"{path}: 0 messages on {stream.topic}; the sensor was not recorded.")
    named = dict(zip(_NAMES, np.array(cells).reshape(n, -1).T.copy(), strict=True))
    received_s = named.pop("received")
    if not named["stamp.secs"].any() and not named["stamp.nsecs"].any():
        # No timestamps in the headers: those of the recording program are used.
        named = {"time [s]": received_s} | {name: v for name, v in named.items() if not name.startswith("stamp")}
    else:
        named["received"] = received_s
    dropped = {"accelerometer": "angular", "gyroscope": "linear"}.get(sensor or "", "-")
    named = {name: values for name, values in named.items() if not name.startswith(dropped)}
    return tuple(named), tuple(named.values())
