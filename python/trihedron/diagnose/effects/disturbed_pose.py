"""A pose that was pushed or not still: the experiment, not the sensor."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, force_only, per_axis
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.observations import Observations
from trihedron.diagnose.within_static import hold_scatter
from trihedron.records.diagnosis import EffectParameter, Where

MOST = 0.25
"""If more than a quarter of the poses are restless it is not a pose that was disturbed but the place that shakes."""


BUMP_SIGMA = 7.0
"""A tenth of a second must leave the line through its surroundings by this much: drift inside a hold does not."""


def _is_bump(obs: Observations, span: tuple[float, float]) -> bool:
    """Whether the readings of a stretch leave the straight line from before to after it."""
    rate = obs.recording.rate_hz
    a, b = (int(k) for k in np.searchsorted(obs.time_s, span))
    side = max(int(0.5 * rate), 5)
    block = max(int(0.1 * rate), 2)
    first, last = max(a - side, 0), min(b + side, len(obs.time_s))
    pairs = [(obs.raw_force, obs.force_density)]
    if obs.raw_rate is not None and obs.rate_density is not None:
        pairs.append((obs.raw_rate, obs.rate_density))
    for values, density in pairs:
        x = values[first:last]
        n = len(x) // block
        if n < 4:
            return True
        means = x[: n * block].reshape(n, block, 3).mean(axis=1)
        k = np.arange(n)
        outer = (k < max(side // block, 2)) | (k >= n - max(side // block, 2))
        line = np.polynomial.polynomial.polyfit(k[outer], means[outer], 1)
        away = means - (line[0] + np.outer(k, line[1]))
        if (np.abs(away) > BUMP_SIGMA * density * np.sqrt(rate / block)).any():
            return True
    return False


class DisturbedPose(DirectEffect):
    """A bump seen inside the hold, or one pose with an acceleration of its own."""

    id = "disturbed-pose"
    mechanism = "one pose was not still or was pushed"
    experiment = "repeat that pose"
    repeatable = True
    is_local = True

    def find(self, context: Context) -> Evidence | None:
        obs = context.obs
        scatter = hold_scatter(obs)
        own = np.array([not hold.is_unsteady for hold in obs.segments.holds])
        loud = own[:, None] & (scatter.ratio > 2.0) & (scatter.p_value * scatter.p_value.size < 1e-6)
        restless = sorted(set(np.flatnonzero(loud.any(axis=1)).tolist()))
        bumped = [span for span in obs.bumped_s if _is_bump(obs, span)]
        if not bumped and not restless:
            return None
        if len(restless) > MOST * obs.n_holds:
            return None
        t = obs.time_s
        holds = obs.segments.holds
        spans = tuple(bumped) + tuple((float(t[holds[i].start]), float(t[holds[i].stop - 1])) for i in restless)
        # A nuisance that the twin has already cut out: it ranks behind whatever the fit gains by.
        strength = 10.0 * (len(bumped) + len(restless))
        parts = []
        if bumped:
            parts.append("bumped at " + ", ".join(f"{a:.1f} s" for a, _ in bumped[:4]))
        if restless:
            parts.append("restless: pose " + ", ".join(str(i) for i in restless[:4]))
        parameters = tuple(EffectParameter("pose_at", 0.5 * (a + b), 0.5 * max(b - a, 0.1), "s") for a, b in spans[:6])
        return Evidence(
            1e-30, strength, parameters, f"Not every pose was still ({'; '.join(parts)}).", "within-static",
            Where((), tuple(f"hold {i}" for i in restless), spans),
        )  # fmt: skip

    def variants(self, context: Context) -> list[Variant]:
        out = []
        for i in range(context.obs.n_holds):
            columns = np.zeros((context.n_points, 3, 3))
            columns[i] = np.eye(3)
            shape = {"pose": (float(i), "index")}
            out.append(Variant(force_only(columns), per_axis("push"), ("m/s^2",) * 3, shape, f"pose {i}"))
        return out

    def statement(self, parameters: tuple[EffectParameter, ...]) -> str:
        pose = next(p.value for p in parameters if p.name == "pose")
        size = float(np.sqrt(sum(p.value**2 for p in parameters if p.name.startswith("push"))))
        return (
            f"Pose {pose:.0f} was not still or was pushed: its mean is off by {size:.2g} m/s²; repeat or leave it out."
        )
