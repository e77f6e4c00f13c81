"""How a simulation draws its noise: from which distribution, and whether separately for each axis."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.comparison.rows import NAMES, Sensor, difference
from trihedron.records.diagnosis import NoiseDifference
from trihedron.records.pose_noise import PoseNoise

NORMAL_EXCESS, UNIFORM_EXCESS = 0.0, -0.6
"""Excess kurtosis of differences of two normal and of two uniform numbers."""
ONE_DRAW, OWN_DRAWS = 0.75, 0.5
"""Smallest correlation of axes with one noise common to all (an LSB of twice the noise leaves as much), and the largest
of axes with noise of their own. Independent noise reaches neither; with ``FEWEST`` differences it reaches 0.2."""
FEWEST = 256


@dataclass(frozen=True)
class Draws:
    """Distribution of the ``n`` static differences of one sensor: their mean excess kurtosis, and ``likeness``, the
    smallest absolute correlation of any two axes."""

    n: int
    excess: float
    likeness: float

    @classmethod
    def of(cls, differences: FloatArray) -> "Draws":
        """Those of ``differences`` (n, 3) of neighbouring readings."""
        centred = differences - differences.mean(axis=0)
        power = np.maximum((centred**2).mean(axis=0), 1e-150)
        excess = (centred**4).mean(axis=0) / power**2 - 3.0
        products = np.abs(centred.T @ centred / len(centred)) / np.sqrt(np.outer(power, power))
        return cls(len(differences), float(excess.mean()), float(products.min()))


def compare_draws(
    sensor: Sensor, model: Draws, recording: Draws, noise: Sequence[PoseNoise]
) -> Iterator[NoiseDifference]:
    """Uniform noise in place of normal where the LSB is finer; the same random numbers on all three axes, where the
    recording's axes are independent."""
    n, middle = min(model.n, recording.n), 0.5 * (NORMAL_EXCESS + UNIFORM_EXCESS)
    is_fine = all(axis.reading_sigma > axis.step for axis in noise)
    # Four standard errors of a kurtosis of n correlated differences must fit between the two values.
    is_measured = is_fine and 4.0 * math.sqrt(48.0 / max(n, 1)) <= -middle
    if is_measured and model.excess < middle < recording.excess:
        remark = f"The noise of the model's {NAMES[sensor]} is uniformly distributed; the recording's is normal."
        yield difference(sensor, "distribution", (model.excess, recording.excess), "excess kurtosis", remark)
    if n >= FEWEST and model.likeness > ONE_DRAW and recording.likeness < OWN_DRAWS:
        remark = (
            f"The noise of the model's {NAMES[sensor]} is one and the same on all three axes (they correlate by "
            f"{model.likeness:.2f}, the recording's by {recording.likeness:.2f}): it was drawn once instead of three "
            "times."
        )
        yield difference(sensor, "distribution", (model.likeness, recording.likeness), "correlation of axes", remark)
