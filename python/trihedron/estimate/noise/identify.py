"""Noise terms of a static log: presence, value, interval, and whether the log is sufficient."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.allan import as_readings, check_question, curve_of
from trihedron.estimate.noise.axis import blank_axis, identify_axis
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
    with_tails,
)
from trihedron.estimate.noise.slow_changes import (
    MOSTLY,
    STEP,
    SlowChange,
    share_of_temperature,
    slow_changes,
    steps_of,
    without,
)
from trihedron.estimate.noise.spectrum import evenness, ordinates, spread_of_mean
from trihedron.estimate.noise.two_levels import two_levels
from trihedron.ranges import merged
from trihedron.records import AllanCurve, Finding
from trihedron.records.noise import FEWEST_READINGS, Noise, NoiseAxis

ACCELEROMETER = ("accel x", "accel y", "accel z")
"""Names of the channels that show gravity."""
MOST_DISTURBED = 0.25
"""Largest share of an axis that is excluded automatically."""
SHORTEST_STRETCH = 64
"""Fewest readings, or means, between two steps that are used."""


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
    excluded = [_checked_stretch(stretch, n, rate_hz) for stretch in exclude_s]
    findings: list[Finding] = []
    repeated = repeated_rows(readings)
    if repeated > 0.001:
        findings.append(Finding.of("repeated-rows", "static", share=repeated))

    def undisturbed(c: int) -> Channel:
        one = Channel(np.array(readings[:, c], dtype=np.float64), rate_hz, names[c], units[c])
        one.leave_out(excluded)
        if not np.any(np.isfinite(one.column)):
            raise InputError(f"{names[c]} holds no finite reading outside the excluded stretches")
        return one.without_events() if automatic else one

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        seen = list(pool.map(undisturbed, range(channels)))
        cuts = merged([*excluded, *(cut for one in seen for cut in one.cuts)])
        # What moves one axis of a body disturbs the others, less visibly: an interval is excluded from all.
        for one in seen:
            one.leave_out(cuts)
        if automatic:
            seen = list(pool.map(lambda one: one.without_changes(heat), seen))
        if cuts:
            total = sum(b - a for a, b in cuts)
            said = Finding.of("stretches-excluded", n_stretches=len(cuts), excluded_s=total / rate_hz, share=total / n)
            findings.append(said)
        findings += [*_motion(seen, rate_hz), *_heated(seen, heat), *_switching(seen, pool)]
        curve = curve_of([one.column[:, np.newaxis] for one in seen], rate_hz, clusters, names, units)
        axes = list(pool.map(lambda c: seen[c].identified(seen[c].blank(), curve, c, heat), range(channels)))
    return Noise(
        axes=tuple(axes),
        curve=curve,
        source=source,
        excluded_s=tuple((a / rate_hz, b / rate_hz) for a, b in cuts),
        breaks_s=tuple(sorted({at / rate_hz for one in seen for at in one.breaks})),
        findings=tuple(findings),
    )


@dataclass(frozen=True, eq=False)
class Channel:
    """Readings of one channel, ``column`` (n,), with its events and slow changes; or means beside the first readings,
    ``head`` (k,).

    ``cuts`` are intervals to exclude, ``choices`` the slow changes that are stated (subtracted) and those that may be
    there, ``share_of_heat`` that of the slow changes which the temperature explains, ``louder`` the ratio of a second
    level of its noise to the first.
    """

    column: FloatArray
    rate_hz: float
    name: str
    unit: str
    steps: Sequence[Event] = ()
    cuts: Sequence[tuple[int, int]] = ()
    findings: Sequence[Finding] = ()
    choices: Sequence[Sequence[SlowChange]] = ((),)
    share_of_heat: float = 0.0
    louder: float = 1.0
    head: FloatArray | None = None

    def stepped(self, choice: int = 0) -> list[Event]:
        """Its steps, those among the slow changes of a choice included."""
        more = steps_of(self.choices[choice], len(self.column), self.rate_hz)
        return sorted([*self.steps, *more], key=lambda step: step.start)

    def stretches(self, choice: int) -> list[tuple[int, int]]:
        """Those between its steps, beside the slow changes of a choice."""
        edges = [0, *(at for step in self.stepped(choice) for at in (step.start, step.stop)), len(self.column)]
        return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= SHORTEST_STRETCH]

    @property
    def breaks(self) -> list[float]:
        """Middles of the steps, in readings."""
        return [step.middle for step in self.stepped()]

    @property
    def is_heated(self) -> bool:
        """Whether the temperature is the larger part of its slow changes."""
        return self.share_of_heat > MOSTLY

    def leave_out(self, stretches: Sequence[tuple[int, int]]) -> None:
        """Mark the readings of ``stretches`` as missing."""
        for start, stop in stretches:
            self.column[start:stop] = np.nan

    def without_events(self) -> Channel:
        """The channel with its impacts and intervals of vibration, to be excluded, and its steps."""
        steps, impacts = sudden_changes(self.column, self.rate_hz)
        calm = replace(self, column=self.column.copy()) if impacts else self
        calm.leave_out([(impact.start, impact.stop) for impact in impacts])
        (shocks, is_level), louder = shaken(calm.column, self.rate_hz), 1.0
        # Steps during shaking are part of it.
        steps = [one for one in steps if not one.overlaps(shocks)]
        if is_level:
            louder = max(event.size for event in shocks)
            impacts, shocks = [one for one in impacts if not one.overlaps(shocks)], []
        else:
            impacts = with_tails(calm.column, impacts)
        findings = list(remarks.events(impacts, shocks, self.rate_hz, self.unit))
        cuts = merged([(e.start, e.stop) for e in (*shocks, *impacts)])
        share = sum(stop - start for start, stop in cuts) / len(self.column)
        if share > MOST_DISTURBED:
            # With too large a share disturbed, no undisturbed noise can be measured: nothing is excluded.
            findings.append(Finding.of("log-motion", "throughout", share=share))
            steps, cuts = [], []
        return replace(self, steps=steps, cuts=cuts, findings=findings, louder=louder)

    def without_changes(self, heat: FloatArray | None = None) -> Channel:
        """The channel without its slow changes, or with the share of them that the temperature (n,) explains."""
        share = 0.0 if heat is None else share_of_temperature(self.column, heat, self.breaks)
        if share > MOSTLY:
            return replace(self, share_of_heat=share)
        choices = slow_changes(self.column, self.rate_hz, self.breaks)
        column = without(self.column, choices[0], self.rate_hz)
        findings = [*self.findings, *remarks.changes(choices[0], self.unit, heat)]
        return replace(self, column=column, findings=findings, choices=choices, share_of_heat=share)

    def blank(self) -> NoiseAxis:
        """Its axis without terms."""
        present = np.isfinite(self.column)
        n = int(np.count_nonzero(present))
        mean = float(np.sum(self.column, where=present)) / max(n, 1)
        return blank_axis(self.name, self.unit, self.rate_hz, n, mean, readout(self.column))

    def identified(
        self, blank: NoiseAxis, curve: AllanCurve, channel: int, heat: FloatArray | None = None
    ) -> NoiseAxis:
        """The ``blank`` axis with its terms, beside the temperature (n,), and the findings of the channel."""
        fast = self.column if self.head is None else self.head
        even, ratio = evenness(fast)
        said = (*remarks.jumps(self.stepped(), self.rate_hz, self.unit), *self.findings)
        said = (*said, *remarks.uneven(even, ratio, self.louder))
        blank = replace(blank, findings=(*said, *blank.findings))
        if blank.sample_sigma == 0.0:
            return blank
        range_degc = remarks.UNLOGGED if heat is None else (float(np.min(heat)), float(np.max(heat)))
        head = None if self.head is None else (self.head, blank.rate_hz)
        choices = []
        stated = self.column - without(self.column, self.choices[0], self.rate_hz)
        for k, changes in enumerate(self.choices):
            smooth = [one for one in changes if one.kind != STEP]
            x = without(self.column + stated, changes, self.rate_hz) if k else self.column
            bands = ordinates(x, self.rate_hz, self.stretches(k), smooth, head)
            choices.append([replace(band, count=even * band.count) for band in bands])
        # N of a level that changes is the mean of a sample of pieces.
        tails = math.hypot(tail_error(fast), 0.5 * spread_of_mean(even))
        axis = identify_axis(choices, blank, curve, channel, tails, range_degc)
        # Drift that the temperature explains is stated with it.
        others = tuple(one for one in axis.findings if one.code != "log-drift")
        return replace(axis, findings=others) if self.is_heated else axis


def _heat(temperature: FloatArray, n: int) -> FloatArray | None:
    """Temperature (n,) with missing values interpolated; ``None`` without any. Raises ``InputError`` on other sizes."""
    if temperature.shape != (n, 1):
        raise InputError(f"{n} readings need as many temperatures, got {' x '.join(map(str, temperature.shape))}")
    there = np.flatnonzero(np.isfinite(temperature[:, 0]))
    return np.interp(np.arange(n), there, temperature[there, 0]) if len(there) else None


def sudden_changes(column: FloatArray, rate_hz: float) -> tuple[list[Event], list[Event]]:
    """Steps and impacts of a channel, beside its slow changes where these explain some of them: what a bias does in its
    first minutes is far outside the spread of its later changes."""
    events = steps_and_impacts(bridged(column))
    changes = slow_changes(column, rate_hz)[0] if any(events) else ()
    if changes:
        beside = steps_and_impacts(bridged(without(column, changes, rate_hz)))
        events = min(events, beside, key=lambda found: tuple(map(len, found)))
    return events


def _motion(seen: Sequence[Channel], rate_hz: float) -> list[Finding]:
    """Finding for a log that is not static, by the accelerometer's readings outside excluded intervals."""
    triad = [one.column for one in seen if one.name in ACCELEROMETER]
    if len(triad) < len(ACCELEROMETER):
        return []
    force = np.column_stack(triad)
    turn = turn_of_gravity(force, rate_hz)
    if turn is not None:
        return [Finding.of("log-motion", "turns", turn_rad=turn[0], every_s=turn[1])]
    other = other_orientation(force, rate_hz)
    if other is None:
        return []
    turn_rad, start, stop = other
    said = Finding.of(
        "log-turned", turn_rad=turn_rad, start_s=start / rate_hz, stop_s=stop / rate_hz, is_first=start == 0,
        is_last=stop == len(force),
    )  # fmt: skip
    return [said]


def _heated(seen: Sequence[Channel], heat: FloatArray | None) -> list[Finding]:
    """Finding for axes whose slow changes are mostly those of the temperature (n,)."""
    axes = [one.name for one in seen if one.is_heated]
    if heat is None or not axes:
        return []
    used = heat[np.isfinite([one.column for one in seen]).any(axis=0)]
    share = max(one.share_of_heat for one in seen)
    said = Finding.of("temperature-driven", "noise", low_degc=used.min(), high_degc=used.max(), share=share, axes=axes)
    return [said]


def _switching(seen: Sequence[Channel], pool: ThreadPoolExecutor) -> list[Finding]:
    """Finding for axes whose level switches between two values."""
    found = pool.map(lambda one: two_levels(one.column, one.rate_hz), seen)
    axes = [
        (one.name, levels.size, one.unit, levels.n_switches, levels.held_s)
        for one, levels in zip(seen, found, strict=True)
        if levels is not None
    ]
    return [Finding.of("two-levels", axes=axes)] if axes else []


def _checked_stretch(stretch: tuple[float, float], n: int, rate_hz: float) -> tuple[int, int]:
    start, stop = stretch
    if not (math.isfinite(start) and start < stop):
        raise InputError(f"an excluded stretch runs from an earlier to a later second, got {start} to {stop}")
    first, last = max(0, math.floor(start * rate_hz)), min(n, math.ceil(min(stop, n / rate_hz) * rate_hz))
    if first >= n or last <= 0:
        raise InputError(f"the excluded stretch {start} s to {stop} s lies outside the log of {n / rate_hz:.6g} s")
    return first, last
