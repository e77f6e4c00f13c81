"""Attitudes as unit quaternions (w, x, y, z) from the body frame to the level frame."""

import math

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.simulate.motion.steps import LEVEL, Quaternion


def quaternion_product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton product pq, normalised: the rotation q followed by p."""
    a, b, c, d = p
    e, f, g, h = q
    w = a * e - b * f - c * g - d * h
    x = a * f + b * e + c * h - d * g
    y = a * g - b * h + c * e + d * f
    z = a * h + b * g - c * f + d * e
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    return (w / norm, x / norm, y / norm, z / norm)


def quaternion_from_vector(v: npt.ArrayLike) -> Quaternion:
    """Rotation by |v| [rad] about v (3,)."""
    x, y, z = (float(c) for c in np.asarray(v, dtype=np.float64))
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return LEVEL
    s = math.sin(0.5 * angle) / angle
    return (math.cos(0.5 * angle), s * x, s * y, s * z)


def vector_from_quaternion(q: Quaternion) -> FloatArray:
    """Rotation vector (3,) [rad], of angle at most π."""
    w, *xyz = q
    v = np.array(xyz)
    n = float(np.linalg.norm(v))
    if n < 1e-12:
        return 2.0 * v
    if w < 0.0:
        w, v = -w, -v
    return v * (2.0 * math.atan2(n, w) / n)


def up_in_body(q: Quaternion) -> FloatArray:
    """Direction of the vertical in the body frame (3,): the third row of the body-to-level matrix."""
    w, x, y, z = q
    return np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


def attitude_with_up(up: npt.ArrayLike) -> Quaternion:
    """An attitude, by the shortest rotation from level, in which the body direction ``up`` (3,) points up."""
    return quaternion_product(LEVEL, quaternion_from_vector(shortest_turn(unit(up), np.array([0.0, 0.0, 1.0]))))


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
