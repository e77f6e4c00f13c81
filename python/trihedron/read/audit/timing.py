"""Findings on timestamps: changes of rate, jitter, gaps, duplicates, lost packets."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.read.clock.rate import steps_of, usual_step
from trihedron.read.sensors import Sensors
from trihedron.read.turning import turning_of
from trihedron.records import Finding, FindingCode, Sampling, Severity, TimestampKind
from trihedron.records.sampling import UNJUDGED

_PARTS = 40
_FEWEST_ROWS = 50
_ABRUPT = 8.0
"""Smallest ratio of the change of rate to the scatter of the parts on both sides; a drifting rate stays below it."""
_SMALLEST = 5e-4
"""Smallest relative change of rate that is reported; a quartz oscillator may cause smaller ones."""
_SURE, _SCALES_DIFFER = 4.0, 0.01
"""Standard deviations of the test, and the scatter of an uncalibrated gyro's scale because its axes' scales differ."""


def audit_pace(time_s: FloatArray, sensors: Sensors) -> list[Finding]:
    """A finding where the rate of timestamps (n,) changes at a row, unless the rotation of gravity confirms the
    change."""
    accelerometer, gyroscope = sensors.accelerometer, sensors.gyroscope
    if gyroscope is None:
        return []
    found = _jump(time_s)
    if found is None:
        return []
    at, ratio = found
    decided = False
    if accelerometer is not None:
        sides = []
        for part in (slice(0, at), slice(at, len(time_s))):
            rate = 1.0 / usual_mean(time_s[part])
            sides.append(turning_of(accelerometer[part], gyroscope[part], rate))
        before, after = sides
        if before is not None and after is not None and before.is_clear and after.is_clear:
            # Wrong timestamps change the gyro's scale from gravity by the ratio of the rates; true ones do not.
            change = math.log(after.scale / before.scale)
            sigma = math.hypot(before.sigma / before.scale, after.sigma / after.scale, _SCALES_DIFFER)
            may_be_true, may_lie = (abs(change + x) < _SURE * sigma for x in (0.0, math.log(ratio)))
            if may_be_true and not may_lie:
                return []
            decided = may_lie and not may_be_true
    return [
        Finding.of(
            FindingCode.CLOCK_JUMPED, percent=100.0 * (ratio - 1.0), where=sensors.place(at), sample=at, decided=decided
        )
    ]


def usual_mean(time_s: FloatArray) -> float:
    """Mean step [s] of timestamps (n,), without gaps."""
    step = np.diff(time_s)
    return float(step[step < GAP_STEPS * usual_step(time_s)].mean())


def _jump(time_s: FloatArray) -> tuple[int, float] | None:
    """(first sample after it, ratio of the steps) of the place where the step changes permanently; None without one."""
    n = (len(time_s) - 1) // _PARTS
    if n < _FEWEST_ROWS:
        return None
    step = np.diff(time_s)
    step = np.where(step < GAP_STEPS * usual_step(time_s), step, np.nan)[: n * _PARTS].reshape(_PARTS, n)
    if not np.isfinite(step).any(axis=1).all():
        return None
    pace = np.nanmean(step, axis=1)
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
    inside = np.nan_to_num(step[k - 1 : k + 1].ravel(), nan=float(pace.mean()))
    sums = np.cumsum(inside - inside.mean())
    return (k - 1) * n + int(np.argmax(np.abs(sums))) + 1, ratio


Place = Callable[[int], str]

GAP_STEPS = 1.5
"""A step longer than this multiple of the usual one is a gap."""
JITTER_STEPS = 0.03
"""Jitter, in steps, below which it is the clock's rounding and not reported."""
SERIOUS_LOSS = 0.05
MUCH_JITTER = 0.2
"""Jitter, in steps, above which it is a warning: it affects a short rotation as much as a reading's noise does."""


def audit_timing(
    time_s: FloatArray,
    rate_hz: float,
    place: Place,
    sampling: Sampling = UNJUDGED,
    lost_behind: npt.NDArray[np.int64] | None = None,
    timestamps_s: FloatArray | None = None,
) -> list[Finding]:
    """Findings on the timestamps of a log. ``place(i)`` names sample i in messages.

    ``lost_behind`` (n - 1,) are the samples lost after each, where the clock shows them; else long steps are gaps.
    ``timestamps_s`` (n,) are the logged timestamps where an even clock replaced them.
    """
    if len(time_s) < 3:
        return []
    usual = usual_step(time_s)
    if not usual > 0:
        return []
    findings: list[Finding] = []
    if steps_of(time_s if timestamps_s is None else timestamps_s).same:
        findings += _duplicates(
            np.diff(time_s if timestamps_s is None else timestamps_s), place, is_mended=timestamps_s is not None
        )
    if lost_behind is not None:
        findings += _lost(np.diff(time_s), lost_behind, place) if lost_behind.any() else []
    elif sampling.kind in (TimestampKind.LATE, TimestampKind.SCATTERED):
        pass  # a late timestamp looks like a loss: the number of lost samples is unknown
    else:
        batched = bool(findings) and steps_of(time_s).same > 0.2 * (len(time_s) - 1)
        gaps = _core.steps_above(time_s, (5.0 if batched else GAP_STEPS) * usual)
        if len(gaps):
            step = np.diff(time_s)
            lost = np.zeros(len(step), dtype=np.int64)
            lost[gaps] = np.maximum(np.rint(step[gaps] / usual) - 1, 0)
            findings += _gap(step, gaps, lost, place)
    timestamps = time_s
    if timestamps_s is not None:
        usual, timestamps = usual_step(timestamps_s), timestamps_s
    count, total, jitter, least, most = _core.inside_steps(timestamps, 0.0, GAP_STEPS * usual)
    mean = total / count
    if jitter > JITTER_STEPS * mean:
        findings.append(
            Finding.of(
                FindingCode.TIME_JITTER,
                severity=Severity.NOTE if jitter < MUCH_JITTER * mean or timestamps_s is not None else Severity.WARNING,
                jitter_s=jitter,
                median_step_s=usual,
                median_rate_hz=1 / usual,
                mean_step_s=mean,
                mean_rate_hz=1 / mean,
                least_s=least,
                largest_s=most,
                rate_hz=rate_hz,
                is_irregular=sampling.kind is TimestampKind.IRREGULAR,
            )
        )
    return findings


def _lost(step: FloatArray, lost: npt.NDArray[np.int64], place: Place) -> list[Finding]:
    gaps = np.flatnonzero(lost > 0)
    return _gap(step, gaps, lost, place) if len(gaps) else []


def _duplicates(step: FloatArray, place: Place, *, is_mended: bool) -> list[Finding]:
    same = np.flatnonzero(step == 0)
    if not len(same):
        return []
    fraction = len(same) / len(step)
    return [
        Finding.of(
            FindingCode.TIME_DUPLICATE,
            "mended" if is_mended else "",
            count=len(same),
            fraction=fraction,
            where=place(int(same[0]) + 1),
            sample=same[0] + 1,
        )
    ]


def _gap(step: FloatArray, gaps: npt.NDArray[np.intp], lost: npt.NDArray[np.int64], place: Place) -> list[Finding]:
    longest = int(gaps[np.argmax(step[gaps])])
    total = int(lost.sum())
    fraction = total / (len(step) + 1 + total)
    worst = sorted((int(g) for g in gaps[np.argsort(step[gaps])[::-1][:3]]), key=int)
    return [
        Finding.of(
            FindingCode.TIME_GAP,
            severity=Severity.SERIOUS if fraction > SERIOUS_LOSS else Severity.WARNING,
            count=len(gaps),
            lost_samples=total,
            fraction=fraction,
            longest_s=step[longest],
            worst=[(step[g], place(g + 1)) for g in worst],
            has_more=len(gaps) > len(worst),
            sample=longest + 1,
        )
    ]


def audit_counter(counter: FloatArray, label: str, place: Place) -> list[Finding]:
    """Packets that are missing by the log's counter; a counter that wraps is continued."""
    if len(counter) < 3 or not np.all(np.isfinite(counter)):
        return []
    step = np.diff(counter)
    back = step < 0
    for modulus in (2.0**8, 2.0**16, 2.0**32):
        if counter.max() < modulus and counter.min() >= 0:
            step = np.where(back, step + modulus, step)
            break
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
            FindingCode.SAMPLES_LOST,
            "counter",
            severity=Severity.WARNING if missing <= SERIOUS_LOSS * len(counter) else Severity.SERIOUS,
            column=label,
            count=len(lost),
            lost_samples=missing,
            wraps=bool(back.any()),
            where=place(int(lost[0]) + 1),
            sample=lost[0] + 1,
        )
    ]
