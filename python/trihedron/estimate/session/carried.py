"""Gravity carried through moves by the gyro, and what noise and stated errors allow it to miss (equation 5.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.gyroscope.measurements import MoveMeasurements


@dataclass(frozen=True, eq=False)
class Carried:
    """Gravity carried through moves: ``residual``, ``sigma`` (m, 3) m/s², ``angle_deg`` (m,).

    ``floor2`` (m,) is the variance across the vertical by noise of poses and samples, (m/s²)², ``model2`` (m,) that by
    a covariance of the gyro's S, where one was given.
    """

    residual: FloatArray
    sigma: FloatArray
    angle_deg: FloatArray
    floor2: FloatArray
    model2: FloatArray

    def spread(self, which: IntArray, n_moves: int) -> Carried:
        """The same as those ``which`` (m,) of more moves; the others are NaN."""

        def filled(values: FloatArray) -> FloatArray:
            out = np.full((n_moves, *values.shape[1:]), np.nan)
            out[which] = values
            return out

        return Carried(*map(filled, (self.residual, self.sigma, self.angle_deg, self.floor2, self.model2)))


def carried(
    measured: MoveMeasurements,
    anchors_s: FloatArray,
    S_a: FloatArray,
    b_a: FloatArray,
    S_w: FloatArray,
    covariance_S_w: FloatArray | None = None,
) -> Carried:
    """``B f_i - f_j`` of every move with the pose means at both ends, each pose with a bias of its own.

    The one definition of gravity after moves: in sample, held out, and of a calibration held against another session.
    ``covariance_S_w`` (9, 9) is that of S_w row by row.
    """
    model = Linear(np.arange(len(measured.links)), S_a, b_a, S_w)
    return carried_each(measured, anchors_s, [model], covariance_S_w)


@dataclass(frozen=True, eq=False)
class Linear:
    """The linear models ``S_a``, ``b_a``, ``S_w`` by which some ``moves`` (k,) are carried."""

    moves: IntArray
    S_a: FloatArray
    b_a: FloatArray
    S_w: FloatArray


def carried_each(
    measured: MoveMeasurements,
    anchors_s: FloatArray,
    models: list[Linear],
    covariance_S_w: FloatArray | None = None,
) -> Carried:
    """:func:`carried` of every move by the model that names it."""
    before, after = measured.links[:, 0], measured.links[:, 1]
    m = len(before)
    rotation, wrt_before, wrt_after, cov_rate = np.zeros((4, m, 3, 3))
    wrt_scale = np.zeros((m, 3, 9))
    S_a, S_w, b_a = np.zeros((m, 3, 3)), np.zeros((m, 3, 3)), np.zeros((m, 3))
    noise = _core.RateNoise(measured.noise_density, measured.sigma_time_s, measured.nominal_step_s)
    for one in models:
        at, bias = one.moves, -measured.bias @ one.S_w.T
        S_a[at], b_a[at], S_w[at] = one.S_a, one.b_a, one.S_w
        rotation[at], wrt_scale[at], wrt_before[at], wrt_after[at], cov_rate[at] = _core.integrate_moves(
            measured.time_s, measured.rate, measured.edges[at], np.ascontiguousarray(anchors_s[at]),
            np.ascontiguousarray(one.S_w), bias[before[at]], bias[after[at]], 3, noise,
        )  # fmt: skip
    start = np.einsum("mij,mj->mi", S_a, measured.reading[before]) + b_a
    end = np.einsum("mij,mj->mi", S_a, measured.reading[after]) + b_a
    moved = np.einsum("mij,mj->mi", rotation, start)
    residual = moved - end
    unit_moved = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    unit_end = end / np.linalg.norm(end, axis=1, keepdims=True)
    angle = np.degrees(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(unit_moved - unit_end, axis=1), 1.0)))
    skew = np.zeros((len(start), 3, 3))
    skew[:, [0, 1, 2], [1, 2, 0]] = -start[:, [2, 0, 1]]
    skew[:, [1, 2, 0], [0, 1, 2]] = start[:, [2, 0, 1]]
    turn = rotation @ skew

    sigma_force, sigma_bias = (np.sqrt(variance)[:, None, :] for variance in (measured.var_reading, measured.var_bias))
    # Roots of covariances side by side: sums of squares do not go negative by rounding, as turns of gravity about
    # itself make differences of large parts do.
    roots = [turn @ _root(cov_rate), rotation @ (S_a * sigma_force[before]), S_a * sigma_force[after],
             turn @ wrt_before @ (S_w * sigma_bias[before]), turn @ wrt_after @ (S_w * sigma_bias[after])]  # fmt: skip
    root = np.concatenate(roots, axis=2)
    across = np.eye(3) - unit_end[:, :, None] * unit_end[:, None, :]
    floor2 = np.sum((across @ root) ** 2, axis=(1, 2))
    model2 = np.zeros(len(angle))
    if covariance_S_w is not None:
        # Zero readings are subtracted: S enters through the rate and through the biases -S z.
        wrt_S = wrt_scale.copy()
        for i in range(3):
            wrt_S[:, :, 3 * i : 3 * i + 3] -= (
                wrt_before[:, :, i : i + 1] * measured.bias[before][:, None, :]
                + wrt_after[:, :, i : i + 1] * measured.bias[after][:, None, :]
            )
        model2 = np.sum((across @ turn @ wrt_S @ _root(covariance_S_w)) ** 2, axis=(1, 2))
    return Carried(residual, np.sqrt(np.sum(root**2, axis=2)), angle, floor2, model2)


def _root(covariance: FloatArray) -> FloatArray:
    """L of L Lᵀ for covariances (..., n, n) that are positive semidefinite but for rounding."""
    values, vectors = np.linalg.eigh(covariance)
    out: FloatArray = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    return out
