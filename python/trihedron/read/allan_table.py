"""Tables of Allan deviations, as ``trihedron allan --csv`` writes them, or as other programs do."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.documents import DocumentError, of_path, read_text
from trihedron.read.errors import ReadError, check_readable

_TAU = {"tau", "taus", "tau_s", "taus_s", "level", "averaging_time", "averaging_time_s", "cluster_time"}
_DEVIATION = {"adev", "oadev", "deviation", "allan_deviation", "dev", "sigma", "sigma_tau"}
_VARIANCE = {"avar", "oavar", "variance", "allan_variance", "allan", "var"}
_CHANNEL = {"channel", "axis", "name", "signal"}
_RATE = {"freq", "freq_hz", "rate", "rate_hz", "fs", "fs_hz"}
_LENGTH = {"n", "n_samples", "samples", "length"}


@dataclass(frozen=True, eq=False)
class AllanTable:
    """Averaging times (k,) [s] and deviations (k, channels); rate and length of the log if the file states them."""

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    tau_s: FloatArray
    deviation: FloatArray
    rate_hz: float | None
    n_samples: int | None


def read_allan_table(path: Path) -> AllanTable:
    """A comma-separated table: a column of averaging times and one per channel, or rows that name their channel.

    Raises
    ------
    ReadError
        When no averaging times or no deviations are recognised, or a cell is not a number.
    """
    check_readable(path)
    try:
        text = read_text(path, "table of Allan deviations").removeprefix("\ufeff")
    except DocumentError as error:
        raise ReadError(of_path(path, error)) from None
    try:
        rows = [row for row in csv.reader(io.StringIO(text, newline="")) if row]
    except csv.Error as error:
        raise ReadError(f"{path}: this is not a comma-separated table ({error}); export it as CSV.") from None
    if len(rows) < 2:
        raise ReadError(f"{path}: a table of Allan deviations has a line of names and a line per averaging time.")
    head = [cell.strip() for cell in rows[0]]
    for i, row in enumerate(rows):
        if len(row) != len(head):
            raise ReadError(f"{path}, line {i + 1}: {len(row)} cells where the names are {len(head)}; mend the line.")
    keys = [re.sub(r"\[.*\]", "", cell).strip().lower().replace(" ", "_").replace(".", "") for cell in head]
    tau = _one_of(keys, _TAU)
    if tau is None:
        raise ReadError(
            f"{path}: no column of averaging times among {', '.join(head)}; name it tau_s, the deviations adev."
        )
    columns = _Columns(path, head, keys, rows[1:])
    channel = _one_of(keys, _CHANNEL)
    return columns.long(tau, channel) if channel is not None else columns.wide(tau)


@dataclass(frozen=True)
class _Columns:
    path: Path
    head: list[str]
    keys: list[str]
    rows: list[list[str]]

    def long(self, tau: int, channel: int) -> AllanTable:
        value = self._value(range(len(self.keys)))
        names = list(dict.fromkeys(row[channel].strip() for row in self.rows))
        times = np.unique(self._numbers(tau))
        deviation = np.full((len(times), len(names)), math.nan)
        place = np.searchsorted(times, self._numbers(tau))
        which = [names.index(row[channel].strip()) for row in self.rows]
        deviation[place, which] = self._deviation(value)
        unit = _unit(self.head[value])
        return self._table(names, [unit] * len(names), times, deviation)

    def wide(self, tau: int) -> AllanTable:
        found: list[int] = []
        names: list[str] = []
        units: list[str] = []
        for i, key in enumerate(self.keys):
            last = next((w for w in (*_DEVIATION, *_VARIANCE) if key == w or key.endswith("_" + w)), None)
            if last is not None:
                found.append(i)
                names.append(key.removesuffix(last).strip("_").replace("_", " ") or f"channel {len(names) + 1}")
                units.append(_unit(self.head[i]))
        if not found:
            self._value(())
        deviation = np.stack([self._deviation(i) for i in found], axis=1)
        return self._table(names, units, self._numbers(tau), deviation)

    def _value(self, places: range | tuple[int, ...]) -> int:
        for wanted in (_DEVIATION, _VARIANCE):
            for i in places:
                if self.keys[i] in wanted:
                    return i
        raise ReadError(
            f"{self.path}: no column of Allan deviations among {', '.join(self.head)}; name it adev or avar."
        )

    def _deviation(self, column: int) -> FloatArray:
        values = self._numbers(column)
        is_variance = any(self.keys[column] == w or self.keys[column].endswith("_" + w) for w in _VARIANCE)
        values = np.where(values > 0.0, values, math.nan)
        return np.sqrt(values) if is_variance else values

    def _numbers(self, column: int) -> FloatArray:
        cells = [row[column].strip() or "nan" for row in self.rows]
        try:
            return np.array([float(cell) for cell in cells])
        except ValueError:
            wrong = next(i for i, cell in enumerate(cells) if not _is_number(cell))
            raise ReadError(
                f"{self.path}, line {wrong + 2}: {cells[wrong]!r} in column {self.head[column]!r} is no number."
            ) from None

    def _table(self, names: list[str], units: list[str], tau_s: FloatArray, deviation: FloatArray) -> AllanTable:
        rate, length = _one_of(self.keys, _RATE), _one_of(self.keys, _LENGTH)
        rate_hz = None if rate is None else float(self._numbers(rate)[0])
        n_samples = None if length is None else int(self._numbers(length)[0])
        if rate_hz is None and "cluster" in self.keys:
            rate_hz = float(np.median(self._numbers(self.keys.index("cluster")) / tau_s))
        return AllanTable(self.path, tuple(names), tuple(units), tau_s, deviation, rate_hz, n_samples)


def _one_of(keys: list[str], wanted: set[str]) -> int | None:
    return next((i for i, key in enumerate(keys) if key in wanted), None)


def _unit(cell: str) -> str:
    found = re.search(r"\[(.*)\]", cell)
    return found.group(1).strip() if found else ""


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
