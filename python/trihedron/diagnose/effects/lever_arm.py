"""The accelerometer triad sits away from the centre of rotation."""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import AXES
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import HeldOut, Where

MIN_SHARE = 0.5
"""One arm must predict at least this share of the motion of moves it was not fitted to: a hand also just travels."""
FEWEST_MOVES = 6
"""Twice the arm's three numbers: the scatter between moves is its error bar."""
TOO_FLAT = 1e6
"""Condition above which a component of the arm moves the readings a thousandth as much as another: it is not seen."""
P_LIMIT = 1e-3
"""False alarms of Hotelling's test on moves whose own travel does not follow the turn."""
SMOOTHED = 5
"""Samples of the mean that both sides pass."""


class LeverArm(DirectEffect):
    """Sample by sample in moves, f - (−g) follows α×r + ω×(ω×r) with one r for all moves.

    A hand's own travel is unknown acceleration of any colour, so the scatter of the arm from move to move, not the
    sample noise, decides (cluster-robust covariance), and whole moves are held out.
    """

    id = "lever-arm"
    mechanism = "the accelerometers sit away from the centre of rotation"
    experiment = (
        "turn about another point: an arm follows the centre of rotation, a displacement inside the case does not"
    )

    def unavailable(self, context: Context) -> str | None:
        return "fewer than six moves with a gyro" if len(context.moves) < FEWEST_MOVES else None

    def find(self, context: Context) -> Evidence | None:
        smooth = _smoothing(context)
        normal, side, energy, samples = [], [], [], []
        for where in context.moves:
            t = context.time_s[where]
            w = smooth(context.rate[where])
            a = np.gradient(w, t, axis=0)
            e = smooth(context.force[where] - context.gravity_in_moves[where])
            # a × r + w × (w × r), as a matrix on r.
            columns = _cross(a) + _cross(w) @ _cross(w)
            flat, target = columns.reshape(-1, 3), e.reshape(-1)
            normal.append(flat.T @ flat)
            side.append(flat.T @ target)
            energy.append(float(target @ target))
            samples.append(len(t))
        N, b, e2 = np.array(normal), np.array(side), np.array(energy)
        total = N.sum(axis=0)
        if np.linalg.cond(total) > TOO_FLAT:
            return None
        arm = np.linalg.solve(total, b.sum(axis=0))
        deviations = b - N @ arm
        m = len(N)
        meat = deviations.T @ deviations * m / (m - 3)
        bread = np.linalg.inv(total)
        cov = bread @ meat @ bread
        wald = float(arm @ np.linalg.solve(cov, arm)) / 3.0 * (m - 3) / (m - 1)
        p = float(fdtrc(3.0, m - 3.0, wald))
        after = 0.0
        for k in range(m):
            other = np.linalg.solve(total - N[k], b.sum(axis=0) - b[k])
            after += float(e2[k] - 2 * other @ b[k] + other @ N[k] @ other)
        share = 1.0 - after / float(e2.sum())
        if share < MIN_SHARE or p > P_LIMIT:
            return None
        n = 3 * sum(samples)
        before_rms, after_rms = float(np.sqrt(e2.sum() / n)), float(np.sqrt(after / n))
        sigma = np.sqrt(np.diag(cov))
        noise = float(np.sqrt((context.noise_floor[0] ** 2).mean()))
        held = HeldOut("dynamics", (before_rms / noise) ** 2, (after_rms / noise) ** 2, before_rms, after_rms, "m/s^2")
        parameters = tuple(
            EffectParameter(f"r_{axis}", float(v), float(s), "m") for axis, v, s in zip(AXES, arm, sigma, strict=True)
        )
        length = float(np.linalg.norm(arm))
        return Evidence(
            max(p, 1e-300), float(m * np.log(float(e2.sum()) / after)), parameters,
            f"The accelerometers sit {100 * length:.1f} cm from the centre of rotation: one arm predicts "
            f"{100 * share:.0f} % of the acceleration in moves it was not fitted to.",
            "dynamics", Where(("ax", "ay", "az")), (held,),
        )  # fmt: skip


def _cross(v: FloatArray) -> FloatArray:
    """(n, 3, 3) matrices of the cross product with every row."""
    x, y, z = v.T
    nothing = np.zeros_like(x)
    rows = [[nothing, -z, y], [z, nothing, -x], [-y, x, nothing]]
    return np.asarray(np.moveaxis(np.array(rows), 2, 0))


def _smoothing(context: Context):  # type: ignore[no-untyped-def]
    """Five-sample mean: both sides of the comparison pass the same filter, so that derivatives are not noise."""
    kernel = np.ones(SMOOTHED) / SMOOTHED

    def smooth(x: FloatArray) -> FloatArray:
        if len(x) < SMOOTHED:
            return x
        padded = np.pad(x, ((2, 2), (0, 0)), mode="edge")
        return np.stack([np.convolve(padded[:, k], kernel, mode="valid") for k in range(x.shape[1])], axis=1)

    assert context is not None
    return smooth
