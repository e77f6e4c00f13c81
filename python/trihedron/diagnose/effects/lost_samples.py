"""Losses of samples: intervals where the two sides join only if samples are inserted (eq. 8.16)."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from trihedron.arrays import TINY, FloatArray, IntArray
from trihedron.diagnose.effects.plateaus import HALF_WINDOW, clipped_samples
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import move_residuals
from trihedron.records import Recording, Segments
from trihedron.session.model import SessionState

MOST_LOST, LONGEST_LOSS_S = 60, 0.15
"""Longest gap, samples or seconds, whichever is more, that is tried: a fifth of a quick hand move."""
LEAST_GAIN = 20.0
"""Log-likelihood that missing samples must gain at a place: by chance once in 5·10⁸, more often where the motion is no
stationary process (a jolt); gravity after the move decides."""
ORDER = 10
"""Order of the autoregression that predicts the motion from sample to sample."""
SPECTRUM = 2**14
"""Frequencies of its spectrum: many more than samples in a gap."""
N_COARSE = 8
"""Counts tried at every place; all are tried where one of these gains half of what is needed."""
NOT_ZERO = 1e-9
"""Share of white noise in the covariance of the motion, so that it has an inverse."""
LEVEL = 10.0
"""Variance of a window's mean over that of the motion: it is free."""
FEWEST_OF_PARABOLA = 6
"""Samples from which the slope of a parabola is more precise than the first step: twice its number of parameters."""


@dataclass(frozen=True)
class Loss:
    """Samples missing behind ``sample`` of ``move``: their number, and the chi-square that it gains."""

    sample: int
    move: int
    count: int
    gain: float


def most_lost(obs: Observations) -> int:
    """Largest number of samples tried at one place."""
    return max(MOST_LOST, round(LONGEST_LOSS_S * obs.recording.rate_hz))


@lru_cache(maxsize=8)
def find_losses(obs: Observations) -> tuple[Loss, ...]:
    """Intervals where the motion on either side joins only if samples are inserted (eq. 8.16), move after move.

    Over windows of six samples before and six after, in both sensors, likelihoods of an autoregression are compared: n
    samples missing, or none. Its size is each window's own.
    """
    models = [_model(obs, values) for values in obs.whitened]
    losses = sorted((one for m in range(obs.n_moves) for one in _losses_of(obs, models, m)), key=lambda one: -one.gain)
    chosen: list[Loss] = []
    for loss in losses:
        if all(abs(loss.sample - other.sample) > 2 * HALF_WINDOW for other in chosen):
            chosen.append(loss)
    return tuple(sorted(chosen, key=lambda loss: loss.sample))


def _losses_of(obs: Observations, models: list[tuple[FloatArray, FloatArray]], m: int) -> list[Loss]:
    (a, b), w, most = obs.move_ranges[m], HALF_WINDOW, most_lost(obs)
    k = a + np.arange(w - 1, b - a - w)
    gaps = np.cumsum(np.diff(obs.time_s, prepend=obs.time_s[0]) > 1.5 / obs.recording.rate_hz)
    k = k[~clipped_samples(obs)[k] & (gaps[k + w] == gaps[k + 1 - w])]
    coarse = np.unique(np.r_[0, np.rint(np.geomspace(1, most, N_COARSE))]).astype(np.intp)
    k = k[_gains(obs, models, k, coarse).max(axis=1) > 0.5 * LEAST_GAIN]
    gains = _gains(obs, models, k, np.arange(most + 1))
    best = gains.argmax(axis=1)
    return [
        Loss(int(sample), m, int(n), 2.0 * float(gain))
        for sample, n, gain in zip(k, best, gains.max(axis=1), strict=True)
        if gain > LEAST_GAIN and 0 < n < most
    ]


def _gains(
    obs: Observations, models: list[tuple[FloatArray, FloatArray]], samples: IntArray, counts: IntArray
) -> FloatArray:
    """(samples, counts) log-likelihood that missing samples behind each of ``samples`` gain, the first count none."""
    out = np.zeros((len(samples), len(counts)))
    for (inverse, log_det), values in zip(models, obs.whitened, strict=True):
        window = np.stack([values[samples + o] for o in range(1 - HALF_WINDOW, HALF_WINDOW + 1)])
        n, _, axes = window.shape
        flat = (window - window.mean(axis=0)).reshape(n, -1)
        for c, count in enumerate(counts):
            squares = ((inverse[count] @ flat) ** 2).sum(axis=0).reshape(-1, axes).sum(axis=1)
            out[:, c] -= 0.5 * axes * (n * np.log(squares + TINY) + log_det[count])
    return out - out[:, :1]


def _model(obs: Observations, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of one sensor's motion in windows with 0, 1, ... samples missing in their middle: the inverse Cholesky factor
    (counts, 2w, 2w) of its covariance, its mean free, and the logarithm of the determinant (counts,)."""
    covariance = _autocovariance([values[a:b] for a, b in obs.move_ranges])
    w, inverse, log_det = HALF_WINDOW, [], []
    for n in range(most_lost(obs) + 1):
        at = np.r_[np.arange(w), np.arange(w) + w + n]
        lag = covariance[np.abs(at[:, None] - at)]
        half = np.linalg.cholesky(lag + covariance[0] * (LEVEL + NOT_ZERO * np.eye(2 * w)))
        inverse.append(np.linalg.inv(half))
        log_det.append(2.0 * float(np.log(np.diag(half)).sum()))
    return np.stack(inverse), np.array(log_det)


def _autocovariance(moves: list[FloatArray]) -> FloatArray:
    """(lags,) autocovariance of the autoregression that Burg's method fits to all moves and axes together (Burg 1975),
    every move in units of its own steps."""
    forward = [(one - one.mean(axis=0)) / (np.sqrt(np.mean(np.diff(one, axis=0) ** 2)) + TINY) for one in moves]
    backward = forward
    coefficients = np.ones(1)
    for _ in range(ORDER):
        pairs = [(f[1:], b[:-1]) for f, b in zip(forward, backward, strict=True) if len(f) > 1]
        power = sum(float((f**2).sum() + (b**2).sum()) for f, b in pairs)
        reflection = -2.0 * sum(float((f * b).sum()) for f, b in pairs) / max(power, TINY)
        forward = [f + reflection * b for f, b in pairs]
        backward = [b + reflection * f for f, b in pairs]
        longer = np.append(coefficients, 0.0)
        coefficients = longer + reflection * longer[::-1]
    return np.fft.irfft(1.0 / np.abs(np.fft.rfft(coefficients, SPECTRUM)) ** 2, SPECTRUM)


def residual_after(obs: Observations, state: SessionState, m: int, losses: dict[int, int]) -> FloatArray:
    """(5,) residuals of gravity and velocity after one move with ``losses`` inserted, in standard errors."""
    return np.asarray(move_residuals(with_inserted(obs, m, losses), state)[0])


def with_inserted(obs: Observations, m: int, losses: dict[int, int]) -> Observations:
    """One move alone, with ``losses`` (counts after samples) inserted."""
    a, b = obs.move_ranges[m]
    assert obs.raw_rate is not None
    own = {k - a: n for k, n in losses.items()}
    time = with_time(obs.time_s[a:b], own, 1.0 / obs.recording.rate_hz)
    force, rate = (with_bridges(one[a:b], own) for one in (obs.raw_force, obs.raw_rate))
    ranges, poses = ((0, len(time)),), obs.move_poses[m : m + 1]
    return replace(obs, time_s=time, raw_force=force, raw_rate=rate, move_ranges=ranges, move_poses=poses)


def insert_samples(recording: Recording, segments: Segments, losses: dict[int, int]) -> tuple[Recording, Segments]:
    """Recording and segments with ``n`` samples inserted behind sample ``k`` for every ``k: n``."""
    place = moved(recording.n_samples, losses)
    time_s = with_time(recording.time_s, losses, 1.0 / recording.rate_hz)
    channels = ("accelerometer", "gyroscope", "temperature_degc", "supply_v")
    logged = {name: value for name in channels if (value := getattr(recording, name)) is not None}
    values: dict[str, Any] = {name: with_bridges(value, losses) for name, value in logged.items()}
    mended = replace(recording, time_s=time_s, auxiliary=type(recording.auxiliary)({}), **values)
    mended = mended.with_facts(recording.facts.moved(place))

    def at(index: int) -> int:
        return int(place[index]) if index < len(place) else len(time_s)

    poses = tuple(
        replace(
            pose, start=at(pose.start), stop=at(pose.stop - 1) + 1, outer_start=at(pose.outer_start),
            outer_stop=at(pose.outer_stop - 1) + 1,
            disturbed=tuple((at(a), at(b - 1) + 1) for a, b in pose.disturbed),
        )
        for pose in segments.poses
    )  # fmt: skip
    moves = tuple(
        replace(move, start=poses[move.pose_before].stop, stop=poses[move.pose_after].start) for move in segments.moves
    )
    mid = np.array([0.5 * (time_s[h.start] + time_s[h.stop - 1]) for h in poses])
    return mended, replace(segments, poses=poses, moves=moves, time_mid_s=mid, whole=None)


def moved(n: int, losses: dict[int, int]) -> IntArray:
    """(n,) places of samples once ``losses`` (counts after samples) are inserted."""
    extra = np.zeros(n, dtype=np.intp)
    extra[[k + 1 for k in losses]] = list(losses.values())
    return np.arange(n) + np.cumsum(extra)


def with_time(time_s: FloatArray, losses: dict[int, int], step_s: float) -> FloatArray:
    """Timestamps with those of the losses; behind a gap they move by the time lost."""
    place = moved(len(time_s), losses)
    return np.interp(np.arange(place[-1] + 1), place, time_s + (place - np.arange(len(place))) * step_s)


def with_bridges(values: FloatArray, losses: dict[int, int]) -> FloatArray:
    """Values (n, ...) with samples on a cubic across every loss."""
    place = moved(len(values), losses)
    out = np.empty((place[-1] + 1, *values.shape[1:]))
    out[place] = values
    for k, n in losses.items():
        out[place[k] + 1 : place[k + 1]] = bridge(values, k, n)
    return out


def bridge(values: FloatArray, k: int, n: int) -> FloatArray:
    """(n, ...) samples between ``k`` and ``k + 1`` on a cubic Hermite by the values and slopes on either side.

    The error of the rotation integrated across the gap is of fifth order in its length.
    """
    if k < 1 or k + 2 >= len(values):
        return np.repeat(values[k : k + 1], n, axis=0)
    a, da = _edge(values[max(k - max(n // 2, 1), 0) : k + 1][::-1])
    b, db = _edge(values[k + 1 : k + 2 + max(n // 2, 1)])
    da = -da
    x = (np.arange(1, n + 1) / (n + 1)).reshape(-1, *([1] * (values.ndim - 1)))
    width = n + 1
    h00, h10 = 2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x
    h01, h11 = -2 * x**3 + 3 * x**2, x**3 - x**2
    out: FloatArray = h00 * a + h10 * width * da + h01 * b + h11 * width * db
    return out


def _edge(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and slope at the first of the samples (m, ...), from a parabola where there are enough: the noise of a
    single step would be multiplied by the length of the gap."""
    if len(values) < FEWEST_OF_PARABOLA:
        return values[0], values[1] - values[0]
    x = np.arange(len(values))
    slope, value = np.polynomial.polynomial.polyfit(x, values.reshape(len(values), -1), 2)[1::-1]
    return value.reshape(values.shape[1:]), slope.reshape(values.shape[1:])
