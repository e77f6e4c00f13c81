"""Findings on readings: not finite, repeated, clipped, or with a resolution coarser than the noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.channel_facts.quiet import Windows
from trihedron.read.audit.repeats import Repeats
from trihedron.read.clock.rate import usual_step
from trihedron.read.repeated_rows import equal_apart
from trihedron.read.turning import Turning
from trihedron.records import Finding, Severity
from trihedron.records.channel_facts import ChannelFacts, Limit
from trihedron.records.words import Words


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
    n = repeats.n - 1
    expected = float(np.prod(repeats.rates[:, :3], axis=1).mean())
    seen = repeats.count[3] / n
    if _is_repeated(seen, expected, repeats):
        # Axes of corrected readings are mixed and not independent: rows equal apart as often as next to each other.
        expected = max(expected, equal_apart(readings, int(repeats.longest[3])))
    if not _is_repeated(seen, expected, repeats):
        return []
    longest = int(repeats.longest[3])
    return [
        Finding.of(
            "repeated-rows",
            sensor=short(sensor),
            count=int(repeats.count[3]),
            fraction=seen,
            chance=expected,
            longest_run=longest,
            where=place(int(repeats.longest_start[3])),
            sample=repeats.longest_start[3],
        )
    ]


def _is_repeated(seen: float, expected: float, repeats: Repeats) -> bool:
    """Whether the share ``seen`` of repeated rows is more than chance."""
    n = repeats.n - 1
    # Six standard deviations above the chance, and at least twice its odds: where three of four rows are repeated,
    # each axis repeats as often, and twice that chance is out of reach.
    limit = expected + 6.0 * np.sqrt(max(expected, 1.0 / n) / n)
    return bool(seen > max(limit, 2.0 * expected / (1.0 + expected)) and repeats.count[3] >= 5)


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


# Gravity that rotates between two samples without a gyro rate: both sensors' axes changed, or rows are cut.

_LEAST_TURN = 0.35
"""Smallest change, as a fraction of gravity (20 degrees), which no bias can explain."""
_CALM = 0.1
"""Largest deviation of readings on either side from their mean, as a fraction of gravity; a shock exceeds it."""
_SEEN = 0.25
"""Largest part of the rotation that the gyro may have measured, between the middles of both sides."""
_SIDE_S, _FEWEST = 0.1, 5
_SLOWEST_HZ = 20.0
"""Lowest rate at which it is tested: by hand a rotation of 20 degrees takes at least a twentieth of a second."""
_GAP_STEPS = 1.5
_BLOCK = 1 << 20


def audit_seam(
    time_s: FloatArray,
    accelerometer: FloatArray,
    gyroscope: FloatArray,
    turning: Turning,
    place: Callable[[int], Words],
) -> list[Finding]:
    """A finding where gravity jumps between two consecutive samples, with the sensor static before and after.

    ``time_s`` (n,) [s]; readings (n, 3) in any unit; ``turning``: the gyro's scale in the whole log.
    """
    step = usual_step(time_s[:_BLOCK])
    side = max(round(_SIDE_S / step), _FEWEST)
    if not 0.0 < step < 1.0 / _SLOWEST_HZ or len(time_s) < 4 * side:
        return []
    few = accelerometer[:: max(len(accelerometer) // 20_000, 1)]
    gravity = float(np.nanmedian(np.linalg.norm(few, axis=1)))
    rest = np.nanmedian(gyroscope[:: max(len(gyroscope) // 20_000, 1)], axis=0)
    leaps = [
        k
        for k in _leaps(accelerometer, _LEAST_TURN * gravity)
        if side <= k <= len(time_s) - side
        and time_s[k] - time_s[k - 1] < _GAP_STEPS * step
        and _is_unseen(
            accelerometer[k - side : k + side] / gravity, turning.scale * step * (gyroscope[k - side : k + side] - rest)
        )
    ]
    if not leaps:
        return []
    return [Finding.of("axes-changed", "leap", count=len(leaps), where=place(leaps[0]), sample=leaps[0])]


def _leaps(readings: FloatArray, least: float) -> list[int]:
    """Samples that differ from the previous one by more than ``least``, computed in blocks to limit memory."""
    found: list[int] = []
    for first in range(0, len(readings) - 1, _BLOCK):
        change = np.diff(readings[first : first + _BLOCK + 1], axis=0)
        found += (first + 1 + np.flatnonzero((change**2).sum(axis=1) > least**2)).tolist()
    return found


def _is_unseen(gravity: FloatArray, turned_rad: FloatArray) -> bool:
    """Whether both halves of gravity (2 n, 3) are constant, and the gyro's rotation per sample (2 n, 3) [rad] explains
    less than ``_SEEN`` of the change between them: other axes keep its size, as a channel that gets stuck does not."""
    halves = np.split(gravity, 2)
    before, after = (half.mean(axis=0) for half in halves)
    is_calm = all(bool(np.all(np.linalg.norm(half - half.mean(axis=0), axis=1) < _CALM)) for half in halves)
    turn = float(np.linalg.norm(after - before))
    is_gravity = abs(float(np.linalg.norm(after) - np.linalg.norm(before))) < 2.0 * _CALM
    n = len(gravity) // 2
    seen = float(np.linalg.norm(turned_rad[n // 2 : n + n // 2 + 1], axis=1).sum())
    return is_calm and is_gravity and turn > _LEAST_TURN and seen < _SEEN * turn
