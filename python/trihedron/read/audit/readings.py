"""Findings on readings: not finite, repeated, clipped, or with a resolution coarser than the noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.channel_facts.quiet import Windows
from trihedron.read.audit.repeats import Repeats
from trihedron.read.repeated_rows import are_more, equal_apart
from trihedron.records import Finding, Severity
from trihedron.records.channel_facts import ChannelFacts, Limit


def short(sensor: str) -> str:
    """The sensor's name for messages."""
    return "gyro" if sensor == "gyroscope" else sensor


def audit_clipping(sensor: str, limits: tuple[Limit, ...], windows: Windows | None, place: Place) -> list[Finding]:
    """A finding that lists the range limits (``limits``) met in motion with their readings, one those met at rest."""
    at_rest = [_is_static(limit, windows) for limit in limits]
    return [
        _clipped(sensor, met, place, is_static=is_static)
        for is_static in (False, True)
        if (met := [limit for limit, still in zip(limits, at_rest, strict=True) if still is is_static])
    ]


def _is_static(limit: Limit, windows: Windows | None) -> bool:
    """Whether most readings at a limit are in quiet windows, of those that are in windows at all."""
    if windows is None:
        return False
    before = np.repeat(np.concatenate([[0], np.cumsum(limit.runs[:, 1] - limit.runs[:, 0])]), 2)[1:-1]
    inside = np.diff([np.interp(edge, limit.runs.ravel(), before) for edge in windows.edges], axis=0)[0]
    return bool(2 * inside[windows.quiet].sum() > inside.sum())


def _clipped(sensor: str, limits: list[Limit], place: Place, *, is_static: bool) -> Finding:
    first = min(int(w.runs[0, 0]) for w in limits)
    numbers = {f"{AXES[w.axis]}_{'high' if w.is_high else 'low'}_count": float(w.count) for w in limits}
    numbers |= {f"{AXES[w.axis]}_{'high' if w.is_high else 'low'}_value": w.value for w in limits}
    return Finding.of(
        "clipping",
        is_static=is_static,
        sensor=short(sensor),
        is_gyro=sensor == "gyroscope",
        limits=[(AXES[w.axis], w.value, w.count, len(w.runs)) for w in limits],
        where=place(first),
        count=sum(w.count for w in limits),
        sample=first,
        numbers=numbers,
    )


Place = Callable[[int], str]
RARE, FEWEST = 1e-9, 5
"""Probability of so many repeated rows, that of six standard deviations; and the fewest that are reported."""
MANY = 0.05
"""Share of a log that is not finite from which on the finding is serious."""


def audit_readings(
    sensor: str, readings: FloatArray, facts: ChannelFacts, windows: Windows | None, place: Place
) -> list[Finding]:
    """Findings on one triad (n, 3). ``place(i)`` names sample i in messages; the usual log needs one pass."""
    repeats = Repeats(readings)
    findings = _non_finite(sensor, repeats, place)
    if len(readings) < 8:
        return findings
    findings += _repeated(sensor, readings, repeats, place)
    findings += audit_clipping(sensor, facts.limits, windows, place)
    findings += _coarse(sensor, facts.step, windows)
    return findings


def _non_finite(sensor: str, repeats: Repeats, place: Place) -> list[Finding]:
    count, first = repeats.n_missing, repeats.first_missing
    if first is None:
        return []
    return [
        Finding.of(
            "non-finite",
            "readings",
            severity=Severity.WARNING if count < MANY * repeats.n else Severity.SERIOUS,
            sensor=short(sensor),
            count=count,
            where=place(first),
            sample=first,
        )
    ]


def _repeated(sensor: str, readings: FloatArray, repeats: Repeats, place: Place) -> list[Finding]:
    """A finding where complete triads repeat more often than by chance."""
    n, count = repeats.n - 1, int(repeats.count[3])
    expected = float(np.prod(repeats.rates[:, :3], axis=1).mean())
    if are_more(count, n, expected, RARE):
        # Axes of corrected readings are mixed and not independent: rows equal apart as often as next to each other.
        expected = max(expected, equal_apart(readings, int(repeats.longest[3])))
    if count < FEWEST or not are_more(count, n, expected, RARE):
        return []
    longest = int(repeats.longest[3])
    return [
        Finding.of(
            "repeated-rows",
            sensor=short(sensor),
            count=count,
            fraction=count / n,
            chance=expected,
            longest_run=longest,
            where=place(int(repeats.longest_start[3])),
            sample=repeats.longest_start[3],
        )
    ]


def _coarse(sensor: str, steps: FloatArray, windows: Windows | None) -> list[Finding]:
    """A finding where the LSB is more than twice the noise."""
    if windows is None:
        return []
    all_axes = zip(AXES, steps.tolist(), windows.quiet_noise(sensor).tolist(), strict=True)
    axes = [(name, step, sigma) for name, step, sigma in all_axes if step > 2.0 * sigma]
    if not axes:
        return []
    numbers = {f"{name}_step": step for name, step, _ in axes}
    return [Finding.of("coarse-resolution", sensor=short(sensor), axes=axes, numbers=numbers)]
