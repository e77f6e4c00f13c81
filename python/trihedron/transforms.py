"""Transforms that several modules use."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray


def cosine_transform(x: FloatArray) -> FloatArray:
    """Orthonormal discrete cosine transform (type II) along the last axis, by one Fourier transform (Makhoul, 1980)."""
    n = x.shape[-1]
    reordered = np.empty_like(x, dtype=np.float64)
    even = (n + 1) // 2
    reordered[..., :even] = x[..., ::2]
    reordered[..., even:] = x[..., 1::2][..., ::-1]
    half = np.fft.rfft(reordered, axis=-1)
    half *= _turns(n)
    out = reordered
    out[..., : half.shape[-1]] = half.real
    out[..., half.shape[-1] :] = -half.imag[..., 1 : n - half.shape[-1] + 1][..., ::-1]
    return out


@lru_cache(maxsize=2)
def _turns(n: int) -> npt.NDArray[np.complex128]:
    turns: npt.NDArray[np.complex128] = np.exp(-0.5j * np.pi * np.arange(n // 2 + 1) / n) * np.sqrt(2.0 / n)
    turns[0] = np.sqrt(1.0 / n)
    turns.setflags(write=False)
    return turns


def cross_matrix(v: FloatArray) -> FloatArray:
    """(..., 3, 3) matrices [v]× of the vector product with ``v`` (..., 3)."""
    return np.asarray(-np.cross(v[..., np.newaxis, :], np.eye(3)), dtype=np.float64)


def rotation_by(vector: FloatArray) -> FloatArray:
    """(3, 3) exp([v]×) of a rotation vector (3,), Rodrigues."""
    angle, cross = float(np.linalg.norm(vector)), cross_matrix(vector)
    if angle < 1e-8:
        return np.asarray(np.eye(3) + cross + 0.5 * cross @ cross, dtype=np.float64)
    out: FloatArray = np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * cross @ cross
    return out


def directions_of(vectors: FloatArray) -> FloatArray:
    """Unit vectors (n, 3) along vectors (n, 3)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
