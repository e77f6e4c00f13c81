"""What the zeros of a session show: temperature, gravity, slow change and its kind, scatter (eq. Z.5-Z.9)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.zeros.process import DRIFT, SCATTER, WALK, ZeroProcess, ZeroReadings

FEWEST_POSES = 15
"""With fewer poses the size of the scatter can be told, nothing else."""
FEWEST_FOR_KIND = 25
"""From here the kind of a slow change can be told."""
CONFOUNDED_VARIANCE = 10.0
"""A coefficient whose variance walk and drift raise by more than this factor is not told apart from them."""
KIND_LIMIT = 8.75
"""1 % point of 3/8 χ²(1) + 3/8 χ²(2) + 1/8 χ²(3): one strength more where the others may be 0."""
SLOW = 0.01
"""p-value from which zeros are said to change slowly: false in 1 % of sessions whose zeros only scatter."""
AT_EDGE = 0.99
"""Share of the grid's last level at which a strength lies on its edge."""
TOO_FEW_NORMS, TOO_FEW_ZEROS = 12, 6
"""Poses up to which none can be spared: nine numbers of S and b are fitted to lengths, three means to zeros."""
AS_LIKELY = 6.0
"""Twice the log-likelihood by which a drift must beat a logged temperature before that no longer stands for it."""
ALL: tuple[int, ...] = (SCATTER, WALK, DRIFT)
Kind = Literal["", "walk", "drift", "slow"]


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Columns tested together: (axes, k) values, (axes, k, k) covariance, p-value, confounded with drift."""

    values: FloatArray
    covariance: FloatArray
    p_value: float
    is_confounded: bool = False


@dataclass(frozen=True, eq=False)
class ZeroEvidence:
    """What the zeros show. Sizes are rms about the session's mean, in the unit of the readings.

    ``sigma`` (3,) most likely scatter, walk and drift with all of them free; ``scatter`` and ``scatter_std`` (axes,);
    p-values before payment for any search: ``p_slow`` of any slow change, ``p_scatter`` of the scatter, both ways of
    ``p_scatter_spared`` without its worst pose ``worst_pose``. ``kind`` of slow change: walk, drift, or slow where this
    recording does not tell them apart. ``is_at_edge`` is set where a strength ran to the end of its range.
    """

    process: ZeroProcess
    n_poses: int
    sigma: FloatArray
    scatter: FloatArray
    scatter_std: FloatArray
    p_slow: float
    p_scatter: float
    p_scatter_spared: float
    worst_pose: int
    kind: Kind
    drift_ratio: float
    walk_ratio: float
    is_at_edge: bool
    groups: dict[str, Coefficients] = field(default_factory=dict)


def examine(
    readings: ZeroReadings, thermal: list[int] | None = None, gravity: list[int] | None = None, *, is_norm: bool = False
) -> ZeroEvidence:
    """Test the zeros of one session.

    Parameters
    ----------
    readings : ZeroReadings
        With every column of the mean that is to be allowed for.
    thermal, gravity : lists of int
        Columns of the design that follow temperature and gravity, if it has them.
    is_norm : bool
        The readings are lengths of specific force: one number a pose, whose fit took many columns.
    """
    process = ZeroProcess.of(readings)
    every = list(range(readings.design.shape[1]))
    top, sigma = process.maximum(ALL, every, restricted=True)
    groups: dict[str, Coefficients] = {}
    if thermal:
        groups["thermal"] = _thermal(process, every, thermal)
    if gravity:
        groups["gravity"] = _gravity(process, every, gravity)
    s_only, _ = process.maximum((SCATTER,), every, restricted=True)
    s_walk, _ = process.maximum((SCATTER, WALK), every, restricted=True)
    s_drift, _ = process.maximum((SCATTER, DRIFT), every, restricted=True)
    ratio_walk, ratio_drift = 2.0 * (s_walk - s_only), 2.0 * (s_drift - s_only)
    p_slow = min(1.0, 2.0 * _half(max(ratio_walk, ratio_drift)))
    kind: Kind = ""
    drift_over, walk_over = 2.0 * (top - s_walk), 2.0 * (top - s_drift)
    if p_slow < SLOW:
        is_drift, is_walk = drift_over > KIND_LIMIT, walk_over > KIND_LIMIT
        kind = "slow"
        if readings.n_poses >= FEWEST_FOR_KIND and is_drift != is_walk:
            kind = "drift" if is_drift else "walk"
    p_scatter = _scatter_p(process, every, top, is_slow=p_slow < SLOW)
    worst, p_spared = _without_worst(process, every, sigma, is_slow=p_slow < SLOW, is_norm=is_norm)
    scatter, scatter_std = _scatter_sizes(process, every, sigma)
    return ZeroEvidence(
        process, readings.n_poses, sigma, scatter, scatter_std, p_slow, p_scatter, max(p_scatter, p_spared), worst,
        kind, drift_over, walk_over, bool((sigma >= AT_EDGE * process.levels[-1]).any()), groups,
    )  # fmt: skip


def _half(ratio: float) -> float:
    """Tail of ½χ²(0) + ½χ²(1): one strength on the edge of its range."""
    return 0.5 * float(chdtrc(1.0, ratio)) if ratio > 0.0 else 1.0


def _scatter_p(process: ZeroProcess, every: list[int], top: float, *, is_slow: bool) -> float:
    """Scatter against noise alone, or, where something changes slowly, against walk and drift of any strength."""
    if not is_slow:
        scatter, _ = process.maximum((SCATTER,), every, restricted=True)
        nothing, _ = process.maximum((), every, restricted=True)
        return _half(2.0 * (scatter - nothing))
    slow, _ = process.maximum((WALK, DRIFT), every, restricted=True)
    ratio = 2.0 * (top - slow)
    # Beside walk and drift the null is that of KIND_LIMIT, which a simulated walk confirms.
    return float(sum(w * chdtrc(k, max(ratio, 0.0)) for w, k in ((0.375, 1.0), (0.375, 2.0), (0.125, 3.0))))


def _thermal(process: ZeroProcess, every: list[int], columns: list[int]) -> Coefficients:
    """Wald test of the mixture (eq. Z.6); confounded where walk and drift make the variance ten times as large."""
    place = [every.index(c) for c in columns]
    mean, covariance = process.mixture(every)
    _, plain = process.mixture(every, (SCATTER,))
    value = mean[:, place]
    block = covariance[:, place][:, :, place]
    chi2 = float(sum(v @ np.linalg.solve(c, v) for v, c in zip(value, block, strict=True)))
    if (process.axis_factor != 1.0).any():
        # Every axis tells its own size by its own readings alone: the correction of eq. Z.7.
        chi2 *= (process.readings.n_poses - len(every) + 0.5) / process.readings.n_poses
    p_value = min(float(chdtrc(value.size, chi2)), _instead_of_drift(process, every, columns))
    wide = np.einsum("akk->ak", block) / np.maximum(np.einsum("akk->ak", plain[:, place][:, :, place]), 1e-300)
    return Coefficients(value, block, p_value, bool(np.median(wide) > CONFOUNDED_VARIANCE))


def _instead_of_drift(process: ZeroProcess, every: list[int], columns: list[int]) -> float:
    """p-value of a logged temperature beside scatter and walk of any strength, where it explains what a drift would.

    A temperature that rises all the while is a straight line, which drift takes for nothing: a Wald test beside drift
    cannot see it. Of two that explain as much the one that was logged explains it, as long as drift does not do better
    by what names two together (eq. Z.6a).
    """
    without = [c for c in every if c not in columns]
    logged, _ = process.maximum((SCATTER, WALK), every, restricted=False)
    drift, _ = process.maximum(ALL, without, restricted=False)
    if 2.0 * (drift - logged) > AS_LIKELY:
        return 1.0
    bare, _ = process.maximum((SCATTER, WALK), without, restricted=False)
    axes = len(process.axis_factor)
    h, p = process.readings.n_poses, len(every)
    ratio = 2.0 * (logged - bare) * max(h - p + 0.5, 0.5) / h
    return float(chdtrc(len(columns) * axes, max(ratio, 0.0)))


def _gravity(process: ZeroProcess, every: list[int], columns: list[int]) -> Coefficients:
    """Likelihood ratio with the correction for few poses (eq. Z.7); values of the mixture."""
    without = [c for c in every if c not in columns]
    full, _ = process.maximum(ALL, every, restricted=False)
    bare, _ = process.maximum(ALL, without, restricted=False)
    h, p = process.readings.n_poses, len(every)
    ratio = 2.0 * (full - bare) * max(h - p + 0.5, 0.5) / h
    mean, covariance = process.mixture(every)
    place = [every.index(c) for c in columns]
    dof = len(columns) * len(mean)
    return Coefficients(mean[:, place], covariance[:, place][:, :, place], float(chdtrc(dof, max(ratio, 0.0))))


def _without_worst(
    process: ZeroProcess, every: list[int], sigma: FloatArray, *, is_slow: bool, is_norm: bool
) -> tuple[int, float]:
    """The pose whose zero is farthest from the others' prediction, and the scatter's p-value without it."""
    readings = process.readings
    if readings.n_poses <= (TOO_FEW_NORMS if is_norm else TOO_FEW_ZEROS):
        return -1, 1.0
    worst = _worst_pose(process, every, sigma)
    rest = ZeroProcess(readings.without(worst), process.axis_factor, process.noise_factor)
    top, _ = rest.maximum(ALL, every, restricted=True)
    return worst, _scatter_p(rest, every, top, is_slow=is_slow)


def _worst_pose(process: ZeroProcess, every: list[int], sigma: FloatArray) -> int:
    from trihedron.diagnose.zeros.curve import residuals_of_poses

    poses, away = residuals_of_poses(process, every, sigma)
    return int(poses[int(np.argmax((away**2).sum(axis=0)))])


def _scatter_sizes(process: ZeroProcess, every: list[int], sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(axes,) size of the scatter of every axis and its standard error: mean and deviation of its likelihood.

    Flat in σ, with walk and drift at their best for each size of a coarse set, so that what they could take is counted.
    """
    top = max(float(process.levels[-1]), 1e-300)
    x = np.linspace(0.0, 1.0, 61)[1:] ** 2 * top
    slow = np.unique(np.vstack([sigma[1:], [0.0, sigma[2]], [sigma[1], 0.0], 2.0 * sigma[1:], 0.5 * sigma[1:]]), axis=0)
    sigmas = np.concatenate([np.column_stack([x, np.tile(s, (len(x), 1))]) for s in slow])
    value = process.grams(sigmas).log_likelihood(every, restricted=True)
    value = value.reshape(len(process.axis_factor), len(slow), -1)
    weight = np.exp(value - value.max(axis=(1, 2), keepdims=True)).sum(axis=1) * np.gradient(x)
    weight /= weight.sum(axis=1, keepdims=True)
    scaled = process.axis_factor[:, None] * x
    mean = (weight * scaled).sum(axis=1)
    deviation = np.sqrt(np.maximum((weight * (scaled - mean[:, None]) ** 2).sum(axis=1), 0.0))
    return mean, deviation
