"""A log with one or two orientations as poses: pieces of equal length in which nothing moves (docs/static-logs.md)."""

from typing import Any

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.records import Pose, Recording, Segments
from trihedron.records.segments import LEAST_SHARE, SAME_POSE_RAD
from trihedron.session.rounding import UNIFORM
from trihedron.transforms import directions_of

N_PIECES, FEWEST_PIECES = 80, 24
"""Pieces of a log, enough for both branches of a temperature cycle; and below which no curve is determined."""
FEWEST_SAMPLES = 16
"""Samples of a piece from which the standard error of its mean is known."""
QUIET_QUANTILE, LOUD = 0.2, 4.0
"""Variance of first differences over that of the quietest fifth, above which a piece is moving: the noise of a part
changes by a factor of two over a hundred kelvin."""
TURNS_RAD = 0.02
"""Angle between the halves of a moving piece, at least: a bias that drifts by 0.1 g in a log causes a tenth of it."""
MOSTLY_STILL = 0.6
"""Share of a log that must be static: in one that moves, slow motion would count as static."""


def static_pieces(recording: Recording) -> tuple[Segments, IntArray] | None:
    """The static pieces of a log without rare orientations, whatever its segmentation makes of a bias that drifts, and
    the orientation (n,) of each, the most frequent first; ``None`` where too little of the log is static."""
    assert recording.accelerometer is not None
    length = max(recording.n_samples // N_PIECES, FEWEST_SAMPLES)
    n, half = recording.n_samples // length, length // 2
    names = ("accelerometer",) if recording.gyroscope is None else ("accelerometer", "gyroscope")
    pieces = {name: getattr(recording, name)[: n * length].reshape(n, length, 3) for name in names}
    variance, is_calm = {}, np.ones(n, dtype=bool)
    for name, readings in pieces.items():
        own = np.nanvar(np.diff(readings, axis=1), axis=1) / 2.0
        # A log that repeats one code is not free of noise: it has at least that of rounding.
        rounding = UNIFORM * recording.facts.of(name).step ** 2
        is_quiet = (own <= LOUD * np.maximum(np.nanquantile(own, QUIET_QUANTILE, axis=0), rounding)).all(axis=1)
        if not is_quiet.any():
            return None
        variance[name] = np.maximum(np.nanmedian(own[is_quiet], axis=0), rounding)
        is_calm &= is_quiet
    force = pieces["accelerometer"]
    early, late = (directions_of(np.nanmean(force[:, k : k + half], axis=1)) for k in (0, half))
    is_calm &= np.linalg.norm(late - early, axis=1) < TURNS_RAD
    if is_calm.sum() < max(FEWEST_PIECES, MOSTLY_STILL * n):
        return None
    orientation = np.full(n, -1)
    orientation[is_calm] = _orientations(directions_of(early + late)[is_calm])
    kept = np.flatnonzero(orientation >= 0)
    if len(kept) < FEWEST_PIECES:
        return None
    of: dict[str, Any] = {f"gyroscope_{figure}": None for figure in ("mean", "sigma", "sigma_mean")}
    for name, readings in pieces.items():
        sigma = np.sqrt(variance[name])
        error = np.tile(sigma / np.sqrt(length), (len(kept), 1))
        of |= {f"{name}_mean": np.nanmean(readings[kept], axis=1), f"{name}_sigma": sigma, f"{name}_sigma_mean": error}
    t, first = recording.time_s, kept * length
    segments = Segments(
        poses=tuple(Pose(k, a, a + length, a, a + length) for k, a in enumerate(first.tolist())), moves=(),
        n_averaged=np.full(len(kept), length), time_mid_s=0.5 * (t[first] + t[first + length - 1]),
        duration_s=np.full(len(kept), length / recording.rate_hz), **of,
    )  # fmt: skip
    return segments, orientation[kept]


def _orientations(up: FloatArray) -> IntArray:
    """(n,) number of the orientation of every piece, the most frequent first; -1 for handling."""
    out = np.full(len(up), -1, dtype=np.int64)
    for number in range(len(up)):
        free = np.flatnonzero(out < 0)
        near = up[free] @ up[free].T > np.cos(SAME_POSE_RAD)
        if not len(free) or near.sum(axis=1).max() < max(LEAST_SHARE * len(up), 2.0):
            break
        # A drifting bias widens an orientation: it is selected about the mean of the largest group.
        centre = directions_of(up[free[near[near.sum(axis=1).argmax()]]].mean(axis=0)[None])[0]
        out[free[up[free] @ centre > np.cos(SAME_POSE_RAD)]] = number
    return out
