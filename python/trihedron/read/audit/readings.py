"""Readings that are no measurements: not finite, stuck, repeated, clipped, or coarser than their noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from trihedron.read.rest import Windows
from trihedron.read.table import FloatArray
from trihedron.records import Finding, FindingCode, Severity

Place = Callable[[int], str]
AXES = "xyz"
CHUNK = 1 << 20
"""Rows per pass: the audit's own memory stays at a few 8 MB arrays whatever the length of the log."""


def audit_readings(sensor: str, readings: FloatArray, windows: Windows | None, place: Place) -> list[Finding]:
    """Findings on one triad (n, 3). ``place(i)`` names sample i for people; memory is bounded by ``CHUNK``."""
    findings = _non_finite(sensor, readings, place)
    if len(readings) < 8:
        return findings
    repeats = Repeats(readings)
    findings += _repeated(sensor, repeats, place)
    for k in range(3):
        # A stuck triad was reported as repeated rows; a single stuck axis is another matter.
        findings += _stuck(sensor, k, repeats, place)
        findings += _clipped(sensor, k, readings[:, k], windows, place)
    findings += _coarse(sensor, readings, windows)
    return findings


def _non_finite(sensor: str, readings: FloatArray, place: Place) -> list[Finding]:
    count, first = 0, -1
    for start in range(0, len(readings), CHUNK):
        bad = ~np.isfinite(readings[start : start + CHUNK]).all(axis=1)
        here = int(np.count_nonzero(bad))
        if here and first < 0:
            first = start + int(np.argmax(bad))
        count += here
    if not count:
        return []
    return [
        Finding(
            FindingCode.NON_FINITE,
            Severity.WARNING if count < 0.05 * len(readings) else Severity.SERIOUS,
            f"The {sensor} has {count} rows without a finite reading (first: {place(first)}).",
            "Lost samples, or a logger that writes NaN.",
            "These rows are left out; nothing is made up in their place.",
            MappingProxyType({"count": float(count), "sample": float(first)}),
        )
    ]


class Repeats:
    """Where a reading equals the one before it: counts, longest runs and their chance, per axis and for the triad."""

    def __init__(self, readings: FloatArray) -> None:
        n = len(readings)
        self.n = n
        self.count = np.zeros(4, dtype=np.int64)
        self.longest = np.ones(4, dtype=np.int64)
        self.longest_start = np.zeros(4, dtype=np.int64)
        run = np.ones(4, dtype=np.int64)
        rates: list[FloatArray] = []
        for start in range(1, n, CHUNK):
            stop = min(start + CHUNK, n)
            same = np.empty((stop - start, 4), dtype=bool)
            np.equal(readings[start:stop], readings[start - 1 : stop - 1], out=same[:, :3])
            np.logical_and.reduce(same[:, :3], axis=1, out=same[:, 3])
            self.count += same.sum(axis=0)
            rates.append(_window_rates(same))
            for k in range(4):
                run[k] = self._runs(k, same[:, k], start, int(run[k]))
        self.rates = np.concatenate(rates) if rates else np.zeros((1, 4))

    def _runs(self, k: int, same: npt.NDArray[np.bool_], start: int, open_run: int) -> int:
        """Longest run of equal readings; a run may continue from the chunk before."""
        breaks = np.flatnonzero(~same)
        edges = np.concatenate([[-1], breaks, [len(same)]])
        lengths = np.diff(edges)
        lengths[0] += open_run - 1
        best = int(np.argmax(lengths))
        if lengths[best] > self.longest[k]:
            self.longest[k] = lengths[best]
            first = start + int(edges[best])
            self.longest_start[k] = first - (open_run - 1) if best == 0 else first
        return int(lengths[-1])

    def chance(self, k: int) -> float:
        """Usual share of equal neighbours where they are frequent (ninth decile over windows of 64 rows)."""
        rate: np.float64 = np.percentile(self.rates[:, k], 90.0)
        return float(rate)


def _window_rates(same: npt.NDArray[np.bool_]) -> FloatArray:
    length = 64
    whole = len(same) // length
    if whole == 0:
        return np.asarray(same.mean(axis=0, keepdims=True), dtype=np.float64)
    blocks = same[: whole * length].reshape(whole, length, 4)
    return np.asarray(blocks.mean(axis=1), dtype=np.float64)


def _longest_by_chance(n: int, probability: float) -> float:
    """Longest run of equal neighbours that chance alone gives in n rows once in a thousand logs."""
    if probability <= 0.0:
        return 4.0
    if probability >= 1.0:
        return float(n)
    return 4.0 - math.log(1000.0 * n) / math.log(probability)


def _repeated(sensor: str, repeats: Repeats, place: Place) -> list[Finding]:
    """Whole triads repeated more often than three independent axes would."""
    n = repeats.n - 1
    expected = float(np.prod(repeats.rates[:, :3], axis=1).mean())
    seen = repeats.count[3] / n
    # Six deviations above the chance of three independent axes, and worth a sentence at all.
    limit = expected + 6.0 * np.sqrt(max(expected, 1.0 / n) / n)
    if seen <= max(limit, 2.0 * expected) or repeats.count[3] < 5:
        return []
    longest = int(repeats.longest[3])
    return [
        Finding(
            FindingCode.REPEATED_ROWS,
            Severity.WARNING if seen < 0.5 else Severity.SERIOUS,
            f"The {sensor} repeats its last reading in {repeats.count[3]} rows ({100 * seen:.3g} %; chance "
            f"would give {100 * expected:.2g} %); the longest run is {longest} rows from "
            f"{place(int(repeats.longest_start[3]))}.",
            "The log is faster than the sensor, or the logger repeats a value when it has no new one.",
            "Noise and error bars count repeated rows as new; log at the sensor's own rate.",
            MappingProxyType(
                {
                    "count": float(repeats.count[3]),
                    "fraction": float(seen),
                    "longest_run": float(longest),
                    "sample": float(repeats.longest_start[3]),
                }
            ),
        )
    ]


def _stuck(sensor: str, k: int, repeats: Repeats, place: Place) -> list[Finding]:
    longest = int(repeats.longest[k])
    if longest <= max(_longest_by_chance(repeats.n, repeats.chance(k)), 2.0 * repeats.longest[3]):
        return []
    return [
        Finding(
            FindingCode.STUCK_VALUES,
            Severity.WARNING if longest < 0.1 * repeats.n else Severity.SERIOUS,
            f"The {sensor}'s {AXES[k]} axis stays at one value for {longest} samples from "
            f"{place(int(repeats.longest_start[k]))}, far longer than chance.",
            "A frozen channel, clipping, or a bus that answers with an old value.",
            "Leave that stretch out.",
            MappingProxyType(
                {"axis": float(k), "longest_run": float(longest), "sample": float(repeats.longest_start[k])}
            ),
        )
    ]


def _clipped(sensor: str, k: int, values: FloatArray, windows: Windows | None, place: Place) -> list[Finding]:
    """An extreme value the signal runs into steeply and stays at: the histogram ends in a wall.

    A quiet sensor that happens to rest on its largest count does not qualify: the wall must be reached in steps far
    above the noise, and hold more samples than the neighbouring values lead up to.
    """
    finite = values[np.isfinite(values)]
    if not len(finite):
        return []
    low, high = float(finite.min()), float(finite.max())
    if low == high:
        return []
    noise = float(windows.quiet_noise(sensor)[k]) if windows is not None else 0.0
    findings = []
    for wall, side in ((high, "most"), (low, "least")):
        at = np.flatnonzero(values == wall)
        if len(at) < 3:
            continue
        depth = 0.01 * (high - low)
        near = int(np.count_nonzero(np.abs(finite - wall) <= depth)) - len(at)
        width = _next_level(finite, wall)
        # Near a smooth peak the density grows as the root of the distance from the top.
        by_shape = near * min(np.sqrt(width / depth), 1.0) if depth > 0 else near
        starts, lengths = _runs_of(at)
        before = np.abs(values[np.maximum(starts - 1, 0)] - wall)
        after = np.abs(values[np.minimum(starts + lengths, len(values) - 1)] - wall)
        steep = (lengths >= 2) & (np.fmax(before, after) > 5.0 * max(noise, width))
        if not np.any(steep) or len(at) <= 3.0 * by_shape:
            continue
        first = int(starts[np.argmax(steep)])
        findings.append(
            Finding(
                FindingCode.CLIPPING,
                Severity.WARNING,
                f"The {sensor}'s {AXES[k]} axis runs into {wall:.7g} {len(at)} times ({len(starts)} stretches, "
                f"first: {place(first)}) and never reads {'more' if side == 'most' else 'less'}: it is clipped there.",
                "The motion left the measuring range.",
                "Turn more slowly, or set a wider range; clipped moves give wrong angles.",
                MappingProxyType(
                    {
                        "axis": float(k),
                        "value": wall,
                        "count": float(len(at)),
                        "stretches": float(len(starts)),
                        "sample": float(first),
                    }
                ),
            )
        )
    return findings


def _next_level(values: FloatArray, wall: float) -> float:
    """Distance from the extreme value to the next value that occurs."""
    distance = np.abs(values - wall)
    distance = distance[distance > 0]
    return float(distance.min()) if len(distance) else 0.0


def _runs_of(at: npt.NDArray[np.intp]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """(start, length) of runs of consecutive indices."""
    breaks = np.flatnonzero(np.diff(at) > 1)
    starts = np.concatenate([at[:1], at[breaks + 1]])
    ends = np.concatenate([at[breaks], at[-1:]])
    return starts, ends - starts + 1


def _coarse(sensor: str, readings: FloatArray, windows: Windows | None) -> list[Finding]:
    """Steps between possible readings that hide the noise."""
    if windows is None:
        return []
    noise = windows.quiet_noise(sensor)
    found = []
    for k in range(3):
        values = readings[:: max(1, len(readings) // 200_000), k]
        levels = np.unique(values[np.isfinite(values)])
        if len(levels) < 2:
            continue
        gaps = np.diff(levels)
        # Rounded decimals make neighbouring levels differ in the last digit: the tenth percentile is the true step.
        quantum = float(np.percentile(gaps, 10.0))
        if len(levels) < 0.2 * len(values) and quantum > 2.0 * noise[k]:
            found.append((k, quantum, float(noise[k])))
    if not found:
        return []
    listed = ", ".join(f"{AXES[k]}: step {quantum:.4g}, noise {sigma:.2g}" for k, quantum, sigma in found)
    return [
        Finding(
            FindingCode.COARSE_RESOLUTION,
            Severity.WARNING,
            f"The {sensor}'s resolution is coarser than its noise ({listed}, raw units).",
            "Few bits, or values rounded when they were written.",
            "Averaging longer does not help where the noise does not move the last digit; choose a smaller range.",
            MappingProxyType({f"step_{AXES[k]}": quantum for k, quantum, _ in found}),
        )
    ]
