"""What effects add to the corrected readings, and slopes of smoothed signals."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from trihedron.arrays import FloatArray

BLOCKS_OF_WIDTH = 10
"""Blocks of samples per smoothing width: the blocks widen it by a part in 2400, and reduce windows of thousands of
samples to dozens of means."""


def smoothed_slope(values: FloatArray, time_s: FloatArray, width: float) -> FloatArray:
    """(n,) rate of change, per second, of ``values`` (n,) smoothed by a Gaussian of ``width`` samples.

    Timestamps are smoothed too: a straight line keeps its slope across pauses, and to the ends.
    """
    length = max(round(width / BLOCKS_OF_WIDTH), 1)
    starts = np.arange(0, len(values), length)
    if len(starts) < 2:
        return np.zeros(len(values))
    n = np.diff(starts, append=len(values))
    level, time = (np.add.reduceat(of, starts) / n for of in (values, time_s))
    smooth, at = (gaussian_filter1d(of, max(width / length, 1.0), mode="nearest") for of in (level, time))
    return np.interp(time_s, time, np.gradient(smooth, at))


@dataclass(frozen=True, eq=False)
class Distortion:
    """What effects add to the corrected readings, linear in their parameters: SI, body frame.

    ``force`` and ``rate`` (points, 3, K) or None, at the points of ``Trajectory`` (poses, then move samples).
    """

    force: FloatArray | None
    rate: FloatArray | None

    @property
    def n_parameters(self) -> int:
        """Number of effect parameters."""
        given = self.force if self.force is not None else self.rate
        return 0 if given is None else int(given.shape[2])


NO_DISTORTION = Distortion(None, None)


def stacked(parts: list[Distortion]) -> Distortion:
    """Several distortions side by side."""
    parts = [p for p in parts if p.n_parameters]
    if not parts:
        return NO_DISTORTION
    if len(parts) == 1:
        return parts[0]

    def side(name: str) -> FloatArray | None:
        given = [getattr(p, name) for p in parts]
        present = next((g for g in given if g is not None), None)
        if present is None:
            return None
        shape = present.shape[:2]
        blocks = [np.zeros((*shape, p.n_parameters)) if g is None else g for p, g in zip(parts, given, strict=True)]
        return np.concatenate(blocks, axis=2)

    return Distortion(side("force"), side("rate"))
