"""Zeros of one or two orientations against a logged temperature: shape, branches, what stays (docs/static-logs.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.effects.thermal_shapes import BRANCH_K_S
from trihedron.diagnose.rest.pieces import RestPieces
from trihedron.diagnose.rest.process import DRIFT, SCATTER, WALK, BiasProcess

LEAST_SWING_K = 0.5
"""A logged temperature that changes by less explains no zero."""
MIN_BIC = 10.0
"""Kass and Raftery's bound for very strong evidence, as among poses."""
FOLDS = 12
TEMPERATURE_BINS, FEWEST_BINS = 12, 3
"""Bins of temperature, and how many must have been passed both ways for a difference between branches."""
VISIBLE = 0.98
"""Held-out rms must fall to this: the same bound as for every effect."""
ALL = (SCATTER, WALK, DRIFT)


@dataclass(frozen=True, eq=False)
class Curve:
    """One sensor's zeros as a function of temperature, raw units per power of kelvin.

    ``names`` (k,) of the terms, ``value``, ``std`` (3, k); ``swing`` (3,) through which the curve runs, ``rest`` (n, 3)
    what it leaves, ``raw`` (n, 3) the readings without it, about the mean of their orientation; ``gain`` twice the
    log-likelihood won beside scatter, walk and drift, ``cost`` what its terms pay.
    """

    names: tuple[str, ...]
    value: FloatArray
    std: FloatArray
    range_degc: tuple[float, float]
    swing: FloatArray
    raw: FloatArray
    rest: FloatArray
    held_before: float
    held_after: float
    gain: float
    cost: float
    p_value: float


def thermal_curve(pieces: RestPieces, sensor: str) -> Curve | None:
    """The simplest curve that the zeros demand, every strength of scatter, walk and drift beside it; ``None`` if none.

    Temperature enters to the first, second, third power, then its rate of change, then a branch of its own while it
    falls; each joins where ΔBIC over three axes exceeds 10.
    """
    heat, speed = pieces.temperature, pieces.temperature_rate
    if heat is None or speed is None or np.ptp(heat) < LEAST_SWING_K:
        return None
    middle, half = float(heat.mean()), float(0.5 * np.ptp(heat))
    u, fastest = (heat - middle) / half, float(np.abs(speed).max())
    terms: dict[str, tuple[FloatArray, float]] = {
        "bias_per_kelvin": (u, half), "bias_per_kelvin2": (u**2, half**2), "bias_per_kelvin3": (u**3, half**3)
    }  # fmt: skip
    more: dict[str, tuple[FloatArray, float]] = {}
    if fastest > 0.0:
        more["bias_per_kelvin_per_s"] = (speed / fastest, fastest)
    if speed.min() < -BRANCH_K_S and speed.max() > BRANCH_K_S:
        more["half_gap"] = (np.tanh(speed / BRANCH_K_S), 1.0)
    cost = 3.0 * float(np.log(len(heat) / 2.0))
    nothing = _likelihood(pieces, sensor, [])
    chosen: list[str] = []
    best, gained = nothing, 0.0
    for name in terms:
        value = _likelihood(pieces, sensor, [terms[k][0] for k in (*chosen, name)])
        # A higher power may be what makes a lower one pay: both are tried before the lower one is refused.
        if 2.0 * (value - best) - cost > MIN_BIC:
            chosen.append(name)
            best = value
        elif name == "bias_per_kelvin":
            both = _likelihood(pieces, sensor, [terms[k][0] for k in ("bias_per_kelvin", "bias_per_kelvin2")])
            if 2.0 * (both - nothing) - 2.0 * cost <= MIN_BIC:
                return None
            chosen.append(name)
    terms |= more
    for name in more:
        value = _likelihood(pieces, sensor, [terms[k][0] for k in (*chosen, name)])
        if 2.0 * (value - best) - cost > MIN_BIC:
            chosen.append(name)
            best = value
    n = len(heat) / 2.0
    columns = [terms[k][0] for k in chosen]
    gained = 2.0 * (best - nothing) * max(n - len(chosen) - pieces.n_poses, 1.0) / n
    return _curve(pieces, sensor, chosen, columns, np.array([terms[k][1] for k in chosen]), gained, cost * len(chosen))


def _process(pieces: RestPieces, sensor: str, axis: int, columns: list[FloatArray]) -> BiasProcess:
    return BiasProcess.of(pieces.readings(sensor, axis, columns))


def _likelihood(pieces: RestPieces, sensor: str, columns: list[FloatArray]) -> float:
    every = list(range(pieces.n_poses + len(columns)))
    return sum(_process(pieces, sensor, axis, columns).maximum(ALL, every, restricted=False)[0] for axis in range(3))


def _curve(
    pieces: RestPieces, sensor: str, names: list[str], columns: list[FloatArray], unit: FloatArray, gain: float,
    cost: float,
) -> Curve | None:  # fmt: skip
    assert pieces.temperature is not None
    assert pieces.temperature_rate is not None
    k = pieces.n_poses
    values = pieces.force if sensor == "accelerometer" else pieces.rate
    assert values is not None
    X = np.column_stack(columns)
    theta, std, fitted, swing = [], [], [], []
    grid = np.linspace(-1.0, 1.0, 101)
    powers = np.column_stack([grid ** (1 + j) for j in range(sum("kelvin_per_s" not in n and n != "half_gap"
                                                                for n in names))])  # fmt: skip
    for axis in range(3):
        mean, covariance = _process(pieces, sensor, axis, columns).mixture(list(range(k + len(names))))
        own = mean[0, k:]
        theta.append(own / unit)
        std.append(np.sqrt(np.maximum(np.diag(covariance[0])[k:], 0.0)) / unit)
        fitted.append(X @ own)
        swing.append(float(np.ptp(powers @ own[: powers.shape[1]])))
    about = np.array([values[pieces.pose == p].mean(axis=0) for p in range(k)])
    raw = values - about[pieces.pose]
    rest = raw - np.array(fitted).T
    rest = rest - np.array([rest[pieces.pose == p].mean(axis=0) for p in range(k)])[pieces.pose]
    before, after = _held_out(pieces, values, X)
    if not after < VISIBLE * before:
        return None
    heat = pieces.temperature
    return Curve(
        tuple(names), np.array(theta), np.array(std), (float(heat.min()), float(heat.max())),
        np.array(swing), raw, rest, before, after, gain, cost, float(chdtrc(3.0 * len(names), max(gain, 0.0))),
    )  # fmt: skip


def _held_out(pieces: RestPieces, values: FloatArray, X: FloatArray) -> tuple[float, float]:
    """Rms over blocks of neighbouring pieces that a plain fit of zeros, then of zeros and curve, did not see."""
    levels = np.column_stack([(pieces.pose == p).astype(np.float64) for p in range(pieces.n_poses)])
    fold = np.minimum(np.arange(len(values)) * FOLDS // len(values), FOLDS - 1)
    errors = []
    for design in (levels, np.hstack([levels, X])):
        missed = np.full(values.shape, np.nan)
        for f in range(FOLDS):
            out = fold == f
            seen = levels[~out].any(axis=0)
            columns = np.concatenate([seen, np.ones(design.shape[1] - levels.shape[1], dtype=bool)])
            theta, *_ = np.linalg.lstsq(design[~out][:, columns], values[~out], rcond=None)
            told = out & (levels[:, ~seen] == 0.0).all(axis=1)
            missed[told] = values[told] - design[told][:, columns] @ theta
        errors.append(missed)
    both = np.isfinite(errors[0]).all(axis=1)
    before, after = (float(np.sqrt(np.mean(e[both] ** 2))) for e in errors)
    return before, after


def branch_gap(pieces: RestPieces, rest: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """(3,) mean difference between heating and cooling at one temperature of what a curve leaves, and its error.

    ``rest`` (n, 3); the error is that of a mean over temperatures, whose differences scatter. ``None`` where no
    temperature was passed both ways. Hysteresis and drift in time both make it.
    """
    heat, speed = pieces.temperature, pieces.temperature_rate
    assert heat is not None
    assert speed is not None
    edges = np.linspace(heat.min(), heat.max() + 1e-9, TEMPERATURE_BINS + 1)
    place = np.digitize(heat, edges)
    gaps = []
    for k in range(1, TEMPERATURE_BINS + 1):
        up, down = (place == k) & (speed > BRANCH_K_S), (place == k) & (speed < -BRANCH_K_S)
        if up.sum() >= 2 and down.sum() >= 2:
            gaps.append(rest[up].mean(axis=0) - rest[down].mean(axis=0))
    if len(gaps) < FEWEST_BINS:
        return None
    return np.mean(gaps, axis=0), np.std(gaps, axis=0, ddof=1) / np.sqrt(len(gaps))
