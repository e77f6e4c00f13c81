"""Biases that drift along a curve of time, a line or a warm-up, beside the random walk that every session allows.

A walk decouples the poses that a warm-up connects: S and b of a sensor that warms up would be several times less
certain than the session determines them. Few poses may not show one: both hypotheses then share the covariance
(docs/model-session.md, 11.12e).
"""

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.estimate.session.observed import Observed
from trihedron.session.drift import TYPICAL
from trihedron.session.model import NOTHING
from trihedron.session.noise import ANYTHING, START_STRENGTHS, Strengths

UNLIKELY = 0.02
"""Probability of a drift, along whichever curve, below which it is left out of account."""
NEGLIGIBLE = 1e-3
"""Probability of one curve below which it is: it must change a parameter by 15 errors to widen it by a tenth."""
WARM_UPS = (0.1, 0.18, 0.32, 0.56, 1.0)
"""Time constants tried, four a decade, as fractions of the session: faster ones alone, one or two poses may as well be
disturbed; slower are a line. Where several are likely they share the covariance."""
Curve = tuple[FloatArray | None, FloatArray | None, list[float]]
"""Columns of three unknowns, one an axis, of force and rate in SI, and their prior sizes; empty: none."""
STEADY: Curve = (None, None, [])


@dataclass(frozen=True, eq=False)
class Likely:
    """A curve of a bias, its probability among all that are likely, and the likeliest strengths of noise beside it."""

    curve: Curve
    probability: float
    strengths: Strengths


def likely_curves(observed: Observed, core: _core.SessionFit, sensor: int) -> list[Likely]:
    """Curves of the bias of a sensor (0 the accelerometer, 1 the gyro) and none, likeliest first; a drift has one half
    a priori. ``core`` is the fit without one."""
    asked = [_columns(curve, sensor) for curve in _curves(observed)]
    # Also with noise as parts have it: a strong random walk absorbs a curve that low noise shows. Moves are believed as
    # in the fit, because their normalisation is part of the evidence.
    strengths = [core.strengths, (*START_STRENGTHS[:3], core.strengths[3])]
    found = core.candidate_gains(asked, [1.0], strengths)
    choice = float(np.log(len(asked)))
    if np.logaddexp.reduce([float(one[0].max()) for one in found]) - choice < np.log(UNLIKELY):
        return [Likely(STEADY, 1.0, core.strengths)]
    answers = core.evidence([NOTHING, *asked], strengths, ANYTHING)
    score = np.array([one[0] for one in answers]) - [0.0, *[choice] * len(asked)]
    share = np.exp(score - np.logaddexp.reduce(score))
    likely = [
        Likely(curve, float(p), one[1])
        for curve, p, one in zip([STEADY, *asked], share, answers, strict=True)
        if p > NEGLIGIBLE
    ]
    return sorted(likely, key=lambda one: -one.probability)


def with_curve(observed: Observed, core: _core.SessionFit, curve: Curve) -> Observed:
    """The session with a curve as three more unknowns, if any; ``core`` is a fit of it."""
    *sides, sigma = curve
    if not sigma:
        return observed
    raw = [
        np.zeros((len(known), 3, 3)) if of is None else np.einsum("ij,njk->nik", np.linalg.inv(scale), of)
        for known, of, scale in zip(
            (observed.force_effect, observed.rate_effect), sides, (core.force_scale, core.rate_scale), strict=True
        )
    ]
    return replace(
        observed,
        force_effect=np.concatenate([observed.force_effect, raw[0]], axis=2),
        rate_effect=np.concatenate([observed.rate_effect, raw[1]], axis=2),
        effect_sigma=np.append(observed.effect_sigma, sigma),
        n_drift=observed.n_drift + len(sigma),
    )


def _curves(observed: Observed) -> list[FloatArray]:
    """Shapes (n,) of a drift where effects act, zero on average over the static time, as the session's bias is."""
    lasts_s, time_s = observed.pose_lasts_s, observed.effect_time_s
    x = (time_s - observed.pose_time_s[0]) / float(observed.pose_time_s[-1] - observed.pose_time_s[0])
    out = [x, *(np.exp(-x / fraction) for fraction in WARM_UPS)]
    return [curve - np.average(curve[: len(lasts_s)], weights=lasts_s) for curve in out]


def _columns(curve: FloatArray, sensor: int) -> tuple[FloatArray | None, FloatArray | None, list[float]]:
    own, sigma = np.ascontiguousarray(curve[:, None, None] * np.eye(3)), [TYPICAL[sensor]] * 3
    return (own, None, sigma) if sensor == 0 else (None, own, sigma)
