"""Quantisation noise Q of a simulation against the recording's, by axis: static noise that rises with frequency."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import AXES
from trihedron.comparison.noise import Sampled
from trihedron.comparison.rows import NAMES, SENSORS, Sensor, difference, measured_row, remarked
from trihedron.estimate.noise.slow import Octaves
from trihedron.probability import NORMAL_95
from trihedron.records.diagnosis import NoiseDifference
from trihedron.records.pose_noise import Measured, PoseNoise
from trihedron.records.words import words

SHARE = 1.0 / 24.0
"""Share of alpha that white noise, corners, octaves, slow noise and the parameters leave."""
STANDS_OUT = 4.0
"""Standard errors of Q² above zero from which an axis shows it."""
LEAST_RATIO = 1.5
"""Ratio of Q from which it differs, as of an octave's density."""
FEWEST_OCTAVES = 4
LEAST_MODEL = 0.1
"""Smallest prediction, relative to the density, that an error is relative to."""


@dataclass(frozen=True)
class WhiteAndQuantisation:
    """N² [u²/Hz] and Q² [u² s²] of one axis, and the standard error of Q²."""

    white: float
    quantisation: float
    sigma: float

    @property
    def is_shown(self) -> bool:
        """Whether Q² exceeds zero by ``STANDS_OUT`` standard errors."""
        return self.quantisation > STANDS_OUT * self.sigma

    def measured(self) -> Measured:
        """Q with its 95 % interval, where it is shown."""
        value, log = math.sqrt(self.quantisation), 0.5 * self.sigma / self.quantisation
        return Measured(value, value * math.exp(-NORMAL_95 * log), value * math.exp(NORMAL_95 * log), log)


def white_and_quantisation(axis: PoseNoise) -> WhiteAndQuantisation | None:
    """N² + 4 Q² rate sin²(πf/rate) fitted to the densities of the octaves, errors relative to the model.

    Rounding of an integral leaves the first difference over the time step of white noise of variance Q², with an Allan
    variance of 3 Q²/τ² (docs/noise.md, 7).
    ``None`` where a low-pass filters the axis, or octaves are too few.
    """
    octaves = [o for o in axis.octaves if o.high_hz <= 0.5 * axis.rate_hz * (1.0 + 1e-9)]
    # A corner above half the rate is no low-pass, but the shape nearest to a rise.
    is_filtered = axis.corner_hz is not None and axis.corner_hz.value < 0.5 * axis.rate_hz
    if len(octaves) < FEWEST_OCTAVES or is_filtered:
        return None
    seen = Octaves(octaves)
    rising = np.array([4.0 * axis.rate_hz * _mean_sin2(o.low_hz, o.high_hz, axis.rate_hz) for o in octaves])
    _, white, quantisation = seen.fitted(rising)
    model = np.maximum(white + quantisation * rising, LEAST_MODEL * seen.density)
    # The misfit of the shape widens the error of its size, beside a free floor.
    weight = 1.0 / (model * seen.sigma) ** 2
    spread = (seen.density - white - quantisation * rising) ** 2 @ weight
    across = rising - weight @ rising / weight.sum()
    excess = max(float(spread) / (len(octaves) - 2), 1.0)
    return WhiteAndQuantisation(white, quantisation, math.sqrt(excess / float(weight @ across**2)))


def _mean_sin2(low_hz: float, high_hz: float, rate_hz: float) -> float:
    """Mean of sin²(πf/rate) between two frequencies."""
    a, b = 2.0 * math.pi * low_hz / rate_hz, 2.0 * math.pi * high_hz / rate_hz
    return 0.5 - 0.5 * (math.sin(b) - math.sin(a)) / (b - a)


def quantisation_noise(model: Sampled, recording: Sampled, *, alpha: float) -> tuple[NoiseDifference, ...]:
    """Rows of the term Q where either side shows it; ``alpha`` is the chance that any figure of one unit differs."""
    return tuple(
        row
        for sensor in SENSORS
        for axis, m, r in zip(AXES, model.noise.get(sensor, ()), recording.noise.get(sensor, ()), strict=False)
        for row in _axis(sensor, axis, m, r, alpha * SHARE / (2 * len(AXES)))
    )


def _axis(sensor: Sensor, axis: str, m: PoseNoise, r: PoseNoise, alpha: float) -> Iterator[NoiseDifference]:
    made, seen = white_and_quantisation(m), white_and_quantisation(r)
    if made is None or seen is None or not (made.is_shown or seen.is_shown):
        return
    unit = "m/s" if sensor == "accelerometer" else "rad"
    if made.is_shown and seen.is_shown:
        row = measured_row(sensor, axis, "Q", (made.measured(), seen.measured()), unit, LEAST_RATIO, alpha)
        yield remarked(row, "quantisation-ratio", sensor=NAMES[sensor], axis=axis)
        return
    apart = abs(made.quantisation - seen.quantisation)
    p_value = math.erfc(apart / math.hypot(made.sigma, seen.sigma) / math.sqrt(2.0))
    less, more = sorted((made, seen), key=lambda one: one.quantisation)
    is_off = p_value < alpha and more.quantisation > LEAST_RATIO**2 * (less.quantisation + 2.0 * less.sigma)
    side = "model" if made.is_shown else "recording"
    remark = words("quantisation-once", side=side, sensor=NAMES[sensor], axis=axis)
    values = math.sqrt(made.quantisation), math.sqrt(seen.quantisation)
    yield difference(sensor, "Q", values, unit, remark if is_off else "", axis=axis, p_value=p_value)
