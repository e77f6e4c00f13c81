"""Attitude carried by the gyro alone against the reference's, on a part of the log that no fit saw."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trihedron._core import rotation_from_vector
from trihedron.arrays import FloatArray
from trihedron.estimate.reference.together import Grid, Reference
from trihedron.records.reference import ReplayStage

Mask = npt.NDArray[np.bool_]

HORIZON_S = 10.0
"""Time over which attitude is carried: some turns of a hand, and a zero of 0.1 °/s adds a degree."""


def replay(
    stage: str, rate: FloatArray, grid: Grid, reference: Reference, time: FloatArray, where: Mask
) -> ReplayStage | None:
    """Rms angle between attitude carried over ten seconds and the reference's; ``rate`` (n, 3) in the reference's body.

    ``where`` (n,) marks the part to use; ``None`` where it holds no ten seconds in a row.
    """
    n = round(HORIZON_S / grid.step_s)
    middle = 0.5 * (rate[1:] + rate[:-1])
    # Second term: the rate turns while it is integrated (coning).
    turn = middle * grid.step_s + np.cross(rate[:-1], rate[1:]) * grid.step_s**2 / 12.0
    steps = rotation_from_vector(np.ascontiguousarray(turn))
    bad = np.concatenate([[0], np.cumsum(~where)])
    errors = []
    for start in range(0, len(rate) - n, max(n // 2, 1)):
        if bad[start + n + 1] != bad[start]:
            continue
        carried = _product(steps[start : start + n])
        C = reference.attitude(time[[start, start + n]])
        off = (C[0].T @ C[1]).T @ carried
        errors.append(float(np.arccos(np.clip((np.trace(off) - 1.0) / 2.0, -1.0, 1.0))))
    if not errors:
        return None
    return ReplayStage(stage, HORIZON_S, float(np.sqrt(np.mean(np.square(errors)))), len(errors))


def _product(rotations: FloatArray) -> FloatArray:
    """Product of (n, 3, 3) in order, pair by pair."""
    while len(rotations) > 1:
        if len(rotations) % 2:
            rotations = np.concatenate([rotations, np.eye(3)[None]])
        rotations = rotations[0::2] @ rotations[1::2]
    return np.asarray(rotations[0], dtype=np.float64)
