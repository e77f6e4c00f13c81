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
from trihedron.estimate.noise.hold_lines import lines_of_holds, without_lines
from trihedron.estimate.noise.hold_statistics import Pooled, as_measured, pooled_logarithm, robust_holds, root_of
from trihedron.estimate.noise.low_pass import LowPass, Spectrum, densities_below, low_passes, undisturbed
from trihedron.estimate.noise.spectrum import cosine_transform
from trihedron.ranges import ranges_of
from trihedron.records.hold_noise import HoldLine, HoldNoise, Measured, OctaveNoise
from trihedron.refused import RefusedError

SHORTEST = 32
"""Readings of a hold that is used: fewer hold no octave below the uppermost two."""
LEAST_DITHER = 0.4
"""Noise over step below which the rounding is not noise of step²/12 any more, and what lies under it is hidden."""
LAGS = 8
"""Lags over which squared differences are correlated: filters of a sensor remember no more readings."""
LONGEST_SEGMENT = 4096
FEWER = 4.0 / 3.0
"""So many more readings are worth half the resolution at low frequencies."""
FEWEST_HOLDS = 3
"""Holds that must show an octave, where there are as many: the scatter of one is not known."""
LEVEL_KNOWN = 1.0
"""Standard error of the logarithm of a density below a corner, from which on the differences of readings say more."""


def noise_of_holds(
    readings: npt.ArrayLike,
    rate_hz: float,
    holds: Sequence[tuple[int, int]],
    *,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
) -> tuple[HoldNoise, ...]:
    """Noise of every axis inside the holds of a session, each figure with its interval.

    The channels are those of one sensor: they share a low-pass unless their spectra deny it.

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
    axes = [_Axis.of(x[:, c], rate_hz, holds, names[c]) for c in range(channels)]
    filters = low_passes([axis.spectrum for axis in axes], rate_hz)
    white = _white(axes, filters, rate_hz)
    return tuple(
        HoldNoise(
            name=name,
            unit=unit,
            rate_hz=rate_hz,
            n_holds=len(axis.parts),
            n_readings=sum(len(part) for part in axis.parts),
            white=density,
            reading_sigma=math.sqrt(max(axis.total - axis.rounding, 0.0)) if axis.is_dithered else 0.0,
            step=axis.step,
            octaves=_octaves(axis.parts, rate_hz),
            lines=axis.lines,
            corner_hz=one.corner_hz,
            corner_above_hz=one.above_hz,
            scatter=axis.pooled.scatter,
            corner_shape=one.shape,
        )
        for axis, one, density, name, unit in zip(axes, filters, white, names, units, strict=True)
    )


@dataclass(frozen=True, eq=False)
class _Axis:
    """Holds of one axis without disturbed ones and lines, and what is pooled over them."""

    parts: list[FloatArray]
    step: float
    lines: tuple[HoldLine, ...]
    pooled: Pooled
    spectrum: Spectrum

    @classmethod
    def of(cls, x: FloatArray, rate_hz: float, holds: Sequence[tuple[int, int]], name: str) -> _Axis:
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
        pooled = pooled_logarithm(power.variance, power.dof)
        whole = Spectrum(*_segments(parts, rate_hz, most=True), step**2 / 12.0 / rate_hz, pooled.scatter)
        beside = whole.beside([line.frequency_hz for line in lines])
        return cls(parts, step, lines, pooled, undisturbed(beside, rate_hz))

    @property
    def rounding(self) -> float:
        return self.step**2 / 12.0

    @property
    def total(self) -> float:
        """Half the mean squared difference of a typical hold."""
        return math.exp(self.pooled.mean)

    @property
    def is_dithered(self) -> bool:
        """Whether differences of readings are more than rounding."""
        return self.total > 0.0 and self._dithers(self.total - self.rounding)

    def _dithers(self, variance: float) -> bool:
        return self.step == 0.0 or variance > (LEAST_DITHER * self.step) ** 2

    def of_differences(self, rate_hz: float) -> Measured | None:
        """White density where the spectrum is flat: half the mean squared difference less rounding."""
        if not self.is_dithered:
            return None
        # The rounding is known: what is left carries the whole error.
        share = self.total / (self.total - self.rounding)
        sensor = as_measured(self.total - self.rounding, share * self.pooled.sigma, self.pooled.dof)
        return root_of(sensor, 1.0 / rate_hz)

    def of_level(self, density: float, sigma_log: float, corner_hz: float, rate_hz: float) -> Measured | None:
        """White density below a filter's corner, of a typical hold.

        ``density`` is that of the mean over holds, which loud ones fill: how far a typical one lies beneath it is read
        off the same band, for holds differ there by a hand's tremor too, and by less in their differences.
        """
        if not (density > 0.0 and self._dithers(2.0 * corner_hz * density)):
            return None
        lowest = float(self.spectrum.frequency_hz[0])
        power, ordinates = _band_power(self.parts, rate_hz, lowest, corner_hz)
        pooled = pooled_logarithm(power, ordinates)
        typical = 1.0
        if pooled.scatter > 0.0:
            typical = min(math.exp(pooled.mean) * float(ordinates.sum()) / float(power @ ordinates), 1.0)
        own = pooled.scatter**2 / max(len(power), 1)
        sigma = math.sqrt(sigma_log**2 + own)
        share = own / sigma**2
        dof = max(len(power) - 1, 1) / share**2 if share > 0.0 else math.inf
        return root_of(as_measured(density * typical, sigma, dof), 1.0)


def _white(axes: Sequence[_Axis], filters: Sequence[LowPass], rate_hz: float) -> list[Measured | None]:
    """Densities of white noise: below the corner where a filter shows, of all frequencies where none does."""
    out = [axis.of_differences(rate_hz) for axis in axes]
    for one in dict.fromkeys(filters):
        if one.corner_hz is None:
            continue
        sharing = [k for k, f in enumerate(filters) if f == one]
        levels = densities_below([axes[k].spectrum for k in sharing], one, rate_hz)
        for k, level in zip(sharing, levels, strict=True):
            if not level[1] < LEVEL_KNOWN:
                continue  # the band below the corner is too narrow, or too uneven, to say
            out[k] = axes[k].of_level(*level, one.corner_hz.value, rate_hz)
    return out


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


def _band_power(
    parts: Sequence[FloatArray], rate_hz: float, low_hz: float, high_hz: float
) -> tuple[FloatArray, FloatArray]:
    """(k,) mean power of each hold between two frequencies, and its number of ordinates; holds too short left out."""
    power, ordinates = [], []
    for part in parts:
        first, last = (math.ceil(f * 2.0 * len(part) / rate_hz) for f in (low_hz, high_hz))
        inside = cosine_transform(part - part.mean())[max(first, 1) : max(last, 2)] ** 2 / rate_hz
        if len(inside):
            power.append(float(inside.mean()))
            ordinates.append(float(len(inside)))
    return np.array(power), np.array(ordinates)


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


def _segments(parts: Sequence[FloatArray], rate_hz: float, *, most: bool = False) -> tuple[FloatArray, FloatArray, int]:
    """Frequencies (k,), mean power (k,) and number of segments of one length that most holds have.

    With ``most``, of half that length where more readings are in such segments by a third.
    """
    length = 1 << int(math.log2(max(SHORTEST, min(LONGEST_SEGMENT, float(np.median([len(p) for p in parts]))))))

    def used(n: int) -> int:
        return sum(len(part) // n * n for part in parts)

    if most and length > SHORTEST and used(length // 2) > used(length) * FEWER:
        length //= 2
    rows = [part[s : s + length] for part in parts for s in range(0, len(part) - length + 1, length)]
    stack = np.stack(rows)
    stack = stack - stack.mean(axis=1, keepdims=True)
    # A line's power in one ordinate depends on its phase there; the mean over segments does not.
    power = np.mean(cosine_transform(stack)[:, 1:] ** 2, axis=0) / rate_hz
    frequency: FloatArray = np.arange(1.0, length) * (rate_hz / (2.0 * length))
    return frequency, np.asarray(power), len(rows)
