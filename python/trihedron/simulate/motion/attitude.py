"""Attitudes: rotations from the body frame to the level frame, stored as unit quaternions (w, x, y, z)."""

import math

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.simulate.motion.steps import Quaternion

VERTICAL = np.array([0.0, 0.0, 1.0])


def rotation_of(q: npt.ArrayLike) -> Rotation:
    """Body-to-level rotations of quaternions (4,) or (m, 4)."""
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def quaternion_of(rotation: Rotation) -> Quaternion:
    """The quaternion of a rotation."""
    x, y, z, w = rotation.as_quat().tolist()
    return (w, x, y, z)


def attitude_with_up(up: npt.ArrayLike) -> Quaternion:
    """An attitude, by the shortest rotation from level, in which the body direction ``up`` (3,) points up."""
    return quaternion_of(Rotation.from_rotvec(shortest_turn(unit(up), VERTICAL)))


def unit(v: npt.ArrayLike) -> FloatArray:
    out: FloatArray = np.asarray(v, dtype=np.float64)
    norm = float(np.linalg.norm(out))
    if out.shape != (3,) or not math.isfinite(norm) or norm == 0.0:
        raise InputError(f"a direction needs three numbers that are not all zero, got {np.asarray(v).tolist()}")
    return out / norm


def shortest_turn(a: FloatArray, b: FloatArray) -> FloatArray:
    """Shortest rotation vector (3,) [rad] that rotates unit vector a to unit vector b."""
    cross = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(cross)), float(a @ b)
    if sine < 1e-12:
        if cosine > 0.0:
            return np.zeros(3)
        other = np.eye(3)[int(np.argmin(np.abs(a)))]
        perpendicular = np.cross(a, other)
        return perpendicular * (math.pi / float(np.linalg.norm(perpendicular)))
    return cross * (math.atan2(sine, cosine) / sine)
