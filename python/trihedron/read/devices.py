"""Several devices or sensors in one table: separated, listed with their row counts, and never merged silently."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.read.clock.base import unwrap
from trihedron.read.columns import SENSORS, Columns
from trihedron.read.errors import ReadError
from trihedron.read.names import parse_name, sensor_said
from trihedron.read.table import Options, Table
from trihedron.records import Finding
from trihedron.records.words import Words
from trihedron.records.words import words as phrase

_PATH = re.compile(r"(?P<device>[^:]+):(?P<rest>.+)")
_BEFORE = re.compile(r"\s*(?P<device>[^\W_]+)[_.:/ -]+(?P<rest>[^\W\d_].*)")
_BEHIND = re.compile(r"(?P<rest>.*?[^\W\d_])(?:[_.: -]+(?P<device>[^\W_]+)|(?P<number>\d))(?P<unit>\s*[\[(].*)?\s*")

Devices = dict[str, dict[int, str]]
"""Device → column number → the column's name without that of the device."""


def one_beside(table: Table, instance: str | None) -> Table:
    """The table with the columns of device ``instance``, named without the device; those of other devices are excluded.

    The table is unchanged where names do not identify devices, or none is chosen and sensors are recognised without.

    Raises ``ReadError`` when no sensor is recognised without a device, and none is chosen.
    """
    devices = _devices(table.names or ())
    if instance in devices:
        own = devices.pop(instance)
        others = {i for columns in devices.values() for i in columns}
        listed = phrase("devices", devices=[(name, table.n_rows) for name in sorted([instance, *devices])])
        return replace(
            table.without(others),
            names=tuple(own.get(i, name) for i, name in enumerate(table.names or ())),
            findings=(*table.findings, chosen(phrase("names"), instance, listed, 0)),
            is_chosen=True,
        )
    if instance is None and devices and not any(parse_name(name).role in SENSORS for name in table.names or ()):
        raise ReadError(
            f"{table.path}: the names of the columns identify {len(devices)} devices: {', '.join(devices)}; read one "
            f"of them with --instance {_quoted(next(iter(devices)))}."
        )
    return table


def _quoted(device: str) -> str:
    """A device as an argument of a shell; a word in capitals would look like the placeholder of one."""
    return device if re.fullmatch(r"[a-z\d_]+", device) else f"'{device}'"


def _devices(names: tuple[str, ...]) -> Devices:
    """Devices that the names identify: two or more with the same columns, which include a complete sensor."""
    for form in (_PATH, _BEFORE, _BEHIND):
        found: Devices = {}
        for i, name in enumerate(names):
            if (parts := form.fullmatch(name)) is not None:
                told = parts.groupdict()
                device = told["device"] or told.get("number", "")
                found.setdefault(device, {})[i] = told["rest"] + (told.get("unit") or "")
        sensors = {device: _of_sensors(columns) for device, columns in found.items()}
        alike = [device for device, columns in sensors.items() if len(columns) >= len("xyz")]
        if 2 <= len(alike) <= MAX_DEVICES and len({frozenset(sensors[device]) for device in alike}) == 1:
            return {device: found[device] for device in alike}
    return {}


def _of_sensors(columns: dict[int, str]) -> set[str]:
    parsed = {name: parse_name(name) for name in columns.values()}
    return {name for name, meaning in parsed.items() if meaning.role in SENSORS and meaning.axis}


MAX_DEVICES = 16
MAX_ROWS = 50_000
LONGEST_BURST = 256
"""Largest displacement of rows against time order where several devices write in bursts."""
_DEVICE_NAMES = re.compile(
    "i|addr|src|ch|channel|port|bus|slot|dev|instance|(imu|device|sensor|unit|node)(id|nr|number|name)?|id|mac|source|"
    "(mac)?address|topic(name)?|(header)?frameid"
)
_LETTERS = {"a": "accelerometer", "g": "gyroscope", "w": "gyroscope", "m": "magnetometer", "t": "temperature"}
"""Sensors of records named by a letter, used only where all records are: letters may also name devices A, B, ..."""


_RATHER = ("uncal", "total")


def pick_kind(words: list[str], kind: str) -> str | None:
    """The record name to use for a sensor; uncorrected readings, and those with gravity, are preferred."""
    fitting = [word for word in words if sensor_said(word) == kind]
    letters = [word.strip("$:").lower() for word in words]
    if not fitting and set(letters) <= _LETTERS.keys():
        fitting = [word for word, letter in zip(words, letters, strict=True) if _LETTERS[letter] == kind]
    return max(fitting, key=lambda w: (*(said in w.lower() for said in _RATHER), -words.index(w)), default=None)


def one_device(table: Table, options: Options, chosen_columns: Columns) -> Table:
    """The rows of one device, where a column identifies several.

    The column is that of role ``device``, or one without a role that is recognised by its name, or because its codes
    alternate as the readings do (in order of time if there is one). Alternating devices without such a column are a
    serious finding; ``--instance 1`` then takes the first row of each turn.

    Raises ``ReadError`` when there are several devices and none is chosen, or the chosen one does not exist.
    """
    time, others = chosen_columns.time, [i for i in range(len(table.columns)) if i not in chosen_columns.used()]
    named = others if chosen_columns.device is None else [chosen_columns.device]
    named = [i for i in named if i == chosen_columns.device or _DEVICE_NAMES.fullmatch(_plain(table, i))]
    order = _in_time(table, time, MAX_ROWS)
    readings = [table.columns[i][order] for i in chosen_columns.readings if len(table.columns[i])]
    found = _device_column(table, named, lambda _: True)
    if found is None and readings and (n := n_interleaved(np.stack(readings, axis=1))) > 1:
        found = _device_column(table, others, lambda codes: bool(np.mean(np.diff(codes[order]) != 0) > 0.5))
        if found is None and options.instance is None:
            return replace(table, findings=(*table.findings, Finding.of("devices-interleaved", n=n)))
        if found is None:
            return _by_turn(table, options.instance or "", n, time)
    if found is None and time is not None and (back := _steps_back(table, time)) is not None:
        # A column that changes where the clock goes back and almost nowhere else.
        found = _device_column(
            table,
            others,
            lambda codes: bool(np.diff(codes)[back].all() and np.count_nonzero(np.diff(codes)) <= 2 * len(back) + 1),
        )
    if found is None and options.instance is not None:
        raise ReadError(
            f"{table.path}: instance {options.instance} was given, but no column identifies devices; leave "
            "--instance out."
        )
    if found is None:
        return table
    column, words, codes = found
    listed = phrase("devices", devices=list(zip(words, np.bincount(codes, minlength=len(words)), strict=True)))
    if options.instance is None:
        raise ReadError(
            f"{table.path}: column {table.label(column)} identifies {len(words)} devices: {listed}; read one of them "
            f"with --instance {_quoted(words[0])}."
        )
    if options.instance not in words:
        raise ReadError(
            f"{table.path}: there is no instance {options.instance}; column {table.label(column)} has {listed}."
        )
    rows = np.flatnonzero(codes == words.index(options.instance)).astype(np.int64)
    note = chosen(phrase("column", column=table.label(column)), options.instance, listed, table.n_rows - len(rows))
    return table.take(rows, table.n_in_file, note)


def chosen(where: Words, what: str, listed: Words, rows_left_out: int) -> Finding:
    """The finding that one of several devices is read."""
    return Finding.of(
        "device-chosen",
        where=where,
        listed=listed,
        chosen=what,
        numbers={"rows_left_out": float(rows_left_out)} if rows_left_out else {},
    )


def _plain(table: Table, column: int) -> str:
    """Letters and digits of a column's name, without its unit."""
    name = table.names[column] if table.names is not None else ""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[\[(].*", "", name.lower()))


def _steps_back(table: Table, time: int) -> IntArray | None:
    """Rows (k,) after which the clock goes back; None without such rows, or where it wraps."""
    raw = table.columns[time]
    back = np.flatnonzero(np.diff(raw) < 0.0)
    return back if len(back) and not unwrap(raw, table, None, [])[1] else None


def _in_time(table: Table, time: int | None, most: int) -> IntArray:
    """Indices of the first rows in order of time; in file order without a time, or where the clock wraps."""
    as_they_stand = np.arange(min(table.n_rows, most))
    if time is None or len(table.columns[time]) != table.n_rows:
        return as_they_stand
    order = np.argsort(table.columns[time][:most], kind="stable")
    return order if np.abs(order - as_they_stand).max(initial=0) <= LONGEST_BURST else as_they_stand


def _by_turn(table: Table, instance: str, n: int, time: int | None) -> Table:
    """Every n-th row, if the timestamps show that no device's row is missing."""
    if instance not in [str(k + 1) for k in range(n)]:
        raise ReadError(f"{table.path}: there is no instance {instance}; rows take turns between {n}, from 1.")
    order = _in_time(table, time, table.n_rows)
    if time is not None:
        step = np.diff(table.columns[time][order])
        turn_s = float(np.median(step[: len(step) // n * n].reshape(-1, n).sum(axis=1)))
        if not np.all(np.abs(step[n:] - step[:-n]) < 0.5 * turn_s / n) or len(order) % n:
            raise ReadError(
                f"{table.path}: rows take turns between {n} devices, but some are missing, and no column says whose a "
                "row is; log it, and read with --columns device=COLUMN --instance N."
            )
    rows = order[int(instance) - 1 :: n].astype(np.int64)
    listed = phrase("devices", devices=[(str(k + 1), len(order[k::n])) for k in range(n)])
    note = chosen(phrase("turns"), instance, listed, table.n_rows - len(rows))
    return table.take(rows, table.n_in_file, note)


def _device_column(
    table: Table, columns: list[int], fits: Callable[[IntArray], bool]
) -> tuple[int, list[str], IntArray] | None:
    """Column, words and codes (n,) of the first column with a few words or whole numbers whose codes pass ``fits``."""
    for i in columns:
        words, values = table.labels.get(i, ((), table.columns[i]))
        if not len(values) or not np.all(values == np.rint(values)) or len(np.unique(values[: 1 << 16])) > MAX_DEVICES:
            continue
        different, codes = np.unique(values, return_inverse=True)
        if 2 <= len(different) <= MAX_DEVICES and np.isfinite(different).all() and fits(codes):
            names = [words[int(k)] for k in different] if words else [f"{value:.0f}" for value in different]
            return i, names, codes.astype(np.int64)
    return None


def by_sensor(table: Table) -> tuple[Table, ...]:
    """Accelerometer and gyro of a table in which a column of words names each row's sensor; else the table itself."""
    for i, (words, codes) in table.labels.items():
        names = {kind: pick_kind(list(words), kind) for kind in SENSORS}
        acc, gyr = names["accelerometer"], names["gyroscope"]
        if acc is None or gyr is None:
            continue
        rows = {name: np.flatnonzero(codes == words.index(name)).astype(np.int64) for name in (acc, gyr)}
        if min(len(r) for r in rows.values()) < 2:
            continue
        left = len(codes) - sum(len(r) for r in rows.values())
        counts = phrase("counted", words=[(word, np.count_nonzero(codes == k)) for k, word in enumerate(words)])
        both = phrase("both", one=acc, other=gyr)
        note = chosen(phrase("column", column=table.label(i)), both, counts, left)
        return table.by_sensor(rows[acc], rows[gyr], left, note)
    return (table,)


# Rows of several devices in one stream, detected from the readings: every second (third, fourth) row is from another.

_MOST = 4
_BLOCK = 24
"""Rows of a block; a multiple of two, three and four."""
_ROWS = 48_000
_CLEAR = 6.0
"""Threshold, in standard errors, of the median difference between the rows of one device and the others in quiet
blocks; a single sensor's white noise gives 0.7, alternating noise (autocorrelation -0.5) 1.3."""
_SAME_SIGN = 0.9
_NEXT, _STAY = 4, 32
"""Distance of blocks up to which they follow each other, and the most of one stay in which a bias does not drift."""
_SLOW, _CHANCE = 0.002, 1.4
"""Share of slow changes above which a contrast is not constant in a stay (mains of 50 ± 0.02 Hz have 0.01 to 0.02), and
the ratio of variances that white noise does not exceed in most stays."""


def n_interleaved(readings: FloatArray) -> int:
    """Number of devices that alternate in rows (n, k) of readings; 1 where all rows are from one device."""
    rows = readings[:_ROWS]
    blocks = len(rows) // _BLOCK
    if blocks < 8:
        return 1
    parts = rows[: blocks * _BLOCK].reshape(blocks, _BLOCK, -1)
    parts = parts[np.isfinite(parts).all(axis=(1, 2))]
    if len(parts) < 8:
        return 1
    return next((k for k in range(2, _MOST + 1) if _takes_turns(parts, k)), 1)


def _takes_turns(parts: FloatArray, k: int) -> bool:
    """Whether every k-th row of blocks (m, rows, channels) differs from the others far more than from its own kind."""
    n = parts.shape[1] // k
    noise = np.sqrt(np.mean((parts[:, k:] - parts[:, :-k]) ** 2, axis=1) / 2.0)
    change = np.abs(np.diff(parts, axis=1))
    # Readings of one sensor that toggle between two neighbouring LSB must not count as two sensors.
    step = np.where(change > 0.0, change, np.inf).min(axis=(0, 1))
    step = np.where(np.isfinite(step), step, 0.0)
    quiet = np.argsort(noise.sum(axis=1), kind="stable")[: max(len(parts) // 2, 8)]
    quiet.sort()
    classes = parts[quiet].reshape(len(quiet), n, k, -1).mean(axis=1)
    contrast = classes[:, 0] - classes[:, 1:].mean(axis=1)
    error = np.sqrt((noise[quiet] ** 2 + step**2 / 12.0) * (1.0 + 1.0 / (k - 1)) / n)
    score = np.median(np.abs(contrast) / np.where(error > 0.0, error, np.inf), axis=0)
    same = np.mean(np.sign(contrast[1:]) == np.sign(contrast[:-1]), axis=0)
    far = (score > _CLEAR) & (np.median(np.abs(contrast), axis=0) > 2.0 * step) & (same > _SAME_SIGN)
    clearest = int(np.argmax(np.where(far, score, 0.0)))
    return bool(far[clearest] and _slow_share(contrast[:, clearest], quiet) < _SLOW)


def _slow_share(contrast: FloatArray, quiet: IntArray) -> float:
    """Share of the mean square of contrasts (m,) that changes slowly from block to block of one stay: where ``quiet``
    (m,) blocks follow each other.

    Devices at rest differ by constants; a vibration near a half (third, quarter) of the sampling rate by its phase.
    """
    stays = np.split(contrast, np.flatnonzero(np.diff(quiet) > _NEXT) + 1)
    parts = [part for stay in stays for k in range(0, len(stay), _STAY) if len(part := stay[k : k + _STAY]) > 2]
    parts = [part for part in parts if part.any()]
    # Of white noise the variance is half the mean square of differences.
    slow = [part.var(ddof=1) - _CHANCE * 0.5 * np.mean(np.diff(part) ** 2) for part in parts]
    return float(np.median(slow / np.array([np.mean(part**2) for part in parts]))) if parts else 0.0
