"""Columns without names of which the number does not say what they are: clocks and constants by their values, the
accelerometer because its length while static is gravity, the gyro because it turns as gravity does."""

import re

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.channel_facts.quiet import look
from trihedron.channel_facts.turning import CLEAR_CORRELATION, FEWEST_PAIRS, turning_of
from trihedron.read.names import ColumnName
from trihedron.read.sensing import of_gravity, static_norm
from trihedron.read.table import Table
from trihedron.records import Finding

_NEARLY_ALL = 0.999
"""Smallest share of steps of a clock that are not backward."""
_FEWEST_ROWS, _ROWS = 20, 200_000
_ROWS_A_SECOND = 100.0
"""Used where no clock tells; it sets the length of windows alone."""
_UNEVEN = 0.1
"""Largest spread of an uncalibrated accelerometer's length over its poses, as a share of its length."""
_TURNED = 0.3
"""Smallest spread of its direction [rad] over a log that shows more than one pose."""
_ALIKE = 0.02
"""Largest difference of correlation between raw and corrected rates; raw ones come first."""
_SECONDS = (1e9, 4e9)
"""Whole seconds since 1970."""

Roles = dict[int, ColumnName]
Triad = tuple[int, int, int]


def by_values(table: Table, columns: list[int], time: int | None) -> tuple[Roles, tuple[Finding, ...]]:
    """Roles of the unnamed ``columns``, and the finding that states them; none where the values do not tell.

    ``time`` is a named clock. Of a table of one sensor, the first three columns that are neither clock nor constant are
    its axes.
    """
    if table.n_rows < _FEWEST_ROWS:
        return {}, ()
    values = {i: table.columns[i][:_ROWS] for i in columns}
    alive = [i for i, one in values.items() if np.any(one[np.isfinite(one)] != one[0])]
    clock = next((i for i in alive if time is None and _is_clock(values[i])), None)
    roles: Roles = {} if clock is None else {clock: ColumnName("time", rank=1)}
    left = [i for i in alive if i not in roles and not _is_clock(values[i])]
    if table.sensor is not None:
        return (roles | _axes(table.sensor, left[:3]), ()) if len(left) >= len("xyz") else ({}, ())
    known = clock if time is None else time
    rate = _ROWS_A_SECOND if known is None else _rows_a_second(table.columns[known][:_ROWS])
    readings = {
        (i, i + 1, i + 2): np.stack([values[i], values[i + 1], values[i + 2]], axis=1)
        for i in left
        if {i + 1, i + 2} <= {*left}
    }
    acc = next((triad for triad, one in readings.items() if _is_gravity(one, rate)), None)
    if acc is None:
        return {}, ()
    turning = {
        triad: _correlation(readings[acc], one, rate) for triad, one in readings.items() if {*triad}.isdisjoint(acc)
    }
    best = max(turning, key=lambda triad: turning[triad], default=acc)
    least = max(CLEAR_CORRELATION, turning.get(best, 0.0) - _ALIKE)
    # One that shares columns with the best is as good where no turn was about the axis that it lacks.
    gyr = next((t for t, one in turning.items() if one > least and (t == best or {*t}.isdisjoint(best))), None)
    roles |= _axes("accelerometer", acc) | ({} if gyr is None else _axes("gyroscope", gyr))
    words = {"time": "time", "accelerometer": "a", "gyroscope": "g"}
    mapping = ",".join(f"{words[one.role]}{one.axis}={i + 1}" for i, one in roles.items() if one.role in words)
    note = Finding.of("columns-assumed", "by-values", n_columns=len(columns), has_gyro=gyr is not None, mapping=mapping)
    return roles, (note,)


def forces_of(table: Table, meanings: Roles, accelerometers: list[Triad], gyroscopes: list[Triad]) -> list[Triad]:
    """Triads that are a gyro by the letter g alone, which also means a force in g, and are gravity by their values.

    They have its length in several poses, and neither turn the accelerometer's readings as a gyro's would, nor are
    turned by them, as where the names of both sensors are exchanged.
    """
    time = next((i for i, one in meanings.items() if one.role == "time"), None)
    named = [(triad, meanings[triad[0]]) for triad in gyroscopes]
    by_letter = [t for t, one in named if not one.unit and one.group.partition("|")[0].split()[-1:] == ["g"]]
    return [triad for triad in by_letter if _is_force(table, triad, next(iter(accelerometers), None), time)]


def _is_force(table: Table, triad: Triad, accelerometer: Triad | None, time: int | None) -> bool:
    triads = [triad] if accelerometer is None else [triad, accelerometer]
    columns = [[table.columns[i][:_ROWS] for i in one] for one in triads]
    if not all(len(axis) >= _FEWEST_ROWS for axes in columns for axis in axes):
        return False
    readings = [np.stack(axes, axis=1) for axes in columns]
    rate = _ROWS_A_SECOND if time is None else _rows_a_second(table.columns[time][:_ROWS])
    if not _is_gravity(readings[0], rate):
        return False
    pairs = [] if accelerometer is None else [(readings[0], readings[1]), (readings[1], readings[0])]
    return all(_correlation(gravity, rates, rate) < CLEAR_CORRELATION for gravity, rates in pairs)


def _axes(sensor: str, triad: tuple[int, ...] | list[int]) -> Roles:
    return {i: ColumnName(sensor, axis, "by values") for i, axis in zip(triad, "xyz", strict=True)}


def _is_clock(values: FloatArray) -> bool:
    return bool(values[-1] > values[0] and np.mean(np.diff(values) >= 0.0) >= _NEARLY_ALL)


def nanoseconds_beside(table: Table, time: int | None) -> int | None:
    """The nanoseconds of a time column of seconds, as ROS names them (``nsecs``, ``secs``), or behind it unnamed."""
    if table.names is None and time is not None and time + 1 < len(table.columns):
        return time + 1 if _are_nanoseconds(table.columns[time], table.columns[time + 1]) else None
    plain = [re.sub(r"\s*[\[(].*", "", name.strip().lower()) for name in table.names or ()]
    stem = re.fullmatch(r"(.*?)secs?", plain[time]) if time is not None and plain else None
    wanted = {f"{stem[1]}{word}" for word in ("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds")} if stem else set()
    return next((i for i, name in enumerate(plain) if name in wanted), None)


def _are_nanoseconds(seconds: FloatArray, values: FloatArray) -> bool:
    """Whether values (n,) are the nanoseconds behind whole ``seconds`` (n,) since 1970."""
    if not (len(values) == len(seconds) > 0 and _SECONDS[0] < seconds[0] < _SECONDS[1]):
        return False
    return bool(np.all(seconds == np.rint(seconds)) and values.min() >= 0.0 and 1e6 < values.max() < 1e9)


def _rows_a_second(time: FloatArray) -> float:
    """Rows in a second of a clock in s, ms, µs or ns, of which the step is the first below a second."""
    step = float(np.median(np.diff(time)))
    fitting = [size for size in (1.0, 1e-3, 1e-6, 1e-9) if 0.0 < step * size < 1.0]
    return 1.0 / (step * fitting[0]) if fitting else _ROWS_A_SECOND


def _is_gravity(readings: FloatArray, rate_hz: float) -> bool:
    """Whether readings (n, 3) have the length of gravity in every static interval, in several directions."""
    readings = readings[np.isfinite(readings).all(axis=1)]
    windows = look({"accelerometer": readings}, rate_hz)
    if windows is None or of_gravity(static_norm(readings, windows)) is None:
        return False
    mean = windows.quiet_mean("accelerometer")
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(mean, axis=1)
        direction = mean / np.maximum(length, TINY)[:, None]
        return bool(length.std() < _UNEVEN * length.mean() and np.linalg.norm(direction.std(axis=0)) > _TURNED)


def _correlation(gravity: FloatArray, rates: FloatArray, rate_hz: float) -> float:
    """Correlation of the change of gravity (n, 3) with what rates (n, 3) predict; 0 where it cannot be judged."""
    turning = turning_of(gravity, rates, rate_hz)
    return 0.0 if turning is None or turning.n < FEWEST_PAIRS else turning.correlation
