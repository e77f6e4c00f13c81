"""The accelerometer triad sits away from the centre of rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import AXES
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.sample_steps import clipped_samples
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import HeldOut, Where

MIN_SHARE = 0.1
"""One arm must predict at least this share of the motion of moves it was not fitted to: a hand also just travels, but
its travel follows no turn, and leaves 5 % at most (21 simulated sessions without an arm)."""
VISIBLE = 0.04
"""The same with all moves weighed alike: held-out rms falls by 2 %."""
MOSTLY = 0.5
"""Share from which an arm is what a session's moves do; below, the hand mostly travels, and the arm is a remark."""
FEWEST_MOVES = 6
"""Twice the arm's three numbers: the scatter between moves is its error bar."""
TOO_FLAT = 1e6
"""Condition above which a component of the arm moves the readings a thousandth as much as another: it is not seen."""
P_LIMIT = 1e-5
"""False alarms of Hotelling's test on moves whose own travel does not follow the turn."""
SMOOTHED, SMOOTHED_S = 5, 0.04
"""Samples, and seconds, of the mean that both sides pass: angular acceleration is a difference of noisy rates."""
N_WEIGHINGS = 4
QUIETEST = 0.5
"""Of the median: no move counts for more than twice the median one, however little the hand travels in it."""


class LeverArm(DirectEffect):
    """Sample by sample in moves, f - (−g) follows α×r + ω×(ω×r) with one r for all moves.

    A hand's own travel is unknown acceleration of any colour, so the scatter of the arm from move to move, not the
    sample noise, decides (jackknife over moves, each weighed by what the arm leaves of it), and moves are held out.
    """

    id = "lever-arm"
    is_of_motion = True
    mechanism = "the accelerometers sit away from the centre of rotation"
    experiment = (
        "turn about another point: an arm follows the centre of rotation, a displacement inside the case does not"
    )

    def unavailable(self, context: Context) -> str | None:
        return "fewer than six moves with a gyro" if len(_true_moves(context)) < FEWEST_MOVES else None

    def find(self, context: Context) -> Evidence | None:
        sums = _sums(context)
        if np.linalg.cond(sums.normal.sum(axis=0)) > TOO_FLAT:
            return None
        found, weight = _fitted(sums)
        held_out = _unpredicted(sums, found.without_one)
        share = 1.0 - float(weight @ held_out) / float(weight @ sums.energy)
        after = float(held_out.sum())
        whole = float(sums.energy.sum())
        if share < MIN_SHARE or 1.0 - after / whole < VISIBLE or found.p_value > P_LIMIT:
            return None
        before_rms, after_rms = float(np.sqrt(whole / sums.n)), float(np.sqrt(after / sums.n))
        noise = float(np.sqrt((context.noise_floor[0] ** 2).mean()))
        held = HeldOut("dynamics", (before_rms / noise) ** 2, (after_rms / noise) ** 2, before_rms, after_rms, "m/s^2")
        sigma = np.sqrt(np.diag(found.covariance))
        parameters = tuple(
            EffectParameter(f"r_{axis}", float(v), float(s), "m")
            for axis, v, s in zip(AXES, found.arm, sigma, strict=True)
        )
        length = float(np.linalg.norm(found.arm))
        # Real motion explains nothing of how gravity and rest disagree: it stands behind what does.
        strength = float(len(weight) * np.log(whole / after)) if 1.0 - after / whole > MOSTLY else 0.0
        return Evidence(
            max(found.p_value, 1e-300), strength, parameters,
            f"The accelerometers sit {100 * length:.1f} cm from the centre of rotation: one arm predicts "
            f"{100 * share:.0f} % of the acceleration in moves it was not fitted to.",
            "dynamics", Where(("ax", "ay", "az")), (held,),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Sums:
    """Per move: ``normal`` (m, 3, 3), ``side`` (m, 3) and ``energy`` (m,) of the least squares for one arm; how many
    readings in each (``samples`` (m,)) and in all (``n``)."""

    normal: FloatArray
    side: FloatArray
    energy: FloatArray
    samples: FloatArray

    @property
    def n(self) -> float:
        """Readings of all channels."""
        return float(self.samples.sum())


@dataclass(frozen=True, eq=False)
class _Arm:
    """``arm`` (3,) m, its jackknife ``covariance``, Hotelling's ``p_value``, the arms ``without_one`` move (m, 3)."""

    arm: FloatArray
    covariance: FloatArray
    p_value: float
    without_one: FloatArray


def _true_moves(context: Context) -> list[slice]:
    """Moves without readings at the end of a range, which are false."""
    if not context.moves:
        return []
    clipped = clipped_samples(context.obs)
    pairs = zip(context.moves, context.obs.move_ranges, strict=True)
    return [where for where, (a, b) in pairs if not clipped[a:b].any()]


def _sums(context: Context) -> _Sums:
    normal, side, energy, samples = [], [], [], []
    width = max(SMOOTHED, int(SMOOTHED_S * context.obs.recording.rate_hz)) | 1
    for where in _true_moves(context):
        w = _smooth(context.rate[where], width)
        a = np.gradient(w, context.time_s[where], axis=0)
        e = _smooth(context.force[where] - context.gravity_in_moves[where], width)
        # a × r + w × (w × r), as a matrix on r.
        columns = (_cross(a) + _cross(w) @ _cross(w)).reshape(-1, 3)
        target = e.reshape(-1)
        normal.append(columns.T @ columns)
        side.append(columns.T @ target)
        energy.append(float(target @ target))
        samples.append(float(len(target)))
    return _Sums(np.array(normal), np.array(side), np.array(energy), np.array(samples))


def _fitted(sums: _Sums) -> tuple[_Arm, FloatArray]:
    """The arm and the weights (m,) of the moves, each by what it leaves: hands travel far in some, hardly in others."""
    left = sums.energy
    for _ in range(N_WEIGHINGS):
        variance = left / sums.samples
        weight = 1.0 / np.maximum(variance, QUIETEST * float(np.median(variance)))
        found = _jackknife(sums.normal * weight[:, None, None], sums.side * weight[:, None])
        left = _unpredicted(sums, np.tile(found.arm, (len(weight), 1)))
    return found, weight


def _jackknife(normal: FloatArray, side: FloatArray) -> _Arm:
    """The moves left out one by one tell the error bar: a move that decides alone makes it wide."""
    m = len(normal)
    N, b = normal.sum(axis=0), side.sum(axis=0)
    arm = np.linalg.solve(N, b)
    without_one = np.linalg.solve(N - normal, (b - side)[:, :, None])[:, :, 0]
    away = without_one - arm
    covariance = away.T @ away * ((m - 1) / (m - 3))
    wald = float(arm @ np.linalg.solve(covariance, arm)) / 3.0 * (m - 3) / (m - 1)
    return _Arm(arm, covariance, float(fdtrc(3.0, m - 3.0, wald)), without_one)


def _unpredicted(sums: _Sums, arms: FloatArray) -> FloatArray:
    """(m,) squares of what one arm a move (m, 3) leaves of it."""
    moved = np.einsum("mi,mij,mj->m", arms, sums.normal, arms)
    return np.asarray(sums.energy - 2.0 * (arms * sums.side).sum(axis=1) + moved)


def _cross(v: FloatArray) -> FloatArray:
    """(n, 3, 3) matrices of the cross product with every row."""
    x, y, z = v.T
    nothing = np.zeros_like(x)
    rows = [[nothing, -z, y], [z, nothing, -x], [-y, x, nothing]]
    return np.asarray(np.moveaxis(np.array(rows), 2, 0))


def _smooth(x: FloatArray, width: int) -> FloatArray:
    """Running mean: both sides of the comparison pass the same filter, so that derivatives are not noise."""
    if len(x) < width:
        return x
    padded = np.pad(x, ((width // 2, width // 2), (0, 0)), mode="edge")
    kernel = np.ones(width) / width
    return np.stack([np.convolve(padded[:, k], kernel, mode="valid") for k in range(x.shape[1])], axis=1)
