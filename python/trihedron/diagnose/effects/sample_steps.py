"""Time errors read from the samples themselves: how far each step is from the one its surroundings announce."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.ndimage import percentile_filter

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.plateaus import plateaus_of
from trihedron.diagnose.session.observations import Observations

HALF_WINDOW = 6
"""Samples on either side from which the local motion is learnt."""
MOST_LOST, LONGEST_LOSS_S = 60, 0.15
"""Samples and seconds, whichever is more, over which a motion may be joined: a fifth of a quick move of the hand."""
AGREEMENT = 30.0
"""Chi-square that one sensor may lose by the count both share."""
AGREEMENT_SHARE = 0.01
"""The same as a share of the joint's own chi-square: a large gap is no exact cubic."""
LEAST_GAIN = 40.0
"""Chi-square a count must win: by chance once in 4·10⁹, once in 650 sessions of 10⁵ intervals and 60 counts each."""
OVER_USUAL, LEFT_SHARE = 5.0, 0.1
"""It must also win five times what joints nearby cost anyway, and leave little: none was found in 48
healthy sessions."""


@dataclass(frozen=True, eq=False)
class StepErrors:
    """Per inner interval of every move, the extra time each sensor sees in its step, with its noise.

    ``sample`` (k,) first sample of the interval, ``move`` (k,); ``extra_s`` (k, sensors), ``sigma_s`` (k, sensors).
    """

    sample: npt.NDArray[np.intp]
    move: npt.NDArray[np.intp]
    extra_s: FloatArray
    sigma_s: FloatArray


def _whitened(obs: Observations) -> list[FloatArray]:
    root = np.sqrt(obs.recording.rate_hz)
    out = [obs.raw_force / (obs.force_density * root)]
    if obs.raw_rate is not None and obs.rate_density is not None:
        out.append(obs.raw_rate / (obs.rate_density * root))
    return out


@lru_cache(maxsize=8)
def clipped_samples(obs: Observations) -> npt.NDArray[np.bool_]:
    """Samples on or next to a plateau at the end of the range: their steps say nothing about time."""
    mask = np.zeros(len(obs.time_s), dtype=bool)
    for is_gyro in (False, True):
        for run in plateaus_of(obs, is_gyro=is_gyro):
            mask[max(run.start - HALF_WINDOW, 0) : run.stop + HALF_WINDOW] = True
    return mask


def step_errors(context: Context) -> StepErrors:
    """The step errors of the recording as it is now observed, found once."""
    return _step_errors(context.obs)


@lru_cache(maxsize=8)
def _step_errors(obs: Observations) -> StepErrors:
    """A step against the slope of a line through the samples around it (the two of the step left out).

    The slope comes from a wide window, so that shaking does not pass for motion; each sensor is judged for itself, so
    that only what both see at once is time.
    """
    sensors = _whitened(obs)
    clipped = clipped_samples(obs)
    w = HALF_WINDOW
    offsets = np.r_[-w:0, 2 : w + 2].astype(float) - 0.5  # the interval's middle is zero
    weights = offsets / (offsets**2).sum()
    index, moves, extra, sigma = [], [], [], []
    for m, (a, b) in enumerate(obs.move_ranges):
        n = b - a
        if n < 2 * w + HALF_WINDOW:
            continue
        step_s = float(np.median(np.diff(obs.time_s[a:b])))
        k = np.arange(w, n - w - 1)
        ok = ~clipped[a + k]
        columns_e, columns_s = [], []
        for x in sensors:
            z = x[a:b]
            gathered = np.stack([z[k + int(o + 0.5)] for o in offsets])
            slope = np.tensordot(weights, gathered, 1) / step_s
            # Third derivative: the line's slope errs by it; taking the cubic part out leaves only higher orders.
            jump = z[k + 1] - z[k]
            near = 0.5 * ((z[k] - z[k - 1]) + (z[k + 2] - z[k + 1]))
            error = jump - near
            power = (slope**2).sum(axis=1) / 5.0
            columns_e.append((slope * error).sum(axis=1) / 5.0 / np.maximum(power, 1e-30))
            columns_s.append(1.0 / np.sqrt(np.maximum(power, 1e-30)))
        index.append((a + k)[ok])
        moves.append(np.full(int(ok.sum()), m))
        extra.append(np.stack(columns_e, axis=1)[ok])
        sigma.append(np.stack(columns_s, axis=1)[ok])
    if not index:
        return StepErrors(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 2)), np.zeros((0, 2)))
    return StepErrors(
        np.concatenate(index).astype(np.intp),
        np.concatenate(moves).astype(np.intp),
        np.concatenate(extra),
        np.concatenate(sigma),
    )


@dataclass(frozen=True)
class Loss:
    """Samples missing behind ``sample`` of ``move``: how many, and the chi-square that the count explains."""

    sample: int
    move: int
    count: int
    gain: float
    per_sensor: tuple[float, ...]


def most_lost(obs: Observations) -> int:
    """Samples that may be missing at one place, at most."""
    return max(MOST_LOST, round(LONGEST_LOSS_S * obs.recording.rate_hz))


@lru_cache(maxsize=4)
def _joints(w: int, order: int, most: int) -> FloatArray:
    """(counts, 2w, 2w) projectors onto what no polynomial of so many coefficients joins across n missing samples."""
    projectors = []
    for n in range(most + 1):
        t = np.r_[np.arange(-w, 0) + 0.5, np.arange(w) + 0.5 + n] / (w + n / 2)
        q, _ = np.linalg.qr(np.vander(t - t.mean(), order))
        projectors.append(np.eye(2 * w) - q @ q.T)
    return np.stack(projectors)


def _unjoined(projector: FloatArray, windows: FloatArray) -> FloatArray:
    """(k,) squares of what a join leaves of ``windows`` (2w, k, axes): a projector is its own square."""
    left = (projector @ windows.reshape(len(windows), -1)).reshape(windows.shape)
    return np.asarray(np.einsum("ikc,ikc->k", left, left))


def _trials(projectors: FloatArray, windows: FloatArray) -> FloatArray:
    """(k, counts) the same for every count of missing samples."""
    left = projectors.reshape(-1, len(windows)) @ windows.reshape(len(windows), -1)
    left = left.reshape(len(projectors), *windows.shape)
    return np.asarray(np.einsum("nikc,nikc->kn", left, left))


def joint_costs(obs: Observations, samples: npt.NDArray[np.intp], w: int, most: int) -> FloatArray:
    """(k, counts, sensors) what a cubic through ``w`` samples before and after leaves, none to ``most`` put between."""
    sensors = _whitened(obs)
    windows = [np.stack([x[samples + o] for o in range(1 - w, w + 1)]) for x in sensors]
    return np.stack([_trials(_joints(w, 4, most), v) for v in windows], axis=2)


def find_losses(context: Context) -> list[Loss]:
    """The losses of the recording as it is now observed, found once."""
    return list(_losses(context.obs))


@lru_cache(maxsize=8)
def _losses(obs: Observations) -> list[Loss]:
    """Intervals where the motion on either side joins smoothly only if samples are put between (eq. 8.16).

    For a trial count n one cubic is laid through six samples before and six after, those after moved by n steps. The
    count that joins all channels best is taken if no sensor objects and what is left is ordinary.
    """
    sensors = _whitened(obs)
    clipped = clipped_samples(obs)
    w = HALF_WINDOW
    most = most_lost(obs)
    stack, stiffer = _joints(w, 4, most), _joints(w, 6, most)
    losses: list[Loss] = []
    for m, (a, b) in enumerate(obs.move_ranges):
        if b - a < 2 * w + 2:
            continue
        k = np.arange(w - 1, b - a - w)
        k = k[~clipped[a + k]]
        if len(k) == 0:
            continue
        windows = [np.stack([x[a + k + o] for o in range(1 - w, w + 1)]) for x in sensors]
        zero = np.stack([_unjoined(stack[0], v) for v in windows], axis=1)
        dof = 3 * (2 * w - 4)
        # What a join costs anyway where the motion is as quick as here: jitter and curvature are no losses.
        ordinary = np.stack(
            [percentile_filter(zero[:, c], 75, size=8 * w + 1, mode="nearest") for c in range(zero.shape[1])], axis=1
        )
        # Only steps that stand out are worth a search; the quieter sensor may be too noisy to show the jump.
        suspect = np.flatnonzero((zero > 3.0 * np.maximum(ordinary, dof)).any(axis=1))
        if len(suspect) == 0:
            continue
        trial = np.stack([_trials(stack, v[:, suspect]) for v in windows], axis=2)
        # Quick motion over a wide gap is no cubic: a quintic where the cubic leaves too much.
        quick = (trial.min(axis=1) > 3.0 * np.maximum(ordinary[suspect], dof)).any(axis=1)
        if quick.any():
            rows = suspect[quick]
            trial[quick] = np.stack([_trials(stiffer, v[:, rows]) for v in windows], axis=2)
        total = trial.sum(axis=2)
        # Where the minimum is flat the smallest count that joins as well: gravity after the move tells more exactly.
        best = (total <= total.min(axis=1, keepdims=True) + AGREEMENT).argmax(axis=1)
        for row, s in enumerate(suspect):
            n = int(best[row])
            if n == 0 or n == most:
                continue
            left = trial[row, n]
            gains = zero[s] - left
            usual = np.maximum(ordinary[s], dof)
            # The gain must also exceed what a trial count wins where the signal is merely rough (shaking, jitter).
            clear = (gains > LEAST_GAIN) & (gains > OVER_USUAL * usual) & (left < LEFT_SHARE * zero[s] + 3.0 * usual)
            # A sensor that sees nothing of it must at least not object; one that sees it must see the same count.
            silent = ~clear & (left < 2.0 * usual)
            good = bool(clear.any() and (clear | silent).all())
            # A count that suits one sensor much better than the common one is no loss of samples.
            agree = all(
                trial[row, n, c] - trial[row, :, c].min() <= max(AGREEMENT, AGREEMENT_SHARE * zero[s, c])
                for c in range(len(windows))
                if clear[c]
            )
            if good and agree:
                losses.append(Loss(int(a + k[s]), m, n, float(gains.sum()), tuple(float(g) for g in gains)))
    losses.sort(key=lambda loss: -loss.gain)
    chosen: list[Loss] = []
    for loss in losses:
        if all(abs(loss.sample - other.sample) > 2 * w for other in chosen):
            chosen.append(loss)
    return sorted(chosen, key=lambda loss: loss.sample)
