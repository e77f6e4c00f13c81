"""Samples missing from a motion that no timestamp shows: where the two sides join only with samples between them."""

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.probability import STRONG

MOST_LOST, LONGEST_LOSS_S = 60, 0.15
"""Longest gap, samples or seconds, whichever is more, that is tried: a fifth of a quick hand move."""


@dataclass(frozen=True, eq=False)
class Joints:
    """``count`` samples are missing behind each ``sample`` (k,), clearest first.

    They gain ``gain`` in log-likelihood over none missing and shocks; where ``is_certain``, also over motions before
    and after that have nothing to do with one another. As many missing samples as the median of those has would be
    certain at ``telling`` joints: long losses show where a single sample does not.
    """

    sample: IntArray
    count: IntArray
    gain: FloatArray
    is_certain: BoolArray
    telling: int

    @property
    def share(self) -> float:
        """Share of samples that are missing."""
        return self.n_lost / max(self.telling, 1)

    @property
    def n_lost(self) -> float:
        """Number of samples that are certainly missing."""
        return float(self.count[self.is_certain].sum())


def most_lost(rate_hz: float) -> int:
    """Largest number of samples tried at one place."""
    return max(MOST_LOST, round(LONGEST_LOSS_S * rate_hz))


def joints(
    readings: list[FloatArray], time_s: FloatArray, rate_hz: float, moves: IntArray, is_cut: BoolArray | None = None
) -> Joints:
    """Joints of ``moves`` (m, 2) in the ``readings`` (n, 3) of each sensor, in units of the noise of a sample.

    An autoregression of the motion (Burg's method, order 10), as large as fits each window of six samples before and
    six after, and the noise of the sensor, compare: none missing; n missing; none missing and shocks of any size, of a
    jolt or of another motion that begins (docs/diagnosis-method.md, 8.16). No joint is asked at a gap of the
    timestamps, or near samples that are ``is_cut`` (n,).
    """
    most = most_lost(rate_hz)
    least = float(np.log(STRONG * most * max(int((moves[:, 1] - moves[:, 0]).sum()), 1)))
    sample, count, gain, over_unrelated, telling = _core.motion_joints(
        readings, moves, (time_s, 1.0 / rate_hz), is_cut, most, least
    )
    return Joints(sample, count, gain, over_unrelated > least, telling)
