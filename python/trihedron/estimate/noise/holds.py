"""Noise inside the holds of a session: white density, spectrum by octaves, lines, filter corner, resolution.

A session's holds are seconds long and differ a little (temperature, gravity on the axis, a hand): every figure is a
mean of logarithms over holds, whose error comes from the number of readings and from the holds' own scatter. Two logs
are then compared figure by figure (:func:`ratio_of`). docs/noise.md, section 8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.channel_facts.step import converter_step
from trihedron.estimate.noise.corner import filter_corner
from trihedron.estimate.noise.hold_lines import lines_of_holds, without_lines
from trihedron.estimate.noise.hold_statistics import as_measured, pooled_logarithm, robust_holds, root_of
from trihedron.estimate.noise.spectrum import cosine_transform
from trihedron.ranges import ranges_of
from trihedron.records.hold_noise import HoldNoise, Measured, OctaveNoise
from trihedron.refused import RefusedError

SHORTEST = 32
"""Readings of a hold that is used: fewer hold no octave below the uppermost two."""
LEAST_DITHER = 0.4
"""Noise over step below which the rounding is not noise of step²/12 any more, and what lies under it is hidden."""
LAGS = 8
"""Lags over which squared differences are correlated: filters of a sensor remember no more readings."""
LONGEST_SEGMENT = 4096
FEWEST_HOLDS = 3
"""Holds that must show an octave, where there are as many: the scatter of one is not known."""


def noise_of_holds(
    readings: npt.ArrayLike,
    rate_hz: float,
    holds: Sequence[tuple[int, int]],
    *,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
) -> tuple[HoldNoise, ...]:
    """Noise of every axis inside the holds of a session, each figure with its interval.

    Parameters
    ----------
    readings : (n,) or (n, channels)
        Raw readings; NaN marks a missing one (holds are cut there).
    rate_hz : float
        Samples per second.
    holds : sequence of (start, stop)
        Windows of stillness, in readings.
    names, units
        One per channel.

    Raises
    ------
    ValueError
        When the rate is no rate, a window is none, or none has 32 readings in a row.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.random.default_rng(1).normal(size=(5000, 1))
    >>> axis = noise_of_holds(x, 100.0, [(k, k + 400) for k in range(0, 5000, 500)])[0]
    >>> axis.white.lower < 0.1 < axis.white.upper, axis.lines, axis.corner_hz
    (True, (), None)
    """
    x = np.asarray(readings, dtype=np.float64)
    x = x[:, np.newaxis] if x.ndim == 1 else x
    if not (math.isfinite(rate_hz) and rate_hz > 0):
        raise RefusedError(f"rate_hz must be a positive number of samples per second, got {rate_hz}")
    for start, stop in holds:
        if not 0 <= start < stop <= len(x):
            raise RefusedError(f"a hold runs from an earlier to a later of {len(x)} readings, got {start} to {stop}")
    channels = x.shape[1]
    names = tuple(names) or tuple(f"channel {c + 1}" for c in range(channels))
    units = tuple(units) or ("",) * channels
    return tuple(_axis(x[:, c], rate_hz, holds, names[c], units[c]) for c in range(channels))


def _axis(x: FloatArray, rate_hz: float, holds: Sequence[tuple[int, int]], name: str, unit: str) -> HoldNoise:
    parts = [run for start, stop in holds for run in _unbroken(x[start:stop])]
    if not parts:
        raise RefusedError(f"{name}: no hold has {SHORTEST} readings in a row; hold still for longer")
    step = converter_step(np.concatenate(parts))
    power = _Power.of(parts)
    keep = robust_holds(power.variance, power.dof)
    parts = [part for part, kept in zip(parts, keep, strict=True) if kept]
    # A line is stated as one; it is neither white noise nor a filter's corner.
    spectrum = _segments(parts, rate_hz)
    lines = lines_of_holds(*spectrum, rate_hz)
    if lines:
        parts = without_lines(parts, lines, rate_hz)
        spectrum = _segments(parts, rate_hz)
    # Correlation and tails are those of what is kept: a knock would lend its own to all.
    power = _Power.of(parts)
    rounding = step**2 / 12.0
    pooled = pooled_logarithm(power.variance, power.dof)
    total = math.exp(pooled.mean)
    white: Measured | None = None
    if total > 0.0 and (step == 0.0 or total - rounding > (LEAST_DITHER * step) ** 2):
        # The rounding is known: what is left carries the whole error.
        share = total / (total - rounding)
        sensor = as_measured(total - rounding, share * pooled.sigma, pooled.dof)
        white = root_of(sensor, 1.0 / rate_hz)
    octaves = _octaves(parts, rate_hz)
    corner, above = filter_corner(*spectrum, rate_hz, rounding / total if total > 0.0 else 1.0, pooled.scatter)
    return HoldNoise(
        name=name,
        unit=unit,
        rate_hz=rate_hz,
        n_holds=len(parts),
        n_readings=sum(len(part) for part in parts),
        white=white,
        step=step,
        octaves=octaves,
        lines=lines,
        corner_hz=corner,
        corner_above_hz=above,
        scatter=pooled.scatter,
    )


def _unbroken(part: FloatArray) -> list[FloatArray]:
    return [part[a:b] for a, b in ranges_of(np.isfinite(part)) if b - a >= SHORTEST]


@dataclass(frozen=True, eq=False)
class _Power:
    """Half the mean squared difference of each hold (k,), and its degrees of freedom (k,)."""

    variance: FloatArray
    dof: FloatArray

    @classmethod
    def of(cls, parts: Sequence[FloatArray]) -> _Power:
        """Of holds (n,) each; the correlation and the kurtosis of differences are those of all holds together."""
        squares = [np.diff(part) ** 2 for part in parts]
        mean = np.array([float(s.mean()) for s in squares])
        count = np.array([len(s) for s in squares], dtype=np.float64)
        # Relative to each hold's own level: holds may differ.
        about = [s / m - 1.0 for s, m in zip(squares, mean, strict=True) if m > 0.0]
        spread = np.zeros(LAGS + 1)
        for lag in range(LAGS + 1):
            products = [float(a[lag:] @ a[: len(a) - lag]) for a in about]
            spread[lag] = sum(products) / max(sum(len(a) - lag for a in about), 1)
        # White noise: 2 (1 + 2/4) = 3 per difference, two thirds of a degree of freedom each.
        per_difference = max(float(spread[0] + 2.0 * spread[1:].sum()), 0.5 * float(spread[0]), 1e-12)
        return cls(0.5 * mean, 2.0 * count / per_difference)


def _octaves(parts: Sequence[FloatArray], rate_hz: float) -> tuple[OctaveNoise, ...]:
    """Mean power between powers of two of a hertz, over the holds long enough to have four ordinates there."""
    nyquist = rate_hz / 2.0
    found: dict[int, tuple[list[float], list[float]]] = {}
    for part in parts:
        power = cosine_transform(part - part.mean())[1:] ** 2 / rate_hz
        frequency = np.arange(1, len(part)) * rate_hz / (2.0 * len(part))
        number = np.floor(np.log2(frequency)).astype(np.int64)
        for octave in np.unique(number).tolist():
            low = 2.0**octave
            inside = number == octave
            n = int(inside.sum())
            # Whole octaves only, or the part below Nyquist where it is most of one.
            if n < 4 or frequency[0] > low * 1.2 or nyquist < low * math.sqrt(2.0):
                continue
            means, dofs = found.setdefault(octave, ([], []))
            means.append(float(power[inside].mean()))
            dofs.append(float(n))
    out = []
    for octave in sorted(found):
        # One long hold, perhaps with the hand still on it, is not the sensor's low octave.
        if len(found[octave][0]) < min(FEWEST_HOLDS, len(parts)):
            continue
        pooled = pooled_logarithm(np.array(found[octave][0]), np.array(found[octave][1]))
        if pooled.sigma > 1.0 or not math.isfinite(pooled.mean):
            continue
        density = as_measured(math.exp(pooled.mean), pooled.sigma, pooled.dof)
        out.append(OctaveNoise(2.0**octave, min(2.0 ** (octave + 1), nyquist), density))
    return tuple(out)


def _segments(parts: Sequence[FloatArray], rate_hz: float) -> tuple[FloatArray, FloatArray, int]:
    """Frequencies (k,), mean power (k,) and number of segments of one length that most holds have."""
    length = 1 << int(math.log2(max(SHORTEST, min(LONGEST_SEGMENT, float(np.median([len(p) for p in parts]))))))
    rows = [part[s : s + length] for part in parts for s in range(0, len(part) - length + 1, length)]
    stack = np.stack(rows)
    stack = stack - stack.mean(axis=1, keepdims=True)
    # A line's power in one ordinate depends on its phase there; the mean over segments does not.
    power = np.mean(cosine_transform(stack)[:, 1:] ** 2, axis=0) / rate_hz
    frequency: FloatArray = np.arange(1.0, length) * (rate_hz / (2.0 * length))
    return frequency, np.asarray(power), len(rows)
