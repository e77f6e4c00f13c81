"""Channels that do not follow the sensor's motion: only noise changes them, so no run of equal readings shows them."""

import numpy as np

from trihedron.arrays import AXES, FloatArray, rms_of
from trihedron.channel_facts.quiet import Windows
from trihedron.quantiles import quantile
from trihedron.records import Finding

FEWEST = 12
"""Fewest quiet windows, half a second each, in which a motionless accelerometer axis is found."""
STILL = 6.0
"""Changes between quiet windows, in noise of their means (the LSB at least), that a motionless channel stays below."""
TURNED, ROUND = 0.3, 0.1
"""Spread of the other two axes between quiet windows above which the sensor was turned, and their distance (rms) from
one circle below which it was turned about the channel's own axis; both as a fraction of the largest reading."""


def audit_motionless_gyro(axes: tuple[int, ...], without_gyro: str) -> list[Finding]:
    """A finding per motionless gyro axis (from 0); ``without_gyro`` is the ``--columns`` of the accelerometer alone."""
    return [_finding("gyro", k, without_gyro) for k in axes]


def audit_motionless_accelerometer(windows: Windows | None, step: FloatArray) -> list[Finding]:
    """A finding where gravity moves between two axes but not as a rotation about the third, which does not change.

    ``step`` (3,) is the LSB.
    """
    if windows is None or int(windows.quiet.sum()) < FEWEST:
        return []
    mean = windows.quiet_mean("accelerometer")
    noise = np.maximum(windows.quiet_noise("accelerometer") / np.sqrt(windows.length), step)
    spread = np.array([quantile(mean[:, k], 0.95) - quantile(mean[:, k], 0.05) for k in range(3)])
    size = float(np.abs(mean).max())
    found = []
    for k in np.flatnonzero(spread <= STILL * noise).tolist():
        others = np.delete(mean, k, axis=1)
        if np.delete(spread, k).min() > TURNED * size and _off_circle(others) > ROUND * size:
            found.append(_finding("accelerometer", k, ""))
    return found


def _off_circle(points: FloatArray) -> float:
    """Distance (rms) of points (n, 2) from the best circle, by least squares of ``x² + y² = 2 c·p + d``."""
    design = np.column_stack([2.0 * points, np.ones(len(points))])
    solved = np.linalg.lstsq(design, (points**2).sum(axis=1), rcond=None)[0]
    radius = np.sqrt(max(float(solved[2] + solved[:2] @ solved[:2]), 0.0))
    return rms_of(np.linalg.norm(points - solved[:2], axis=1) - radius)


def _finding(sensor: str, k: int, without: str) -> Finding:
    return Finding.of(
        "stuck-values",
        "motionless",
        sensor=sensor,
        axis_name=AXES[k],
        axis=k,
        has_others=bool(without),
        mapping=without,
    )
