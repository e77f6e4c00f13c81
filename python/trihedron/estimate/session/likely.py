"""Causes beside noise and random walks, each decided by its evidence (docs/model-session.md, 11.12e): a g-sensitivity
of the gyro, curves of time along which either bias drifts.

A walk absorbs any of them, but it decouples the poses that they connect: S and b would be several times less certain.
Few poses may not show one: all that is likely then shares the covariance.
"""

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.estimate.session.observed import Observed
from trihedron.session.drift import PER_FORCE, TYPICAL, by_force
from trihedron.session.model import NOTHING
from trihedron.session.noise import ANYTHING, START_STRENGTHS, Strengths

UNLIKELY = 0.02
"""Probability of a cause, in whichever shape, below which it is left out of account."""
NEGLIGIBLE = 1e-3
"""Probability of one shape below which it is: it must change a parameter by 15 errors to widen it by a tenth."""
WARM_UPS = (0.1, 0.18, 0.32, 0.56, 1.0)
"""Time constants tried, four a decade, as fractions of the session: faster ones alone, one or two poses may as well be
disturbed; slower are a line. Where several are likely they share the covariance."""
CAUSES = ("gyro-g-sensitivity", "accel-bias-drift", "gyro-bias-drift")
"""In the order in which they are decided: the strongest first."""
Columns = tuple[FloatArray | None, FloatArray | None, list[float]]
"""Columns of force and rate in SI by some unknowns, and their prior sizes; empty: none."""


@dataclass(frozen=True, eq=False)
class Likely:
    """A shape of a cause, its probability among all that are likely, and the likeliest strengths of noise beside it."""

    columns: Columns
    probability: float
    strengths: Strengths


def likely_shapes(observed: Observed, core: _core.SessionFit, cause: str) -> list[Likely]:
    """Shapes of a cause and none, likeliest first; a cause has one half a priori. ``core`` is the fit without it."""
    asked = _shapes(observed, core, cause)
    # Also with noise as parts have it: a strong random walk absorbs a curve that low noise shows. Moves are believed as
    # in the fit, because their normalisation is part of the evidence.
    strengths = [core.strengths, (*START_STRENGTHS[:3], core.strengths[3])]
    found = core.candidate_gains(asked, [1.0], strengths)
    choice = float(np.log(len(asked)))
    # Stronger noise helps the fit without it no further: its strengths are already those of largest evidence.
    if len(asked) == 1 and found[0][0][0, 0] > -np.log(NEGLIGIBLE):
        return [Likely(asked[0], 1.0, (*START_STRENGTHS[:3], (1.0, core.strengths[3][1])))]
    if np.logaddexp.reduce([float(one[0].max()) for one in found]) - choice < np.log(UNLIKELY):
        return [Likely(NOTHING, 1.0, core.strengths)]
    answers = core.evidence([NOTHING, *asked], strengths, ANYTHING)
    score = np.array([one[0] for one in answers]) - [0.0, *[choice] * len(asked)]
    share = np.exp(score - np.logaddexp.reduce(score))
    likely = [
        Likely(columns, float(p), one[1])
        for columns, p, one in zip([NOTHING, *asked], share, answers, strict=True)
        if p > NEGLIGIBLE
    ]
    return sorted(likely, key=lambda one: -one.probability)


def with_columns(observed: Observed, core: _core.SessionFit, cause: str, columns: Columns) -> Observed:
    """The session with the columns of a cause as more unknowns, if any; ``core`` is a fit of it."""
    *sides, sigma = columns
    if not sigma:
        return observed
    raw = [
        np.zeros((len(known), 3, len(sigma))) if of is None else np.linalg.inv(scale) @ of
        for known, of, scale in zip(
            (observed.force_effect, observed.rate_effect), sides, (core.force_scale, core.rate_scale), strict=True
        )
    ]
    first = len(observed.effect_sigma)
    return replace(
        observed,
        force_effect=np.concatenate([observed.force_effect, raw[0]], axis=2),
        rate_effect=np.concatenate([observed.rate_effect, raw[1]], axis=2),
        effect_sigma=np.append(observed.effect_sigma, sigma),
        causes=observed.causes | {cause: slice(first, first + len(sigma))},
    )


def _shapes(observed: Observed, core: _core.SessionFit, cause: str) -> list[Columns]:
    if cause == "gyro-g-sensitivity":
        force = observed.effect_force @ np.asarray(core.force_scale).T + np.asarray(core.force_bias)
        return [(None, by_force(force), [PER_FORCE] * 9)]
    sensor = int(cause == "gyro-bias-drift")
    each = [curve[:, None, None] * np.eye(3) for curve in _curves(observed)]
    sigma = [TYPICAL[sensor]] * 3
    return [(None, one, sigma) if sensor else (one, None, sigma) for one in each]


def _curves(observed: Observed) -> list[FloatArray]:
    """Shapes (n,) of a drift where effects act, zero on average over the static time, as the session's bias is."""
    lasts_s, time_s = observed.pose_lasts_s, observed.effect_time_s
    x = (time_s - observed.pose_time_s[0]) / float(observed.pose_time_s[-1] - observed.pose_time_s[0])
    out = [x, *(np.exp(-x / fraction) for fraction in WARM_UPS)]
    return [curve - np.average(curve[: len(lasts_s)], weights=lasts_s) for curve in out]
