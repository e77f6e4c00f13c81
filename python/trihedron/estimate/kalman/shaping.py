"""From the identified noise of an axis to the filter's shaping states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.records.kalman import AxisNoise

SLOWEST_PER_SESSION, FASTEST_PER_POSE = 0.3, 6.0
"""Extreme inverse correlation times, over those of the session and of a pose. With one Gauss-Markov process per decade
between them the Allan deviation follows flicker within 2 %."""


@dataclass(frozen=True)
class ShapingOptions:
    """How the noise becomes states (docs/kalman.md, eq. 4-8).

    ``flicker_rates_per_s`` are the inverse correlation times β of the Gauss-Markov processes for flicker: one for the
    article's filter, empty for as many as the session needs. ``ramp_frequency_rad_s`` is ω₀ of the second-order ramp, 0
    for one tenth of the session's inverse length: its slope then lasts for the whole session; ``ramp_damping`` is ζ.
    With ``averages`` a reading is the mean over its pose, exactly; without, it is the value at its end (the article).
    """

    flicker_rates_per_s: tuple[float, ...] = ()
    ramp_frequency_rad_s: float = 0.0
    ramp_damping: float = 1.0 / np.sqrt(2.0)
    averages: bool = True

    @classmethod
    def of_the_article(cls, session_s: float, pose_s: float) -> ShapingOptions:
        """Eight states: one Gauss-Markov process in the middle of the session's time scales, instantaneous readings."""
        return cls(flicker_rates_per_s=(1.0 / float(np.sqrt(session_s * pose_s)),), averages=False)


def shaping_model(
    noise: AxisNoise, options: ShapingOptions, *, session_s: float, pose_s: float
) -> _core.AxisKalmanModel:
    """Compiled shaping filter of one axis for a session of ``session_s`` with poses of about ``pose_s``."""
    rates = options.flicker_rates_per_s
    if not rates:
        slow, fast = SLOWEST_PER_SESSION / session_s, FASTEST_PER_POSE / pose_s
        n = max(2, int(np.ceil(np.log10(fast / slow))) + 1)
        rates = tuple(float(rate) for rate in np.geomspace(slow, fast, n))
    return _core.AxisKalmanModel(
        quantisation=noise.quantisation,
        white=noise.white,
        flicker=noise.flicker,
        walk=noise.walk,
        ramp=noise.ramp,
        gauss_markov=noise.gauss_markov,
        gauss_markov_rate=1.0 / noise.gauss_markov_time_s if noise.gauss_markov_time_s > 0 else 0.0,
        resolution=noise.resolution,
        dither=noise.sample_sigma,
        flicker_rates=list(rates),
        ramp_frequency=options.ramp_frequency_rad_s or 0.1 / session_s,
        ramp_damping=options.ramp_damping,
        averages=options.averages,
    )
