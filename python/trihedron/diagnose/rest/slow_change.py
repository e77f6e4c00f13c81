"""Whether the biases of a static log change slowly, and whether a walk alone makes that (docs/static-logs.md, R.9)."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.rest.process import DRIFT, SCATTER, WALK, BiasProcess, BiasReadings

SMOOTH = 8.75
"""1 % point of 3/8 χ²(1) + 3/8 χ²(2) + 1/8 χ²(3): one strength more where the others may be 0."""
SLOW = 0.01
"""p-value from which biases are said to change slowly: false in 1 % of logs whose biases only scatter."""


@dataclass(frozen=True, eq=False)
class SlowChange:
    """How biases change: ``sigma`` (3,) likeliest scatter, walk and drift, rms about the mean in the readings' unit.

    ``p_value`` of any slow change beside scatter; ``drift_ratio`` twice the log-likelihood that a smooth drift wins
    beside scatter and walk.
    """

    process: BiasProcess
    sigma: FloatArray
    p_value: float
    drift_ratio: float

    @property
    def is_slow(self) -> bool:
        """Whether anything changes slowly."""
        return self.p_value < SLOW

    @property
    def is_smooth(self) -> bool:
        """Whether a walk alone does not make it."""
        return self.drift_ratio > SMOOTH


def slow_change(readings: BiasReadings) -> SlowChange:
    """Test the biases of one log, every column of its design allowed for."""
    process = BiasProcess.of(readings)
    every = list(range(readings.design.shape[1]))
    top, sigma = process.maximum((SCATTER, WALK, DRIFT), every, restricted=True)
    alone, walk, drift = (
        process.maximum(free, every, restricted=True)[0] for free in ((SCATTER,), (SCATTER, WALK), (SCATTER, DRIFT))
    )
    ratio = 2.0 * (max(walk, drift) - alone)
    # Two tries, each with the tail of ½χ²(0) + ½χ²(1): one strength on the edge of its range.
    p_value = min(1.0, float(chdtrc(1.0, ratio))) if ratio > 0.0 else 1.0
    return SlowChange(process, sigma, p_value, 2.0 * (top - walk))
