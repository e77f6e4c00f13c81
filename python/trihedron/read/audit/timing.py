"""Findings on timestamps: changes of rate, jitter, gaps, duplicates, lost packets."""

import math
from collections.abc import Callable

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.channel_facts.turning import turning_of
from trihedron.read.clock.rate import mean_rate_hz, steps_of, steps_of_counter, usual_step
from trihedron.read.sensors import Sensors
from trihedron.records import Finding, Severity, TimestampKind
from trihedron.records.words import Words

Place = Callable[[int], Words]

_PARTS = 40
_FEWEST_ROWS = 50
_ABRUPT = 8.0
"""Smallest ratio of the change of rate to the scatter of the parts on both sides; a drifting rate stays below it."""
_SMALLEST = 5e-4
"""Smallest relative change of rate that is reported; a quartz oscillator may cause smaller ones."""
_SURE, _SCALES_DIFFER = 4.0, 0.01
"""Standard deviations of the test, and the scatter of an uncalibrated gyro's scale because its axes' scales differ."""


def audit_pace(sensors: Sensors) -> list[Finding]:
    """A finding where the rate of the timestamps changes at a row, unless the rotation of gravity confirms the
    change."""
    time_s = sensors.logged_s
    accelerometer, gyroscope = sensors.accelerometer, sensors.gyroscope
    if gyroscope is None:
        return []
    found = _jump(time_s)
    if found is None:
        return []
    at, ratio = found
    decided = False
    if accelerometer is not None:
        before, after = (
            turning_of(accelerometer[part], gyroscope[part], mean_rate_hz(time_s[part]))
            for part in (slice(0, at), slice(at, None))
        )
        if before is not None and after is not None and before.is_clear and after.is_clear:
            # Wrong timestamps change the gyro's scale from gravity by the ratio of the rates; true ones do not.
            change = math.log(after.scale / before.scale)
            sigma = math.hypot(before.sigma / before.scale, after.sigma / after.scale, _SCALES_DIFFER)
            may_be_true, may_lie = (abs(change + x) < _SURE * sigma for x in (0.0, math.log(ratio)))
            if may_be_true and not may_lie:
                return []
            decided = may_lie and not may_be_true
    return [
        Finding.of("clock-jumped", percent=100.0 * (ratio - 1.0), where=sensors.place(at), sample=at, decided=decided)
    ]


def _jump(time_s: FloatArray) -> tuple[int, float] | None:
    """(first sample after it, ratio of the steps) of the place where the step changes permanently; None without one."""
    n = (len(time_s) - 1) // _PARTS
    if n < _FEWEST_ROWS:
        return None
    longest = GAP_STEPS * usual_step(time_s)
    parts = [_core.inside_steps(time_s[k * n : (k + 1) * n + 1], -np.inf, longest) for k in range(_PARTS)]
    if not all(count for count, *_ in parts):
        return None
    pace = np.array([total / count for count, total, *_ in parts])
    best: tuple[float, int] | None = None
    for k in range(4, _PARTS - 4):
        # The part with the change belongs to neither side.
        before, after = pace[: k - 1], pace[k + 1 :]
        scatter = math.sqrt(0.5 * (before.var() + after.var())) + 1e-9 * abs(float(pace.mean()))
        contrast = abs(float(after.mean() - before.mean())) / scatter
        if best is None or contrast > best[0]:
            best = contrast, k
    assert best is not None
    contrast, k = best
    ratio = float(pace[k + 1 :].mean() / pace[: k - 1].mean())
    if contrast < _ABRUPT or abs(ratio - 1.0) < _SMALLEST:
        return None
    inside = np.diff(time_s[(k - 1) * n : (k + 1) * n + 1])
    inside = np.where(inside <= longest, inside, pace.mean())
    sums = np.cumsum(inside - inside.mean())
    return (k - 1) * n + int(np.argmax(np.abs(sums))) + 1, ratio


GAP_STEPS = 1.5
"""A step longer than this multiple of the usual one is a gap."""
JITTER_STEPS = 0.03
"""Jitter, in steps, below which it is the clock's rounding and not reported."""
SERIOUS_LOSS = 0.05
"""Fraction of samples that may be missing from a log in which no gap in time shows where."""
MUCH_JITTER = 0.2
"""Jitter, in steps, above which it is a warning: it affects a short rotation as much as a reading's noise does."""


def audit_timing(sensors: Sensors, rate_hz: float) -> list[Finding]:
    """Findings on the timestamps of a log.

    Long steps are gaps; the clock counts the samples lost in them, if it can.
    """
    time_s, logged_s, place = sensors.time_s, sensors.logged_s, sensors.place
    if len(time_s) < 3 or not usual_step(time_s) > 0:
        return []
    findings: list[Finding] = []
    if steps_of(logged_s).same:
        findings += _duplicates(np.diff(logged_s), place, is_mended=logged_s is not time_s)
    lost = _lost_behind(sensors)
    if lost is not None and lost.any():
        findings.append(_gap(np.diff(time_s), lost, place))
    usual = usual_step(logged_s)
    count, total, jitter, least, most = _core.inside_steps(logged_s, 0.0, GAP_STEPS * usual)
    mean = total / count
    if jitter > JITTER_STEPS * mean:
        is_note = jitter < MUCH_JITTER * mean or logged_s is not time_s
        findings.append(
            Finding.of(
                "time-jitter",
                severity=Severity.NOTE if is_note else Severity.WARNING,
                jitter_s=jitter,
                median_step_s=usual,
                mean_step_s=mean,
                least_s=least,
                largest_s=most,
                rate_hz=rate_hz,
                is_irregular=sensors.sampling.kind is TimestampKind.IRREGULAR,
            )
        )
    return findings


def _lost_behind(sensors: Sensors) -> IntArray | None:
    """(n - 1,) samples lost after each: those that the clock counts, else those of long steps; None if unknown."""
    if sensors.lost_behind is not None:
        return sensors.lost_behind
    if sensors.sampling.kind in (TimestampKind.LATE, TimestampKind.SCATTERED):
        return None  # a late timestamp looks like a loss
    time_s, usual = sensors.time_s, usual_step(sensors.time_s)
    is_batched = steps_of(time_s).same > 0.2 * (len(time_s) - 1)
    gaps = _core.steps_above(time_s, (5.0 if is_batched else GAP_STEPS) * usual)
    if not len(gaps):
        return None
    lost = np.zeros(len(time_s) - 1, dtype=np.int64)
    lost[gaps] = np.maximum(np.rint((time_s[gaps + 1] - time_s[gaps]) / usual) - 1, 0)
    return lost


def _duplicates(step: FloatArray, place: Place, *, is_mended: bool) -> list[Finding]:
    same = np.flatnonzero(step == 0)
    if not len(same):
        return []
    fraction = len(same) / len(step)
    return [
        Finding.of(
            "time-duplicate",
            severity=Severity.NOTE if is_mended else Severity.WARNING,
            is_mended=is_mended,
            count=len(same),
            fraction=fraction,
            where=place(int(same[0]) + 1),
            sample=same[0] + 1,
        )
    ]


def _gap(step: FloatArray, lost: IntArray, place: Place) -> Finding:
    gaps = np.flatnonzero(lost > 0)
    longest = int(gaps[np.argmax(step[gaps])])
    total = int(lost.sum())
    fraction = total / (len(step) + 1 + total)
    worst = sorted(gaps[np.argsort(step[gaps])[::-1][:3]].tolist())
    return Finding.of(
        "time-gap",
        count=len(gaps),
        lost_samples=total,
        fraction=fraction,
        longest_s=step[longest],
        worst=[(step[g], place(g + 1)) for g in worst],
        has_more=len(gaps) > len(worst),
        sample=longest + 1,
    )


def audit_counter(counter: FloatArray, label: str, place: Place) -> list[Finding]:
    """Packets that are missing by the log's counter; a counter that wraps is continued."""
    if len(counter) < 3 or not np.all(np.isfinite(counter)):
        return []
    step = steps_of_counter(counter)
    if np.any(step < 0):
        return []
    # The upper quartile, because a counter of the sensor's internal rate may step by 3 and 4 in turn without a loss.
    usual = float(np.percentile(step, 75.0))
    lost = np.flatnonzero(step > 1.5 * usual)
    if usual <= 0 or not len(lost):
        return []
    missing = int(np.sum(np.rint(step[lost] / usual) - 1))
    return [
        Finding.of(
            "samples-lost",
            "counter",
            severity=Severity.WARNING if missing <= SERIOUS_LOSS * len(counter) else Severity.SERIOUS,
            column=label,
            count=len(lost),
            lost_samples=missing,
            wraps=bool(np.any(np.diff(counter) < 0)),
            where=place(int(lost[0]) + 1),
            sample=lost[0] + 1,
        )
    ]
