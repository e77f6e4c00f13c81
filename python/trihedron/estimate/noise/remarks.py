"""What is said about a log and its terms: every finding of the noise stage in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from trihedron.records.finding import Finding, FindingCode, Severity
from trihedron.records.noise import NoiseAxis, SpectralLine, TermName

if TYPE_CHECKING:
    from trihedron.estimate.noise.screening import Event, Readout


def _finding(
    code: FindingCode, severity: Severity, seen: str, cause: str = "", action: str = "", **numbers: float
) -> Finding:
    return Finding(code, severity, seen, cause, action, MappingProxyType(numbers))


def rows_repeated(share: float) -> Finding:
    """The same row more often than its channels repeat by chance."""
    return _finding(
        FindingCode.REPEATED_ROWS,
        Severity.WARNING,
        f"{100 * share:.2g} % of the rows repeat the row before in every channel.",
        "the log was written faster than the sensor measures, or resampled by holding the last value",
        "N and Q then depend on the resampling; log at the sensor's own rate.",
        share=share,
    )


def events(
    steps: Sequence[Event], knocks: Sequence[Event], shocks: Sequence[Event], rate_hz: float, unit: str
) -> list[Finding]:
    """Steps, knocks and shaking of one axis, the largest of each with its time."""
    out = []
    if steps:
        worst = max(steps, key=lambda e: abs(e.size))
        out.append(
            _finding(
                FindingCode.LOG_STEP,
                Severity.WARNING,
                f"The level jumps {_times(len(steps))}, by up to {abs(worst.size):.3g} {unit} at "
                f"{worst.start / rate_hz:.1f} s.",
                "the sensor or its table was moved, the supply or a heater switched, or the sensor has telegraph noise",
                "A step looks like K and R; each side is fitted with a level of its own, so that K holds what is left.",
                n_steps=len(steps),
                step=worst.size,
                time_s=worst.start / rate_hz,
            )
        )
    if knocks:
        worst = max(knocks, key=lambda e: abs(e.size))
        out.append(
            _finding(
                FindingCode.LOG_KNOCK,
                Severity.NOTE,
                f"{len(knocks)} short excursion{'s' if len(knocks) > 1 else ''} of up to {abs(worst.size):.3g} {unit}, "
                f"the largest at {worst.start / rate_hz:.1f} s.",
                "a knock at the table, a door, a lost or damaged reading",
                "They raise N and Q; these stretches are left out.",
                n_knocks=len(knocks),
                knock=worst.size,
                time_s=worst.start / rate_hz,
            )
        )
    if shocks:
        total = sum(e.stop - e.start for e in shocks) / rate_hz
        out.append(
            _finding(
                FindingCode.LOG_MOTION,
                Severity.WARNING,
                f"For {total:.3g} s the readings scatter up to {max(e.size for e in shocks):.2g} times as much as in "
                f"the rest, first at {shocks[0].start / rate_hz:.1f} s.",
                "motion, vibration or handling during a log that should be still",
                "It raises N; these stretches are left out.",
                shaken_s=total,
            )
        )
    return out


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def disturbed_throughout(share: float) -> Finding:
    """Too much of the log would have to be left out."""
    return _finding(
        FindingCode.LOG_MOTION,
        Severity.SERIOUS,
        f"Events cover {100 * share:.0f} % of the log: it is disturbed throughout, and nothing was left out.",
        "the sensor was not at rest",
        "The terms describe the disturbance as much as the sensor; record at rest.",
        share=share,
    )


def stretches_excluded(stretches: Sequence[tuple[int, int]], n: int, rate_hz: float) -> Finding:
    """What was left out."""
    total = sum(b - a for a, b in stretches)
    return _finding(
        FindingCode.STRETCHES_EXCLUDED,
        Severity.NOTE,
        f"{len(stretches)} stretch{'es' if len(stretches) > 1 else ''} of together {total / rate_hz:.3g} s "
        f"({100 * total / n:.2g} % of the log) left out.",
        "",
        "Clusters there are means of the readings that remain, weighted by their number; nothing is interpolated.",
        excluded_s=total / rate_hz,
    )


def written(readings: Readout) -> list[Finding]:
    """Saturation of one axis."""
    if readings.clipped == 0.0:
        return []
    return [
        _finding(
            FindingCode.CLIPPING,
            Severity.SERIOUS,
            f"{100 * readings.clipped:.2g} % of the readings lie on the same extreme value.",
            "the sensor or the converter is at the end of its range",
            "Every term comes out too small; use a wider range or another orientation.",
            share=readings.clipped,
        )
    ]


def dead(readings: Readout, unit: str) -> Finding:
    """The noise does not move the converter."""
    return _finding(
        FindingCode.QUANTISATION_DEAD,
        Severity.SERIOUS,
        f"One reading's noise ({readings.sigma:.3g} {unit}) is below half a step of the converter "
        f"({readings.resolution:.3g} {unit}): {100 * readings.repeated:.0f} % of the readings repeat the one before.",
        "the resolution is coarser than the noise",
        "N is that of the rounding, and slow terms may hide inside one step; use a narrower range or a finer output.",
        sigma=readings.sigma,
        resolution=readings.resolution,
    )


def lines(found: Sequence[SpectralLine], unit: str) -> Finding:
    """Periodic disturbances, the strongest first."""
    strong = sorted(found, key=lambda line: -line.amplitude)
    told = ", ".join(f"{line.frequency_hz:.4g} Hz ({line.amplitude:.2g} {unit})" for line in strong[:4])
    more = f" and {len(strong) - 4} more" if len(strong) > 4 else ""
    return _finding(
        FindingCode.SPECTRAL_LINE,
        Severity.NOTE,
        f"{len(strong)} periodic line{'s' if len(strong) > 1 else ''}: {told}{more}.",
        "mains, a fan, vibration of the building, or a clock inside the sensor",
        "A line makes waves in the Allan curve near half its period; its frequencies were left out of the fit.",
        n_lines=len(strong),
        frequency_hz=strong[0].frequency_hz,
        amplitude=strong[0].amplitude,
    )


def coloured(highest_hz: float, nyquist_hz: float, at_nyquist: float) -> Finding:
    """The upper end of the spectrum is not noise terms alone."""
    if math.isnan(at_nyquist):
        return _finding(
            FindingCode.SPECTRUM_COLOURED,
            Severity.SERIOUS,
            "No part of the upper spectrum is a sum of noise terms.",
            "resampling, a narrow filter or periodic disturbance shapes the whole band",
            "N and Q are not those of the sensor; log at its own rate without filtering.",
        )
    falls = "falls to" if at_nyquist < 1.0 else "rises to"
    cause = (
        "a low-pass filter in the sensor or the logger, or averaging by a resampler"
        if at_nyquist < 1.0
        else "aliasing, resampling, a resonance or vibration"
    )
    return _finding(
        FindingCode.SPECTRUM_COLOURED,
        Severity.WARNING,
        f"Above {highest_hz:.3g} Hz the spectrum leaves the noise terms and {falls} {100 * at_nyquist:.3g} % of them "
        f"at {nyquist_hz:.3g} Hz.",
        cause,
        "All terms are quoted from below; averaging times under half a period of that frequency show the filter, and Q "
        "cannot be told from it.",
        highest_hz=highest_hz,
        nyquist_hz=nyquist_hz,
        ratio=at_nyquist,
    )


def curve_alone() -> Finding:
    """The log behind a curve was not seen."""
    return _finding(
        FindingCode.CURVE_ALONE,
        Severity.NOTE,
        "The terms come from Allan deviations alone, taken as overlapping ones of an undisturbed log.",
        "",
        "Steps, knocks, lines and gaps cannot be told from noise in a curve; identify from the log where there is one.",
    )


def curve_coloured(first_s: float) -> Finding:
    """The short end of a curve is no sum of terms."""
    return _finding(
        FindingCode.SPECTRUM_COLOURED,
        Severity.WARNING,
        f"Below {first_s:.3g} s the curve is not a sum of noise terms.",
        "a low-pass filter in the sensor or the logger, resampling, or a periodic disturbance",
        "All terms are quoted from longer averaging times; a Q may be the tail of what was left out.",
        first_s=first_s,
    )


def curve_ramp() -> Finding:
    """A curve shows the square of a drift, not its shape."""
    return _finding(
        FindingCode.RAMP_OR_WALK,
        Severity.WARNING,
        "R and K are hard to tell apart in a curve: a random walk that happened to go one way has the curve of a ramp.",
        "the curve keeps the squares of differences and loses their order",
        "Identify from the log where there is one.",
    )


def curve_unexplained(deviation: float, tau_s: float) -> Finding:
    """A point that the terms miss by more than chance."""
    return _finding(
        FindingCode.SPECTRUM_UNEXPLAINED,
        Severity.WARNING,
        f"Near {tau_s:.2g} s the curve lies {100 * abs(deviation):.0f} % "
        f"{'above' if deviation > 0 else 'below'} the fitted terms.",
        "a periodic disturbance, temperature, or noise of another shape",
        "Intervals were widened to allow for it.",
        deviation=deviation,
        tau_s=tau_s,
    )


def unexplained(deviation: float, frequency_hz: float) -> Finding:
    """A band whose power the terms miss."""
    return _finding(
        FindingCode.SPECTRUM_UNEXPLAINED,
        Severity.WARNING,
        f"Near {frequency_hz:.2g} Hz the spectrum lies {100 * abs(deviation):.0f} % "
        f"{'above' if deviation > 0 else 'below'} the fitted terms.",
        "disturbance that is not noise (temperature, daily life of the building), or noise of another shape",
        "Intervals were widened to allow for it.",
        deviation=deviation,
        frequency_hz=frequency_hz,
    )


def _slow_noise_unresolved(axis: NoiseAxis) -> Finding:
    """B and K together are needed, neither by itself."""
    flicker, walk = axis.terms[TermName.BIAS_INSTABILITY], axis.terms[TermName.RATE_RANDOM_WALK]
    evidence = axis.slow_pair.evidence if axis.slow_pair is not None else 0.0
    return _finding(
        FindingCode.SLOW_NOISE_UNRESOLVED,
        Severity.NOTE,
        f"Slow noise is there; B and K are not separable here: B {flicker.lower:.2g} … {flicker.upper:.2g} "
        f"{axis.unit}, K {walk.lower:.2g} … {walk.upper:.2g} {axis.unit}/√s, not both zero.",
        "the log is short compared with the times over which flicker and walk differ",
        "Variances of means use the most likely sum of both; record longer to tell them apart.",
        evidence=evidence,
        flicker_lower=flicker.lower,
        flicker_upper=flicker.upper,
        walk_lower=walk.lower,
        walk_upper=walk.upper,
    )


def about_terms(axis: NoiseAxis) -> list[Finding]:
    """Drift, and a log too short to show any minimum."""
    out = []
    ramp = axis.terms[TermName.RATE_RAMP]
    if ramp.is_present:
        out.append(
            _finding(
                FindingCode.LOG_DRIFT,
                Severity.WARNING,
                f"The level drifts by {ramp.value * axis.duration_s:.3g} {axis.unit} over the log "
                f"({ramp.value:.3g} ± {ramp.sigma:.1g} {axis.unit}/s).",
                "warming up, or a change of the room's temperature",
                "R describes this log, not the sensor; let it warm up, or log the temperature.",
                slope=ramp.value,
            )
        )
    if axis.is_slow_noise_unresolved:
        out.append(_slow_noise_unresolved(axis))
    if not axis.terms[TermName.RATE_RANDOM_WALK].is_present and axis.optimal_averaging() is None:
        limit = axis.terms[TermName.RATE_RANDOM_WALK].limit
        out.append(
            _finding(
                FindingCode.LOG_TOO_SHORT,
                Severity.NOTE,
                f"No minimum before the log's end: K is below {limit:.2g} {axis.unit}/√s, more is not known.",
                "the log is short compared with the sensor's stability",
                "Record longer to find the best averaging time.",
                limit=limit,
            )
        )
    return out
