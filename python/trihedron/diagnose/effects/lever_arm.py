"""Places of the accelerometers: the triad away from the centre of rotation, or its axes apart (size effect)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.ndimage import uniform_filter1d
from scipy.special import fdtrc

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Effect, Evidence, Variant, force_only, per_axis_parameters
from trihedron.diagnose.effects.saturation import clipped_samples
from trihedron.records.domains import HeldOut, Where
from trihedron.records.words import why_not

MIN_SHARE = 0.1
"""Least share of the motion in other moves that one arm must predict. The travel of a hand does not follow the
rotation: without an arm it leaves at most 5 % (21 simulated sessions)."""
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
"""Readings per polynomial in a short move."""
SHORT = 0.2
"""Quantile of the lengths that is a short move: a fifth of the moves may be shorter, with fewer readings."""
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
        found = min((_fitted(moves, one) for one in SHRUNK), key=lambda one: one.p_value)
        p_value = len(SHRUNK) * found.p_value
        before, after = (float(found.by.weight @ found.by.squares(one)) for one in (moves.target, found.held_out))
        share = 1.0 - after / before
        if share < MIN_SHARE or p_value > P_LIMIT:
            return None
        # Weighted rms over polynomials and moves, with the same weights before and after.
        scale = 3.0 * float((found.by.white**2).sum()) * float(found.by.weight.sum())
        before_rms, after_rms = float(np.sqrt(before / scale)), float(np.sqrt(after / scale))
        noise = float(np.sqrt((context.noise_floor[0] ** 2).mean()))
        held = HeldOut("dynamics", (before_rms / noise) ** 2, (after_rms / noise) ** 2, before_rms, after_rms, "m/s^2")
        arm, sigma = found.by.value[:N_ARM], np.sqrt(np.diag(found.covariance))
        parameters = per_axis_parameters("r", arm, sigma, "m")
        statement = self.reported("arm", arm_m=float(np.linalg.norm(arm)), share=share)
        strength = float(len(moves.target) * np.log(before / after))
        return Evidence(p_value, strength, parameters, statement, "dynamics", Where(("ax", "ay", "az")), (held,))


@dataclass(frozen=True, eq=False)
class _Moves:
    """Moves as polynomials of time, in the frame at their start: ``target`` (m, shapes, 3) force without gravity
    [m/s²], ``columns`` (m, shapes, 3, 4) its derivative by the arm along each axis [per m] and by a delay [per s]."""

    target: FloatArray
    columns: FloatArray

    def left(self, value: FloatArray) -> FloatArray:
        """(m, shapes, 3) what arm and delay ``value`` (4,), or (m, 4) one for every move, do not explain."""
        one = np.broadcast_to(value, (len(self.target), N_ARM + 1))
        return np.asarray(self.target - np.einsum("mkia,ma->mki", self.columns, one))


@dataclass(frozen=True, eq=False)
class _Weighed:
    """One least-squares answer: ``value`` (4,) arm [m] and delay [s], ``white`` (shapes, shapes) that whitens curves,
    ``weight`` (m,) of the moves."""

    value: FloatArray
    white: FloatArray
    weight: FloatArray

    def squares(self, curves: FloatArray) -> FloatArray:
        """(m,) sums of squares of whitened curves (m, shapes, 3)."""
        return np.asarray(((self.white @ curves) ** 2).sum(axis=(1, 2)))


@dataclass(frozen=True, eq=False)
class _Arm:
    """The weighted fit ``by``, the arm's jackknife ``covariance`` (3, 3), Hotelling's ``p_value``, and ``held_out``
    (m, shapes, 3) what is left in each move by arm and delay fitted without its jackknife group."""

    by: _Weighed
    covariance: FloatArray
    p_value: float
    held_out: FloatArray


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


def _weighed(moves: _Moves, by: _Weighed, shrunk: float, n: int) -> _Weighed:
    """``n`` iterations of the weighted least squares, each with covariance and weights from the last residuals."""
    m, n_shapes = moves.target.shape[:2]
    for _ in range(n):
        left = moves.left(by.value)
        # (shapes, 3 m): one matrix product instead of one per move.
        rows = left.transpose(1, 0, 2).reshape(n_shapes, -1)
        covariance = (rows * np.repeat(by.weight, 3)) @ rows.T / (3.0 * m)
        mean = float(np.trace(covariance)) / n_shapes
        white = np.linalg.inv(np.linalg.cholesky(covariance + shrunk * mean * np.eye(n_shapes)))
        squares = replace(by, white=white).squares(left)
        weight = 1.0 / np.maximum(squares, QUIETEST * float(np.median(squares)))
        root = np.sqrt(weight)[:, None, None]
        columns, target = (root * (white @ one.reshape(m, n_shapes, -1)) for one in (moves.columns, moves.target))
        # Rotations about the vertical alone do not determine the delay; the shortest solution has none then.
        value, *_ = np.linalg.lstsq(columns.reshape(-1, N_ARM + 1), target.ravel(), rcond=None)
        by = _Weighed(np.asarray(value, np.float64), white, weight / weight.mean())
    return by


def _fitted(moves: _Moves, shrunk: float) -> _Arm:
    """The arm with its jackknife covariance: each move (or group of moves) is left out in turn, covariance and weights
    are estimated again without it.

    A single move that determines the arm, or the noise in which it is significant, so widens the covariance.
    """
    m, n_shapes = moves.target.shape[:2]
    whole = _weighed(moves, _Weighed(np.zeros(N_ARM + 1), np.eye(n_shapes), np.ones(m)), shrunk, N_WEIGHINGS)
    groups = min(m, MOST_GROUPS)
    group = np.arange(m) % groups
    without_one = np.empty((groups, N_ARM + 1))
    for k in range(groups):
        others = group != k
        few = _Moves(moves.target[others], moves.columns[others])
        without_one[k] = _weighed(few, replace(whole, weight=whole.weight[others]), shrunk, N_AGAIN).value
    arm, away = whole.value[:N_ARM], (without_one - whole.value)[:, :N_ARM]
    covariance = away.T @ away * ((groups - 1) / (groups - 3))
    wald = float(arm @ np.linalg.solve(covariance, arm)) / 3.0 * (groups - 3) / (groups - 1)
    return _Arm(whole, covariance, float(fdtrc(3.0, groups - 3.0, wald)), moves.left(without_one[group]))


def _cross(v: FloatArray) -> FloatArray:
    """(n, 3, 3) matrices of the cross product with every row."""
    return np.asarray(np.cross(v[:, None, :], np.eye(3)).transpose(0, 2, 1))


def _smooth(x: FloatArray, width: int) -> FloatArray:
    """Running mean, applied alike to both sides of the comparison, so that differences are less noisy."""
    return x if len(x) < width else np.asarray(uniform_filter1d(x, width, axis=0, mode="nearest"))


class AccelSizeEffect(Effect):
    """Accelerometers Y and Z displaced from accelerometer X: each reads its own α×r + ω×(ω×r)."""

    id = "accel-size-effect"
    needs_moves = True
    applies_elsewhere = True
    size = 5e-3
    """m: distance between dies in one package."""

    def variants(self, context: Context) -> list[Variant]:
        w, a = context.rate, context.angular_acceleration
        axes, to_axes = context.accel_axes, np.linalg.inv(context.accel_axes)
        square = np.sum(w**2, axis=1)[:, None]
        sides = []
        for j in (1, 2):
            n = to_axes[j]
            # n · (α × r + ω × (ω × r)) as a row vector that multiplies r.
            along = np.cross(n, a) + (w @ n)[:, None] * w - square * n
            sides.append(axes[:, j, None] * along[:, None, :])
        columns = np.concatenate(sides, axis=2)
        names = tuple(f"r{j + 1}{axis}-r1{axis}" for j in (1, 2) for axis in AXES)
        return [Variant(force_only(columns), names, ("m",) * 6)]
