"""Sensor noise with exact discrete statistics: Q, N, B, K, R per axis, each from its own random stream."""

import zlib
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
from trihedron.errors import InputError
from trihedron.simulate.motion.plan import Label
from trihedron.simulate.readout import NONE, Triple


@dataclass(frozen=True)
class NoiseTerms:
    """Coefficients of the five noise terms per axis, SI, each defined by its Allan variance.

    With u the unit of the signal (rad/s or m/s²): ``Q`` quantisation [u·s], 3Q²/τ²; ``N`` white [u·√s = u/√Hz], N²/τ;
    ``B`` bias instability [u], (2 ln 2/π) B²; ``K`` rate random walk [u/√s], K²τ/3; ``R`` ramp [u/s], R²τ²/2.
    """

    Q: Triple = NONE
    N: Triple = NONE
    B: Triple = NONE
    K: Triple = NONE
    R: Triple = NONE

    def __post_init__(self) -> None:
        for name in "QNBKR":
            values = getattr(self, name)
            if any(not np.isfinite(v) or (v < 0.0 and name != "R") for v in values):
                raise InputError(f"noise term {name} must hold three numbers that are not negative, got {values}")


def _sequence(seed: int, stage: str) -> np.random.SeedSequence:
    if seed < 0:
        raise InputError(f"the seed must not be negative, got {seed}")
    return np.random.SeedSequence([seed, zlib.crc32(stage.encode())])


def stream(seed: int, stage: str) -> np.random.Generator:
    """Random generator of one stage, which depends only on the seed and the stage's name."""
    return np.random.default_rng(_sequence(seed, stage))


def key(seed: int, stage: str) -> int:
    """Key of one stage's random stream in the Rust kernel."""
    return int(_sequence(seed, stage).generate_state(1, np.uint64)[0])


def make_noise(terms: NoiseTerms, n: int, dt: float, seed: int, sensor: str) -> FloatArray:
    """(n, 3) noise at step ``dt`` [s], unit of the signal.

    Per step: Q/dt times the first difference of white noise; white noise N/√dt; B as a sum of Gauss-Markov processes
    with spectrum 1/f; a random walk from 0 with increments K√dt; R as a ramp.
    """
    table = [[terms.Q[k], terms.N[k], terms.B[k], terms.K[k], terms.R[k]] for k in range(3)]
    keys = [[key(seed, f"{sensor}/{name}/{k}") for name in "QNBK"] for k in range(3)]
    return _core.simulate_noise(n, dt, table, keys)


# Bias repeatability: the bias differs from pose to pose, for example because the mounting is stressed.
RESTS = frozenset({"pose", "disturbance", "vibration"})
"""Kinds of steps that keep the attitude: a disturbed pose remains the same pose."""


def bias_of_poses(labels: tuple[Label, ...], time_s: FloatArray, sigma: Triple, rng: np.random.Generator) -> FloatArray:
    """(n, 3) biases at ``time_s`` (n,): N(0, ``sigma``²) drawn once per pose, ``sigma`` (3,), linear during moves.

    Consecutive static steps are one pose. Unit: that of ``sigma``.
    """
    stretches = _stretches(labels)
    if not stretches:
        return np.zeros((len(time_s), 3))
    draws = np.repeat(rng.standard_normal((len(stretches), 3)) * np.asarray(sigma), 2, axis=0)
    knots = np.array(stretches).ravel()
    return np.column_stack([np.interp(time_s, knots, draws[:, k]) for k in range(3)])


def bias_in_moves(labels: tuple[Label, ...], time_s: FloatArray, sigma: Triple, rng: np.random.Generator) -> FloatArray:
    """(n, 3) departure of the bias, during moves only, from the straight line between its poses (eq. 11.8b).

    N(0, ``sigma``²) at the first and at the last instant of a move, independently, linear between; 0 in poses.
    """
    out = np.zeros((len(time_s), 3))
    for (_, start_s), (stop_s, _) in pairwise(_stretches(labels)):
        ends = rng.standard_normal((2, 3)) * np.asarray(sigma)
        first, last = np.searchsorted(time_s, [start_s, stop_s])
        part = ((time_s[first:last] - start_s) / max(stop_s - start_s, TINY))[:, None]
        out[first:last] = (1.0 - part) * ends[0] + part * ends[1]
    return out


def _stretches(labels: tuple[Label, ...]) -> list[list[float]]:
    """Start and stop of every pose [s]."""
    stretches: list[list[float]] = []
    moved = True
    for label in labels:
        if label.kind not in RESTS:
            moved = True
        elif moved:
            stretches.append([label.start_s, label.stop_s])
            moved = False
        else:
            stretches[-1][1] = label.stop_s
    return stretches
