"""The error of a pose's mean along the vertical, the only part of it that the length of gravity sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.segment.channels import Channels, mean_present
from trihedron.segment.noise import MeanNoise, pool_mean_noise
from trihedron.segment.runs import Run

FEWEST_ON_ELLIPSOID = 9
"""Poses from which the ellipsoid of their readings (six numbers) is fitted."""
MOST_UNEVEN = 3.0
"""Ratio of the axes' sensitivities above which such an ellipsoid is no accelerometer's: its poses lie in a plane."""
WORST_CONDITION = 50.0
"""Condition number above which poses do not tell its numbers apart."""


def upright(mean: FloatArray, *, has_unit: bool) -> FloatArray | None:
    """(h, 3) unit gradients of the length of gravity by the raw means (h, 3) of the accelerometer.

    Normals of the ellipsoid with the sensor's axes through the means; where they do not fix one, their own directions
    if the readings have a unit (zeros are then small beside gravity), else ``None``.
    """
    if len(mean) >= FEWEST_ON_ELLIPSOID and np.isfinite(mean).all():
        centre, scale = 0.5 * (mean.max(axis=0) + mean.min(axis=0)), float(np.ptp(mean, axis=0).max())
        if scale > 0.0:
            x = (mean - centre) / scale
            design = np.hstack([x**2, x])
            length = np.linalg.norm(design, axis=0)
            if length.all() and np.linalg.cond(design / length) < WORST_CONDITION:
                found = np.linalg.lstsq(design, np.ones(len(x)), rcond=None)[0]
                square = found[:3]
                if square.min() > 0.0 and square.max() < MOST_UNEVEN**2 * square.min():
                    return _unit(2.0 * square * x + found[3:])
    return _unit(mean) if has_unit and np.isfinite(mean).all() and np.any(mean, axis=1).all() else None


def _unit(rows: FloatArray) -> FloatArray:
    out: FloatArray = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    return out


def along(channels: Channels, runs: list[Run], up: FloatArray) -> Channels:
    """The accelerometer's blocks along each pose's own direction ``up`` (h, 3), as the first axis of a triad.

    A support that gives, a tremor and a body that goes on settling turn gravity across itself: readings across the
    vertical differ by the angle, that along it by half its square.
    """
    force = np.flatnonzero(~channels.is_gyroscope)
    mean, variance = np.zeros((channels.n_blocks, 3)), np.zeros((channels.n_blocks, 3))
    for run, direction in zip(runs, up, strict=True):
        for a, b in run.quiet_ranges():
            blocks = channels.mean[a:b, force]
            mean[a:b, 0] = (blocks - mean_present(blocks)) @ direction
            variance[a:b, 0] = channels.variance[a:b, force] @ direction**2
    quantum = np.array([float(channels.quantum[force].min()), 0.0, 0.0])
    return replace(channels, mean=mean, variance=variance, quantum=quantum, is_gyroscope=np.zeros(3, dtype=bool))


def noise_along(channels: Channels, runs: list[Run]) -> MeanNoise:
    """The law of that one axis, from steady holds where there are any."""
    pooled = [r for run in runs if not run.is_unsteady for r in run.quiet_ranges()]
    return pool_mean_noise(channels, pooled or [r for run in runs for r in run.quiet_ranges()])
