"""Axes along which a simulated log reads: rates of the world instead of the body's, gravity with the other sign."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trihedron.estimate.gyroscope.world_rates import CarriedGravity, carried_gravity
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import NoiseDifference
from trihedron.sensor_model import correct
from trihedron.units import degrees_from_radians

OPPOSITE = -0.9
"""Mean cosine between gravity in the poses of both logs below which they are one protocol with the sign turned."""


def rates_of_world(recording: Recording, segments: Segments) -> NoiseDifference | None:
    """The statement that a simulated log's rates are the world's, ``None`` where they are not."""
    seen: CarriedGravity | None = carried_gravity(recording, segments)
    if seen is None or not seen.is_of_world:
        return None
    body, world = degrees_from_radians(seen.body_rad), degrees_from_radians(seen.world_rad)
    remark = (
        f"The gyro of the model reads rates along the axes of the world, not of the body: the tilt error "
        f"after rotations is {body:.0f}° if they are the body's and {world:.1f}° if they are the world's. Turn them by "
        "the transpose of the attitude; until then only its accelerometer is compared."
    )
    return NoiseDifference("gyroscope", "", "frame", None, None, None, None, "1", None, True, remark)


def sign_of_gravity(
    simulated: tuple[Segments, Calibration], recording: tuple[Segments, Calibration]
) -> NoiseDifference | None:
    """The statement that gravity has opposite signs in two logs of one protocol, pose by pose, ``None`` elsewhere."""
    ours, theirs = _gravity(*recording), _gravity(*simulated)
    if ours is None or theirs is None or len(ours) != len(theirs):
        return None
    if float(np.mean(np.sum(ours * theirs, axis=1))) > OPPOSITE:
        return None
    remark = (
        "Gravity has the opposite sign in the model, pose by pose: a static accelerometer reads +g along the axis "
        "that points up (specific force), not −g."
    )
    return NoiseDifference("accelerometer", "", "frame", -1.0, 1.0, -1.0, None, "1", None, True, remark)


def _gravity(segments: Segments, calibration: Calibration) -> npt.NDArray[np.float64] | None:
    """(n, 3) direction of specific force in the poses."""
    mean = segments.accelerometer_mean
    if mean is None:
        return None
    force = correct(mean, calibration.accelerometer.S, calibration.accelerometer.b)
    out: npt.NDArray[np.float64] = force / np.linalg.norm(force, axis=1, keepdims=True)
    return out
