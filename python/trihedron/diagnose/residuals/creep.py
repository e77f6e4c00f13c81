"""Rates at rest that are motion: a support that gives turns the sensor, and gravity says so (eq. 8.7c)."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context

LEAST_SAMPLES = 9
"""Readings of a pose below which its thirds say nothing."""
FEWEST_POSES = 6
IS_MOTION = 0.5
"""Share of the rates at rest from which they are motion and no zeros that scatter. Scatter of zeros leaves about
1/(2 poses); creep of a soft support 0.7 and more where the accelerometer sees it at all."""
PUSHED = 0.1
"""Share of the poses that somebody may have pushed; a soft support gives under all of them."""


def share_of_creep(context: Context) -> float:
    """Share of the variance of rates at rest, across the vertical, that the tilt inside the same poses accounts for.

    Between the mean of a pose's first third and that of its last the vertical turns by the rate, weighed with the
    trapezoid that the two means make: exactly that if the pose moves, nothing if only the gyro's zero differs. At most
    twice the share without the poses that tilt most: one that was pushed proves nothing of the others.
    """
    obs, twin = context.obs, context.fitted.twin
    if obs.raw_rate is None:
        return 0.0
    turned, tilted, across = [], [], []
    for i, hold in enumerate(obs.segments.holds):
        n = hold.stop - hold.start
        if n < LEAST_SAMPLES:
            continue
        third = n // 3
        force, rate = obs.raw_force[hold.start : hold.stop], obs.raw_rate[hold.start : hold.stop]
        change = twin.accel_S @ (np.nanmean(force[-third:], axis=0) - np.nanmean(force[:third], axis=0))
        since = np.arange(n) + 0.5
        weight = np.minimum(np.minimum(since, n - since) / third, 1.0)
        up, lasts = twin.up[i], weight.sum() / obs.recording.rate_hz
        flat = np.eye(3) - np.outer(up, up)
        turned.append(flat @ twin.gyro_S @ (weight @ np.nan_to_num(rate) / weight.sum()))
        # The vertical in the body goes by u' = u x w: what of w lies across it is u' x u.
        tilted.append(np.cross(change / twin.gravity, up) / lasts)
        across.append(flat)
    if len(turned) < FEWEST_POSES:
        return 0.0
    calm = np.argsort([np.linalg.norm(t) for t in tilted])[: len(tilted) - int(np.ceil(PUSHED * len(tilted)))]
    y, x, flats = np.array(turned), np.array(tilted), np.array(across)
    return min(_share(y, x, flats), 2.0 * _share(y[calm], x[calm], flats[calm]))


def _share(y: FloatArray, x: FloatArray, flats: FloatArray) -> float:
    """Share of the variance of ``y`` (poses, 3) about one zero for all (``flats`` (poses, 3, 3) of it) due to ``x``."""
    constant = np.concatenate(flats)

    def left(columns: FloatArray) -> float:
        found, *_ = np.linalg.lstsq(columns, y.ravel(), rcond=None)
        return float(((y.ravel() - columns @ found) ** 2).sum())

    without = left(constant)
    return 1.0 - left(np.column_stack([constant, x.ravel()])) / without if without > 0.0 else 0.0
