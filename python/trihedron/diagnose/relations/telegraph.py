"""Random telegraph signals: a bias that switches between two levels at random times (eq. 8.7a).

The readings inside the poses show at what height they switch, and the means of poses that do not switch which level
they have.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import toeplitz
from scipy.special import logsumexp

from trihedron.arrays import TINY, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.relations.signals import Sensor, Signal
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import MEDIAN_CHI2

TELEGRAPH = "telegraph"
"""Family of the variable."""
N_BLOCKS, N_FINE = 16, 4
"""Block means per pose; parts of a block in which its noise is computed."""
LEAST_SAMPLES = 3 * N_BLOCKS
"""Readings of a pose below which its blocks are not used."""
FEWEST_AT_A_LEVEL = 3
"""A level seen in fewer poses is a disturbance of these poses."""
FLICKER, WALK = (0.5, 1.0, 2.0), (0.3, 0.5, 1.0, 4.0)
"""Amplitudes of 1/f noise, or of a random walk, relative to the white noise of a part of a block."""
FREEDOM = 8.0
"""Degrees of freedom of the noise of a pose relative to the usual one: a tremble doubles it."""
HEIGHTS = np.geomspace(1.0, 40.0, 14)
"""Heights of a switch, in units of the noise of a block."""
BETWEEN = (0.87, 0.93, 1.07, 1.15)
"""Factors on the likeliest of them that are tried too."""
RATES = (0.1, 0.4, 1.0)
"""Switches per pose."""
WALKS = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Variance of the bias walk between poses, relative to that of the scatter."""
SHARES = (0.03, 0.1)
"""Shares of poses that a jolt disturbs by any height: the alternative to equal heights."""
ROUNDING = 1e-9
"""Relative gain below which a change of one state is none."""


def telegraphs(context: Context) -> Iterator[tuple[Signal, int, float]]:
    """The likeliest path on each axis of each sensor that has both levels, that axis, and its score: twice the
    log-likelihood that it gains over biases that scatter and drift, less the penalty of the choice among axes.

    The score is that of the poses alone: in moves the signal switches at times that no column tells.
    """
    inside = _inside_poses(context.obs)
    sensors: tuple[Sensor, ...] = ("accelerometer", "gyroscope")
    sensors = sensors[: 1 if context.obs.raw_rate is None else 2]
    for number, sensor in enumerate(sensors):
        for axis in range(3):
            levels = _levels(context, number, axis, inside[number][axis])
            if levels is not None:
                state, gain = levels
                column = context.between_poses(state - state.mean())[:, None]
                signal = Signal(sensor, TELEGRAPH, ("a random telegraph signal",), column, ("1",))
                yield signal, axis, 2.0 * (gain - float(np.log(3 * len(sensors))))


class _Inside(NamedTuple):
    """Per pose: whether the signal ``switches`` inside it, and if so its mean ``state``; the ``gain`` of equal steps up
    and down over noise, and over a few steps of any height, in log-likelihood."""

    switches: npt.NDArray[np.bool_]
    state: FloatArray
    gain: float


def _levels(context: Context, sensor: int, axis: int, inside: _Inside) -> tuple[FloatArray, float] | None:
    """State in every pose, between -1 and 1, and what it gains in log-likelihood; ``None`` with one level."""
    error, state, obs = _static_errors(context, sensor), context.fitted.state, context.obs
    up = state.up
    if sensor:
        assert obs.pose_rate_noise is not None
        reading, seen = error @ np.linalg.inv(context.gyro_axes)[axis], np.ones(len(error))
        known = np.ones((len(error), 1))
        noise = np.sqrt(obs.pose_rate_noise**2 @ state.gyro_S[axis] ** 2)
    else:
        # Gravity shows the component along the vertical only, less what S and b take of it.
        reading, seen = np.einsum("ni,ni->n", up, error), up @ context.accel_axes[:, axis]
        known = np.column_stack([up, *(up[:, j] * up[:, k] for j in range(3) for k in range(j, 3))])
        noise = obs.norm_sigma(up @ state.accel_S)
    rest = np.eye(len(error)) - known @ np.linalg.pinv(known)
    level = _states(rest @ reading, seen, rest, inside)
    if (
        len(error) <= known.shape[1]
        or min(np.count_nonzero(level < 0.0), np.count_nonzero(level > 0.0)) < FEWEST_AT_A_LEVEL
    ):
        return None
    # The level of a pose without a switch is one of two, chosen by the mean that it is to explain.
    gain = inside.gain - float(np.log(2.0)) * np.count_nonzero(~inside.switches)
    time, scatter = context.time_s[: len(error)], _Scatter(float(np.median(noise**2)), len(error) - known.shape[1])
    levels = np.column_stack([known, seen * level])
    gain += _likelihood(reading, levels, time, scatter) - _likelihood(reading, known, time, scatter)
    return level, gain - 0.5 * float(np.log(len(error)))


def _static_errors(context: Context, sensor: int) -> FloatArray:
    """(poses, 3) what the means over the poses read beyond gravity and the effects of the hypothesis, SI, body."""
    obs, state, distortion = context.obs, context.fitted.state, context.fitted.distortion
    if sensor:
        assert obs.pose_rate is not None
        error, effects = obs.pose_rate @ state.gyro_S.T, distortion.rate
    else:
        error, effects = obs.pose_force @ state.accel_S.T + state.accel_b - state.gravity * state.up, distortion.force
    return np.asarray(error if effects is None else error - effects[: len(error)] @ state.effect)


class _Scatter(NamedTuple):
    """``least`` variance of readings about their combination, that of their noise, and the degrees of freedom."""

    least: float
    dof: int


def _likelihood(reading: FloatArray, known: FloatArray, time: FloatArray, scatter: _Scatter) -> float:
    """Largest log-likelihood of a ``reading`` that scatters and walks at random about a combination of ``known``.

    A scatter below the noise of the means would reward a combination of as many columns as there are poses.
    """
    walk = np.minimum.outer(time, time) - time.min()
    walk /= max(float(np.median(np.diff(time))), TINY)
    best = -np.inf
    for share in WALKS:
        root = np.linalg.cholesky(np.eye(len(time)) + share * walk)
        y, x = np.linalg.solve(root, reading), np.linalg.solve(root, known)
        y = y - x @ np.linalg.lstsq(x, y)[0]
        variance = max(float(y @ y) / scatter.dof, scatter.least)
        fit = scatter.dof * np.log(variance) + float(y @ y) / variance
        best = max(best, -float(np.log(np.diag(root)).sum() + 0.5 * fit))
    return best


def _states(reading: FloatArray, seen: FloatArray, rest: FloatArray, inside: _Inside) -> FloatArray:
    """(poses,) states that explain most of the ``reading``, in which a state counts by ``rest @ seen``.

    From the sign of every reading on, the state of one pose after another is changed while that explains more.
    """
    plain = ~inside.switches
    state = np.where(plain, np.where(reading * seen < 0.0, -1.0, 1.0), inside.state)
    own = seen**2 * np.diag(rest)
    for _ in range(len(state) ** 2):
        x = rest @ (seen * state)
        turned = -2.0 * state * seen
        # Inner products of the reading with the column, and of the column with itself, after each change.
        along, norm = reading @ x + turned * reading, x @ x + 2.0 * turned * x + 4.0 * state**2 * own
        explained = np.where(plain & (along > 0.0) & (norm > 0.0), along**2 / np.maximum(norm, TINY), 0.0)
        k = int(explained.argmax())
        if explained[k] <= max(float(reading @ x), 0.0) ** 2 / max(float(x @ x), TINY) * (1.0 + ROUNDING):
            break
        state[k] = -state[k]
    return state


@lru_cache(maxsize=4)
def _inside_poses(obs: Observations) -> tuple[tuple[_Inside, ...], ...]:
    """What the readings inside the poses show, by sensor and axis."""
    poses = obs.segments.poses
    which = np.flatnonzero([not pose.is_unsteady and pose.stop - pose.start >= LEAST_SAMPLES for pose in poses])
    out: list[tuple[_Inside, ...]] = []
    for raw in (obs.raw_force, obs.raw_rate):
        if raw is None or not len(which):
            nothing = _Inside(np.zeros(len(poses), dtype=bool), np.zeros(len(poses)), 0.0)
            out.append((nothing,) * 3)
            continue
        blocks = _block_means(obs, raw, which)
        # Means over longer blocks have less noise: a step of the same height is more of it.
        lasts = np.sqrt([poses[i].stop - poses[i].start for i in which])
        scale = lasts / np.median(lasts)
        out.append(tuple(_path(blocks[:, :, k], scale, which, len(poses)) for k in range(3)))
    return tuple(out)


def _block_means(obs: Observations, raw: FloatArray, which: npt.NDArray[np.intp]) -> FloatArray:
    """(poses, blocks, axes) means of equal parts in units of the noise between neighbours, whatever their length."""
    out = []
    for i in which:
        values = raw[obs.segments.poses[i].samples()]
        first = np.linspace(0, len(values), N_BLOCKS + 1).astype(np.intp)[:-1]
        known = np.isfinite(values)
        present = np.add.reduceat(known, first, axis=0, dtype=np.float64)
        with np.errstate(invalid="ignore"):
            mean = np.add.reduceat(np.where(known, values, 0.0), first, axis=0) / present
        out.append(mean * np.sqrt(len(values) / N_BLOCKS))
    blocks = np.array(out)
    # Robust: the median over all poses of squared differences, half of it per block.
    noise = np.sqrt(np.nanmedian(np.diff(blocks, axis=1) ** 2, axis=(0, 1)) / MEDIAN_CHI2[1] / 2.0)
    return np.asarray(np.nan_to_num(blocks / np.where(noise > 0.0, noise, np.inf)))


def _path(blocks: FloatArray, scale: FloatArray, which: npt.NDArray[np.intp], n_poses: int) -> _Inside:
    """The likeliest path of one axis through each of the poses ``which``, whose steps have a ``scale``."""
    noises = [_Noise.of(colour, blocks, scale) for colour in _colours()]
    without = max(one.without() for one in noises)
    best, path = max((_of_one_height(one) for one in noises), key=lambda found: found[0])
    switches, state = np.zeros(n_poses, dtype=bool), np.zeros(n_poses)
    switches[which], state[which] = path > 0, _STATES[path]
    return _Inside(switches, state, best - without)


class _Noise(NamedTuple):
    """Whitened readings of every pose in noise of one colour: their ``square`` (poses,), ``along`` a unit step of every
    path and its squared ``norm`` (poses, paths)."""

    square: FloatArray
    along: FloatArray
    norm: FloatArray
    log_det: float

    @classmethod
    def of(cls, colour: _Colour, blocks: FloatArray, scale: FloatArray) -> _Noise:
        """Noise of one colour for ``blocks`` (poses, blocks), whose steps have a ``scale`` (poses,)."""
        y, shapes = blocks @ colour.whiten.T, colour.shapes
        along, norm = scale[:, None] * (y @ shapes.T), np.outer(scale**2, (shapes**2).sum(axis=1))
        return cls((y**2).sum(axis=1), along, norm, colour.log_det)

    def likelihood(self, height: float) -> FloatArray:
        """(poses, paths) log-likelihood of steps of a height. Poses differ in noise: by Student's t."""
        left = self.square[:, None] - 2.0 * height * self.along + height**2 * self.norm
        return np.asarray(-0.5 * (self.log_det + (FREEDOM + N_BLOCKS - 1) * np.log1p(left / FREEDOM)))

    def without(self) -> float:
        """Log-likelihood of noise alone, or with a step of any height in some poses."""
        steps = np.array([logsumexp(self.likelihood(height)[:, _N_SWITCHES == 1], axis=1) for height in HEIGHTS])
        step = logsumexp(steps, axis=0) - np.log(len(HEIGHTS) * _N_PATHS[1])
        plain = self.likelihood(0.0)[:, 0]
        mixed = [np.logaddexp(np.log1p(-share) + plain, np.log(share) + step).sum() for share in SHARES]
        return float(max(plain.sum(), *mixed))


def _of_one_height(noise: _Noise) -> tuple[float, npt.NDArray[np.intp]]:
    """Log-likelihood of steps of one height, and the path (poses,) that is likeliest."""
    tried = [_at_height(noise, height) for height in HEIGHTS]
    at = HEIGHTS[int(np.argmax([one[0] for one in tried]))]
    return max((*tried, *(_at_height(noise, at * factor) for factor in BETWEEN)), key=lambda found: found[0])


def _at_height(noise: _Noise, height: float) -> tuple[float, npt.NDArray[np.intp]]:
    each = noise.likelihood(height)
    top = each.max(axis=1, keepdims=True)
    by_number = np.exp(each - top) @ _BY_NUMBER
    totals = [float(np.log(by_number @ _prior(rate)).sum()) for rate in RATES]
    k = int(np.argmax(totals))
    path = (each + np.log(_prior(RATES[k]) / _N_PATHS)[_N_SWITCHES]).argmax(axis=1)
    return float(top.sum()) + totals[k], path


# Every path through a pose with two switches or fewer: none, up or down once, there and back.


def _paths() -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """(paths, blocks) levels, 0 or 1, and (paths,) numbers of switches."""
    at = np.arange(N_BLOCKS)
    up = [(at >= k).astype(float) for k in range(1, N_BLOCKS)]
    there = [((at >= j) & (at < k)).astype(float) for j, k in combinations(range(1, N_BLOCKS), 2)]
    levels = [np.zeros(N_BLOCKS), *up, *(1.0 - one for one in up), *there, *(1.0 - one for one in there)]
    n = np.array([0] + [1] * (2 * len(up)) + [2] * (2 * len(there)))
    return np.array(levels), n


_LEVELS, _N_SWITCHES = _paths()
_STATES = 2.0 * _LEVELS.mean(axis=1) - 1.0


_N_PATHS = np.bincount(_N_SWITCHES)
_BY_NUMBER = np.eye(3)[_N_SWITCHES] / _N_PATHS
"""(paths, 3) mean over the paths with none, one or two switches."""


def _prior(rate: float) -> FloatArray:
    """(3,) probability of none, one and two switches: Poisson."""
    weight = np.array([1.0, rate, rate**2 / 2.0])
    return np.asarray(weight / weight.sum())


class _Colour(NamedTuple):
    """Noise of one colour: ``whiten`` (b - 1, b) blocks without their mean, its determinant, (paths, b - 1) levels
    whitened."""

    whiten: FloatArray
    log_det: float
    shapes: FloatArray


@lru_cache(maxsize=1)
def _colours() -> tuple[_Colour, ...]:
    n = N_BLOCKS * N_FINE
    # 1/f noise by Kasdin's filter (fractional integration of order one half); the walk is summed white noise.
    taps = np.cumprod(np.concatenate([[1.0], (np.arange(1, n) - 0.5) / np.arange(1, n)]))
    flicker, walk = toeplitz(taps, np.zeros(n)), np.tril(np.ones((n, n)))
    mean = np.kron(np.eye(N_BLOCKS), np.ones((1, N_FINE)) / N_FINE)
    about_mean = np.linalg.svd(np.eye(N_BLOCKS) - 1.0 / N_BLOCKS)[0][:, :-1].T
    out = []
    for filtered in (0.0 * walk, *(c * flicker for c in FLICKER), *(c * walk for c in WALK)):
        cov = mean @ (np.eye(n) + filtered @ filtered.T) @ mean.T
        change = np.diff(np.eye(N_BLOCKS), axis=0)
        cov /= np.diag(change @ cov @ change.T).mean() / 2.0
        root = np.linalg.cholesky(about_mean @ cov @ about_mean.T)
        whiten = np.linalg.solve(root, about_mean)
        out.append(_Colour(whiten, 2.0 * float(np.log(np.diag(root)).sum()), _LEVELS @ whiten.T))
    return tuple(out)
