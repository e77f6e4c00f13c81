"""Error over a horizon of a filter that does not correct S and g-sensitivity, drawn from their posterior."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.strengths import DRAWN
from trihedron.estimate.reference.motion import MotionFit
from trihedron.records.filter_noise import Cause

Left = dict[float, dict[Cause, FloatArray]]
"""Mean squares (k,) [rad²] by horizon and cause."""
SIZES = np.geomspace(1e-5, 0.1, 33)
"""Sizes tried for the error of the elements of S."""
G_SENSITIVITY = "gyro-g-sensitivity"
PARTS = np.geomspace(1e-2, 10.0, 33)
"""Sizes tried for the g-sensitivity, in units of the data sheets' typical value."""
FLAT = 1e-2
"""Fraction of the prior's information that stays when a prior is removed, so that the covariance is invertible."""


def left_over(found: MotionFit, horizons_s: Sequence[float]) -> Left:
    """Mean square errors over all starts of every horizon of a gyro with one scale, orthogonal axes, no g-sensitivity.

    The mounting is no calibration error, and a filter estimates the bias: neither is included.
    """
    side, point = found.sides[0], found.points[0]
    grid = side.grid
    C = side.reference.attitude(grid.time_s * (1.0 + point.rate) + point.offset_s) @ point.mounting

    def carried(signal: FloatArray) -> FloatArray:
        """(n, 3, 9) derivative of the angle by the elements of a matrix times a signal (n, 3) less its mean."""
        apart = np.where(side.seen[:, None], signal - signal[side.seen].mean(axis=0), 0.0)
        return np.cumsum(np.einsum("nij,nk->nijk", C, apart).reshape(len(C), 3, 9), axis=0) * grid.step_s

    S, cov = found.value(0, "S"), found.covariance(0, ("S",))
    across = _across(S)
    # Without its rotation a matrix has six degrees of freedom: the other three directions are excluded.
    u, gains, _ = np.linalg.svd(across)
    kept = u[:, gains > 0.5]
    elements = drawn_errors(kept.T @ left_of(S), kept.T @ across @ cov @ across.T @ kept, SIZES) @ kept.T
    by: dict[Cause, tuple[FloatArray, FloatArray]] = {"calibration": (carried(grid.gyroscope), elements)}
    if side.force is not None and G_SENSITIVITY in found.places[0]:
        by["g-sensitivity"] = (carried(side.force), _g_sensitivities(found))
    return {
        h: {
            cause: mean_square(_steps(angle, max(1, round(h / grid.step_s))), errors)
            for cause, (angle, errors) in by.items()
        }
        for h in horizons_s
    }


def _g_sensitivities(found: MotionFit) -> FloatArray:
    """(k, 9) draws of the g-sensitivity: its likelihood without the fit's prior, with one size for all elements."""
    name = G_SENSITIVITY
    size = float(np.mean(found.wider.get(name, 1.0) * found.sides[0].sigma(name)))
    inverse = np.linalg.inv(found.covariance(0, (name,)))
    cov = np.asarray(np.linalg.inv(inverse - (1.0 - FLAT) * np.eye(len(inverse)) / size**2), float)
    return drawn_errors(cov @ inverse @ found.value(0, name), cov, size * PARTS)


def _steps(angle: FloatArray, ahead: int) -> FloatArray:
    return angle[ahead:] - angle[:-ahead]


def mean_square(steps: FloatArray, errors: FloatArray) -> FloatArray:
    """(k,) mean square error of parameter errors (k, f), from their derivatives (n, 3, f) at n starts."""
    square = np.einsum("nai,naj->ij", steps, steps) / max(1, len(steps))
    return np.asarray(np.einsum("ki,ij,kj->k", errors, square, errors))


def drawn_errors(seen: FloatArray, cov: FloatArray, sizes: FloatArray, n: int = DRAWN, seed: int = 0) -> FloatArray:
    """(n, f) posterior draws of errors with estimate ``seen`` (f,), covariance (f, f) and one prior σ among ``sizes``.

    Without the prior the variance of the estimate would count twice: noise makes a perfect matrix seem imperfect.
    """
    width = [cov + size**2 * np.eye(len(seen)) for size in sizes]
    log_p = np.array([-0.5 * (np.linalg.slogdet(V)[1] + seen @ np.linalg.solve(V, seen)) for V in width])
    weight = np.exp(log_p - log_p.max())
    rng = np.random.default_rng(seed)
    out = []
    for k in rng.choice(len(sizes), n, p=weight / weight.sum()):
        gain = sizes[k] ** 2 * np.linalg.inv(width[k])
        left = sizes[k] ** 2 * (np.eye(len(seen)) - gain)
        values, vectors = np.linalg.eigh(0.5 * (left + left.T))
        out.append(gain @ seen + vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=len(seen))))
    return np.array(out)


def _across(S: FloatArray) -> FloatArray:
    """(9, 9) derivative of :func:`left_of` with respect to S."""
    step = 1e-6 * float(np.linalg.norm(S))
    return np.array([(left_of(S + step * e) - left_of(S - step * e)) / (2.0 * step) for e in np.eye(9)]).T


def left_of(S: FloatArray) -> FloatArray:
    """(9,) S less the nearest orthogonal matrix times one scale; the scale is 1 for readings in SI."""
    u, s, vt = np.linalg.svd(S.reshape(3, 3))
    # For counts the mean scale is nominal and no error.
    scale = 1.0 if 0.5 < float(np.mean(s)) < 2.0 else float(np.mean(s))
    return np.asarray(S - scale * (u @ vt).ravel())
