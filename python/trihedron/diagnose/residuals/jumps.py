"""Zeros that change inside still poses: the second half of some poses against their first (eq. 8.7a)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from trihedron.diagnose.session.observations import FloatArray, Observations

QUIET, LOUD = 0.3, 0.9
"""Quantiles over the poses whose ratio tells jumps from slow noise: that is in all poses alike, a zero that jumps only
in those where it did."""
N_DRAWS, SEED = 20_000, 1
FEWEST_POSES = 12
BOTH = 4.0
"""A pose in which both sensors change by this many times their usual is motion, and tells nothing of a zero."""
JUMPS = 1e-3
"""p-value from which zeros are said to change inside poses."""
N_LOOKS = 3
"""Axes."""
LEAST_QUIET = 0.05
"""Below this a coarse converter hides what the quiet poses do."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """``p_value`` (two sensors) of zeros that change in some poses, ``ratio`` how much more than in the others (as a
    variance), ``holds`` which: accelerometer, gyro."""

    p_value: tuple[float, float]
    ratio: tuple[float, float]
    holds: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]


@lru_cache(maxsize=4)
def jumps_in_poses(obs: Observations) -> Jumps:
    """Whether some poses change from their first half to their second as the others do not.

    Flicker and walks change all poses by normal amounts, and the ratio of two quantiles over the poses has a known law
    then. A pose that turns shows it in both sensors and is left out.
    """
    sides = [_changes(obs, obs.raw_force, obs.force_density)]
    sides += [_changes(obs, obs.raw_rate, obs.rate_density)]
    usual = [None if s is None else s / np.maximum(np.quantile(s, QUIET, axis=0) / 0.3853, 1e-12) for s in sides]
    still = np.array([not hold.is_unsteady for hold in obs.segments.holds])
    if usual[0] is not None and usual[1] is not None:
        still &= ~((usual[0].max(axis=1) > BOTH) & (usual[1].max(axis=1) > BOTH))
    p, ratio, holds = [1.0, 1.0], [1.0, 1.0], [np.zeros(0, dtype=np.intp)] * 2
    for k, side in enumerate(sides):
        if side is None or still.sum() < FEWEST_POSES:
            continue
        z = side[still]
        low, high = np.quantile(z, QUIET, axis=0), np.quantile(z, LOUD, axis=0)
        seen = low > LEAST_QUIET
        if not seen.any():
            continue
        ratios = np.where(seen, high / np.maximum(low, 1e-12), 0.0)
        axis = int(ratios.argmax())
        p[k] = min(1.0, N_LOOKS * float((1 + (_null(len(z)) >= ratios[axis]).sum()) / (N_DRAWS + 1)))
        ratio[k] = float((ratios[axis] * 0.3853 / 1.645) ** 2)
        holds[k] = np.flatnonzero(still)[np.argsort(-z[:, axis])[: max(1, len(z) // 10)]]
    return Jumps((p[0], p[1]), (ratio[0], ratio[1]), (holds[0], holds[1]))


def _changes(obs: Observations, values: FloatArray | None, density: FloatArray | None) -> FloatArray | None:
    """(holds, 3) |second half − first| over what white noise makes of it."""
    if values is None or density is None:
        return None
    out = []
    for hold in obs.segments.holds:
        first, second = np.array_split(values[hold.samples()], 2)
        lasts = max(len(first) + len(second), 2) / obs.recording.rate_hz
        change = np.nanmean(second, axis=0) - np.nanmean(first, axis=0)
        out.append(np.abs(change) * np.sqrt(lasts) / np.maximum(2.0 * density, 1e-300))
    return np.array(out)


@lru_cache(maxsize=16)
def _null(n: int) -> FloatArray:
    """Draws of the ratio for ``n`` poses whose changes are normal."""
    z = np.abs(np.random.default_rng(SEED).normal(size=(N_DRAWS, n)))
    low, high = np.quantile(z, (QUIET, LOUD), axis=1)
    return np.asarray(high / np.maximum(low, 1e-12))
