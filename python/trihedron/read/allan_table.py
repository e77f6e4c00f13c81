"""Tables of Allan deviations, as ``trihedron allan --csv`` writes them, or as other programs do."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.errors import ReadError
from trihedron.read.source import read_table
from trihedron.read.table import Table

_TAU = {"tau", "taus", "tau_s", "taus_s", "level", "averaging_time", "averaging_time_s", "cluster_time"}
_DEVIATION = ("adev", "oadev", "deviation", "allan_deviation", "dev", "sigma", "sigma_tau")
_VARIANCE = ("avar", "oavar", "variance", "allan_variance", "allan", "var")
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
    """A table with names: a column of averaging times and one per channel, or rows that name their channel.

    Raises ``ReadError`` when no averaging times or no deviations are recognised, or a cell is not a number.
    """
    table = read_table(path)
    names = table.names or ()
    keys = [re.sub(r"\[.*\]", "", name).strip().lower().replace(" ", "_").replace(".", "") for name in names]
    tau = _one_of(keys, _TAU)
    if tau is None:
        raise ReadError(
            f"{path}: no column of averaging times among {', '.join(names)}; name it tau_s, the deviations adev."
        )
    tau_s = table.columns[tau]
    channel = _one_of(keys, _CHANNEL)
    values = [i for i, key in enumerate(keys) if _ending(key) and i not in (tau, channel)]
    if not values:
        raise ReadError(f"{path}: no column of Allan deviations among {', '.join(names)}; name it adev or avar.")
    with np.errstate(invalid="ignore"):
        powers = [0.5 if _ending(keys[i]) in _VARIANCE else 1.0 for i in values]
        columns = [
            np.where(table.columns[i] > 0.0, table.columns[i], math.nan) ** p
            for i, p in zip(values, powers, strict=True)
        ]
    deviation = np.stack(columns, axis=1)
    stems = [keys[i].removesuffix(_ending(keys[i])).strip("_") for i in values]
    titles = [stem.replace("_", " ") or f"channel {k + 1}" for k, stem in enumerate(stems)]
    units = [found[1].strip() if (found := re.search(r"\[(.*)\]", names[i])) else "" for i in values]
    rate, length = (
        None if (i := _one_of(keys, wanted)) is None else float(table.columns[i][0]) for wanted in (_RATE, _LENGTH)
    )
    if rate is None and "cluster" in keys:
        rate = float(np.median(table.columns[keys.index("cluster")] / tau_s))
    if channel is not None:
        titles, tau_s, deviation = _by_channel(table, channel, tau_s, deviation[:, 0])
        units = units[:1] * len(titles)
    n_samples = None if length is None else int(length)
    return AllanTable(path, tuple(titles), tuple(units), tau_s, deviation, rate, n_samples)


def _by_channel(
    table: Table, channel: int, tau_s: FloatArray, deviation: FloatArray
) -> tuple[list[str], FloatArray, FloatArray]:
    """Names of the channels, averaging times (k,) and deviations (k, channels) of rows that name their channel."""
    words, codes = table.labels.get(channel, ((), np.zeros(0, dtype=np.int64)))
    if not words:
        numbers, codes = np.unique(table.columns[channel], return_inverse=True)
        words = tuple(f"{number:g}" for number in numbers)
    times, place = np.unique(tau_s, return_inverse=True)
    out = np.full((len(times), len(words)), math.nan)
    out[place, codes] = deviation
    return list(words), times, out


def _one_of(keys: list[str], wanted: Iterable[str]) -> int | None:
    return next((i for i, key in enumerate(keys) if key in wanted), None)


def _ending(key: str) -> str:
    """The word for a deviation or a variance with which a name ends; "" for other names."""
    return next((word for word in (*_DEVIATION, *_VARIANCE) if key == word or key.endswith("_" + word)), "")
