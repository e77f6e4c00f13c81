"""Noise of a session, measured once: `calibrate` and `diagnose` use the same weights (docs/model-session.md)."""

import math
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray, IntArray, rms_of
from trihedron.errors import InputError
from trihedron.probability import CLEAR, MEDIAN_CHI2, ndtri
from trihedron.quantiles import medians, quantiles
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.session.averaging import unresolved_variance
from trihedron.session.rounding import rounding_of_moves

LEAST_SHARE = 1e-9
"""Least error of a pose mean over the largest reading, for logs without scatter (a simulation without noise)."""
Along = tuple[FloatArray, FloatArray]
"""Directions (h, 3) and the standard errors (h,) of pose means along them."""
Pair = tuple[float, float]
Strengths = tuple[Pair, tuple[float, float, float, float], Pair, Pair]
"""Corner times of walks [s], scatter from pose to pose in its units (accelerometer, gyro by axis), departure in moves
in units of the scatter, factors on the noise of moves. Pairs: accelerometer and gyro; of moves gravity and velocity."""
NO_SCATTER = 1e-3
"""Scatter that counts as zero."""
Bounds = tuple[Pair, Pair, Pair]
"""Shortest corner times [s], largest scatter, largest factors on the noise of moves: each for the pairs above."""
ANYTHING: Bounds = ((0.0, 0.0), (np.inf, np.inf), (np.inf, np.inf))
NOISE_CORNER_S = 20.0
"""Shortest corner time that the part's noise explains, where white noise and bias walk have equal Allan deviation: in
consumer parts it is this or later. Every hypothesis allows a walk of any strength; a stronger one is called drift."""


def strengths_of_all(
    corner_s: float, scatter: float = NO_SCATTER, between: float = 1.0, moves: float = 1.0
) -> Strengths:
    """The same strengths of both sensors, all axes, gravity and velocity."""
    return (corner_s, corner_s), (scatter,) * 4, (between, between), (moves, moves)


START_STRENGTHS = strengths_of_all(8.0 * NOISE_CORNER_S)
"""Start of the search for strengths."""
NOISE_DOF = 100.0
"""Degrees of freedom of the predicted noise, which is measured in the recording to about 7 %."""
DRIFT_DOF = 10.0
"""The same for biases: their variance between sessions is estimated from one or two sessions and scatters by 70 %
(28 simulated sessions of 20 to 32 poses), as a variance with 4 degrees of freedom per session does."""
PART_NOISE: Bounds = ((NOISE_CORNER_S, NOISE_CORNER_S), (NO_SCATTER, NO_SCATTER), (1.0, 1.0))
"""Bounds of a part whose noise is that of its samples."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SessionNoise:
    """Noise of one session in raw units.

    Standard errors of pose means ``pose_force_sigma``, ``pose_rate_sigma`` (h, 3), white noise ``force_density``,
    ``rate_density`` (3,) per √Hz. ``force_up`` are the verticals (h, 3) and the standard errors (h,) of the means along
    them, NaN where those of the axes apply; ``None`` where no vertical is known. ``force_scatter``, ``rate_scatter``:
    scatter of the bias from pose to pose that 1/f noise explains, 0 where poses show none.
    """

    pose_force_sigma: FloatArray
    force_density: FloatArray
    pose_rate_sigma: FloatArray | None
    rate_density: FloatArray | None
    force_up: Along | None = None
    force_scatter: float = 0.0
    rate_scatter: float = 0.0

    def scatter_unit(self) -> FloatArray:
        """(2, 3) scatter of strength one, raw: the usual standard error of a pose, accelerometer and gyro.

        One size for three axes: an axis with more noise need not scatter more. The accelerometer's is that along the
        vertical where it is known, because static poses show no other scatter.
        """
        out = np.ones((2, 3))
        out[0] = rms_of(medians(self.pose_force_sigma))
        if self.force_up is not None and np.isfinite(self.force_up[1]).any():
            out[0] = np.nanmedian(self.force_up[1])
        if self.pose_rate_sigma is not None:
            out[1] = rms_of(medians(self.pose_rate_sigma))
        return np.maximum(out, TINY)


def measure_noise(
    recording: Recording, segments: Segments, ranges: list[tuple[int, int]]
) -> tuple[SessionNoise, FloatArray]:
    """Noise of poses, and variance (m, 4, 3) of the integrals of every move, (raw unit · s)², in the half-open sample
    ``ranges`` of the moves: of force and rate by motion faster than the samples, then by rounding and slow noise.

    Refused when the segments state no uncertainty of their means.
    """
    if (
        recording.accelerometer is None
        or segments.accelerometer_sigma is None
        or segments.accelerometer_sigma_mean is None
        or segments.accelerometer_mean is None
    ):
        raise InputError("the segments state no uncertainty of their pose means")
    step_s = 1.0 / recording.rate_hz
    floor = LEAST_SHARE * max(float(np.abs(segments.accelerometer_mean).max()), TINY)
    sigmas = [np.maximum(segments.accelerometer_sigma_mean, floor)]
    densities = [np.asarray(segments.accelerometer_sigma) * np.sqrt(step_s)]
    spans = segments.spans
    of_rate = 0.0
    if recording.gyroscope is not None and segments.gyroscope_sigma is not None:
        sigmas.append(np.maximum(np.asarray(segments.gyroscope_sigma_mean), TINY))
        densities.append(np.asarray(segments.gyroscope_sigma) * np.sqrt(step_s))
        of_rate = expected_scatter(recording.gyroscope, spans)
    moves_last = np.array([recording.time_s[b - 1] - recording.time_s[a] for a, b in ranges])
    variances = np.zeros((len(ranges), 4, 3))
    for k, readings in enumerate((recording.accelerometer, recording.gyroscope)):
        if readings is None or not ranges:
            continue
        quantum = recording.facts.of(("accelerometer", "gyroscope")[k]).step
        variances[:, k] = unresolved_variance(readings, ranges, spans, step_s, quantum, recording.time_s)
        if k == 0:
            # For a gyro rounding is estimated with the angles of moves and the place of its bias.
            variances[:, 2] += rounding_of_moves(readings, ranges, quantum, segments.accelerometer_sigma) * step_s**2
        if k < len(sigmas):
            halves, lasts = half_changes(readings, spans), np.diff(spans, axis=1)[:, 0] * step_s
            variances[:, 2 + k] += coloured_variance(sigmas[k], halves, densities[k], lasts, moves_last)
    up, error = segments.accelerometer_up, segments.accelerometer_sigma_up
    along = None if up is None or error is None else (np.ascontiguousarray(up), np.maximum(error, floor))
    scatter = 0.0 if along is None else expected_scatter(recording.accelerometer, spans, along[0])
    rate_sigma, rate_density = (sigmas[1], densities[1]) if len(sigmas) > 1 else (None, None)
    noise = SessionNoise(
        pose_force_sigma=sigmas[0], force_density=densities[0], pose_rate_sigma=rate_sigma, rate_density=rate_density,
        force_up=along, force_scatter=scatter, rate_scatter=of_rate,
    )  # fmt: skip
    return noise, variances


def along_gradient(sigma: FloatArray, along: Along | None, gradient: FloatArray) -> FloatArray:
    """(h,) standard errors of a quantity with gradient ``gradient`` (h, 3) by the means, as in the session model.

    Across the vertical from the errors of the axes (h, 3), along it from the vertical's own where it is known.
    """
    plain = (gradient**2 * sigma**2).sum(axis=1)
    if along is None:
        return np.asarray(np.sqrt(plain))
    up, error = along
    share = (gradient * up).sum(axis=1)
    across = gradient - share[:, None] * up
    known = np.isfinite(error)
    own = share**2 * np.where(known, error, 0.0) ** 2
    return np.asarray(np.sqrt(np.where(known, (across**2 * sigma**2).sum(axis=1) + own, plain)))


# Slow noise of the sensors inside moves, estimated from the poses (eq. 8.2b).

QUIET = 0.3
"""Quantile over the poses of the change between halves: slow noise is in all poses alike, a bias that jumps only in
some."""
QUARTERS, FEWEST_OF_QUARTER = 4, 3
"""Parts of a pose whose bend shows its slow noise, and the readings that each has at least."""
MAY_EXCEED = 2.5
"""Largest ratio of the colour of all poses to that of the quiet ones, whose quantile is good to a factor of two."""


def coloured_variance(
    pose_sigma: FloatArray,
    halves: FloatArray,
    density: FloatArray,
    pose_duration_s: FloatArray,
    move_duration_s: FloatArray,
) -> FloatArray:
    """(moves, 3) variance, (raw unit · s)², that slow noise adds to every move's integral, beyond that of white noise.

    The integral of white noise over T has the variance N²T. Pose means show flicker and walk: where a mean over τ has
    c² times the white variance, c²N² replaces N² as long as T is of the order of τ. Without it most healthy sessions of
    parts with flicker (0.2 mg, 20 °/h) disagree (benches/blind_nuisances.py --flicker).

    ``pose_sigma`` (poses, 3) are standard errors of pose means, estimated without assuming white noise, ``halves``
    (poses, 3) the mean of every pose's second half minus that of its first, ``density`` (3,) white noise per √Hz; raw.
    """
    white = density / np.sqrt(pose_duration_s)[:, None]
    quiet = _quiet(halves, white) ** 2
    pooled = medians((pose_sigma / white) ** 2)
    colour = np.maximum(np.minimum(pooled, MAY_EXCEED * quiet), 1.0)
    return np.outer(move_duration_s, (colour - 1.0) * density**2)


def _quiet(halves: FloatArray, white: FloatArray) -> FloatArray:
    """(3,) ratio of slow to white noise in the quiet poses, from changes ``halves`` (poses, 3) between the halves of
    a pose and the standard errors ``white`` (poses, 3) of its mean."""
    return np.asarray(quantiles(np.abs(halves / white), [QUIET])[0] / (2.0 * ndtri(0.5 + 0.5 * QUIET)))


def quiet_errors(readings: FloatArray, spans: IntArray, white: FloatArray) -> FloatArray:
    """(poses, 3) standard errors of the means over ``spans`` (poses, 2): those by white noise alone, ``white``, with
    the slow noise that the quiet poses have: a motion is larger in some. At least that of all axes together: a quantile
    of few poses is uncertain, and noise below a filter's corner exceeds that of the samples on all axes alike.

    Quarters show it by their bend, which has the error of a change between halves: where every support yields no pose
    is quiet, but a motion that decays is mostly a slope.
    """
    long = spans[:, 1] - spans[:, 0] >= FEWEST_OF_QUARTER * QUARTERS
    if not long.any():
        return white
    steps, white_long = _steps(readings, spans[long], np.eye(3)[None], QUARTERS), white[long]
    bends = 0.5 * (steps[:, 2] - steps[:, 0])
    of_all = _quiet(bends.reshape(-1, 1), white_long.reshape(-1, 1))
    return white * np.maximum(np.maximum(_quiet(bends, white_long), of_all), 1.0)


# Bias scatter from pose to pose by 1/f noise, estimated from inside the poses (docs/model-session.md, 11.12d).

PARTS = 8
"""Parts of a pose: neighbouring ones differ by white noise, its halves by white noise and flicker."""
FEWEST_POSES = 6
"""Fewer poses do not separate two processes (drift, scatter, settling) on three axes."""
FEWEST_READINGS = 4 * PARTS


def expected_scatter(readings: FloatArray, spans: IntArray, up: FloatArray | None = None) -> float:
    """Standard deviation [raw] of a pose's bias about that of the session by flicker alone, along the vertical ``up``,
    or, of a gyro, whose bias shows along all axes, their rms.

    Means of neighbouring parts of length t differ by a variance 2N²/t + 4 ln 2 h for white noise N² and a flicker of
    one-sided density h/f. Below the frequencies that a pose of length T sees, down to those of a session of length L,
    lies a variance h ln(L/2T). It is 0 where white noise explains the differences of halves. ``spans`` (h, 2) are the
    half-open ranges of the poses, ``up`` (h, 3) raw unit verticals, NaN where unknown.
    """
    usable = spans[:, 1] - spans[:, 0] >= FEWEST_READINGS
    if up is not None:
        usable &= np.isfinite(up).all(axis=1)
    if np.count_nonzero(usable) < FEWEST_POSES:
        return 0.0
    spans, along = spans[usable], np.eye(3)[None] if up is None else up[usable, None, :]
    halves, parts = (_steps(readings, spans, along, n) for n in (2, PARTS))
    return rms_of(_between_poses(halves, parts, spans))


def _between_poses(halves: FloatArray, parts: FloatArray, spans: IntArray) -> FloatArray:
    """(k,) scatter along each direction from differences of halves (h, 1, k) and parts (h, PARTS - 1, k) of poses."""
    k = halves.shape[2]
    of_halves = np.array([_mean_square(halves[:, :, i].ravel()) for i in range(k)])
    # Variance of the differences of halves if the noise of the parts is white.
    white = np.array([_mean_square(parts[:, :, i].ravel()) for i in range(k)]) * (2.0 / PARTS)
    if not (white > 0.0).all():
        return np.zeros(k)  # readings are missing, or constant
    excess = float(np.mean(of_halves / white)) - 1.0
    # One standard error: it only widens uncertainties.
    if not excess > math.sqrt(2.0 / halves.size):
        return np.zeros(k)
    level = excess * white / (4.0 * math.log(2.0) * (1.0 - 2.0 / PARTS))
    octaves = float(np.ptp(spans)) / (2.0 * float(np.median(spans[:, 1] - spans[:, 0])))
    return np.sqrt(level * max(math.log(octaves), 0.0))


def half_changes(readings: FloatArray, spans: IntArray) -> FloatArray:
    """(h, 3) mean over the second half of every range ``spans`` (h, 2) less that over the first."""
    return np.asarray(_steps(readings, spans, np.eye(3)[None], 2)[:, 0])


def _steps(readings: FloatArray, spans: IntArray, along: FloatArray, n: int) -> FloatArray:
    """(h, n - 1, k) differences of the means of ``n`` neighbouring parts of every pose along directions (h, k, 3), or
    along those of one (1, k, 3) for all."""
    edges = spans[:, :1] + (spans[:, 1:] - spans[:, :1]) * np.arange(n + 1) // n
    ranges = np.stack([edges[:, :-1], edges[:, 1:]], axis=2).reshape(-1, 2)
    means, _ = _core.means_by_owner(readings, ranges, np.arange(len(ranges)), len(ranges))
    return np.diff(means.reshape(len(spans), n, 3) @ np.swapaxes(along, 1, 2), axis=1)


def _mean_square(x: FloatArray) -> float:
    squares = x**2
    # Changes far beyond are disturbances by hand, not noise.
    near = squares <= CLEAR**2 * np.median(squares) / MEDIAN_CHI2[1]
    return float(np.mean(squares[near]))


def between_sessions(away: FloatArray, noise: FloatArray, alike: FloatArray | float = 1.0) -> float:
    """Variance of the bias change between two sessions from the biases of n poses about their mean (eq. 9.3).

    ``2 C₁ + (V - C₁)/n``, V the variance of ``away`` (n,) or (n, axes) beyond the variance ``noise``, C₁ the covariance
    of neighbours, the cosine of whose verticals is ``alike``: between two sessions 1/f noise differs by twice its
    variance within one.
    """
    n = len(away)
    total = max(float((away**2).sum()) / (away.size - away.size / n) - float(np.mean(noise)), 0.0)
    weight = np.broadcast_to(alike, away[1:].shape)
    # Subtracting the mean makes neighbours anticorrelated by variance/n, which is added back.
    shared = float((away[1:] * away[:-1] * weight).sum() / max((weight**2).sum(), TINY)) + float(np.mean(away**2)) / n
    shared = min(max(shared, 0.0), total)
    return 2.0 * shared + (total - shared) / n
