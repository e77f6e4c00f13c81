"""Does the filter believe the right amount? Tests of innovations, and of errors where the truth is known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import stats

from trihedron.arrays import AXES, FloatArray
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.kalman import Consistency

CONFIDENCE = 0.99
DIFFUSE_RATIO = 30.0
"""An innovation predicted this many times wider than the later ones tells of the diffuse start, not of noise."""


def is_settled(innovation_sigma: FloatArray) -> npt.NDArray[np.bool_]:
    """Which innovations (n,) were predicted by the data; the others only by the diffuse start."""
    typical = float(np.median(innovation_sigma[len(innovation_sigma) // 2 :]))
    settled: npt.NDArray[np.bool_] = innovation_sigma <= DIFFUSE_RATIO * typical
    return settled


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
    low, high = float(stats.chi2.ppf(tail, n)) / n, float(stats.chi2.ppf(1.0 - tail, n)) / n
    n_lags = min(20, n // 5)
    power = float(z @ z)
    r = np.array([float(z[lag:] @ z[: n - lag]) / power for lag in range(1, n_lags + 1)]) if power > 0 else np.zeros(0)
    p = 1.0
    if len(r):
        q = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, n_lags + 1))))
        p = float(stats.chi2.sf(q, n_lags))
    return Consistency(power / n, low, high, n, p, n_lags, tuple(float(v) for v in r))


def consistency_findings(axis: int | None, seen: Consistency) -> list[Finding]:
    """What an inconsistent filter tells about the noise it was given; ``axis`` None stands for all three."""
    out: list[Finding] = []
    name = "" if axis is None else AXES[axis]
    if seen.n and seen.nis_mean > seen.nis_high:
        out.append(
            Finding.of(
                FindingCode.INNOVATIONS_TOO_LARGE,
                "norm" if axis is None else "axis",
                axis=name,
                nis_mean=seen.nis_mean,
                nis_low=seen.nis_low,
                nis_high=seen.nis_high,
                widening=np.sqrt(seen.nis_mean),
            )
        )
    elif seen.n and seen.nis_mean < seen.nis_low:
        out.append(
            Finding.of(
                FindingCode.INNOVATIONS_TOO_SMALL,
                "norm" if axis is None else "axis",
                axis=name,
                nis_mean=seen.nis_mean,
                nis_low=seen.nis_low,
                nis_high=seen.nis_high,
            )
        )
    if seen.n_lags and seen.whiteness_p < 1.0 - CONFIDENCE:
        out.append(
            Finding.of(
                FindingCode.INNOVATIONS_COLOURED,
                "norm" if axis is None else "axis",
                axis=name,
                whiteness_p=seen.whiteness_p,
                n_lags=seen.n_lags,
                autocorrelation_1=seen.autocorrelation[0],
            )
        )
    return out
