"""Zeros that take two values: a trap in a readout, a play; no zero that is drawn anew in every pose (eq. 8.7e)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from trihedron.arrays import FloatArray

FEWEST_POSES = 10
"""Poses below which three that agree by chance are as good as two values."""
ELSEWHERE = (0.1, 0.25, 0.5)
"""Shares of the poses that may lie between the values, because the zero changed in them."""
WIDENED = (1.0, 2.0)
"""Factors on the errors of the poses' means: flicker and settling come on top of them."""
MOST_LEVELS = 60
"""Zeros, evenly spread over the sorted ones, that are tried as either value."""
APART = 4.0
"""Errors of a mean by which two values must differ, or they are one."""
GAIN = 12.0
"""Log-likelihood beyond a normal scatter's from which zeros take two values."""
MOST_OF_POSES, FEWEST_EACH = 0.5, 3
"""Share of the poses that must be at one of the values, and poses at the rarer one."""
SCATTERS = np.logspace(-1.0, 4.0, 41)


@dataclass(frozen=True)
class TwoLevels:
    """The two values, how many poses are at each, and the log-likelihood by which they beat one normal law."""

    values: tuple[float, float]
    poses: tuple[int, int]
    n: int
    gain: float

    @property
    def is_clear(self) -> bool:
        """Whether the zeros take two values."""
        return self.gain > GAIN and sum(self.poses) > MOST_OF_POSES * self.n and min(self.poses) >= FEWEST_EACH


NONE = TwoLevels((0.0, 0.0), (0, 0), 0, 0.0)


def two_levels(zeros: FloatArray, sigma: FloatArray, known: FloatArray | None = None) -> TwoLevels:
    """Two values with noise ``sigma`` (n,), some poses between them, against a normal law, for zeros (n,).

    ``known`` (n, k): what zeros may follow (gravity, time); the normal law is about a straight line in these, for poses
    on six faces have two values of a g-sensitivity too.
    """
    n = len(zeros)
    if n < FEWEST_POSES:
        return NONE
    tried = np.sort(zeros)[np.linspace(0, n - 1, min(n, MOST_LEVELS)).round().astype(int)]
    low, high = (side[np.triu_indices(len(tried), 1)] for side in np.meshgrid(tried, tried, indexing="ij"))
    apart = high - low > APART * float(np.median(sigma))
    if not apart.any():
        return NONE
    low, high = low[apart], high[apart]
    # Everything that lies in no value lies anywhere that a zero was seen.
    log_width = np.log(np.ptp(zeros) + 2.0 * float(np.median(sigma)))
    best, at, poses = -np.inf, 0, (0, 0)
    for factor in WIDENED:
        error = factor * sigma
        each = np.stack([_log_normal(zeros - level[:, None], error) for level in (low, high)])
        for share in ELSEWHERE:
            parts = np.concatenate(
                [each + np.log(0.5 * (1.0 - share)), np.full((1, *each.shape[1:]), np.log(share) - log_width)]
            )
            total = logsumexp(parts, axis=0).sum(axis=1)
            if float(total.max()) > best:
                best, at = float(total.max()), int(total.argmax())
                likeliest = parts[:, at].argmax(axis=0)
                poses = int((likeliest == 0).sum()), int((likeliest == 1).sum())
    return TwoLevels((float(low[at]), float(high[at])), poses, n, best - _one_law(zeros, sigma, known))


def _log_normal(away: FloatArray, error: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (away / error) ** 2 - np.log(error * np.sqrt(2.0 * np.pi)))


def _one_law(zeros: FloatArray, sigma: FloatArray, known: FloatArray | None) -> float:
    """Log-likelihood of a normal law, or of one about a line in what is known, which pays for its coefficients."""
    constant = np.ones((len(zeros), 1))
    best = _normal_about(constant, zeros, sigma)
    if known is None:
        return best
    spread = np.ptp(known, axis=0)
    columns = np.hstack([constant, (known - known.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)])
    price = float(0.5 * known.shape[1] * np.log(len(zeros)))
    return max(best, _normal_about(columns, zeros, sigma) - price)


def _normal_about(columns: FloatArray, zeros: FloatArray, sigma: FloatArray) -> float:
    best = float("-inf")
    for scatter in SCATTERS * float(np.median(sigma)):
        error = np.hypot(sigma, scatter)
        found, *_ = np.linalg.lstsq(columns / error[:, None], zeros / error, rcond=None)
        best = max(best, float(_log_normal(zeros - columns @ found, error).sum()))
    return best
