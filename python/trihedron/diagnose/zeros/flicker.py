"""Whether zeros that wander do so as 1/f noise would, inside poses and from one to the next (docs/zeros.md, Z.11)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.zeros.process import ZeroReadings, unit_kernels
from trihedron.diagnose.zeros.readings import SessionZeros, accel_zeros, gyro_zeros

MOST_READINGS = 400
"""Means of parts of poses: the time of an answer grows with their cube."""
MOST_PARTS = 8
FEWEST_POSES = 6
DOUBT = 2.0
"""Log-likelihood that another process must win over flicker: every sensor has some, few have anything else (1 : 7)."""
STRENGTHS = np.concatenate([[0.0], np.geomspace(1e-4, 1e6, 81)])
"""Of a process over white noise, in its largest direction."""
SINGULAR = 1e-9
"""Share of the largest singular value below which columns of the mean repeat each other."""
SHARES = (0.3, 1.0, 3.0, 10.0, 30.0)
"""Mean squares of a second process over those of the first, tried for two at once."""


def gyro_flicker(context: Context) -> FloatArray | None:
    """(3,) rms, rad/s, by which 1/f noise moves the gyros' zeros from pose to pose; ``None`` where that is not it."""
    return _flicker(lambda parts: gyro_zeros(context, parts), context.obs.n_holds)


def accel_flicker(context: Context) -> FloatArray | None:
    """(1,) the same of the accelerometer along the vertical, m/s²."""
    return _flicker(lambda parts: accel_zeros(context, parts), context.obs.n_holds)


def _flicker(zeros_of: Callable[[int], SessionZeros | None], n_poses: int) -> FloatArray | None:
    if n_poses < FEWEST_POSES:
        return None
    zeros = zeros_of(int(np.clip(MOST_READINGS // n_poses, 2, MOST_PARTS)))
    if zeros is None or not np.isfinite(zeros.readings.values).all():
        return None
    return flicker_of(zeros.readings, [k for k in range(zeros.readings.design.shape[1]) if k not in zeros.thermal])


def flicker_of(readings: ZeroReadings, columns: list[int]) -> FloatArray | None:
    """(axes,) rms about the session's mean of zeros of poses that flicker, in the unit of ``readings``, their parts.

    White noise of unknown strength and flicker, a covariance -h ln|t - t'| averaged over the parts, is held against
    white noise and scatter, a walk or a drift by REML with the ``columns`` of the design in the mean, and against
    these two at a time, which must win what their further strength costs. ``None`` where any of them is plainly
    likelier, or where white noise alone does.
    """
    r = readings
    n_axes, along = len(r.values), r.direction @ r.direction.T
    walk, drift, _, _ = unit_kernels(r)
    same = (r.pose[:, None] == r.pose[None]).astype(float)
    kernels = [_unit(_flicker_kernel(r)) * along, _unit(same) * along, walk, drift]
    basis = _complement(r.design[:, columns] * np.sqrt(r.length_s)[:, None])
    flicker, strength = _restricted(r, basis, kernels[0])
    rivals = [_restricted(r, basis, one)[0].max(axis=1).sum() for one in kernels[1:]]
    # A strength of its own, common to the axes, is worth half a logarithm of what tells it.
    cost = 0.5 * np.log(r.n_poses * n_axes)
    for first, second in ((0, 1), (0, 2), (0, 3), (1, 2)):
        both = [_restricted(r, basis, kernels[first] + share * kernels[second])[0] for share in SHARES]
        rivals.append(max(one.max(axis=1).sum() for one in both) - cost)
    best = flicker.argmax(axis=1)
    if flicker.max(axis=1).sum() < max(rivals) - DOUBT or not best.any():
        return None
    return np.asarray(np.sqrt(strength[np.arange(n_axes), best] * _of_poses(r, kernels[0])))


def _restricted(r: ZeroReadings, basis: FloatArray, kernel: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(axes, g) restricted log-likelihoods over strengths of a kernel, the noise at its best; (axes, g) strengths."""
    root = np.sqrt(r.length_s)
    value, vector = np.linalg.eigh(basis.T @ (root[:, None] * kernel * root) @ basis)
    value = np.maximum(value, 0.0)
    squares = ((r.values * root) @ basis @ vector) ** 2
    ratio = STRENGTHS / max(float(value.max()), 1e-300)
    spread = 1.0 + ratio[:, None] * value
    white = np.maximum((squares[:, None, :] / spread).mean(axis=2), 1e-300)
    return -0.5 * (len(value) * np.log(white) + np.log(spread).sum(axis=1)), ratio * white


def _complement(columns: FloatArray) -> FloatArray:
    """(n, n - p) orthonormal directions in which the columns (n, p) say nothing."""
    left, size, _ = np.linalg.svd(columns, full_matrices=True)
    rank = int(np.count_nonzero(size > SINGULAR * size.max()))
    return np.asarray(left[:, rank:])


def _unit(kernel: FloatArray) -> FloatArray:
    """A kernel (n, n) of unit mean square about the mean."""
    size = float(np.mean(np.diag(kernel)) - kernel.mean())
    out: FloatArray = kernel / max(size, 1e-12)
    return out


def _of_poses(r: ZeroReadings, kernel: FloatArray) -> float:
    """Mean square about their mean that poses have under a kernel of their parts."""
    weight = (r.pose[None] == np.unique(r.pose)[:, None]) * r.length_s
    weight = weight / weight.sum(axis=1, keepdims=True)
    of_poses = weight @ kernel @ weight.T
    return max(float(np.mean(np.diag(of_poses)) - of_poses.mean()), 0.0)


def _flicker_kernel(r: ZeroReadings) -> FloatArray:
    """(n, n) -ln|t - t'| averaged over both parts: differences of its means are those of noise of density 1/f."""
    span = max(float(r.time_s[-1] - r.time_s[0]), 1e-9)
    start, stop = (r.time_s - 0.5 * r.length_s) / span, (r.time_s + 0.5 * r.length_s) / span
    corners = [(stop, start, 1.0), (start, start, -1.0), (stop, stop, -1.0), (start, stop, 1.0)]
    total = sum(sign * _second_integral(np.subtract.outer(a, b)) for b, a, sign in corners)
    out: FloatArray = -total / np.outer(stop - start, stop - start)
    return out


def _second_integral(x: npt.NDArray[np.float64]) -> FloatArray:
    """Of ln|x|."""
    x = np.abs(x)
    out: FloatArray = 0.5 * x * x * np.log(np.maximum(x, 1e-300)) - 0.75 * x * x
    return out
