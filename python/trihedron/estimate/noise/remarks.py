"""Findings of the noise stage on a log and its terms."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from trihedron.estimate.noise.slow_changes import EXPONENTIAL, WAVE
from trihedron.ranges import merged
from trihedron.records import Finding, NoiseAxis, SpectralLine, TermName

if TYPE_CHECKING:
    from trihedron.arrays import FloatArray
    from trihedron.estimate.noise.screening import Event, Readout
    from trihedron.estimate.noise.slow_changes import SlowChange

NAMED = 4
"""Most spectral lines that a finding lists one by one."""
FALLEN = 0.95
"""Power at Nyquist over the terms' below which a filter shows; vibration leaves it as it is."""
EVEN = 0.9
"""Share of the degrees of freedom that noise of one level leaves: below it intervals are 5 % wider."""
UNLOGGED = (math.nan, math.nan)
"""Range of a temperature that was not logged."""


def jumps(steps: Sequence[Event], rate_hz: float, unit: str) -> Iterator[Finding]:
    """Finding for steps of one axis; the largest with its time."""
    if steps:
        worst = max(steps, key=lambda e: abs(e.size))
        yield Finding.of("log-jump", n_steps=len(steps), step=worst.size, unit=unit, time_s=worst.start / rate_hz)


def events(impacts: Sequence[Event], shocks: Sequence[Event], rate_hz: float, unit: str) -> Iterator[Finding]:
    """Findings for impacts and shaking of one axis; the largest impact with its time."""
    if impacts:
        worst = max(impacts, key=lambda e: abs(e.size))
        count, start_s = len(merged((e.start, e.stop) for e in impacts)), worst.start / rate_hz
        yield Finding.of("log-impact", n_impacts=count, impact=worst.size, unit=unit, time_s=start_s)
    if shocks:
        total = sum(e.stop - e.start for e in shocks) / rate_hz
        yield Finding.of(
            "log-motion", shaken_s=total, times=max(e.size for e in shocks), first_s=shocks[0].start / rate_hz
        )


def of_readout(readings: Readout, unit: str) -> Iterator[Finding]:
    """Findings for readings at the range limit, and for noise that is too small for the resolution of the ADC."""
    if readings.clipped > 0.0:
        yield Finding.of("clipping", "static", share=readings.clipped)
    if readings.sigma == 0.0 or readings.is_dead:
        sigma, resolution, repeated = readings.sigma, readings.resolution, readings.repeated
        yield Finding.of("quantisation-dead", sigma=sigma, resolution=resolution, unit=unit, repeated=repeated)


def lines(found: Sequence[SpectralLine], unit: str) -> Finding:
    """Finding for spectral lines, the strongest first."""
    strong = sorted(found, key=lambda line: -line.amplitude)
    return Finding.of(
        "spectral-line",
        n_lines=len(strong),
        strongest=[(line.frequency_hz, line.amplitude, unit) for line in strong[:NAMED]],
        has_more=len(strong) > NAMED,
        n_more=len(strong) - NAMED,
        frequency_hz=strong[0].frequency_hz,
        amplitude=strong[0].amplitude,
    )


def coloured(highest_hz: float, nyquist_hz: float, at_nyquist: float) -> Finding:
    """Finding for an upper end of the spectrum that no sum of noise terms explains: a filter's, or another cause's."""
    if math.isnan(at_nyquist):
        return Finding.of("spectrum-low-pass", "throughout")
    if at_nyquist < FALLEN:
        return Finding.of("spectrum-low-pass", "falls", highest_hz=highest_hz, nyquist_hz=nyquist_hz, ratio=at_nyquist)
    return Finding.of("spectrum-unexplained", "above", highest_hz=highest_hz, nyquist_hz=nyquist_hz, ratio=at_nyquist)


def unexplained(deviation: float, frequency_hz: float) -> Finding:
    """Finding for a part of the spectrum that the terms do not explain."""
    tau_s = 0.5 / frequency_hz
    return Finding.of("spectrum-unexplained", deviation=deviation, frequency_hz=frequency_hz, tau_s=tau_s)


def uneven(even: float, ratio: float, louder: float) -> Iterator[Finding]:
    """Finding for a level of noise that changes along the log, so far that it costs a tenth of the readings, or with
    stretches ``louder`` than the others."""
    if even < EVEN or louder > 1.0:
        yield Finding.of("log-uneven", ratio=max(ratio, louder))


def changes(found: Sequence[SlowChange], unit: str, heat: FloatArray | None = None) -> Iterator[Finding]:
    """Findings for the exponentials of a warm-up, beside the logged temperature ``heat``, and for waves."""
    low_degc, high_degc = UNLOGGED if heat is None else (float(heat.min()), float(heat.max()))
    for one in found:
        if one.kind == WAVE:
            yield Finding.of("log-drift", "wave", period_s=one.time_s, amplitude=one.size, unit=unit)
        elif one.kind == EXPONENTIAL:
            yield Finding.of(
                "log-drift",
                "warm-up",
                drift=one.size,
                time_s=one.time_s,
                unit=unit,
                has_temperature=heat is not None,
                low_degc=low_degc,
                high_degc=high_degc,
            )


def about_terms(axis: NoiseAxis, range_degc: tuple[float, float] = UNLOGGED) -> Iterator[Finding]:
    """Findings for drift, inseparable slow noise, and a log too short for a minimum of the Allan deviation."""
    terms = axis.terms
    ramp, flicker, walk = terms[TermName.RATE_RAMP], terms[TermName.BIAS_INSTABILITY], terms[TermName.RATE_RANDOM_WALK]
    if ramp.is_present:
        yield Finding.of(
            "log-drift",
            drift=ramp.value * axis.duration_s,
            slope=ramp.value,
            sigma_slope=ramp.sigma,
            unit=axis.unit,
            has_temperature=math.isfinite(range_degc[0]),
            low_degc=range_degc[0],
            high_degc=range_degc[1],
        )
    if axis.is_slow_noise_unresolved:
        yield Finding.of(
            "slow-noise-unresolved",
            evidence=axis.slow_pair.evidence if axis.slow_pair is not None else 0.0,
            unit=axis.unit,
            flicker_lower=flicker.lower,
            flicker_upper=flicker.upper,
            walk_lower=walk.lower,
            walk_upper=walk.upper,
        )
    if not walk.is_present and axis.optimal_averaging() is None:
        yield Finding.of("log-too-short", limit=walk.limit, unit=axis.unit)
