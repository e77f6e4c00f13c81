"""Biases of one or two orientations against a logged temperature: curve, branches, residuals (docs/static-logs.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.effects.thermal import BRANCH_K_S
from trihedron.diagnose.rest.pieces import RestPieces
from trihedron.diagnose.rest.process import DRIFT, INITIAL_SLOPE, SCATTER, WALK, BiasProcess, BiasReadings, unit_kernels
from trihedron.diagnose.sample_evidence import VISIBLE


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
        """(axes,) difference between the highest and the lowest value."""
        return np.asarray(np.ptp(self.values, axis=1))


def covariance_of(process: BiasProcess, axis: int, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, n) covariance of the readings, and the part of it due to walk and drift."""
    r = process.readings
    W, D, _, _ = unit_kernels(r)
    s, w, d = (process.axis_factor[axis] * sigma) ** 2
    slow = w * W + d * D
    V = slow + s * (r.pose[:, None] == r.pose[None, :]) + np.diag(process.noise_factor * r.sigma[axis] ** 2)
    return V, slow


def smooth_curve(process: BiasProcess, keep: list[int], sigma: FloatArray, time_s: FloatArray) -> DriftCurve:
    """Mean and standard error of walk plus drift at ``time_s`` (m,), relative to its mean over those times.

    Norm readings, which contain three walks along the vertical (``direction`` of three columns), give three curves.
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
            # Covariance of a value of the walk with its mean over an interval around it.
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


# Whether the biases of a static log change slowly, and whether a walk alone explains it (docs/static-logs.md, R.9).

SMOOTH = 8.75
"""1 % point of 3/8 χ²(1) + 3/8 χ²(2) + 1/8 χ²(3): one strength more where the others may be 0."""
SLOW = 0.01
"""p-value below which biases change slowly: false in 1 % of logs whose biases only scatter."""


@dataclass(frozen=True, eq=False)
class SlowChange:
    """Changes of the biases: ``sigma`` (3,) scatter, walk and drift, rms about the mean, in the readings' unit.

    ``p_value`` of any slow change beside scatter; ``drift_ratio`` twice the log-likelihood that a smooth drift gains
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
        """Whether a walk alone does not explain the change."""
        return self.drift_ratio > SMOOTH


def slow_change(readings: BiasReadings) -> SlowChange:
    """Test the biases of one log, with every column of its design included."""
    process = BiasProcess.of(readings)
    every = list(range(readings.design.shape[1]))
    top, sigma = process.maximum((SCATTER, WALK, DRIFT), every, restricted=True)
    alone, walk, drift = (
        process.maximum(free, every, restricted=True)[0] for free in ((SCATTER,), (SCATTER, WALK), (SCATTER, DRIFT))
    )
    ratio = 2.0 * (max(walk, drift) - alone)
    # Two tests, each with the tail of ½χ²(0) + ½χ²(1): one strength at the boundary of its range.
    p_value = min(1.0, float(chdtrc(1.0, ratio))) if ratio > 0.0 else 1.0
    return SlowChange(process, sigma, p_value, 2.0 * (top - walk))


LEAST_SWING_K = 0.5
"""A logged temperature that changes by less is not used."""
MIN_BIC = 10.0
"""Kass and Raftery's bound for very strong evidence, as among poses."""
FOLDS = 12
TEMPERATURE_BINS, FEWEST_BINS = 12, 3
"""Bins of temperature, and the least number passed both while heating and cooling for a difference of branches."""
ALL = (SCATTER, WALK, DRIFT)
POWERS = ("bias_per_kelvin", "bias_per_kelvin2", "bias_per_kelvin3")
"""Terms that are powers of the temperature."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One sensor's bias as a function of temperature, raw units per power of kelvin.

    ``names`` (k,) of the terms, ``value``, ``std`` (3, k); ``swing`` (3,) range of the curve, ``rest`` (n, 3)
    residuals, ``raw`` (n, 3) readings without the curve, about the mean of their orientation; ``gain`` twice the
    log-likelihood gained beside scatter, walk and drift, ``cost`` the penalty of its terms.
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


def thermal_curve(pieces: RestPieces, sensor: int) -> Curve | None:
    """The simplest significant curve of the biases, scatter, walk and drift being free beside it; ``None`` if none.

    Temperature enters to the first, second, third power, then its rate of change, then a different branch while it
    falls; each is added where ΔBIC over three axes exceeds 10.
    """
    heat, speed = pieces.temperature, pieces.temperature_rate
    if heat is None or speed is None or np.ptp(heat) < LEAST_SWING_K:
        return None
    half, fastest = float(0.5 * np.ptp(heat)), float(np.abs(speed).max())
    u = (heat - float(heat.mean())) / half
    terms = {name: (u**k, half**k) for k, name in enumerate(POWERS, start=1)}
    if fastest > 0.0:
        terms["bias_per_kelvin_per_s"] = (speed / fastest, fastest)
    if speed.min() < -BRANCH_K_S and speed.max() > BRANCH_K_S:
        terms["half_gap"] = (np.tanh(speed / BRANCH_K_S), 1.0)
    cost = 3.0 * float(np.log(len(heat) / 2.0))
    nothing = best = _likelihood(pieces, sensor, [])
    chosen: list[str] = []
    for name in terms:
        value = _likelihood(pieces, sensor, [terms[k][0] for k in (*chosen, name)])
        # A lower power may be significant only with the next one: both are tried before the lower one is dropped.
        if 2.0 * (value - best) - cost > MIN_BIC:
            chosen.append(name)
            best = value
        elif name == POWERS[0]:
            both = _likelihood(pieces, sensor, [terms[k][0] for k in POWERS[:2]])
            if 2.0 * (both - nothing) - 2.0 * cost <= MIN_BIC:
                return None
            chosen.append(name)
    n = len(heat) / 2.0
    columns, units = zip(*(terms[k] for k in chosen), strict=True)
    gained = 2.0 * (best - nothing) * max(n - len(chosen) - pieces.n_poses, 1.0) / n
    return _curve(pieces, sensor, chosen, columns, np.array(units), gained, cost * len(chosen))


def _process(pieces: RestPieces, sensor: int, axis: int, columns: Sequence[FloatArray]) -> BiasProcess:
    return BiasProcess.of(pieces.readings(sensor, [axis], columns))


def _likelihood(pieces: RestPieces, sensor: int, columns: Sequence[FloatArray]) -> float:
    every = list(range(pieces.n_poses + len(columns)))
    return sum(_process(pieces, sensor, axis, columns).maximum(ALL, every, restricted=False)[0] for axis in range(3))


def _curve(
    pieces: RestPieces, sensor: int, names: list[str], columns: Sequence[FloatArray], unit: FloatArray, gain: float,
    cost: float,
) -> Curve | None:  # fmt: skip
    assert pieces.temperature is not None
    assert pieces.temperature_rate is not None
    k = pieces.n_poses
    values = pieces.means[sensor]
    X = np.column_stack(columns)
    theta, std, fitted, swing = [], [], [], []
    grid = np.linspace(-1.0, 1.0, 101)
    powers = np.column_stack([grid ** (1 + j) for j in range(len([n for n in names if n in POWERS]))])
    for axis in range(3):
        mean, covariance = _process(pieces, sensor, axis, columns).mixture(list(range(k + len(names))))
        own = mean[0, k:]
        theta.append(own / unit)
        std.append(np.sqrt(np.maximum(np.diag(covariance[0])[k:], 0.0)) / unit)
        fitted.append(X @ own)
        swing.append(float(np.ptp(powers @ own[: powers.shape[1]])))
    raw = pieces.about_poses(values)
    rest = pieces.about_poses(raw - np.array(fitted).T)
    before, after = _held_out(pieces, values, X)
    if not after < VISIBLE * before:
        return None
    heat = pieces.temperature
    return Curve(
        tuple(names), np.array(theta), np.array(std), (float(heat.min()), float(heat.max())),
        np.array(swing), raw, rest, before, after, gain, cost, float(chdtrc(3.0 * len(names), max(gain, 0.0))),
    )  # fmt: skip


def _held_out(pieces: RestPieces, values: FloatArray, X: FloatArray) -> tuple[float, float]:
    """Held-out rms of blocks of neighbouring pieces, by a plain fit of biases, then of biases and curve."""
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
    """(3,) mean difference of the residuals between heating and cooling at one temperature, and its standard error.

    ``rest`` (n, 3); the error is that of a mean over temperature bins. ``None`` where too few bins were passed both
    ways. Hysteresis and drift in time both cause it.
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
