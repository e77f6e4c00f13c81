"""Time errors from the samples: how far each step of a reading deviates from the steps around it."""

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
"""Samples on either side that determine the local motion."""
MOST_LOST, LONGEST_LOSS_S = 60, 0.15
"""Longest gap, samples or seconds, whichever is more, that is tried: a fifth of a quick hand move."""
AGREEMENT = 30.0
"""Chi-square by which the common count may fit one sensor worse than its own best count."""
AGREEMENT_SHARE = 0.01
"""The same as a share of the chi-square without samples inserted: a large gap is no exact cubic."""
LEAST_GAIN = 40.0
"""Chi-square that a count must gain: by chance once in 4·10⁹, once in 650 sessions of 10⁵ intervals and 60 counts."""
OVER_USUAL, LEFT_SHARE = 5.0, 0.1
"""The gain must also be five times the usual chi-square of joins nearby, and the remainder small: no loss is found
in 48 healthy sessions."""


@dataclass(frozen=True, eq=False)
class StepErrors:
    """Extra time that each sensor sees in its step, per inner interval of every move, with its noise.

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
    """(n,) samples within ``HALF_WINDOW`` of a plateau at a range limit: their steps give no time error."""
    mask = np.zeros(len(obs.time_s), dtype=bool)
    for is_gyro in (False, True):
        for run in plateaus_of(obs, is_gyro=is_gyro):
            mask[max(run.start - HALF_WINDOW, 0) : run.stop + HALF_WINDOW] = True
    return mask


def step_errors(context: Context) -> StepErrors:
    """The step errors of the recording as currently observed; cached."""
    return _step_errors(context.obs)


@lru_cache(maxsize=8)
def _step_errors(obs: Observations) -> StepErrors:
    """A step minus the mean of the two steps beside it, in units of the local slope of the signal.

    The slope is that of a line through the six samples on either side, the two of the step left out, so that vibration
    is not taken for motion. Each sensor is evaluated by itself: only an error common to both is one of time.
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
            # Zero for a parabola; the third derivative and higher orders remain.
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
    """Samples missing behind ``sample`` of ``move``: their number, and the chi-square that it gains."""

    sample: int
    move: int
    count: int
    gain: float
    per_sensor: tuple[float, ...]


def most_lost(obs: Observations) -> int:
    """Largest number of samples tried at one place."""
    return max(MOST_LOST, round(LONGEST_LOSS_S * obs.recording.rate_hz))


@lru_cache(maxsize=4)
def _joints(w: int, order: int, most: int) -> FloatArray:
    """(counts, 2w, 2w) residual projectors of a polynomial of ``order`` coefficients across n missing samples."""
    projectors = []
    for n in range(most + 1):
        t = np.r_[np.arange(-w, 0) + 0.5, np.arange(w) + 0.5 + n] / (w + n / 2)
        q, _ = np.linalg.qr(np.vander(t - t.mean(), order))
        projectors.append(np.eye(2 * w) - q @ q.T)
    return np.stack(projectors)


def _unjoined(projector: FloatArray, windows: FloatArray) -> FloatArray:
    """(k,) sum of squared residuals of ``windows`` (2w, k, axes) for one count: a projector is its own square."""
    left = (projector @ windows.reshape(len(windows), -1)).reshape(windows.shape)
    return np.asarray(np.einsum("ikc,ikc->k", left, left))


def _trials(projectors: FloatArray, windows: FloatArray) -> FloatArray:
    """(k, counts) sum of squared residuals of ``windows`` (2w, k, axes) for every count of missing samples."""
    left = projectors.reshape(-1, len(windows)) @ windows.reshape(len(windows), -1)
    left = left.reshape(len(projectors), *windows.shape)
    return np.asarray(np.einsum("nikc,nikc->kn", left, left))


def joint_costs(obs: Observations, samples: npt.NDArray[np.intp], w: int, most: int) -> FloatArray:
    """(k, counts, sensors) chi-square of a cubic through ``w`` samples on either side, 0 to ``most`` inserted."""
    sensors = _whitened(obs)
    windows = [np.stack([x[samples + o] for o in range(1 - w, w + 1)]) for x in sensors]
    return np.stack([_trials(_joints(w, 4, most), v) for v in windows], axis=2)


def find_losses(context: Context) -> list[Loss]:
    """The losses of the recording as currently observed; cached."""
    return list(_losses(context.obs))


@lru_cache(maxsize=8)
def _losses(obs: Observations) -> list[Loss]:
    """Intervals where the motion on either side joins smoothly only if samples are inserted (eq. 8.16).

    For a trial count n one cubic is fitted to six samples before and six after, those after shifted by n steps. The
    count that fits all channels best is accepted if no sensor contradicts it and the remaining chi-square is usual.
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
        # Usual chi-square of joins in motion as quick as here: jitter and curvature are no losses.
        ordinary = np.stack(
            [percentile_filter(zero[:, c], 75, size=8 * w + 1, mode="nearest") for c in range(zero.shape[1])], axis=1
        )
        # Only steps that stand out are searched; the quieter sensor may be too noisy to show the jump.
        suspect = np.flatnonzero((zero > 3.0 * np.maximum(ordinary, dof)).any(axis=1))
        if len(suspect) == 0:
            continue
        trial = np.stack([_trials(stack, v[:, suspect]) for v in windows], axis=2)
        # Quick motion over a wide gap is no cubic: a quintic is used where the cubic leaves too much.
        quick = (trial.min(axis=1) > 3.0 * np.maximum(ordinary[suspect], dof)).any(axis=1)
        if quick.any():
            rows = suspect[quick]
            trial[quick] = np.stack([_trials(stiffer, v[:, rows]) for v in windows], axis=2)
        total = trial.sum(axis=2)
        # Where the minimum is flat the smallest count is taken: the tilt error after the move gives the exact one.
        best = (total <= total.min(axis=1, keepdims=True) + AGREEMENT).argmax(axis=1)
        for row, s in enumerate(suspect):
            n = int(best[row])
            if n == 0 or n == most:
                continue
            left = trial[row, n]
            gains = zero[s] - left
            usual = np.maximum(ordinary[s], dof)
            # The gain must also exceed that of a count where the signal is merely rough (vibration, jitter).
            clear = (gains > LEAST_GAIN) & (gains > OVER_USUAL * usual) & (left < LEFT_SHARE * zero[s] + 3.0 * usual)
            # A sensor that does not show the loss must not contradict it; one that shows it must give the same count.
            silent = ~clear & (left < 2.0 * usual)
            good = bool(clear.any() and (clear | silent).all())
            # A sensor that fits another count much better contradicts the loss.
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
