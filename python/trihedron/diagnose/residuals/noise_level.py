"""Noise inside poses that changes for a while: one level in consecutive poses, against one of each pose (eq. 8.7g)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.diagnose.effects.contract import SENSORS
from trihedron.diagnose.residuals.goodness_of_fit import CHANNELS
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import CLEAR
from trihedron.quantiles import medians
from trihedron.ranges import Range
from trihedron.records.diagnosis import EffectParameter, Relation
from trihedron.records.words import relation_experiment, relation_resembles, words
from trihedron.session.noise import FEWEST_POSES
from trihedron.session.rounding import undithered_axes

ORDERS = (2, 1)
"""Differences of readings whose variances are compared: the second for the level, because motion is slow; the first
shows with it whether the spectrum is that of noise."""
NORMS = (6.0, 2.0)
"""Variance of these differences of white noise of variance one."""
SAMPLES_OF_ONE = 1.94
"""Readings for every independent square of second differences of white noise, twice the sum of squared correlations
less one."""
SPAN, OF_AXES = 2.0, 1.0
"""Standard deviations of the logarithm of a loud pose's variance: common to the axes, and of each axis beside it."""
SCATTERS = (0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
"""Scatter of that logarithm over usual poses, beyond chance; the likeliest of these."""
SHARES = np.linspace(0.01, 0.6, 30)
"""Share of poses with a level of their own; the likeliest of these."""
USUAL_SHARE = 0.1
"""The same while an interval is sought."""
SAME_SHAPE = np.log(1.3)
"""Largest difference between the ratios of both variances, in their logarithm: a hand or a support that vibrates has
most of its power in the first differences."""
LEAST_RATIO = 2.0
"""Variance over the usual one from which a change is named, or its inverse: noise of a part changes by a factor of two
over a hundred kelvin."""


@dataclass(frozen=True, eq=False)
class NoiseChange:
    """Noise of one sensor (0 accelerometer, 1 gyro) in poses ``first`` to ``last`` over that of the others.

    ``axes`` are those tested, ``ratio`` of the standard deviations with ``sigma``; ``score`` is twice the
    log-likelihood gained, less its penalty; ``share`` is that of the excess in the variance of all poses.
    """

    sensor: int
    first: int
    last: int
    axes: tuple[int, ...]
    ratio: FloatArray
    sigma: FloatArray
    score: float
    share: float

    @property
    def changed(self) -> list[int]:
        """Places in ``axes`` of those whose noise differs."""
        return np.flatnonzero(np.abs(self.ratio - 1.0) > CLEAR * self.sigma).tolist()

    @property
    def channels(self) -> list[str]:
        """Channels whose noise differs."""
        return [CHANNELS[3 * self.sensor + self.axes[k]] for k in self.changed]


@lru_cache(maxsize=4)
def noise_changes(obs: Observations) -> tuple[NoiseChange, ...]:
    """The interval of poses of each sensor whose noise differs most clearly from that of all others, if one does."""
    poses = [pose.undisturbed() for pose in obs.segments.poses]
    moves = [[span] for span in obs.move_ranges]
    found = (_change(obs, sensor, poses, moves) for sensor in range(obs.readings.shape[1] // 3))
    return tuple(one for one in found if one is not None and one.score > 0.0)


def noise_relations(obs: Observations, limit: float) -> tuple[Relation, ...]:
    """The changes that score more than ``limit``, as empirical relations of the noise to time."""
    poses, t = obs.segments.poses, obs.time_s
    out = []
    for one in (change for change in noise_changes(obs) if change.score > limit):
        label, *_ = SENSORS[one.sensor]
        begins_s, ends_s = float(t[poses[one.first].start]), float(t[poses[one.last].stop - 1])
        each = zip(one.channels, one.ratio[one.changed], one.sigma[one.changed], strict=True)
        ratios = tuple(EffectParameter(name, float(ratio), float(sigma), "1") for name, ratio, sigma in each)
        said = words(
            "relation-follows-noise", sensor=label, ratios=[ratio.value for ratio in ratios],
            axes=[name[1] for name in one.channels], begins_s=begins_s, ends_s=ends_s,
        )  # fmt: skip
        out.append(Relation(
            "gyroscope" if one.sensor else "accelerometer", ("time",), words("relation-form-noise"), ratios, one.share,
            None, relation_resembles("noise"), relation_experiment("noise"), said,
        ))  # fmt: skip
    return tuple(out)


def _change(obs: Observations, sensor: int, poses: list[list[Range]], moves: list[list[Range]]) -> NoiseChange | None:
    readings = (obs.raw_force, obs.raw_rate)[sensor]
    assert readings is not None
    steps = obs.recording.facts.steps[3 * sensor : 3 * sensor + 3]
    variance, n = _variances(readings, poses)
    usable = np.flatnonzero(n > 0)
    if len(usable) < FEWEST_POSES:
        return None
    usual = np.array([medians(variance[usable, k]) for k in range(2)])
    is_coarse = undithered_axes(steps, np.sqrt(usual[1]))
    axes = np.flatnonzero(~is_coarse & (variance[usable].min(axis=(0, 1)) > 0.0))
    if not len(axes):
        return None
    logs = np.log(variance[usable][:, :, axes] / usual[:, axes])
    noise = np.repeat(2.0 * SAMPLES_OF_ONE / n[usable, None], len(axes), axis=1)
    score, inside, level = _interval(logs[:, 0], noise)
    if np.abs(level).max() < np.log(LEAST_RATIO) or not _is_noise(logs[inside], usual[:, axes]):
        return None
    first, last = usable[inside][[0, -1]]
    in_moves = _variances(readings, moves)
    excess = np.exp(level)
    agree = _moves_agree(
        (in_moves[0][:, 0, axes] / usual[0, axes]).mean(axis=1), in_moves[1] * len(axes),
        (obs.move_poses >= first).all(axis=1) & (obs.move_poses <= last).all(axis=1), float(excess.mean()),
    )  # fmt: skip
    if agree is None:
        return None
    share = float(np.average(inside, weights=n[usable])) * float(np.abs(excess - 1.0).mean())
    sigma = np.sqrt(1.0 / (1.0 / noise[inside]).sum(axis=0))
    ratio = np.exp(0.5 * level)
    return NoiseChange(
        sensor, int(first), int(last), tuple(axes.tolist()), ratio, 0.5 * ratio * sigma, score + agree,
        share / (1.0 + share),
    )  # fmt: skip


def _variances(readings: FloatArray, stretches: list[list[Range]]) -> tuple[FloatArray, FloatArray]:
    """(k, 2, 3) variances of the readings by second and first differences, and (k,) readings of every stretch."""
    out, n = np.zeros((len(stretches), 2, 3)), np.zeros(len(stretches))
    for k, parts in enumerate(stretches):
        for j, (order, norm) in enumerate(zip(ORDERS, NORMS, strict=True)):
            steps = np.concatenate([np.diff(readings[a:b], order, axis=0) for a, b in parts or [(0, 0)]])
            steps = steps[np.isfinite(steps).all(axis=1)]
            if len(steps):
                out[k, j] = (steps**2).mean(axis=0) / norm
                n[k] = len(steps) if j == 0 else n[k]
    return out, n


def _of_one_level(away: FloatArray, variance: FloatArray) -> FloatArray:
    """(h,) log-likelihood of poses at one level, ``away`` (h, k) from it."""
    return np.asarray(-0.5 * (away**2 / variance + np.log(2.0 * np.pi * variance)).sum(axis=-1))


def _of_any_level(logs: FloatArray, variance: FloatArray) -> FloatArray:
    """(h,) log-likelihood of poses with levels of their own: normal, common part and axes."""
    own = OF_AXES**2 + variance
    weight = 1.0 + SPAN**2 * (1.0 / own).sum(axis=-1)
    chi2 = (logs**2 / own).sum(axis=-1) - SPAN**2 * (logs / own).sum(axis=-1) ** 2 / weight
    return np.asarray(-0.5 * (chi2 + np.log(2.0 * np.pi * own).sum(axis=-1) + np.log(weight)))


def _mixed(one_level: FloatArray, any_level: FloatArray, share: FloatArray | float) -> FloatArray:
    return np.asarray(np.logaddexp(np.log1p(-share) + one_level, np.log(share) + any_level))


def _interval(logs: FloatArray, noise: FloatArray) -> tuple[float, BoolArray, FloatArray]:
    """Score of the best interval of poses, which poses it has (h,), and its level (k,)."""
    n = len(logs)
    without, best = -np.inf, (-np.inf, np.zeros(n, dtype=bool), np.zeros(logs.shape[1]))
    for scatter in SCATTERS:
        variance = noise + scatter**2
        usual, own = _of_one_level(logs, variance), _of_any_level(logs, variance)
        shares = SHARES[:, None]
        without = max(without, float(_mixed(usual, own, shares).sum(axis=1).max()))
        tried = {_longest_gain(_mixed(_of_one_level(logs - level, variance), own, USUAL_SHARE)
                               - _mixed(usual, own, USUAL_SHARE)) for level in logs}  # fmt: skip
        for first, stop in tried:
            if stop - first > n // 2:
                continue
            inside = np.zeros(n, dtype=bool)
            inside[first:stop] = True
            level = medians(logs[inside])
            spread = 1.0 / (1.0 / variance[inside]).sum(axis=0)
            as_one = np.where(inside, _of_one_level(logs - level, variance), usual)
            # The level is integrated out: its prior is that of a loud pose.
            gain = float(_mixed(as_one, own, shares).sum(axis=1).max() + _of_any_level(level, np.zeros_like(level)))
            gain += 0.5 * float(np.log(2.0 * np.pi * spread).sum())
            if gain > best[0]:
                best = gain, inside, level
    # Two sensors, and every interval of poses.
    return 2.0 * (best[0] - without) - 2.0 * float(np.log(n * (n + 1))), best[1], best[2]


def _longest_gain(gain: FloatArray) -> Range:
    """The half-open range with the largest sum."""
    total = np.concatenate([[0.0], np.cumsum(gain)])
    lowest = np.minimum.accumulate(total)
    stop = int((total - lowest).argmax())
    return int(total[: stop + 1].argmin()), stop


def _is_noise(logs: FloatArray, usual: FloatArray) -> bool:
    """Whether the excess of poses (h, 2, k) is white, or has the spectrum of the usual noise, of variances (2, k)."""
    fast, all_of_it = medians(logs.reshape(len(logs), -1)).reshape(2, -1)
    white = np.log1p(np.maximum(np.expm1(fast) * usual[0] / usual[1], -0.99))
    return bool(min(np.abs(all_of_it - white).mean(), np.abs(all_of_it - fast).mean()) < SAME_SHAPE)


def _moves_agree(power: FloatArray, n: FloatArray, inside: BoolArray, level: float) -> float | None:
    """Score by the moves (m,): noise of the sensor continues through those ``inside``, whose ``power`` over the usual
    noise is then ``level`` at least; None where it does not. Without it they would be any of all moves."""
    if level < 1.0 or not inside.any():
        return 0.0
    reach = power >= level * (1.0 - CLEAR * np.sqrt(2.0 * SAMPLES_OF_ONE / np.maximum(n, 1.0)))
    if not reach[inside].all():
        return None
    chosen = np.arange(np.count_nonzero(inside))
    return float(-2.0 * np.log((np.count_nonzero(reach) - chosen) / (len(power) - chosen)).sum())
