"""Motion faster than the samples: the error of every move's integral by aliasing (eq. 8.2a)."""

from collections.abc import Iterable, Sequence

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.session.rounding import UNIFORM

GAP = 1.5
"""A step longer than this many usual ones has lost samples, as in the session model (its ``gaps``)."""


def unresolved_variance(
    readings: FloatArray,
    move_ranges: Sequence[tuple[int, int]],
    pose_ranges: Iterable[Sequence[int]],
    step_s: float,
    quantum: FloatArray,
    time_s: FloatArray | None = None,
) -> FloatArray:
    """(moves, 3) variance, (raw unit · s)², of every move's integral by motion above half the sampling frequency.

    Raw ``readings`` (n, 3) of one sensor, half-open sample ranges. The power of the noise is that of the poses, at
    least that of rounding by the LSB ``quantum`` (3,); ``time_s`` (n,) shows gaps.
    """
    moves, poses = (np.array(list(of), dtype=np.int64).reshape(-1, 2) for of in (move_ranges, pose_ranges))
    is_gap = np.zeros(0, dtype=bool) if time_s is None else np.diff(time_s) > GAP * step_s
    after = np.flatnonzero(is_gap) + 1
    return _core.unresolved_power(readings, (moves, poses), after.tolist(), UNIFORM * quantum**2) * step_s**2
