"""Slow noise of the sensors inside moves, as the poses show it (eq. 8.2b)."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.quantiles import medians, quantiles

QUIET, QUIET_OF_NORMAL = 0.3, 0.3853
"""Quantile over the poses of the change from first half to second, and that of |x| for a normal x: slow noise is in all
poses alike, a zero that jumps only in those where it did."""
MAY_EXCEED = 2.5
"""How far the colour of all poses may exceed that of the quiet ones: their quantile is good to a factor of two."""


def coloured_variance(
    pose_sigma: FloatArray,
    halves: FloatArray,
    density: FloatArray,
    pose_duration_s: FloatArray,
    move_duration_s: FloatArray,
) -> FloatArray:
    """Variance that slow noise adds to every move's integral, beyond that of white noise.

    The integral of white noise over T has the variance N²T. Flicker and walk add what the poses' means show of them: a
    mean over τ with c² times the white variance stands for c²N² as long as T is of the order of τ. Without it most
    healthy sessions of a consumer part (0.3 mg, 20 °/h) disagree (benches/blind_nuisances.py --flicker).

    Parameters
    ----------
    pose_sigma : (poses, 3)
        Standard errors of pose means that do not assume whiteness, raw units.
    halves : (poses, 3)
        Mean of every pose's second half minus that of its first, raw units.
    density : (3,)
        White noise, raw units per √Hz.
    pose_duration_s, move_duration_s : (poses,), (moves,)

    Returns
    -------
    (moves, 3) array, (raw unit · s)²
    """
    white = density / np.sqrt(pose_duration_s)[:, None]
    quiet = (quantiles(np.abs(halves / white), [QUIET])[0] / (2.0 * QUIET_OF_NORMAL)) ** 2
    pooled = medians((pose_sigma / white) ** 2)
    colour = np.maximum(np.minimum(pooled, MAY_EXCEED * quiet), 1.0)
    out: FloatArray = np.outer(move_duration_s, (colour - 1.0) * density**2)
    return out
