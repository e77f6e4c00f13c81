"""A long log cut into static pieces, independent of its segmentation, for biases that drift (docs/static-logs.md)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.diagnose.context import TEMPERATURE_WINDOW_S, smoothed_slope
from trihedron.diagnose.static_log.process import BiasReadings
from trihedron.records import Recording
from trihedron.records.channel_facts import ChannelFacts
from trihedron.session.drift import LEAST_SHARE, SAME_POSE_RAD

N_PIECES = 80
"""Pieces of a log: enough for a curve of third order on both branches of a temperature cycle, and fast."""
FEWEST_PIECES = 24
"""Two for each bin of temperature and each block that is held out (:mod:`heat`)."""
FEWEST_SAMPLES = 8
"""Samples of half a piece from which the standard error of its mean is known."""
QUIET_QUANTILE, LOUD = 0.2, 4.0
"""Variance of first differences over that of the quietest fifth, above which a piece is moving: the noise of a part
changes by a factor of two over a hundred kelvin."""
TURNS_RAD = 0.02
"""Angle between the halves of a moving piece, at least: a bias that drifts by 0.1 g in a log causes a tenth of it."""
MOSTLY_STILL = 0.6
"""Share of a log that must be static: in one that moves, slow motion would count as static."""
FEWEST_OF_POSE = 4
"""Number of pieces below which an orientation is handling."""


@dataclass(frozen=True, eq=False)
class StaticPieces:
    """Means over the halves of static pieces of a log, raw units: n = 2 per piece, in the order of time.

    ``pose`` (n,) number of the orientation, ``piece`` (n,) of the piece, ``spans`` their sample ranges; ``means``
    (n, 3) and white noise ``sigma`` (3,) of one sample for the accelerometer and, where logged, the gyro; ``count``
    (n,) samples of every mean; ``temperature`` (n,) °C and ``temperature_rate`` (n,) K/s, where logged.
    """

    time_s: FloatArray
    length_s: FloatArray
    count: IntArray
    pose: IntArray
    piece: IntArray
    spans: tuple[tuple[int, int], ...]
    means: tuple[FloatArray, ...]
    sigma: tuple[FloatArray, ...]
    temperature: FloatArray | None
    temperature_rate: FloatArray | None

    @property
    def n_poses(self) -> int:
        """Number of orientations."""
        return int(self.pose.max()) + 1

    def about_poses(self, values: FloatArray) -> FloatArray:
        """Values (n, k) minus their mean over each orientation."""
        level = np.array([values[self.pose == p].mean(axis=0) for p in range(self.n_poses)])
        return np.asarray(values - level[self.pose])

    def readings(self, sensor: int, columns: Sequence[FloatArray] = ()) -> BiasReadings:
        """Readings of a sensor for the bias process: columns of a bias per orientation, then ``columns`` (n,) each."""
        levels = [np.ones(len(self.time_s))]
        levels += [(self.pose == k).astype(np.float64) for k in range(1, self.n_poses)]
        return BiasReadings(
            np.ascontiguousarray(self.means[sensor].T), self.sigma[sensor][:, None] / np.sqrt(self.count),
            self.time_s, self.length_s, self.piece, np.column_stack([*levels, *columns]),
        )  # fmt: skip


def static_pieces(recording: Recording) -> StaticPieces | None:
    """The static pieces of a log without rare orientations; ``None`` where too little of the log is static."""
    assert recording.accelerometer is not None
    n = recording.n_samples
    half = max(n // (2 * N_PIECES), FEWEST_SAMPLES)
    starts = np.arange(0, n - 2 * half + 1, 2 * half)
    if len(starts) < FEWEST_PIECES:
        return None
    sides = [recording.accelerometer] + ([] if recording.gyroscope is None else [recording.gyroscope])
    facts = [known for known in (recording.facts.accelerometer, recording.facts.gyroscope) if known is not None]
    loud = np.zeros(len(starts), dtype=bool)
    noise = []
    for values, known in zip(sides, facts, strict=True):
        rough = np.array([np.nanvar(np.diff(values[a : a + 2 * half], axis=0), axis=0) / 2.0 for a in starts])
        step = _at_least(np.zeros(3), known) ** 2
        quiet = np.maximum(np.nanquantile(rough, QUIET_QUANTILE, axis=0), step)
        loud |= ~(rough <= LOUD * quiet).all(axis=1)
        noise.append(np.sqrt(np.maximum(np.nanmedian(rough[~loud], axis=0), quiet) if (~loud).any() else quiet))
    means = [np.array([[np.nanmean(v[a + k * half : a + (k + 1) * half], axis=0) for k in (0, 1)] for a in starts])
             for v in sides]  # fmt: skip
    up = means[0] / np.linalg.norm(means[0], axis=2, keepdims=True)
    calm = ~loud & (np.linalg.norm(up[:, 1] - up[:, 0], axis=1) < TURNS_RAD)
    still, means = starts[calm], [m[calm] for m in means]
    if len(still) < max(FEWEST_PIECES, MOSTLY_STILL * len(starts)):
        return None
    pose = _orientations(means[0].mean(axis=1))
    keep = pose >= 0
    if keep.sum() < FEWEST_PIECES:
        return None
    still, pose = still[keep], pose[keep]
    means = [m[keep].reshape(-1, 3) for m in means]
    t = recording.time_s
    middles = np.array([[t[a + k * half] + t[min(a + (k + 1) * half, n) - 1] for k in (0, 1)] for a in still]) / 2.0
    heat = _logged(recording, still, half)
    count = np.full(2 * len(still), half, dtype=np.int64)
    return StaticPieces(
        middles.ravel(), count / recording.rate_hz, count, np.repeat(pose, 2),
        np.repeat(np.arange(len(still)), 2), tuple((int(a), int(a) + 2 * half) for a in still), tuple(means),
        tuple(_at_least(own, known) for own, known in zip(noise, facts, strict=True)), *heat,
    )  # fmt: skip


def _at_least(sigma: FloatArray, facts: ChannelFacts) -> FloatArray:
    """Noise of a sensor, at least that of rounding: a log that repeats one code is not free of noise."""
    return np.asarray(np.maximum(sigma, facts.step / np.sqrt(12.0)))


def _logged(recording: Recording, starts: IntArray, half: int) -> tuple[FloatArray, FloatArray] | tuple[None, None]:
    """(n,) temperature of every half piece, and its rate of change."""
    logged = recording.temperature_degc
    if logged is None or not np.isfinite(logged).any():
        return None, None
    t = recording.time_s
    good = np.isfinite(logged)
    filled = np.interp(t, t[good], logged[good])
    # Smoothed over a piece: steps of a tenth of a kelvin are removed, heating and cooling remain.
    width = max(TEMPERATURE_WINDOW_S * recording.rate_hz, float(half))
    speed = smoothed_slope(filled, t, width)
    spans = [(a + k * half, a + (k + 1) * half) for a in starts for k in (0, 1)]
    return np.array([filled[a:b].mean() for a, b in spans]), np.array([speed[a:b].mean() for a, b in spans])


def _orientations(force: FloatArray) -> IntArray:
    """(n,) number of the orientation of every piece, the most frequent first; -1 for handling."""
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    out = np.full(len(up), -1, dtype=np.int64)
    found = 0
    while (out < 0).any():
        free = np.flatnonzero(out < 0)
        near = up[free] @ up[free].T > np.cos(SAME_POSE_RAD)
        # A drifting bias widens an orientation: it is selected about the mean of the largest group.
        centre = up[free[near[near.sum(axis=1).argmax()]]].mean(axis=0)
        members = free[up[free] @ (centre / np.linalg.norm(centre)) > np.cos(SAME_POSE_RAD)]
        if len(members) < max(LEAST_SHARE * len(up), FEWEST_OF_POSE):
            break
        out[members] = found
        found += 1
    return out
