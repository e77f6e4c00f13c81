"""What the steps from timestamp to timestamp are, in one pass: most logs have no odd one and are done."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray


@dataclass(frozen=True)
class Steps:
    """Numbers of steps ``back``, of zero (``same``) and ``forward``, and of timestamps that are not finite."""

    back: int
    same: int
    forward: int
    missing: int


def steps_of(time_s: FloatArray) -> Steps:
    """Steps of timestamps (n,)."""
    return Steps(*_core.timestamp_steps(np.asarray(time_s, dtype=np.float64)))
