"""Biases of one or two orientations against a logged temperature, and in time (docs/static-logs.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.effects.thermal import BRANCH_K_S
from trihedron.diagnose.sample_evidence import VISIBLE
from trihedron.diagnose.static_log.pieces import StaticPieces
from trihedron.diagnose.static_log.process import DRIFT, SCATTER, STRENGTHS, WALK, BiasProcess, BiasReadings, maximum
from trihedron.session.drift import LEAST_SWING_K

SLOW = 0.01
"""p-value below which biases change slowly: false in 1 % of logs whose biases only scatter."""
AT_BOUNDARY = (0.375, 0.375, 0.125)
"""Weights of χ² with 1, 2, 3 degrees of freedom: one strength more where all three may be 0."""


@dataclass(frozen=True, eq=False)
class SlowChange:
    """Changes of the biases: ``strengths`` (4,) as the process has them.

    ``p_value`` of any slow change beside scatter, ``smooth_p`` of a smooth drift beside scatter and walk.
    """

    processes: tuple[BiasProcess, ...]
    strengths: FloatArray
    p_value: float
    smooth_p: float

    @property
    def is_slow(self) -> bool:
        return self.p_value < SLOW

    @property
    def is_smooth(self) -> bool:
        """Whether a walk alone does not explain the change."""
        return self.smooth_p < SLOW

    def curve(self, keep: Sequence[int], time_s: FloatArray) -> DriftCurve:
        """Walk plus drift of every axis at ``time_s`` (m,), with the columns ``keep`` in the mean."""
        paths = [one.slow_path(keep, self.strengths, time_s) for one in self.processes]
        values, sigma = (np.array(one) for one in zip(*paths, strict=True))
        return DriftCurve(time_s, values, sigma)


@dataclass(frozen=True, eq=False)
class DriftCurve:
    """``values``, ``sigma`` (axes, m) at ``time_s`` (m,): walk plus drift about its mean over the session."""

    time_s: FloatArray
    values: FloatArray
    sigma: FloatArray

    @property
    def rms(self) -> FloatArray:
        """(axes,) rms about the mean."""
        return np.asarray(self.values.std(axis=1))

    @property
    def range(self) -> FloatArray:
        """(axes,) difference between the highest and the lowest value."""
        return np.asarray(np.ptp(self.values, axis=1))


def slow_change(readings: BiasReadings) -> SlowChange:
    """Test the biases of one log, with every column of its design included."""
    processes = tuple(BiasProcess(readings, axis) for axis in range(len(readings.values)))
    every = range(readings.design.shape[1])
    top, strengths = maximum(processes, STRENGTHS, every, restricted=True)
    alone, walk, drift = (
        maximum(processes, free, every, restricted=True)[0] for free in ((SCATTER,), (SCATTER, WALK), (SCATTER, DRIFT))
    )
    ratio = max(2.0 * (max(walk, drift) - alone), 0.0)
    smooth = max(2.0 * (top - walk), 0.0)
    return SlowChange(
        processes,
        strengths,
        # Two tests, each with the tail of ½χ²(0) + ½χ²(1): one strength at the boundary of its range.
        float(chdtrc(1.0, ratio)),
        sum(share * float(chdtrc(k, smooth)) for k, share in enumerate(AT_BOUNDARY, start=1)),
    )


MIN_BIC = 10.0
"""Kass and Raftery's bound for very strong evidence, as among poses."""
FOLDS = TEMPERATURE_BINS = 12
"""Blocks of time held out in turn, and bins of temperature: the shortest log has two pieces in each."""
FEWEST_BINS = 3
"""Bins passed both while heating and cooling that give a difference of branches its scatter."""
POWERS = ("bias_per_kelvin", "bias_per_kelvin2", "bias_per_kelvin3")
"""Terms that are powers of the temperature."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One sensor's bias as a function of temperature, raw units per power of kelvin.

    ``names`` (k,) of the terms, ``value``, ``std`` (3, k); ``swing`` (3,) range of the curve, ``rest`` (n, 3)
    residuals, ``held_out`` (n, 3) those of blocks that the fit had not seen; ``score`` twice the log-likelihood gained
    beside scatter, walk and drift, less the penalty of its terms.
    """

    names: tuple[str, ...]
    value: FloatArray
    std: FloatArray
    swing: FloatArray
    rest: FloatArray
    held_out: FloatArray
    score: float
    p_value: float


def thermal_curve(pieces: StaticPieces, sensor: int) -> Curve | None:
    """The most likely curve of the biases, scatter, walk and drift being free beside it; ``None`` if none is.

    Temperature enters to the first, second or third power, with or without its rate of change and another branch while
    it falls; every term has to raise ΔBIC over three axes by 10.
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
    every, n, k = list(terms), len(heat) / 2.0, pieces.n_poses
    readings = pieces.readings(sensor, [column for column, _ in terms.values()])
    processes = [BiasProcess(readings, axis) for axis in range(3)]

    def likelihood(chosen: Sequence[str]) -> float:
        keep = [*range(k), *(k + every.index(name) for name in chosen)]
        return sum(maximum([one], STRENGTHS, keep, restricted=False)[0] for one in processes)

    cost, nothing = 3.0 * float(np.log(n)), likelihood(())
    gains = {chosen: 2.0 * (likelihood(chosen) - nothing) for chosen in _choices(every)}
    chosen = max(gains, key=lambda one: gains[one] - (cost + MIN_BIC) * len(one))
    if gains[chosen] <= (cost + MIN_BIC) * len(chosen):
        return None
    gained = gains[chosen] * max(n - len(chosen) - k, 1.0) / n
    fits = [one.estimates([*range(k), *(k + every.index(name) for name in chosen)]) for one in processes]
    theta = np.array([mean[k:] for mean, _ in fits])
    std = np.array([np.sqrt(np.diag(covariance)[k:]) for _, covariance in fits])
    X, unit = np.stack([terms[name][0] for name in chosen], axis=1), np.array([terms[name][1] for name in chosen])
    raw = pieces.about_poses(pieces.means[sensor])
    held_out = _held_out(raw, pieces.about_poses(X))
    if not np.mean(held_out**2) < VISIBLE**2 * np.mean(raw**2):
        return None
    grid, order = np.linspace(-1.0, 1.0, 101), sum(name in POWERS for name in chosen)
    swing = np.ptp(np.stack([grid ** (1 + j) for j in range(order)], axis=1) @ theta[:, :order].T, axis=0)
    return Curve(
        chosen, theta / unit, std / unit, swing, raw - pieces.about_poses(X @ theta.T), held_out,
        gained - cost * len(chosen), float(chdtrc(3.0 * len(chosen), max(gained, 0.0))),
    )  # fmt: skip


def _choices(every: Sequence[str]) -> list[tuple[str, ...]]:
    """Every order of the temperature, with every choice of the other terms."""
    beside = [name for name in every if name not in POWERS]
    more = [one for n in range(len(beside) + 1) for one in combinations(beside, n)]
    return [(*POWERS[:order], *one) for order in range(1, len(POWERS) + 1) for one in more]


def _held_out(values: FloatArray, X: FloatArray) -> FloatArray:
    """Values (n, 3) about their orientations less those predicted by a plain fit of X to the other blocks."""
    fold = np.arange(len(values)) * FOLDS // len(values)
    missed = values.copy()
    for f in range(FOLDS):
        out = fold == f
        missed[out] -= X[out] @ np.linalg.lstsq(X[~out], values[~out], rcond=None)[0]
    return missed


def branch_gap(pieces: StaticPieces, rest: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """(3,) mean difference of the residuals between heating and cooling at one temperature, and its standard error.

    ``rest`` (n, 3); the error is that of a mean over temperature bins. ``None`` where too few bins were passed both
    ways. Hysteresis and drift in time both cause it.
    """
    heat, speed = pieces.temperature, pieces.temperature_rate
    assert heat is not None
    assert speed is not None
    place = np.digitize(heat, np.linspace(heat.min(), heat.max(), TEMPERATURE_BINS + 1)[1:-1])
    gaps = []
    for k in range(TEMPERATURE_BINS):
        up, down = (place == k) & (speed > BRANCH_K_S), (place == k) & (speed < -BRANCH_K_S)
        if up.sum() >= 2 and down.sum() >= 2:
            gaps.append(rest[up].mean(axis=0) - rest[down].mean(axis=0))
    if len(gaps) < FEWEST_BINS:
        return None
    return np.mean(gaps, axis=0), np.std(gaps, axis=0, ddof=1) / np.sqrt(len(gaps))
