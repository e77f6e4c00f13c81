"""Noise inside the poses of a session: white density, spectrum by octaves, lines, filter corner, resolution.

A session's poses are seconds long and differ slightly (temperature, gravity on the axis, a hand): every figure is a
mean of logarithms over poses, whose error comes from the number of readings and from the scatter between poses. Two
logs are then compared figure by figure (:func:`ratio_of`). docs/noise.md, section 7.
"""

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.channel_facts.low_pass import LEAKAGE, Spectrum, gain_of, low_passes
from trihedron.channel_facts.pooled import as_measured, pooled_logarithm, root_of
from trihedron.channel_facts.static_axes import StaticAxis
from trihedron.records.channel_facts import LowPass
from trihedron.records.pose_noise import Measured, OctaveNoise, PoseNoise
from trihedron.transforms import cosine_transform

SHAPE_TERMS = 2
EVEN_POWERS = 2.0 * np.arange(1, SHAPE_TERMS + 1)[:, np.newaxis]
"""Even powers of frequency by which the shape below the corner may differ from the best of the list: for running means,
Butterworth filters to order 4 and their squares the density's error is then 1.3 % at most (2.6 % with one)."""
SHAPE_ERROR = 0.01
"""Standard uncertainty of the density's logarithm due to that error."""
FIRST_SLOW = 1e-3
"""Slow noise relative to the density with which the search begins, at the lowest frequency."""


def densities_below(spectra: Sequence[Spectrum], low_pass: LowPass, rate_hz: float) -> list[tuple[float, float]]:
    """White density [u²/Hz] of each axis below a common corner, and the standard error of its logarithm.

    Whittle likelihood of the ordinates below the corner: density times the gain of ``low_pass`` times exp of an even
    polynomial of frequency common to the axes, plus each axis' slow noise, relative to its density, and rounding. The
    level at frequency zero is returned: the uncertainty of the filter's shape is included. ``low_pass`` has a corner.
    """
    # Imported here: commands that read a log start faster.
    from scipy.optimize import least_squares

    assert low_pass.corner_hz is not None
    corner, n = low_pass.corner_hz.value, len(spectra)
    bins = [[values[s.bins[0] <= corner] for values in s.bins] for s in spectra]
    gains = [gain_of(frequency, corner, low_pass.shape, rate_hz) for frequency, _, _ in bins]
    slow = [s.beneath(frequency) for s, (frequency, _, _) in zip(spectra, bins, strict=True)]
    sizes = np.cumsum([one.shape[1] for one in slow])

    def residuals(x: FloatArray) -> FloatArray:
        """Roots of the deviance of every bin, for the log densities, the polynomial and the sizes of slow noise."""
        bend, out = x[n : n + SHAPE_TERMS], []
        beneath = np.split(x[n + SHAPE_TERMS :], sizes[:-1])
        for k, (frequency, power, count) in enumerate(bins):
            shape = gains[k] * np.exp(bend @ (frequency / corner) ** EVEN_POWERS)
            ratio = power / (np.exp(x[k]) * (shape + slow[k] @ beneath[k]) + spectra[k].rounding)
            deviance = np.maximum(ratio - 1.0 - np.log(np.maximum(ratio, TINY)), 0.0)
            out.append(np.sign(ratio - 1.0) * np.sqrt(count * deviance))
        return np.concatenate(out)

    level = [math.log(max(float(np.median(b[1] / gain)), TINY)) for b, gain in zip(bins, gains, strict=True)]
    start = np.array([*level, *[0.0] * SHAPE_TERMS, *[FIRST_SLOW] * sizes[-1]])
    lowest = np.r_[np.full(n + SHAPE_TERMS, -np.inf), np.zeros(sizes[-1])]
    found = least_squares(residuals, start, bounds=(lowest, np.inf))
    free = np.flatnonzero(found.active_mask == 0)
    J = np.asarray(found.jac, dtype=np.float64)[:, free]
    covariance = np.zeros((len(start), len(start)))
    covariance[np.ix_(free, free)] = np.linalg.pinv(J.T @ J, rcond=1e-12)
    # Leakage from below the band: at most the level at its lower end, falling with frequency squared at least.
    leak = np.array([(s.frequency_hz[0] / corner) ** 2 if s.slow == LEAKAGE else 0.0 for s in spectra])
    sigma = np.sqrt(np.diag(covariance)[:n] + SHAPE_ERROR**2 + leak**2)
    return [(float(np.exp(a)), float(s)) for a, s in zip(found.x[:n], sigma, strict=True)]


FEWEST_POSES = 3
"""Fewest poses with an octave, where there are as many: one pose does not show the scatter."""
LEVEL_KNOWN = 1.0
"""Largest standard error of the log density below a corner; above it the differences of readings are used."""


def noise_of_poses(readings: FloatArray, rate_hz: float, poses: Sequence[tuple[int, int]]) -> tuple[PoseNoise, ...]:
    """Noise of every axis inside the poses of a session, each figure with its interval.

    The channels of ``readings`` (n, channels), raw, are those of one sensor: they share a low-pass filter unless their
    spectra contradict it. NaN marks a missing reading, at which ``poses`` (start, stop) are divided. Raises
    ``InputError`` when no pose has 32 readings in a row.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.random.default_rng(1).normal(size=(5000, 1))
    >>> axis = noise_of_poses(x, 100.0, [(k, k + 400) for k in range(0, 5000, 500)])[0]
    >>> axis.white.lower < 0.1 < axis.white.upper, axis.corner_hz
    (True, None)
    """
    axes = [StaticAxis.of(column, rate_hz, poses, f"channel {c + 1}") for c, column in enumerate(readings.T)]
    filters = low_passes([axis.spectrum for axis in axes], rate_hz)
    white = _white(axes, filters, rate_hz)
    return tuple(
        PoseNoise(
            rate_hz=rate_hz,
            white=density,
            reading_sigma=math.sqrt(max(axis.total - axis.rounding, 0.0)) if axis.is_dithered else 0.0,
            step=axis.step,
            octaves=_octaves(axis.parts, rate_hz),
            corner_hz=one.corner_hz,
            corner_above_hz=one.above_hz,
            corner_shape=one.shape,
        )
        for axis, one, density in zip(axes, filters, white, strict=True)
    )


def _white(axes: Sequence[StaticAxis], filters: Sequence[LowPass], rate_hz: float) -> list[Measured | None]:
    """White noise densities: below the corner where a filter is detected, else from all frequencies."""
    out = [_of_differences(axis, rate_hz) for axis in axes]
    for one in dict.fromkeys(filters):
        if one.corner_hz is None:
            continue
        sharing = [k for k, f in enumerate(filters) if f == one]
        levels = densities_below([axes[k].spectrum for k in sharing], one, rate_hz)
        for k, level in zip(sharing, levels, strict=True):
            if not level[1] < LEVEL_KNOWN:
                continue  # the band below the corner is too narrow or too uneven
            out[k] = _of_level(axes[k], *level, one.corner_hz.value, rate_hz)
    return out


def _band_power(
    parts: Sequence[FloatArray], rate_hz: float, low_hz: float, high_hz: float
) -> tuple[FloatArray, FloatArray]:
    """(k,) mean power of each pose between two frequencies, and its number of ordinates; short poses are skipped."""
    bands = []
    for part in parts:
        first, last = (math.ceil(f * 2.0 * len(part) / rate_hz) for f in (low_hz, high_hz))
        bands.append(cosine_transform(part - part.mean())[max(first, 1) : max(last, 2)] ** 2 / rate_hz)
    bands = [band for band in bands if len(band)]
    return np.array([band.mean() for band in bands]), np.array([float(len(band)) for band in bands])


def _of_differences(axis: StaticAxis, rate_hz: float) -> Measured | None:
    """White density of a flat spectrum: half the mean squared difference of readings less the variance of rounding."""
    if not axis.is_dithered:
        return None
    # The variance of rounding is known: the rest has the whole error.
    share = axis.total / (axis.total - axis.rounding)
    sensor = as_measured(axis.total - axis.rounding, share * axis.pooled.sigma, axis.pooled.dof)
    return root_of(sensor, 1.0 / rate_hz)


def _of_level(axis: StaticAxis, density: float, sigma_log: float, corner_hz: float, rate_hz: float) -> Measured | None:
    """White density below a filter's corner, of a typical pose.

    ``density`` is that of the mean over poses, which noisy ones dominate. The ratio of a typical pose to it is measured
    in the same band: there poses also differ by tremor of a hand, more than in the differences of readings.
    """
    if not (density > 0.0 and axis.dithers(2.0 * corner_hz * density)):
        return None
    lowest = float(axis.spectrum.frequency_hz[0])
    power, ordinates = _band_power(axis.parts, rate_hz, lowest, corner_hz)
    pooled = pooled_logarithm(power, ordinates)
    typical = 1.0
    if pooled.scatter > 0.0:
        typical = min(math.exp(pooled.mean) * float(ordinates.sum()) / float(power @ ordinates), 1.0)
    own = pooled.scatter**2 / max(len(power), 1)
    sigma = math.sqrt(sigma_log**2 + own)
    share = own / sigma**2
    dof = max(len(power) - 1, 1) / share**2 if share > 0.0 else math.inf
    return root_of(as_measured(density * typical, sigma, dof), 1.0)


def _octaves(parts: Sequence[FloatArray], rate_hz: float) -> tuple[OctaveNoise, ...]:
    """Mean power in octaves between powers of 2 Hz, over the poses with at least four ordinates in the octave."""
    nyquist, out = rate_hz / 2.0, []
    lowest = rate_hz / (2.0 * max(len(part) for part in parts))
    # Whole octaves only, or the part below Nyquist where it is most of one.
    for octave in range(math.floor(math.log2(lowest)), math.floor(math.log2(nyquist / math.sqrt(2.0))) + 1):
        low = 2.0**octave
        whole = [part for part in parts if rate_hz / (2.0 * len(part)) <= 1.2 * low]
        power, ordinates = _band_power(whole, rate_hz, low, 2.0 * low)
        power, ordinates = power[ordinates >= 4], ordinates[ordinates >= 4]
        # A single long pose, perhaps still held by hand, does not determine the sensor's low octave.
        if len(power) < max(min(FEWEST_POSES, len(parts)), 1):
            continue
        pooled = pooled_logarithm(power, ordinates)
        if pooled.sigma > 1.0 or not math.isfinite(pooled.mean):
            continue
        out.append(
            OctaveNoise(low, min(2.0 * low, nyquist), as_measured(math.exp(pooled.mean), pooled.sigma, pooled.dof))
        )
    return tuple(out)
