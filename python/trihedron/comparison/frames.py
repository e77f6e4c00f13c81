"""Axes along which a simulated log reads: rates of the world instead of the body's, gravity with the other sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import NoiseDifference
from trihedron.sensor_model import correct
from trihedron.units import degrees_from_radians, rate_to_si

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


# Rates along the axes of the world where those of the body are wanted: told by gravity before and after the moves.

FEWEST_MOVES = 4
"""Three unknown angles of the first attitude and some moves to spare."""
MISSED_RAD = 0.3
"""Gravity carried by body rates misses by less than this after any move, scales and biases of cheap parts included."""
BETTER = 0.3
"""World rates explain what body rates do not where their error is less than this share of it."""


@dataclass(frozen=True)
class CarriedGravity:
    """Rms angle [rad] by which gravity is missed after the moves, rates taken as the body's and as the world's."""

    body_rad: float
    world_rad: float

    @property
    def is_of_world(self) -> bool:
        """Whether the rates are the world's."""
        return self.body_rad > MISSED_RAD and self.world_rad < BETTER * self.body_rad


def carried_gravity(recording: Recording, segments: Segments) -> CarriedGravity | None:
    """Gravity carried through the moves by the rates, as if of the body and as if of the world.

    Of the body: ``u₊ = ΔRᵀ u``. Of the world: ``R₊ = ΔR R``, so ``u_n = R₀ᵀ (ΔR_n … ΔR_1)ᵀ e_z``, with R₀ from all
    poses (Wahba's problem). Rates are read by their unit, biases off by the rest before and after each move; ``None``
    without a unit or with fewer than four moves in a row.
    """
    scale = rate_to_si(recording.gyroscope_unit)
    if scale is None or recording.gyroscope is None or segments.accelerometer_mean is None:
        return None
    mean, still = segments.accelerometer_mean, segments.gyroscope_mean
    if still is None or len(segments.moves) < FEWEST_MOVES or len(segments.moves) != segments.n_poses - 1:
        return None
    up = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    attitude = Rotation.identity()
    carried, misses = [np.array([0.0, 0.0, 1.0])], []
    for move in segments.moves:
        bias = 0.5 * (still[move.pose_before] + still[move.pose_after])
        part = slice(move.start, move.stop)
        step = np.gradient(recording.time_s[part])[:, None] if move.stop - move.start > 1 else 0.0
        turns = (recording.gyroscope[part] - bias) * scale * step
        if not np.isfinite(turns).all():
            return None
        body = world = Rotation.identity()
        for one in Rotation.from_rotvec(np.atleast_2d(turns)):
            body, world = body * one, one * world
        miss = float(np.arccos(np.clip(up[move.pose_after] @ body.inv().apply(up[move.pose_before]), -1.0, 1.0)))
        misses.append(miss)
        attitude = world * attitude
        carried.append(attitude.inv().apply([0.0, 0.0, 1.0]))
    _, missed = Rotation.align_vectors(up, np.array(carried))
    return CarriedGravity(float(np.sqrt(np.mean(np.square(misses)))), float(missed) / float(np.sqrt(len(up))))
