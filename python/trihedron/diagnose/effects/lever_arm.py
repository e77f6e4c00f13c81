"""The accelerometer triad is away from the centre of rotation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.ndimage import uniform_filter1d
from scipy.special import fdtrc

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.plateaus import clipped_samples
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import HeldOut, Where
from trihedron.records.words import why_not

MIN_SHARE = 0.1
"""Least share of the motion in other moves that one arm must predict. The travel of a hand does not follow the
rotation: without an arm it leaves at most 5 % (21 simulated sessions)."""
MOSTLY = 0.5
"""Share from which the arm explains most of a session's motion; below it the arm ranks behind all other effects."""
FEWEST_MOVES = 6
"""Twice the three unknowns of the arm: its uncertainty comes from the scatter between moves."""
TOO_FLAT = 1e6
"""Condition number above which a component of the arm changes the readings a thousand times less than another."""
P_LIMIT = 1e-5
"""False-alarm rate of Hotelling's test for moves whose travel does not follow the rotation."""
SMOOTHED, SMOOTHED_S = 5, 0.04
"""Window of the mean applied to both sides, samples and s: angular acceleration is a difference of noisy rates."""
N_SHAPES = 24
"""Polynomials of time per move. The travel of a hand is made of slow ones: of five simulated hands with arms of 2 to
3 cm none is detected at 1e-5 with equal weights of the samples, one with 10 polynomials, three with 24."""
SAMPLES_PER_SHAPE = 3
"""Readings per polynomial in a short move (the 20 % quantile of the lengths)."""
SHORT = 0.2
FEWEST_PER_SHAPE = 2
"""Readings per polynomial below which a move is excluded: its polynomials are not independent."""
SHRUNK = (0.02, 100.0)
"""Share of the mean variance added to each polynomial's: a 24 by 24 covariance comes from as few as 18 curves. The
second gives nearly equal weights, better for few moves with long arms; p is doubled for the choice."""
N_WEIGHINGS, N_AGAIN = 6, 3
"""Iterations from unit weights, and from the full fit without one group of moves."""
MOST_GROUPS = 40
"""Largest number of jackknife groups: beyond it the relative error of the uncertainty (a ninth) hardly falls, and
the run time stays linear in the moves."""
QUIETEST = 0.5
"""In medians: a move's misfit counts as at least this, so that its weight is at most twice the median one."""
N_ARM = 3
"""Unknowns of an arm. A delay between the sensors is fitted beside it: turning gravity would imitate an arm."""
ROUNDING = 1e-9
"""Relative to the arm's diagonal, added to that of the delay against a singular matrix; no bias at a delay of 0.1 s."""


class LeverArm(DirectEffect):
    """In moves f - (−g) follows α×r + ω×(ω×r) with one r for all of them.

    The travel of the hand is an unknown, mostly slow acceleration. Significance therefore comes from the scatter of the
    arm between moves (jackknife), not from sample noise. The covariance of the travel in time, in the frame at each
    move's start, is estimated from all moves, so that motion which hands do little of has most weight.
    """

    id = "lever-arm"
    is_of_motion = True

    def unavailable(self, context: Context) -> str | None:
        return why_not("six-moves") if len(_true_moves(context)) < FEWEST_MOVES else None

    def find(self, context: Context) -> Evidence | None:
        moves = _written(context)
        flat = np.einsum("mkia,mkib->ab", moves.columns, moves.columns)[:N_ARM, :N_ARM]
        if len(moves.target) < FEWEST_MOVES or np.linalg.cond(flat) > TOO_FLAT:
            return None
        found, by = min((_fitted(moves, one) for one in SHRUNK), key=lambda one: one[0].p_value)
        before, after = (float(by.weight @ one) for one in _held_out(moves, found, by.shapes))
        share = 1.0 - after / before
        if share < MIN_SHARE or len(SHRUNK) * found.p_value > P_LIMIT:
            return None
        # Weighted rms over polynomials and moves, with the same weights before and after.
        scale = 3.0 * float(np.trace(by.shapes)) * float(by.weight.sum())
        before_rms, after_rms = float(np.sqrt(before / scale)), float(np.sqrt(after / scale))
        noise = float(np.sqrt((context.noise_floor[0] ** 2).mean()))
        held = HeldOut("dynamics", (before_rms / noise) ** 2, (after_rms / noise) ** 2, before_rms, after_rms, "m/s^2")
        sigma = np.sqrt(np.diag(found.covariance))
        parameters = tuple(
            EffectParameter(f"r_{axis}", float(v), float(s), "m")
            for axis, v, s in zip(AXES, found.value[:N_ARM], sigma, strict=True)
        )
        length = float(np.linalg.norm(found.value[:N_ARM]))
        # Real motion explains no misfit of gravity or velocity: it ranks behind the effects that do.
        whole, left = (float(one.sum()) for one in _held_out(moves, found, np.eye(moves.n_shapes)))
        strength = float(len(by.weight) * np.log(whole / left)) if 1.0 - left / whole > MOSTLY else 0.0
        return Evidence(
            max(len(SHRUNK) * found.p_value, 1e-300), strength, parameters,
            self.reported("arm", arm_m=length, share=share), "dynamics", Where(("ax", "ay", "az")), (held,),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Moves:
    """Moves as polynomials of time, in the frame at their start: ``target`` (m, shapes, 3) force without gravity
    [m/s²], ``columns`` (m, shapes, 3, 4) its derivative by the arm along each axis [per m] and by a delay [per s]."""

    target: FloatArray
    columns: FloatArray

    @property
    def n_shapes(self) -> int:
        """Number of shapes."""
        return int(self.target.shape[1])


@dataclass(frozen=True, eq=False)
class _Arm:
    """``value`` (4,) arm [m] and delay [s], the arm's jackknife ``covariance`` (3, 3) and Hotelling's ``p_value``;
    ``without_one`` (m, 4) the value without each move's jackknife group, ``delay_without_one`` (m,) the delay fitted
    alone without it."""

    value: FloatArray
    covariance: FloatArray
    p_value: float
    without_one: FloatArray
    delay_without_one: FloatArray


def _true_moves(context: Context) -> list[slice]:
    """Moves without readings at a range limit, which are false."""
    if not context.moves:
        return []
    clipped = clipped_samples(context.obs)
    pairs = zip(context.moves, context.obs.move_ranges, strict=True)
    return [where for where, (a, b) in pairs if not clipped[a:b].any()]


def _written(context: Context) -> _Moves:
    poses = context.obs.n_poses
    spans = _true_moves(context)
    short = float(np.quantile([where.stop - where.start for where in spans], SHORT))
    n_shapes = int(np.clip(short // SAMPLES_PER_SHAPE, 1, N_SHAPES))
    width = max(SMOOTHED, int(SMOOTHED_S * context.obs.recording.rate_hz)) | 1
    targets, columns = [], []
    for where in spans:
        if where.stop - where.start < FEWEST_PER_SHAPE * n_shapes:
            continue
        t = context.time_s[where]
        w = _smooth(context.rate[where], width)
        a = np.gradient(w, t, axis=0)
        gravity = _smooth(context.gravity_in_moves[where], width)
        e = _smooth(context.force[where], width) - gravity
        # α × r + ω × (ω × r) as a matrix on r; a delay changes gravity by d/dt of -g, which is -ω × (-g).
        made = np.concatenate([_cross(a) + _cross(w) @ _cross(w), -np.cross(w, gravity)[:, :, None]], axis=2)
        begun = context.fitted.path.attitude[where.start - poses : where.stop - poses].transpose(0, 2, 1)
        shapes = _shapes(t, n_shapes)
        targets.append(shapes.T @ (begun @ e[:, :, None])[:, :, 0])
        columns.append(np.tensordot(shapes.T, begun @ made, axes=1))
    return _Moves(np.array(targets), np.array(columns))


def _shapes(time_s: FloatArray, count: int) -> FloatArray:
    """(n, count) Legendre polynomials over the time of a move, of mean square 1, times the weight of each sample."""
    x = 2.0 * (time_s - time_s[0]) / (time_s[-1] - time_s[0]) - 1.0
    weight = 0.5 * np.gradient(x)
    return np.asarray(legvander(x, count - 1) * np.sqrt(2.0 * np.arange(count) + 1.0) * weight[:, None])


@dataclass(frozen=True, eq=False)
class _Weighed:
    """One least-squares answer: ``value`` (4,), inverse covariance of the ``shapes``, ``weight`` (m,) of the moves."""

    value: FloatArray
    shapes: FloatArray
    weight: FloatArray


def _normal(moves: _Moves, by: _Weighed) -> tuple[FloatArray, FloatArray]:
    """(m, 4, 4) normal matrices and (m, 4) right-hand sides."""
    m = len(moves.target)
    flat = moves.columns.reshape(m, -1, N_ARM + 1)
    weighted = by.weight[:, None, None] * (by.shapes @ moves.columns.reshape(m, moves.n_shapes, -1)).reshape(flat.shape)
    normal = flat.transpose(0, 2, 1) @ weighted
    # Rotations about the vertical alone do not determine the delay; it is zero then.
    normal[:, N_ARM, N_ARM] += ROUNDING * np.trace(normal[:, :N_ARM, :N_ARM], axis1=1, axis2=2)
    return normal, (weighted.transpose(0, 2, 1) @ moves.target.reshape(m, -1, 1))[:, :, 0]


def _weighed(moves: _Moves, by: _Weighed, shrunk: float, n: int) -> _Weighed:
    """``n`` iterations of the weighted least squares, each with covariance and weights from the last residuals."""
    for _ in range(n):
        left = moves.target - moves.columns @ by.value
        # (shapes, 3 m): one matrix product instead of one per move.
        rows = left.transpose(1, 0, 2).reshape(moves.n_shapes, -1)
        covariance = (rows * np.repeat(by.weight, 3)) @ rows.T / (3.0 * len(left))
        mean = float(np.trace(covariance)) / moves.n_shapes
        shapes = np.asarray(np.linalg.inv(covariance + shrunk * mean * np.eye(moves.n_shapes)), np.float64)
        squares = _squares(left, shapes)
        weight = 1.0 / np.maximum(squares, QUIETEST * float(np.median(squares)))
        by = _Weighed(by.value, shapes, weight / weight.mean())
        normal, side = (one.sum(axis=0) for one in _normal(moves, by))
        by = replace(by, value=np.linalg.solve(normal, side))
    return by


def _fitted(moves: _Moves, shrunk: float) -> tuple[_Arm, _Weighed]:
    """The arm with its jackknife covariance: each move (or group of moves) is left out in turn, covariance and weights
    are estimated again without it.

    A single move that determines the arm, or the noise in which it is significant, so widens the covariance.
    """
    m = len(moves.target)
    start = _Weighed(np.zeros(N_ARM + 1), np.eye(moves.n_shapes), np.ones(m))
    whole = _weighed(moves, start, shrunk, N_WEIGHINGS)
    groups = min(m, MOST_GROUPS)
    group = np.arange(m) % groups
    without_one = np.empty((groups, N_ARM + 1))
    for k in range(groups):
        others = group != k
        few = _Moves(moves.target[others], moves.columns[others])
        without_one[k] = _weighed(few, replace(whole, weight=whole.weight[others]), shrunk, N_AGAIN).value
    away = (without_one - whole.value)[:, :N_ARM]
    covariance = away.T @ away * ((groups - 1) / (groups - 3))
    arm = whole.value[:N_ARM]
    wald = float(arm @ np.linalg.solve(covariance, arm)) / 3.0 * (groups - 3) / (groups - 1)
    p_value = float(fdtrc(3.0, groups - 3.0, wald))
    normal, side = _normal(moves, whole)
    of_group = np.eye(groups)[group]
    delay = (side.sum(axis=0) - of_group.T @ side)[:, N_ARM]
    delay /= normal[:, N_ARM, N_ARM].sum() - of_group.T @ normal[:, N_ARM, N_ARM]
    return _Arm(whole.value, covariance, p_value, without_one[group], delay[group]), whole


def _squares(left: FloatArray, shapes: FloatArray) -> FloatArray:
    """(m,) sums of squares of curves (m, shapes, 3) in the metric ``shapes``, their inverse covariance in time."""
    return np.asarray((left * (shapes @ left)).sum(axis=(1, 2)))


def _held_out(moves: _Moves, found: _Arm, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(m,) squares left in each move by a delay alone and by arm and delay, fitted without that move's group."""
    alone = moves.target - moves.columns[..., N_ARM] * found.delay_without_one[:, None, None]
    beside = moves.target - np.einsum("mkia,ma->mki", moves.columns, found.without_one)
    return _squares(alone, shapes), _squares(beside, shapes)


def _cross(v: FloatArray) -> FloatArray:
    """(n, 3, 3) matrices of the cross product with every row."""
    return np.asarray(np.cross(v[:, None, :], np.eye(3)).transpose(0, 2, 1))


def _smooth(x: FloatArray, width: int) -> FloatArray:
    """Running mean, applied alike to both sides of the comparison, so that differences are less noisy."""
    return x if len(x) < width else np.asarray(uniform_filter1d(x, width, axis=0, mode="nearest"))
