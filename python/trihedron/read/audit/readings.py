"""Readings that are no measurements: not finite, stuck, repeated, clipped, or coarser than their noise."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import numpy as np

from trihedron.read.audit.clipping import AXES, audit_clipping, find_walls, quantum, short
from trihedron.read.audit.repeats import Repeats, longest_by_chance
from trihedron.read.rest import Windows
from trihedron.read.table import FloatArray
from trihedron.records import Finding, FindingCode, Severity

Place = Callable[[int], str]


def audit_readings(sensor: str, readings: FloatArray, windows: Windows | None, place: Place) -> list[Finding]:
    """Findings on one triad (n, 3). ``place(i)`` names sample i for people; one pass for the usual log."""
    repeats = Repeats(readings)
    findings = _non_finite(sensor, repeats, place)
    if len(readings) < 8:
        return findings
    findings += _repeated(sensor, repeats, place)
    walls = find_walls(readings, windows.quiet_noise(sensor) if windows is not None else np.zeros(3))
    findings += audit_clipping(sensor, walls, place)
    for k in range(3):
        at_wall = any(w.axis == k and w.value == readings[repeats.longest_start[k], k] for w in walls)
        # A stuck triad was reported as repeated rows, a value stuck at a wall as clipping.
        findings += [] if at_wall else _stuck(sensor, k, repeats, readings, windows, place)
    findings += _coarse(sensor, readings, windows)
    return findings


def _non_finite(sensor: str, repeats: Repeats, place: Place) -> list[Finding]:
    count, first = repeats.n_missing, repeats.first_missing
    if first is None:
        return []
    return [
        Finding(
            FindingCode.NON_FINITE,
            Severity.WARNING if count < 0.05 * repeats.n else Severity.SERIOUS,
            f"The {short(sensor)} has {count} rows without a finite reading (first: {place(first)}).",
            "Lost samples, or a logger that writes NaN.",
            "These rows are left out; nothing is made up in their place.",
            MappingProxyType({"count": float(count), "sample": float(first)}),
        )
    ]


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
            f"The {short(sensor)} repeats its last reading in {repeats.count[3]} rows ({100 * seen:.3g} %; chance "
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


def _stuck(
    sensor: str, k: int, repeats: Repeats, readings: FloatArray, windows: Windows | None, place: Place
) -> list[Finding]:
    """One axis that holds a value far longer than chance while it should not.

    Where the resolution hides the noise a value may well stay for a whole rest; there the other axes must move.
    """
    longest, start = int(repeats.longest[k]), int(repeats.longest_start[k])
    if longest <= max(longest_by_chance(repeats.n, repeats.chance(k)), 2.0 * repeats.longest[3]):
        return []
    if windows is not None:
        others = [j for j in range(3) if j != k]
        noise = windows.quiet_noise(sensor)
        stretch = readings[start : start + longest]
        step = quantum(readings[:, k])
        moving = np.nanstd(stretch[:, others], axis=0) > 5.0 * np.maximum(noise[others], step)
        if step > 2.0 * noise[k] and not moving.any():
            return []
    return [
        Finding(
            FindingCode.STUCK_VALUES,
            Severity.WARNING if longest < 0.1 * repeats.n else Severity.SERIOUS,
            f"The {short(sensor)}'s {AXES[k]} axis stays at {readings[start, k]:.7g} for {longest} samples from "
            f"{place(start)}, far longer than chance.",
            "A frozen channel, clipping, or a bus that answers with an old value.",
            "Leave that stretch out.",
            MappingProxyType({"axis": float(k), "longest_run": float(longest), "sample": float(start)}),
        )
    ]


def _coarse(sensor: str, readings: FloatArray, windows: Windows | None) -> list[Finding]:
    """Steps between possible readings that hide the noise."""
    if windows is None:
        return []
    noise = windows.quiet_noise(sensor)
    found = []
    for k in range(3):
        step = quantum(readings[:, k])
        if step > 2.0 * noise[k]:
            found.append((k, step, float(noise[k])))
    if not found:
        return []
    listed = ", ".join(f"{AXES[k]}: step {step:.4g}, noise {sigma:.2g}" for k, step, sigma in found)
    return [
        Finding(
            FindingCode.COARSE_RESOLUTION,
            Severity.WARNING,
            f"The {short(sensor)}'s resolution is coarser than its noise ({listed}, raw units).",
            "Few bits, or values rounded when they were written.",
            "Averaging longer does not help where the noise does not move the last digit; choose a smaller range.",
            MappingProxyType({f"{AXES[k]}_step": step for k, step, _ in found}),
        )
    ]
