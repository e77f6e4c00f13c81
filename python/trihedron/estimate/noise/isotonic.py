"""Values that are known never to fall."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray


def never_falling(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Isotonic regression by pooling adjacent violators."""
    level: list[float] = []
    mass: list[float] = []
    size: list[int] = []
    for value, weight in zip(values.tolist(), weights.tolist(), strict=True):
        level.append(value)
        mass.append(weight)
        size.append(1)
        while len(level) > 1 and level[-2] > level[-1]:
            last, last_mass, last_size = level.pop(), mass.pop(), size.pop()
            level[-1] = (level[-1] * mass[-1] + last * last_mass) / (mass[-1] + last_mass)
            mass[-1] += last_mass
            size[-1] += last_size
    return np.repeat(level, size)
