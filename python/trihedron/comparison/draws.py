"""How a simulation draws its noise: from which distribution, and whether separately for each axis."""

import math
from collections.abc import Iterator, Sequence
from typing import Literal

from trihedron.arrays import FloatArray
from trihedron.records.diagnosis import NoiseDifference
from trihedron.records.pose_noise import PoseNoise

Sensor = Literal["accelerometer", "gyroscope"]

NORMAL_EXCESS, UNIFORM_EXCESS = 0.0, -0.6
"""Excess kurtosis of differences of two normal and of two uniform numbers."""
ONE_DRAW, OWN_DRAWS = 0.75, 0.5
"""Smallest correlation of axes with one noise common to all (an LSB of twice the noise leaves as much), and the largest
of axes with noise of their own. Independent noise reaches neither; with ``FEWEST`` differences it reaches 0.2."""
FEWEST = 256
NAMES = {"accelerometer": "accelerometer", "gyroscope": "gyro"}


def uniform_for_normal(
    sensor: Sensor, model: FloatArray, recording: FloatArray, n: int, noise: Sequence[PoseNoise]
) -> Iterator[NoiseDifference]:
    """Uniform noise in place of normal: by the excess kurtosis (3,) of ``n`` differences, where the LSB is finer."""
    middle = 0.5 * (NORMAL_EXCESS + UNIFORM_EXCESS)
    is_fine = all(axis.reading_sigma > axis.step for axis in noise)
    # Four standard errors of a kurtosis of n correlated differences must fit between the two values.
    if not is_fine or 4.0 * math.sqrt(48.0 / max(n, 1)) > -middle:
        return
    m, r = float(model.mean()), float(recording.mean())
    if m < middle < r:
        remark = f"The noise of the model's {NAMES[sensor]} is uniformly distributed; the recording's is normal."
        yield NoiseDifference(sensor, "", "distribution", m, r, None, None, "excess kurtosis", None, True, remark)


def one_draw_for_all(sensor: Sensor, model: float, recording: float, n: int) -> Iterator[NoiseDifference]:
    """The same random numbers on all three axes, where the recording's axes are independent.

    ``model`` and ``recording`` are the smallest absolute correlations of two axes' ``n`` static differences.
    """
    if n < FEWEST or not (model > ONE_DRAW and recording < OWN_DRAWS):
        return
    remark = (
        f"The noise of the model's {NAMES[sensor]} is one and the same on all three axes (they correlate by "
        f"{model:.2f}, the recording's by {recording:.2f}): it was drawn once instead of three times."
    )
    yield NoiseDifference(
        sensor, "", "distribution", model, recording, None, None, "correlation of axes", None, True, remark
    )
