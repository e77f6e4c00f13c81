"""Time errors read from the samples themselves: how far each step is from the one its neighbours announce."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.diagnose.context import Context
from trihedron.diagnose.observations import FloatArray


@dataclass(frozen=True, eq=False)
class StepErrors:
    """Per inner sample interval of every move: estimated extra time, its noise, and how well one time explains it.

    ``sample`` (k,) index of the interval's first sample; ``extra_s`` (k,), ``sigma_s`` (k,); ``gain`` (k,) chi-square
    explained by one extra time in all channels, ``misfit`` (k,) what is left of it per remaining degree of freedom.
    """

    sample: npt.NDArray[np.intp]
    move: npt.NDArray[np.intp]
    extra_s: FloatArray
    sigma_s: FloatArray
    gain: FloatArray
    misfit: FloatArray


def step_errors(context: Context) -> StepErrors:
    """A step d_k = x_{k+1} - x_k against the mean of the two next to it, in units of the local slope (eq. 8.11).

    If n samples are missing between k and k+1, every channel jumps by n dt times its own slope at once; a jittered
    sample does it by its time error. White noise gives the step error 5 σ².
    """
    obs = context.obs
    channels = [obs.raw_force]
    sigmas = [obs.force_density]
    if obs.raw_rate is not None and obs.rate_density is not None:
        channels.append(obs.raw_rate)
        sigmas.append(obs.rate_density)
    x = np.hstack(channels)
    sigma = np.concatenate(sigmas) * np.sqrt(obs.recording.rate_hz)
    out: list[tuple[FloatArray, ...]] = []
    for m, (a, b) in enumerate(obs.move_ranges):
        z = x[a:b] / sigma
        if len(z) < 6:
            continue
        dt = np.diff(obs.time_s[a:b])
        d = np.diff(z, axis=0)
        mean_dt = float(np.median(dt)) if len(dt) else 1.0
        error = d[1:-1] - 0.5 * (d[:-2] + d[2:])
        slope = (d[:-2] + d[2:]) / (2.0 * mean_dt)
        # The third difference of a smooth motion also leaves a step error: its size is judged from the steps around.
        weight = (slope**2).sum(axis=1) / 5.0
        extra = (slope * error).sum(axis=1) / 5.0 / np.maximum(weight, 1e-30)
        gain = weight * extra**2
        misfit = ((error**2).sum(axis=1) / 5.0 - gain) / (z.shape[1] - 1)
        index = np.arange(a + 1, a + 1 + len(extra))
        out.append((index.astype(float), np.full(len(extra), float(m)), extra, 1 / np.sqrt(np.maximum(weight, 1e-30)), gain, misfit))
    if not out:
        empty = np.zeros(0)
        return StepErrors(np.zeros(0, np.intp), np.zeros(0, np.intp), empty, empty, empty, empty)
    index, move, extra, s, gain, misfit = (np.concatenate(column) for column in zip(*out, strict=True))
    return StepErrors(index.astype(np.intp), move.astype(np.intp), extra, s, gain, misfit)
