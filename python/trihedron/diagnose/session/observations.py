"""Observations of a session: pose means with their noise, and the samples of every move."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import TINY, BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.gravity import earth_rate_up
from trihedron.records import Recording, Segments
from trihedron.session.model import Prior, SessionReadings, SessionState
from trihedron.session.noise import FEWEST_READINGS, measure_noise
from trihedron.session.rounding import (
    UNIFORM,
    biases_by_codes,
    density_without_rounding,
    rounding_in_moves,
    undithered_axes,
)
from trihedron.session.support import Support, support_of

LOUD = 3.0
"""Variance of a pose over that of a usual one in the session from which it was not static: real noise is not exactly
Gaussian or white, and a pose on another support has 50 % more."""
LONGEST_MOVE_S = 180.0
"""Longest move that is integrated, s: hand moves take seconds, a fixture minutes; beyond it the bias dominates."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Observations(SessionReadings):
    """Raw readings of one recording, centred, with the layout of its poses and moves.

    ``segments`` has its poses cut at disturbances, ``whole`` as they were found.
    ``raw_force`` (n, 3), ``raw_rate`` (n, 3) are raw readings minus ``force_origin`` / ``rate_origin``, the means over
    the poses. ``move_ranges`` are half-open sample ranges that include the last sample of the pose before and the first
    of the pose after, so that static samples bracket the whole motion; ``move_poses`` (m, 2) their poses. ``jitter_s``
    is the scatter of sampling instants about their timestamps, once a diagnosis has found it.
    ``unresolved`` (m, 4, 3) is the variance of the moves' integrals, (raw unit · s)²: of force and rate by motion
    faster than the samples, then by rounding, slow noise and vibration at the end of a pose.
    ``leans`` (poses, 2, 3): of a support that yields, change of the vertical from the mean over a pose to its ends.
    ``averaging`` is the smoothing of the samples by the sensors' filters (eq. 11.6d).
    ``undithered`` (3,) are gyro axes whose noise does not dither the LSB; ``rounding`` (n, 3, k) the derivatives of raw
    rates in moves by k errors of rounding with prior σ ``rounding_sigma`` (k,): place of each of these axes' biases
    inside the LSB, then errors that all moves share.
    """

    recording: Recording
    segments: Segments
    whole: Segments
    time_s: FloatArray
    raw_force: FloatArray
    raw_rate: FloatArray | None
    move_ranges: tuple[tuple[int, int], ...]
    move_poses: npt.NDArray[np.intp]
    jitter_s: float = 0.0
    unresolved: FloatArray
    leans: FloatArray | None = None
    averaging: float = 0.0
    undithered: BoolArray = field(default_factory=lambda: np.zeros(3, dtype=np.bool_))
    rounding: FloatArray | None = None
    rounding_sigma: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def n_moves(self) -> int:
        return len(self.move_ranges)

    def pose_names(self, which: Iterable[int]) -> tuple[str, ...]:
        """Poses by their numbers in the recording, from 1, before they were cut at disturbances."""
        poses = self.segments.poses
        return tuple(self.whole.pose_name(poses[i].start, poses[i].stop) for i in which)

    def move_names(self, which: Iterable[int]) -> tuple[str, ...]:
        """Moves by their numbers in the recording, from 1."""
        return tuple(self.whole.move_name(*self.move_ranges[m]) for m in which)

    def times(self, ranges: Iterable[Sequence[int]]) -> tuple[tuple[float, float], ...]:
        """First and last time [s] of half-open ranges of samples."""
        return tuple((float(self.time_s[start]), float(self.time_s[stop - 1])) for start, stop in ranges)

    def without_moves_from(self, poses: Collection[int]) -> Observations:
        """Without the moves that begin at these poses. Where moves were left out before, their numbers are others."""
        keep = [m for m, (before, _) in enumerate(self.move_poses.tolist()) if before not in poses]
        ranges, unresolved = tuple(self.move_ranges[m] for m in keep), self.unresolved[keep]
        return replace(self, move_ranges=ranges, move_poses=self.move_poses[keep], unresolved=unresolved)

    @property
    def readings(self) -> FloatArray:
        """(n, 6) readings of both sensors; (n, 3) without a gyro."""
        return self.raw_force if self.raw_rate is None else np.hstack([self.raw_force, self.raw_rate])

    @property
    def whitened(self) -> tuple[FloatArray, ...]:
        """(n, 3) readings of each sensor in units of the white noise of a sample."""
        pairs = ((self.raw_force, self.force_density), (self.raw_rate, self.rate_density))
        root = np.sqrt(self.recording.rate_hz)
        return tuple(raw / (density * root) for raw, density in pairs if raw is not None and density is not None)

    def support_seen(self, state: SessionState) -> Support | None:
        """Motion of the support inside the poses; ``None`` without a gyro, or with few poses."""
        moves = [(int(pose), *edges) for pose, edges in zip(self.move_poses[:, 0], self.move_ranges, strict=True)]
        near = state.gyro_S, state.accel_S, state.up
        return support_of(self.recording, self.segments.poses, moves, self, near, state.gravity)

    def on(self, support: Support, gyro_S: FloatArray) -> Observations:
        """The observations with poses that a yielding support rotates."""
        if self.pose_rate is None or self.pose_rate_sigma is None:
            return self
        seen = self.pose_rate, self.pose_rate_sigma, self.unresolved, self.move_poses[:, 0]
        pose_rate, sigma, unresolved = support.applied(*seen, gyro_S)
        return replace(self, unresolved=unresolved, pose_rate=pose_rate, pose_rate_sigma=sigma, leans=support.leans)

    def pose_means(self, samples: FloatArray) -> FloatArray:
        """(poses, ...) means over each pose of a whole-recording signal (n, ...), without missing readings."""
        poses = self.segments.poses
        ranges = [span for pose in poses for span in pose.undisturbed()]
        owner = [i for i, pose in enumerate(poses) for _ in pose.undisturbed()]
        means = _core.column_means(samples.reshape(len(samples), -1), np.array(ranges), np.array(owner), len(poses))
        return np.asarray(means.reshape(-1, *samples.shape[1:]))

    def model(self, gravity_m_s2: float, prior: Prior | None) -> _core.SessionModel:
        """The Rust model."""
        return self.core_model(gravity_m_s2, self.core_moves, (self.jitter_s, 1.0 / self.recording.rate_hz), prior)

    @cached_property
    def rounding_at_points(self) -> FloatArray | None:
        """(points, 3, k) ``rounding`` at the poses, then at the samples of the moves; ``None`` without any."""
        if self.rounding is None:
            return None
        at_rest = np.zeros((self.n_poses, *self.rounding.shape[1:]))
        places = np.eye(3)[:, self.undithered]
        at_rest[:, :, : places.shape[1]] = places
        return np.concatenate([at_rest, *(self.rounding[a:b] for a, b in self.move_ranges)])

    @cached_property
    def core_moves(self) -> _core.SessionMoves:
        """The samples of the moves in the core, prepared once for many fits."""
        force, rate = (
            None if raw is None else _core.sharpened(raw, self.time_s, self.averaging)
            for raw in (self.raw_force, self.raw_rate)
        )
        assert force is not None
        return _core.SessionMoves(
            pose_time_s=self.pose_time_s, time_s=self.time_s, force=force, rate=rate,
            ranges=np.array(self.move_ranges, dtype=np.int64).reshape(-1, 2), before=self.move_poses[:, 0],
            unresolved=self.unresolved, leans=np.zeros((self.n_poses, 2, 3)) if self.leans is None else self.leans,
        )  # fmt: skip


def observe(recording: Recording, segments: Segments, averaging: float = 0.0) -> Observations:
    """Observations of a segmented recording.

    Refused without an accelerometer or with fewer than two poses: there is no session state to compare with.
    """
    recording = recording.with_distinct_timestamps()
    segments, swing = means_beside_lines(recording, segments)
    if recording.accelerometer is None or segments.accelerometer_mean is None:
        raise InputError("a diagnosis needs accelerometer readings: this recording has none")
    if segments.n_poses < 2:
        raise InputError(
            f"a diagnosis compares the model with static poses: {segments.n_poses} found, at least 2 are needed"
        )
    t = recording.time_s
    whole = segments if segments.whole is None else segments.whole
    force_origin = segments.accelerometer_mean.mean(axis=0)
    rate_origin = np.zeros(3)
    raw_rate = pose_rate = None
    if recording.gyroscope is not None and segments.gyroscope_mean is not None:
        rate_origin = segments.gyroscope_mean.mean(axis=0)
        raw_rate = recording.gyroscope - rate_origin
        pose_rate = segments.gyroscope_mean - rate_origin
    ranges, poses = [], []
    for move in segments.moves:
        start, stop = max(move.start - 1, 0), min(move.stop + 1, recording.n_samples)
        values = recording.accelerometer[start:stop]
        finite = np.isfinite(values).all() and raw_rate is not None and np.isfinite(raw_rate[start:stop]).all()
        # Neither angle nor velocity can be integrated between poses hours apart, or across a gap: most of a move.
        lasts, steps = t[stop - 1] - t[start], np.diff(t[start:stop])
        is_known = lasts <= LONGEST_MOVE_S and steps.max(initial=0.0) < 0.5 * lasts
        if finite and is_known and stop - start >= 3:
            ranges.append((start, stop))
            poses.append((move.pose_before, move.pose_after))
    noise, of_moves = measure_noise(recording, segments, ranges)
    spans = segments.spans
    if noise.pose_rate_sigma is not None:
        lasts = t[spans[:, 1] - 1] - t[spans[:, 0]]
        swing[:, 1] += _turned_at_ends(noise.pose_rate_sigma, lasts)
    for own, ends in zip(of_moves, poses, strict=True):
        own[2:] += swing[list(ends)].sum(axis=0)
    obs = Observations(
        recording=recording, segments=segments, whole=whole, time_s=recording.time_s,
        raw_force=recording.accelerometer - force_origin, raw_rate=raw_rate, force_origin=force_origin,
        rate_origin=rate_origin, pose_force=segments.accelerometer_mean - force_origin, pose_rate=pose_rate,
        **vars(noise),
        pose_time_s=0.5 * (t[spans[:, 0]] + t[spans[:, 1] - 1]),
        move_ranges=tuple(ranges), move_poses=np.array(poses, dtype=np.intp).reshape(-1, 2), unresolved=of_moves,
        averaging=averaging, earth_up_rad_s=earth_rate_up(recording.latitude_deg),
    )  # fmt: skip
    return obs if obs.n_moves == 0 else _beside_rounding(obs)


def _beside_rounding(obs: Observations) -> Observations:
    """The observations with the places of the gyro's undithered biases inside the LSB as unknowns: their error is the
    same in all poses and in readings of moves that rest there, and no number of poses averages it out."""
    step, sigma = obs.recording.facts.of("gyroscope").step, obs.segments.gyroscope_sigma
    if obs.raw_rate is None or obs.pose_rate is None or obs.pose_rate_sigma is None or obs.rate_density is None:
        return obs
    axes = np.zeros(3, dtype=np.bool_) if sigma is None else undithered_axes(step, sigma)
    if not axes.any():
        return obs
    interval_s, pose_rate = 1.0 / obs.recording.rate_hz, obs.pose_rate
    variance, hidden, shared = rounding_in_moves(obs.raw_rate, step, pose_rate, axes, np.array(obs.move_ranges))
    readings = [obs.raw_rate[pose.samples()] for pose in obs.segments.poses]
    by_codes, own = biases_by_codes(pose_rate, readings, step, axes)
    root = np.sqrt(obs.segments.duration_s)[:, None]
    white = density_without_rounding(obs.rate_density, step, interval_s, axes) / root
    raw_rate, unresolved = obs.raw_rate.copy(), obs.unresolved.copy()
    for k, ((a, b), pair) in enumerate(zip(obs.move_ranges, obs.move_poses, strict=True)):
        # At rest inside a move an axis reads as in the poses around it.
        before, after = (by_codes - pose_rate)[pair]
        raw_rate[a:b] += hidden[a:b] * np.linspace(before, after, b - a)
        # Rounding to codes that are passed through is in the noise of samples.
        beyond = variance[a:b].sum(axis=0) - (b - a) * UNIFORM * step**2
        unresolved[k, 3] += np.maximum(beyond, 0.0) * interval_s**2
    return replace(
        obs, raw_rate=raw_rate, pose_rate=by_codes, unresolved=unresolved, undithered=axes,
        pose_rate_sigma=np.where(axes, np.hypot(own, white), obs.pose_rate_sigma),
        rounding=np.concatenate([hidden[:, :, None] * np.eye(3)[:, axes], shared], axis=2),
        rounding_sigma=np.concatenate([step[axes] * np.sqrt(UNIFORM), np.ones(shared.shape[2])]),
    )  # fmt: skip


def _turned_at_ends(rate_sigma: FloatArray, lasts_s: FloatArray) -> FloatArray:
    """(poses, 3) variance, (raw unit · s)², of the angle between a pose's mean and its ends where it was not static.

    A rate that changes inside a pose (the tail of a move, a push) makes its mean uncertain, and rotates its ends
    against its middle by that error times half the pose. It is zero for poses with the session's usual noise.
    """
    usual = np.median(rate_sigma**2 * lasts_s[:, None], axis=0) / lasts_s[:, None]
    return np.maximum(rate_sigma**2 - LOUD * usual, 0.0) * (0.5 * lasts_s[:, None]) ** 2


def means_beside_lines(recording: Recording, segments: Segments) -> tuple[Segments, FloatArray]:
    """Segments whose poses with a line have mean and standard error of a fit of constant + lines; swing of the lines
    (docs/diagnosis-method.md, 8.0).

    A sinusoid of amplitude A that is no whole number of cycles moves the mean of a pose of length T by up to A/(πfT),
    and block means scatter by it. Poses without a significant line stay as they are. Samples are taken as even.

    The swing (h, 2, 3), force and rate, is the variance of a line's integral at the edge of its pose, (raw unit · s)²:
    A²/2(2πf)². A move that begins or ends in it does not begin or end at rest.
    """
    changed: dict[str, FloatArray] = {}
    swing = np.zeros((segments.n_poses, 2, 3))
    whole = np.array([(p.start, p.start if p.disturbed else p.stop) for p in segments.poses], dtype=np.int64)
    both = (("accelerometer", recording.accelerometer), ("gyroscope", recording.gyroscope))
    for s, (sensor, readings) in enumerate(both):
        mean, error = getattr(segments, f"{sensor}_mean"), getattr(segments, f"{sensor}_sigma_mean")
        sigma = getattr(segments, f"{sensor}_sigma")
        if readings is None or mean is None or error is None or sigma is None or not len(mean):
            continue
        white = sigma / np.sqrt(np.maximum(segments.n_averaged, 1))[:, None]
        # Ratio of the errors of means to white noise: a line does not change the slow noise.
        colour = np.maximum(np.median(error / np.maximum(white, TINY), axis=0), 1.0)
        fitted, own, integral = _core.poses_beside_lines(readings, whole, sigma, FEWEST_READINGS)
        has_line = np.isfinite(fitted)
        swing[:, s] = np.where(has_line, integral / recording.rate_hz**2, 0.0)
        changed[f"{sensor}_mean"] = np.where(has_line, fitted, mean)
        changed[f"{sensor}_sigma_mean"] = np.where(has_line, colour * own, error)
        if s == 0 and segments.accelerometer_sigma_up is not None:
            up = np.where(has_line.any(axis=1), np.nan, segments.accelerometer_sigma_up)
            changed["accelerometer_sigma_up"] = up
    return replace(segments, **changed), swing  # type: ignore[arg-type]
