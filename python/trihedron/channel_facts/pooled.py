"""Pooling of figures over many poses, and the ratio of two such figures."""

import math
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import TINY, BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.probability import fdtrc, stdtrit
from trihedron.quantiles import MAD_TO_SIGMA
from trihedron.records.pose_noise import Measured, Ratio

MOST_LEFT_OUT = 0.25
"""Share of poses that may be excluded for noise far above the rest's: a disturbed pose, not another sensor."""
UNKNOWN = 50.0
"""Logarithm at which an interval ends: 21 decades either way."""
FAR = 5.0
"""Robust standard deviations beyond which a pose is disturbed: one undisturbed pose in a million."""


@dataclass(frozen=True)
class Pooled:
    """Mean logarithm over poses, its standard error with its degrees of freedom, and the scatter of the poses."""

    mean: float
    sigma: float
    dof: float
    scatter: float


def robust_poses(variance: FloatArray, dof: FloatArray) -> BoolArray:
    """(k,) poses whose noise is not far above that of the others; at most a quarter is excluded, the worst first."""
    keep = np.asarray(variance > 0.0)
    if np.count_nonzero(keep) < 4:
        return keep if keep.any() else np.ones(len(variance), dtype=bool)
    logs = np.log(np.maximum(variance, TINY))
    centre = float(np.median(logs[keep]))
    spread = MAD_TO_SIGMA * float(np.median(np.abs(logs[keep] - centre)))
    score = (logs - centre) / np.sqrt(np.maximum(spread**2, 2.0 / dof))
    worst = np.argsort(-score)[: int(MOST_LEFT_OUT * len(variance))]
    keep[worst[score[worst] > FAR]] = False
    return keep


def pooled_logarithm(values: FloatArray, dof: FloatArray) -> Pooled:
    """Mean logarithm of chi-squared ``values`` (k,) over ``dof`` (k,), with a scatter of the poses.

    The scatter is that of DerSimonian and Laird (1986). Where it is positive, the standard error is estimated from the
    k poses alone and has a t distribution.
    """
    from scipy.special import digamma, polygamma

    good = (values > 0.0) & (dof > 0.0)
    if not good.any():
        return Pooled(-math.inf, math.inf, 1.0, 0.0)
    half = 0.5 * dof[good]
    logs = np.log(values[good]) - (digamma(half) - np.log(half))
    own = np.asarray(polygamma(1, half))
    k = len(logs)
    weight = 1.0 / own
    mean = float(weight @ logs / weight.sum())
    excess = float(weight @ (logs - mean) ** 2) - (k - 1)
    between = max(0.0, excess / float(weight.sum() - (weight**2).sum() / weight.sum())) if k > 1 else 0.0
    weight = 1.0 / (own + between)
    mean = float(weight @ logs / weight.sum())
    sigma = 1.0 / math.sqrt(float(weight.sum()))
    # The part of the error due to the scatter is estimated from k - 1 numbers.
    share = between / (between + 1.0 / float(np.mean(1.0 / own)))
    degrees = (k - 1) / share**2 if share > 0.0 else math.inf
    if not np.isfinite(sigma):
        degrees = 1.0
    return Pooled(mean, sigma, float(degrees), math.sqrt(between))


def as_measured(value: float, sigma_log: float, dof: float) -> Measured:
    """A positive value with the 95 % interval of its logarithm."""
    reach = min(_quantile(dof) * sigma_log, UNKNOWN)
    return Measured(value, value * math.exp(-reach), value * math.exp(reach), sigma_log, dof)


def ratio_of(one: Measured, other: Measured) -> Ratio:
    """Ratio of two figures; degrees of freedom after Welch and Satterthwaite.

    Raises ``ValueError`` when a figure is not positive.
    """
    if not (one.value > 0.0 and other.value > 0.0):
        raise InputError("only positive figures have a ratio")
    squares = (one.sigma_log**2, other.sigma_log**2)
    sigma = math.sqrt(sum(squares))
    parts = sum(s**2 / d for s, d in zip(squares, (one.dof, other.dof), strict=True) if math.isfinite(d))
    dof = sigma**4 / parts if parts > 0.0 else math.inf
    log_ratio = math.log(one.value / other.value)
    reach = _quantile(dof) * sigma
    p_value = fdtrc(1.0, min(dof, 1e9), (log_ratio / sigma) ** 2) if sigma > 0.0 else float(log_ratio == 0.0)
    value = math.exp(log_ratio)
    return Ratio(value, value * math.exp(-reach), value * math.exp(reach), p_value)


def _quantile(dof: float) -> float:
    return stdtrit(min(dof, 1e9), 0.975)


def root_of(power: Measured, factor: float) -> Measured:
    """The amplitude whose square is a power times ``factor``."""
    value, lower, upper = (math.sqrt(factor * p) for p in (power.value, power.lower, power.upper))
    return Measured(value, lower, upper, 0.5 * power.sigma_log, power.dof)
