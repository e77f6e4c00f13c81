"""The filter's model of an axis' noise, and tests of the innovations against it."""

from collections.abc import Iterator

import numpy as np

from trihedron import _core
from trihedron.arrays import AXES, BoolArray, FloatArray
from trihedron.probability import chdtrc, chdtri
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.kalman import AxisNoise, Consistency

SLOWEST_PER_SESSION, FASTEST_PER_POSE = 0.3, 6.0
"""Extreme inverse correlation times of flicker, times the length of session and of pose. With one Gauss-Markov process
per decade between them the Allan deviation follows flicker within 2 %."""


RAMP_PER_SESSION, RAMP_DAMPING = 0.1, 1.0 / np.sqrt(2.0)
"""ω₀ of the second-order ramp, times the length of the session, for a slope that lasts for all of it; ζ."""


def shaping_model(noise: AxisNoise, *, session_s: float, pose_s: float) -> _core.AxisKalmanModel:
    """Compiled shaping filter of one axis for a session of ``session_s`` with poses of about ``pose_s``; a reading is
    the exact mean over its pose (docs/kalman.md, eq. 4-8)."""
    slow, fast = SLOWEST_PER_SESSION / session_s, FASTEST_PER_POSE / pose_s
    n = max(2, int(np.ceil(np.log10(fast / slow))) + 1)
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
        flicker_rates=np.geomspace(slow, fast, n).tolist(),
        ramp_frequency=RAMP_PER_SESSION / session_s,
        ramp_damping=RAMP_DAMPING,
        averages=True,
    )


CONFIDENCE = 0.99
DIFFUSE_RATIO = 30.0
"""Ratio of an innovation's σ to the later ones' above which the diffuse start dominates it, and not the noise."""


def is_settled(innovation_sigma: FloatArray) -> BoolArray:
    """Innovations (n,) that the data predict; the σ of the others is dominated by the diffuse start."""
    typical = float(np.median(innovation_sigma[len(innovation_sigma) // 2 :]))
    return innovation_sigma <= DIFFUSE_RATIO * typical


def check_innovations(innovation: FloatArray, innovation_sigma: FloatArray) -> Consistency:
    """Mean of the normalised innovation squared, and Ljung-Box test of whiteness (docs/kalman.md, eq. 11-12).

    Parameters
    ----------
    innovation, innovation_sigma : (n,)
        One-step prediction errors and their predicted standard deviations, any unit.
    """
    z = (innovation / innovation_sigma)[is_settled(innovation_sigma)]
    n = len(z)
    if n == 0:
        return Consistency(float("nan"), 0.0, float("inf"), 0, 1.0, 0)
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = chdtri(n, 1.0 - tail) / n, chdtri(n, tail) / n
    n_lags = min(20, n // 5)
    power = float(z @ z)
    r = np.array([float(z[lag:] @ z[: n - lag]) / power for lag in range(1, n_lags + 1)]) if power > 0 else np.zeros(0)
    p = 1.0
    if len(r):
        q = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, n_lags + 1))))
        p = chdtrc(n_lags, q)
    return Consistency(power / n, low, high, n, p, n_lags, tuple(float(v) for v in r))


def consistency_findings(axis: int | None, seen: Consistency) -> Iterator[Finding]:
    """Findings where innovations contradict the noise model; ``axis`` None for the norm of all three."""
    case, name = ("norm", "") if axis is None else ("axis", AXES[axis])
    mean, low, high = seen.nis_mean, seen.nis_low, seen.nis_high
    if seen.n and mean > high:
        yield Finding.of(
            FindingCode.INNOVATIONS_TOO_LARGE,
            case,
            axis=name,
            nis_mean=mean,
            nis_low=low,
            nis_high=high,
            widening=np.sqrt(mean),
        )
    elif seen.n and mean < low:
        yield Finding.of(FindingCode.INNOVATIONS_TOO_SMALL, case, axis=name, nis_mean=mean, nis_low=low, nis_high=high)
    if seen.n_lags and seen.whiteness_p < 1.0 - CONFIDENCE:
        yield Finding.of(
            FindingCode.INNOVATIONS_CORRELATED,
            case,
            axis=name,
            whiteness_p=seen.whiteness_p,
            n_lags=seen.n_lags,
            autocorrelation_1=seen.autocorrelation[0],
        )
