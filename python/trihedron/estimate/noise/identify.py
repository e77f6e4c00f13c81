"""Noise terms of a static log: presence, value, interval, and whether the log is sufficient."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.allan import as_readings, check_question, curve_of_columns
from trihedron.estimate.noise.axis import blank_axis, identify_axis, stretches_between
from trihedron.estimate.noise.gaps import bridged
from trihedron.estimate.noise.screening import (
    Event,
    other_orientation,
    readout,
    repeated_rows,
    shaken,
    steps_and_impacts,
    tail_error,
    turn_of_gravity,
)
from trihedron.estimate.noise.slow_changes import (
    MOSTLY,
    SlowChange,
    beside_each,
    share_of_temperature,
    slow_changes,
    without,
)
from trihedron.estimate.noise.spectrum import ordinates
from trihedron.estimate.noise.two_levels import TwoLevels, two_levels
from trihedron.ranges import merged
from trihedron.records import AllanCurve, Finding, FindingCode
from trihedron.records.noise import FEWEST_READINGS, Noise, NoiseAxis

ACCELEROMETER = ("accel x", "accel y", "accel z")
"""Names of the channels that show gravity."""
MOST_DISTURBED = 0.25
"""Largest share of an axis that is excluded automatically."""


def identify_noise(
    x: npt.ArrayLike,
    rate_hz: float,
    *,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
    exclude_s: Sequence[tuple[float, float]] = (),
    automatic: bool = True,
    clusters: Sequence[int] | None = None,
    temperature_degc: npt.ArrayLike | None = None,
    source: str = "memory",
) -> Noise:
    """Identify the noise terms of every channel of a static log by maximum likelihood (docs/noise.md, section 3).

    Parameters
    ----------
    x : (n,) or (n, channels)
        Equally spaced readings in any unit; NaN marks a missing one.
    rate_hz : float
        Samples per second.
    names, units : sequence of str
        One per channel.
    exclude_s : sequence of (start, stop)
        Intervals to exclude, in seconds from the first reading.
    automatic : bool
        Exclude impacts and intervals of vibration, and start a new level at each step; each is a finding.
    clusters : (k,) of int, optional
        Readings per cluster of the Allan curve.
    temperature_degc : (n,), optional
        Temperature of the sensor, NaN where missing: where slow changes follow it, a finding says so.
    source : str
        Name of the log, for reports.

    Returns
    -------
    Noise
        Terms of every axis with 95 % intervals.

    Raises
    ------
    ValueError
        When the log is shorter than 512 readings, an interval to exclude is empty, or a channel does not change.

    Examples
    --------
    >>> import numpy as np
    >>> noise = trihedron.identify_noise(np.random.default_rng(1).normal(size=100_000), rate_hz=100.0)
    >>> round(noise.axes[0].value("N"), 3), noise.axes[0].terms["K"].is_present
    (0.099, False)
    """
    readings = as_readings(x)
    check_question(rate_hz, "overlapping", 0.95)
    n, channels = readings.shape
    names = tuple(names) or tuple(f"channel {c + 1}" for c in range(channels))
    units = tuple(units) or ("",) * channels
    if len(names) != channels or len(units) != channels:
        raise InputError(f"{channels} channels need as many names and units, got {len(names)} and {len(units)}")
    if n < FEWEST_READINGS:
        raise InputError(
            f"{n} readings ({n / rate_hz:.3g} s) are too few to separate noise terms: at least {FEWEST_READINGS} are "
            "needed, an hour or more is useful"
        )
    heat = None if temperature_degc is None else _heat(as_readings(temperature_degc), n)
    range_degc = remarks.UNLOGGED if heat is None else (float(np.min(heat)), float(np.max(heat)))
    excluded = [_checked_stretch(stretch, n, rate_hz) for stretch in exclude_s]
    findings: list[Finding] = []
    repeated = repeated_rows(readings)
    if repeated > 0.001:
        findings.append(Finding.of(FindingCode.REPEATED_ROWS, "static", share=repeated))

    def undisturbed(c: int) -> _Undisturbed:
        column = np.array(readings[:, c], dtype=np.float64)
        _leave_out(column, excluded)
        if not np.any(np.isfinite(column)):
            raise InputError(f"{names[c]} holds no finite reading outside the excluded stretches")
        return _without_events(column, rate_hz, units[c]) if automatic else _Undisturbed(column, [], [], [])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        quiet = list(pool.map(undisturbed, range(channels)))
        cuts = merged([*excluded, *(cut for one in quiet for cut in one.cuts)])
        # What moves one axis of a body disturbs the others, less visibly: an interval is excluded from all.
        for one in quiet:
            _leave_out(one.column, cuts)

        def screened(c: int) -> _Screened:
            return _screen(quiet[c], rate_hz, (names[c], units[c]), heat, automatic=automatic)

        seen = list(pool.map(screened, range(channels)))
        if cuts:
            total = sum(b - a for a, b in cuts)
            findings.append(
                Finding.of(
                    FindingCode.STRETCHES_EXCLUDED,
                    n_stretches=len(cuts),
                    excluded_s=total / rate_hz,
                    share=total / n,
                )
            )
        findings += _motion(seen, rate_hz)
        if heat is not None:
            findings += _heated(seen, heat)
        findings += _switching(seen, pool.map(lambda one: two_levels(one.column, rate_hz), seen))
        curve = curve_of_columns([one.column for one in seen], rate_hz, clusters, names, units)
        axes = list(pool.map(lambda c: _identified(seen[c], range_degc, curve, c), range(channels)))
    return Noise(
        axes=tuple(axes),
        curve=curve,
        source=source,
        excluded_s=tuple((a / rate_hz, b / rate_hz) for a, b in cuts),
        breaks_s=tuple(sorted({e.middle / rate_hz for one in seen for e in one.steps})),
        findings=tuple(findings),
    )


@dataclass(frozen=True, eq=False)
class _Undisturbed:
    """One channel with excluded intervals as NaN, its own automatic ``cuts``, the ``steps`` of its level, findings."""

    column: FloatArray
    cuts: list[tuple[int, int]]
    steps: list[Event]
    findings: list[Finding]


@dataclass(frozen=True, eq=False)
class _Screened:
    """One channel with excluded intervals as NaN, the ``steps`` of its level, the ``choices`` of its slow changes, of
    which the first are subtracted, and the share of these that the temperature explains."""

    column: FloatArray
    blank: NoiseAxis
    steps: list[Event]
    choices: list[Sequence[SlowChange]]
    share_of_heat: float

    @property
    def is_heated(self) -> bool:
        """Whether the temperature is the larger part of its slow changes."""
        return self.share_of_heat > MOSTLY


def _heat(temperature: FloatArray, n: int) -> FloatArray | None:
    """Temperature (n,) with missing values interpolated; ``None`` without any. Raises ``InputError`` on other sizes."""
    if temperature.shape != (n, 1):
        raise InputError(f"{n} readings need as many temperatures, got {' x '.join(map(str, temperature.shape))}")
    there = np.flatnonzero(np.isfinite(temperature[:, 0]))
    return np.interp(np.arange(n), there, temperature[there, 0]) if len(there) else None


def _leave_out(column: FloatArray, stretches: Sequence[tuple[int, int]]) -> None:
    for start, stop in stretches:
        column[start:stop] = np.nan


def _without_events(column: FloatArray, rate_hz: float, unit: str) -> _Undisturbed:
    """A channel's impacts and intervals of vibration, to be excluded, and its steps."""
    steps, impacts = sudden_changes(column, rate_hz)
    calm = column.copy() if impacts else column
    _leave_out(calm, [(impact.start, impact.stop) for impact in impacts])
    shocks = shaken(calm, rate_hz)
    # Steps during shaking are part of it.
    steps = [s for s in steps if not any(e.start <= s.start and s.stop <= e.stop for e in shocks)]
    findings = list(remarks.events(steps, impacts, shocks, rate_hz, unit))
    cuts = merged([(e.start, e.stop) for e in (*shocks, *impacts)])
    share = sum(stop - start for start, stop in cuts) / len(column)
    if share > MOST_DISTURBED:
        # With too large a share disturbed, no undisturbed noise can be measured: nothing is excluded.
        findings.append(Finding.of(FindingCode.LOG_MOTION, "throughout", share=share))
        steps, cuts = [], []
    return _Undisturbed(column, cuts, steps, findings)


def sudden_changes(column: FloatArray, rate_hz: float) -> tuple[list[Event], list[Event]]:
    """Steps and impacts of a channel, beside its slow changes where these explain some of them: what a bias does in its
    first minutes is far outside the spread of its later changes."""
    events = steps_and_impacts(bridged(column))
    changes = slow_changes(column, rate_hz)[0] if any(events) else ()
    if changes:
        beside = steps_and_impacts(bridged(without(column, changes, rate_hz)))
        events = min(events, beside, key=lambda found: tuple(map(len, found)))
    return events


def _screen(
    quiet: _Undisturbed, rate_hz: float, named: tuple[str, str], heat: FloatArray | None, *, automatic: bool
) -> _Screened:
    """A channel, ``named`` by its name and unit, beside the logged temperature (n,)."""
    name, unit = named
    column, steps, findings = quiet.column, quiet.steps, quiet.findings
    share = 0.0 if heat is None else share_of_temperature(column, heat, [e.middle for e in steps])
    choices: list[Sequence[SlowChange]] = [()]
    if automatic and share <= MOSTLY:
        choices = slow_changes(column, rate_hz, [e.middle for e in steps])
        column = without(column, choices[0], rate_hz)
        findings = [*findings, *remarks.changes(choices[0], unit, heat)]
    present = np.isfinite(column)
    n = int(np.count_nonzero(present))
    mean = float(np.sum(column, where=present)) / max(n, 1)
    blank = blank_axis(name, unit, rate_hz, n, mean, readout(column))
    return _Screened(column, replace(blank, findings=(*findings, *blank.findings)), steps, choices, share)


def _motion(seen: Sequence[_Screened], rate_hz: float) -> list[Finding]:
    """Finding for a log that is not static, by the accelerometer's readings outside excluded intervals."""
    triad = [one.column for one in seen if one.blank.name in ACCELEROMETER]
    if len(triad) < len(ACCELEROMETER):
        return []
    force = np.column_stack(triad)
    turn = turn_of_gravity(force, rate_hz)
    if turn is not None:
        return [Finding.of(FindingCode.LOG_MOTION, "turns", turn_rad=turn[0], every_s=turn[1])]
    other = other_orientation(force, rate_hz)
    if other is None:
        return []
    turn_rad, start, stop = other
    said = Finding.of(
        FindingCode.LOG_TURNED, turn_rad=turn_rad, start_s=start / rate_hz, stop_s=stop / rate_hz, is_first=start == 0,
        is_last=stop == len(force),
    )  # fmt: skip
    return [said]


def _heated(seen: Sequence[_Screened], heat: FloatArray) -> list[Finding]:
    """Finding for axes whose slow changes are mostly those of the temperature (n,)."""
    axes = [one.blank.name for one in seen if one.is_heated]
    if not axes:
        return []
    used = heat[np.isfinite([one.column for one in seen]).any(axis=0)]
    share = max(one.share_of_heat for one in seen)
    said = Finding.of(
        FindingCode.TEMPERATURE_DRIVEN, "noise", low_degc=used.min(), high_degc=used.max(), share=share, axes=axes
    )
    return [said]


def _switching(seen: Sequence[_Screened], found: Iterable[TwoLevels | None]) -> list[Finding]:
    """Finding for axes whose level switches between two values."""
    axes = [
        (one.blank.name, levels.size, one.blank.unit, levels.n_switches, levels.held_s)
        for one, levels in zip(seen, found, strict=True)
        if levels is not None
    ]
    return [Finding.of(FindingCode.TWO_LEVELS, axes=axes)] if axes else []


def _identified(seen: _Screened, range_degc: tuple[float, float], curve: AllanCurve, channel: int) -> NoiseAxis:
    if seen.blank.sample_sigma == 0.0:
        return seen.blank
    stretches, rate_hz = stretches_between(len(seen.column), seen.steps), seen.blank.rate_hz
    beside = beside_each(seen.column, seen.choices, rate_hz)
    choices = [ordinates(x, rate_hz, stretches, changes) for x, changes in beside]
    axis = identify_axis(choices, seen.blank, curve, channel, tail_error(seen.column), range_degc)
    # Drift that the temperature explains is stated with it.
    others = tuple(one for one in axis.findings if one.code is not FindingCode.LOG_DRIFT)
    return replace(axis, findings=others) if seen.is_heated else axis


def _checked_stretch(stretch: tuple[float, float], n: int, rate_hz: float) -> tuple[int, int]:
    start, stop = stretch
    if not (math.isfinite(start) and start < stop):
        raise InputError(f"an excluded stretch runs from an earlier to a later second, got {start} to {stop}")
    first, last = max(0, math.floor(start * rate_hz)), min(n, math.ceil(min(stop, n / rate_hz) * rate_hz))
    if first >= n or last <= 0:
        raise InputError(f"the excluded stretch {start} s to {stop} s lies outside the log of {n / rate_hz:.6g} s")
    return first, last
