"""Measurements of a recording's moves: arrays for the fit of a session, with their noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.biases import pool_biases, shrink
from trihedron.probability import chdtrc
from trihedron.quantiles import MAD_TO_SIGMA, median
from trihedron.ranges import Range, rows_beside
from trihedron.records import Move, Recording, Segments, SensorCalibration
from trihedron.session.rounding import biases_by_codes, density_without_rounding, rounding_in_moves, undithered_axes

GAP_STEPS = 5.0
"""A time step longer than this many usual ones is a gap, in which the rate is unknown."""
BESIDE = 2
"""Samples kept on either side of a move: the one that brackets it, and its neighbour."""
BLOCK_S = 0.5
"""Block length for the angle random walk: of the order of a move's duration, and long against the correlation of
samples by an anti-alias filter."""
FEWEST_BLOCKS = 8
"""Fewest blocks that measure a noise, to a quarter of itself."""


@dataclass(frozen=True, eq=False)
class MoveMeasurements:
    """Input of the fit of a session, in raw units of each sensor.

    ``reading``, ``bias`` (n, 3) are the pose means of accelerometer and gyro, ``var_reading``, ``var_bias`` (n, 3)
    their variances; ``links`` (m, 2) the poses before and after each move. ``rows`` (samples,) are the recording's rows
    in and beside moves, move after move, ``time_s`` (samples,) their times, ``edges`` (m, 2) each move's range in them;
    ``noise_density`` (3,) is the angle random walk in raw unit · √s, ``clipped_s`` (m,) the time of each move in which
    the gyro is at its range limit. ``rate``, ``force`` (samples, 3) are the readings of gyro and accelerometer;
    ``is_undithered`` (3,) are the axes whose noise does
    not dither the LSB ``quantum`` (3,), ``is_hidden`` (samples, 3) is 1 where the reading of such an axis is in the LSB
    of its bias. ``bias_read``, ``var_bias_read`` (n, 3) are the biases from each pose alone, ``var_reading_noise``
    (n, 3) the variance of the accelerometer's pose means by noise alone, ``reading_variance`` (samples, 3) that of gyro
    readings which are bridged or rounded, ``shared_errors`` (samples, 3, k) are k errors of one σ each that all moves
    share; ``latitude_deg`` is the place's, if it is known.
    """

    links: IntArray
    rows: IntArray
    time_s: FloatArray
    edges: IntArray
    durations_s: FloatArray
    reading: FloatArray
    var_reading: FloatArray
    bias: FloatArray
    var_bias: FloatArray
    noise_density: FloatArray
    sigma_time_s: float
    nominal_step_s: float
    clipped_s: FloatArray
    is_gapped: BoolArray
    rate: FloatArray
    force: FloatArray
    is_undithered: BoolArray
    bias_read: FloatArray
    var_bias_read: FloatArray
    var_reading_noise: FloatArray
    reading_variance: FloatArray
    quantum: FloatArray
    is_hidden: FloatArray
    shared_errors: FloatArray
    latitude_deg: float | None

    @property
    def is_lost(self) -> BoolArray:
        """Moves (m,) with more time at the gyro's range limit than can be bridged."""
        return self.clipped_s > LONGEST_BRIDGE_S

    @property
    def angle_variance(self) -> FloatArray:
        """(m, 3) variance of the integrated readings by those that are bridged or rounded, (raw unit · s)²."""
        of_moves = [self.reading_variance[a:b].sum(axis=0) for a, b in self.edges]
        return np.array(of_moves) * self.nominal_step_s**2

    @property
    def n_moves(self) -> int:
        """Number of moves."""
        return len(self.links)

    def without_g_sensitivity(self, by_force: FloatArray, S: FloatArray, b: FloatArray) -> MoveMeasurements:
        """The moves without what the gyro reads ``by_force`` (3, 3), raw unit per m/s², of an accelerometer S, b."""
        of_poses = (self.reading @ S.T + b) @ by_force.T
        read = self.bias_read - of_poses
        bias, var_bias = shrink(read, self.var_bias_read, pool_biases(read, self.var_bias_read)[0])
        bias = np.where(self.is_undithered, self.bias - of_poses, bias)
        return replace(
            self, rate=self.rate - (self.force @ S.T + b) @ by_force.T, bias_read=read, bias=bias,
            var_bias=np.where(self.is_undithered, self.var_bias, var_bias),
        )  # fmt: skip


def rate_noise_density(
    recording: Recording, still: Sequence[Sequence[Range]], sigma: FloatArray | None = None
) -> FloatArray:
    """Angle random walk ``N`` of each raw axis in raw unit · √s, (3,), from block means in ``still`` parts of poses;
    where these are too short, from the scatter ``sigma`` (3,) of samples, if given.

    ``N² = τ σ²(τ)`` with the Allan variance of blocks of τ = 0.5 s, pooled over the poses: unlike the scatter of single
    samples it is valid for filtered gyros, whose neighbouring samples are correlated. The lower limit is the rounding
    of the ADC, ``LSB²/12`` per sample, which also covers codes that a turn passes through. Raises ``InputError`` when
    the poses are too short.
    """
    assert recording.gyroscope is not None
    step_s = 1.0 / recording.rate_hz
    kept = np.array([(k, *part) for k, parts in enumerate(still) for part in parts], dtype=np.int64).reshape(-1, 3)
    squares, count = _core.block_differences(
        recording.gyroscope, kept[:, 1:].copy(), kept[:, 0].copy(), max(1, round(BLOCK_S / step_s))
    )
    if count < FEWEST_BLOCKS and sigma is None:
        raise InputError("the poses are too short to measure the gyro's noise: keep each pose for at least a second")
    variance = np.array(squares) / count if sigma is None or count >= FEWEST_BLOCKS else sigma**2
    return np.asarray(np.sqrt(np.maximum(variance, recording.facts.of("gyroscope").step ** 2 / 12.0) * step_s))


def measure_moves(recording: Recording, segments: Segments, accelerometer: SensorCalibration) -> MoveMeasurements:
    """Collect pose means, moves and noise; clipped gyro readings are bridged.

    Raises ``InputError`` when a sensor is missing or there is no move between two poses.
    """
    gyroscope, raw_force = recording.gyroscope, recording.accelerometer
    if gyroscope is None or raw_force is None:
        raise InputError(f"the recording has no {'gyroscope' if gyroscope is None else 'accelerometer'}")
    accelerometer_mean, gyroscope_mean = _both_means(segments)
    assert segments.accelerometer_sigma_mean is not None
    assert segments.gyroscope_sigma_mean is not None
    moves = _moves_of(recording, segments)
    in_log = np.array([[move.start, move.stop] for move in moves], dtype=np.int64)
    links = np.array([[move.pose_before, move.pose_after] for move in moves], dtype=np.int64)
    rows, edges = rows_beside(in_log, BESIDE, recording.n_samples)
    # A row that lacks a reading is a lost sample, as one that was not logged.
    is_whole = np.isfinite(gyroscope[rows]).all(axis=1) & np.isfinite(raw_force[rows]).all(axis=1)
    rows, edges = rows[is_whole], np.concatenate([[0], np.cumsum(is_whole)])[edges]
    reading, bias = (np.ascontiguousarray(mean, dtype=np.float64) for mean in (accelerometer_mean, gyroscope_mean))
    quantum = recording.facts.of("gyroscope").step
    # The variance of pose means includes their rounding error (docs/segmentation.md).
    var_bias, var_reading = segments.gyroscope_sigma_mean**2, segments.accelerometer_sigma_mean**2
    scatter = np.full(3, np.inf) if segments.gyroscope_sigma is None else segments.gyroscope_sigma
    undithered = undithered_axes(quantum, scatter)
    rate, of_bridge, is_clipped = bridge_clipping(recording, rows)
    rounding = rounding_in_moves(gyroscope, quantum, gyroscope_mean, undithered, in_log)
    of_rounding, hidden, shared = (each[rows] for each in rounding)
    time_s = recording.time_s[rows]
    bias_read, var_bias_read = bias, var_bias
    bias, var_bias = shrink(bias, var_bias, pool_biases(bias, var_bias)[0])
    if np.any(undithered):
        of_codes, own = biases_by_codes(
            bias_read, [gyroscope[pose.samples()] for pose in segments.poses], quantum, undithered
        )
        bias, var_bias = np.where(undithered, of_codes, bias), np.where(undithered, own**2, var_bias)
        # At rest inside a move an axis reads as in the poses around it.
        for (first, last), pair in zip(edges, (of_codes - bias_read)[links], strict=True):
            rate[first:last] += hidden[first:last] * np.linspace(pair[0], pair[1], last - first)
    still = [pose.undisturbed() for pose in segments.poses]
    seen = rate_noise_density(recording, still, segments.gyroscope_sigma)
    density = density_without_rounding(seen, quantum, 1.0 / recording.rate_hz, undithered)
    nominal, jitter = _steps_of(recording)
    return MoveMeasurements(
        links=links,
        rows=rows,
        time_s=time_s,
        edges=edges,
        durations_s=time_s[edges[:, 1] - 1] - time_s[edges[:, 0]],
        reading=reading,
        var_reading=var_reading + _unexplained_reading_variance(accelerometer),
        bias=bias,
        var_bias=var_bias,
        noise_density=density,
        sigma_time_s=jitter,
        nominal_step_s=nominal,
        clipped_s=np.array([nominal * np.count_nonzero(is_clipped[a:b].any(axis=1)) for a, b in edges]),
        is_gapped=np.array([np.max(np.diff(time_s[a:b]), initial=0.0) > GAP_STEPS * nominal for a, b in edges]),
        rate=rate,
        force=raw_force[rows],
        is_undithered=undithered,
        bias_read=bias_read,
        var_bias_read=var_bias_read,
        var_reading_noise=var_reading,
        reading_variance=np.where(is_clipped, of_bridge, of_rounding),
        quantum=quantum,
        is_hidden=hidden,
        shared_errors=shared,
        latitude_deg=recording.latitude_deg,
    )


def _moves_of(recording: Recording, segments: Segments) -> list[Move]:
    moves = [move for move in segments.moves if move.stop - move.start >= 2]
    if not moves:
        raise InputError(
            "no move between two poses was found: turn the sensor by hand between poses and keep each for some seconds"
        )
    if moves[-1].stop > recording.n_samples or segments.poses[-1].stop > recording.n_samples:
        raise InputError("the segments reach beyond the recording: they belong to another log")
    return moves


def _steps_of(recording: Recording) -> tuple[float, float]:
    """The median time step, and the standard deviation of a timestamp, s."""
    steps = np.diff(recording.time_s)
    nominal = median(steps[steps > 0]) if np.any(steps > 0) else 1.0 / recording.rate_hz
    return nominal, median(np.abs(steps - nominal)) * MAD_TO_SIGMA / np.sqrt(2.0)


def _both_means(segments: Segments) -> tuple[FloatArray, FloatArray]:
    if segments.accelerometer_mean is None or segments.gyroscope_mean is None:
        raise InputError("moves need the pose means of both sensors: segment a recording that has both")
    return segments.accelerometer_mean, segments.gyroscope_mean


def _unexplained_reading_variance(accelerometer: SensorCalibration) -> FloatArray:
    """Variance (3,) per raw axis of the accelerometer's residual beyond noise: directions have it as norms do."""
    quality = accelerometer.quality
    if quality is None or not np.isfinite(quality.rms_dof) or not np.isfinite(quality.floor):
        return np.zeros(3)
    # Only where significant: half of all sound recordings scatter slightly more than predicted.
    if quality.dof < 1 or chdtrc(quality.dof, quality.chi2) > 1e-3:
        return np.zeros(3)
    excess = max(quality.rms_dof**2 - quality.floor**2, 0.0)
    gains: FloatArray = np.sum(accelerometer.S**2, axis=0)
    return excess / gains


# Clipped gyro readings: replaced by a smooth peak, with the variance of the replacement.


LONGEST_BRIDGE_S = 0.15
"""Longest clipped run that is bridged: rotation by hand is smooth over this time; a longer peak may have any shape."""

DOUBT = 0.5
"""Standard uncertainty of the bridged area above the range limit, relative to that area."""


def bridge_clipping(recording: Recording, rows: IntArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Gyro readings at ``rows`` (k,) with clipped runs replaced by the cubic that continues the slopes on both sides:
    readings (k, 3), their variances (k, 3) by the replacement, raw², and which are replaced (k, 3).

    The standard uncertainty of its area is ``DOUBT`` of what is above the chord.
    """
    gyroscope, time_s = recording.gyroscope, recording.time_s
    assert gyroscope is not None
    rate = gyroscope[rows]
    variance, is_clipped = np.zeros(rate.shape), np.zeros(rate.shape, dtype=bool)
    for limit in recording.facts.of("gyroscope").limits:
        for first, stop in limit.runs.tolist():
            at = np.flatnonzero((rows >= first) & (rows < stop))
            is_clipped[at, limit.axis] = True
            found = limit.bridged(time_s, gyroscope, first, stop) if len(at) else None
            if found is not None:
                # Equal and independent variances of the run's samples, whose integral has the variance of the area.
                count, step_s = stop - first, (time_s[stop] - time_s[first - 1]) / (stop - first + 1)
                rate[at, limit.axis] = found[0][rows[at] - first]
                variance[at, limit.axis] = (DOUBT * found[1] / step_s) ** 2 / count
    return rate, variance, is_clipped
