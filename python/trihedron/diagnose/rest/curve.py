"""The smooth latent curve of a bias with its band (docs/static-logs.md, R.10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.rest.process import DRIFT, INITIAL_SLOPE, SCATTER, WALK, BiasProcess, BiasReadings, unit_kernels


@dataclass(frozen=True, eq=False)
class DriftCurve:
    """``values``, ``sigma`` (axes, m) at ``time_s`` (m,): walk plus drift about its mean over the session."""

    time_s: FloatArray
    values: FloatArray
    sigma: FloatArray

    @property
    def rms(self) -> FloatArray:
        """(axes,) rms about the mean."""
        return np.asarray(np.sqrt(np.mean((self.values - self.values.mean(axis=1, keepdims=True)) ** 2, axis=1)))

    @property
    def range(self) -> FloatArray:
        """(axes,) from the lowest to the highest value."""
        return np.asarray(np.ptp(self.values, axis=1))


def covariance_of(process: BiasProcess, axis: int, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, n) covariance of the readings, and the share of walk and drift in it."""
    r = process.readings
    W, D, _, _ = unit_kernels(r)
    s, w, d = (process.axis_factor[axis] * sigma) ** 2
    slow = w * W + d * D
    V = slow + s * (r.pose[:, None] == r.pose[None, :]) + np.diag(process.noise_factor * r.sigma[axis] ** 2)
    return V, slow


def smooth_curve(process: BiasProcess, keep: list[int], sigma: FloatArray, time_s: FloatArray) -> DriftCurve:
    """Mean and standard error of walk plus drift at ``time_s`` (m,), its mean over those times taken off.

    Of readings of a length, which see three walks along the vertical (``direction`` of three columns), three curves.
    """
    r = process.readings
    X = r.design[:, keep]
    start, span = r.time_s[0], max(float(r.time_s[-1] - r.time_s[0]), 1e-9)
    t, at = (r.time_s - start) / span, np.clip((time_s - start) / span, 0.0, 1.0)
    walk, drift = process.sizes

    def kernel(a: FloatArray, b: FloatArray, w: float, d: float, length: FloatArray | None = None) -> FloatArray:
        low, high = np.minimum.outer(a, b), np.maximum.outer(a, b)
        bent = low**2 * (3.0 * high - low) / 6.0 + INITIAL_SLOPE * np.outer(a, b)
        if length is not None:
            # A value of the walk against its mean over a stretch around it.
            inside = np.maximum(0.5 * length - np.abs(a[:, None] - b), 0.0)
            low = low - inside**2 / (2.0 * np.maximum(length, 1e-12))
        return np.asarray(w / walk * low + d / drift * bent)

    centre = np.eye(len(at)) - 1.0 / len(at)
    values, errors = [], []
    is_length = r.direction.shape[1] > 1
    seen = [(0, k) for k in range(r.direction.shape[1])] if is_length else [(k, 0) for k in range(len(r.values))]
    for axis, along in seen:
        y = r.values[axis]
        V, _ = covariance_of(process, axis, sigma)
        _, w, d = (process.axis_factor[axis] * sigma) ** 2
        cross = centre @ (kernel(at, t, w, d, r.length_s / span) * r.direction[:, along])
        inverse = np.linalg.inv(V)
        side = inverse @ X
        A = np.linalg.pinv(X.T @ side)
        P = inverse - side @ A @ side.T
        values.append(cross @ P @ y)
        covariance = centre @ kernel(at, at, w, d) @ centre - cross @ P @ cross.T
        errors.append(np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    return DriftCurve(time_s, np.array(values), np.array(errors))


# Whether the biases of a static log change slowly, and whether a walk alone makes that (docs/static-logs.md, R.9).

SMOOTH = 8.75
"""1 % point of 3/8 χ²(1) + 3/8 χ²(2) + 1/8 χ²(3): one strength more where the others may be 0."""
SLOW = 0.01
"""p-value from which biases are said to change slowly: false in 1 % of logs whose biases only scatter."""


@dataclass(frozen=True, eq=False)
class SlowChange:
    """How biases change: ``sigma`` (3,) likeliest scatter, walk and drift, rms about the mean in the readings' unit.

    ``p_value`` of any slow change beside scatter; ``drift_ratio`` twice the log-likelihood that a smooth drift wins
    beside scatter and walk.
    """

    process: BiasProcess
    sigma: FloatArray
    p_value: float
    drift_ratio: float

    @property
    def is_slow(self) -> bool:
        """Whether anything changes slowly."""
        return self.p_value < SLOW

    @property
    def is_smooth(self) -> bool:
        """Whether a walk alone does not make it."""
        return self.drift_ratio > SMOOTH


def slow_change(readings: BiasReadings) -> SlowChange:
    """Test the biases of one log, every column of its design allowed for."""
    process = BiasProcess.of(readings)
    every = list(range(readings.design.shape[1]))
    top, sigma = process.maximum((SCATTER, WALK, DRIFT), every, restricted=True)
    alone, walk, drift = (
        process.maximum(free, every, restricted=True)[0] for free in ((SCATTER,), (SCATTER, WALK), (SCATTER, DRIFT))
    )
    ratio = 2.0 * (max(walk, drift) - alone)
    # Two tries, each with the tail of ½χ²(0) + ½χ²(1): one strength on the edge of its range.
    p_value = min(1.0, float(chdtrc(1.0, ratio))) if ratio > 0.0 else 1.0
    return SlowChange(process, sigma, p_value, 2.0 * (top - walk))
