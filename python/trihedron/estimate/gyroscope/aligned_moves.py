"""Moves measured and aligned, with a gyro's apparent limit believed only where gravity does not deny it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.estimate.gyroscope.alignment import (
    AccelerometerPart,
    Aligned,
    MoveOptions,
    align,
    align_screened,
    finished,
)
from trihedron.estimate.gyroscope.lost_turns import is_asked_for_losses
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.estimate.gyroscope.resting_ends import resting_ends
from trihedron.estimate.gyroscope.rounding import plateau_variance, resting_axes
from trihedron.estimate.gyroscope.start import starts, turned_starts
from trihedron.estimate.gyroscope.verification import is_astray, missed_deg, predict
from trihedron.quantiles import medians
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.session.averaging import TRIED, averaging_of, broadening
from trihedron.units import rate_to_si

DENIED = 0.1
"""Part of what peaks that were cut would be short of by which gravity is missed, and they were not."""

LEFT, MOST_PASSES = 0.01, 12
"""What is to be left of the error of a zero inside its step after fitting it and the readings at rest that stand for it
in turn: a pass leaves the part of a move that is still, a tenth where all axes turn, two thirds where one does."""


def measured_and_aligned(
    recording: Recording, segments: Segments, part: AccelerometerPart, gravity_m_s2: float, options: MoveOptions
) -> tuple[MoveMeasurements, Aligned, MoveOptions]:
    """Moves of a session, their alignment, and the options that suit them.

    A machine that always turns at one speed, seen through a converter coarser than its noise, ends at one code, as a
    gyro at its limit does. Had peaks been cut there, the readings as they are would fall short by what bridges them.
    Where gravity is carried far better than that, nothing was cut, unless the code is the end of a converter's word.
    """
    measured, aligned = _aligned_as_cut_or_not(recording, segments, part, gravity_m_s2, options)
    measured, aligned, options = _with_still_ends(recording, segments, measured, aligned, part, gravity_m_s2, options)
    return *_averaged(recording, segments, measured, aligned, part, gravity_m_s2, options), options


def _aligned_as_cut_or_not(
    recording: Recording, segments: Segments, part: AccelerometerPart, gravity_m_s2: float, options: MoveOptions
) -> tuple[MoveMeasurements, Aligned]:
    bridged = _measured(recording, segments, part, options, is_bridged=True)
    facts = recording.facts.of("gyroscope")
    is_word = any(limit.is_word for limit in facts.limits)
    if np.any(bridged.clipped_s > 0.0) and not is_word:
        measured = _measured(recording, segments, part, options, is_bridged=False)
        plain = _aligned(recording, measured, part, gravity_m_s2, options)
        if _denies_cut(plain, bridged, measured):
            return measured, plain
    return bridged, _aligned(recording, bridged, part, gravity_m_s2, options)


def _averaged(
    recording: Recording,
    segments: Segments,
    measured: MoveMeasurements,
    aligned: Aligned,
    part: AccelerometerPart,
    gravity_m_s2: float,
    options: MoveOptions,
) -> tuple[MoveMeasurements, Aligned]:
    """Moves of a sensor that averages over its interval as far as they show it, and what they leave open of that."""
    rate, lost, variance = measured.rate, broadening(measured.rate, recording.time_s), measured.reading_variance

    def at(share: float) -> tuple[MoveMeasurements, Aligned]:
        read = measured.of_rate(recording, segments, rate + share * lost, variance, options.rate_degree)
        start = np.asarray(aligned.fit.gyroscope_scale)[None]
        fit = align(read, part, gravity_m_s2, start, options, aligned.used)
        return read, finished(fit, read, part, aligned.used, aligned.outliers)

    points, half, means = (at(share)[1] for share in TRIED)
    excess = max(aligned.inflation, 1.0)
    found = averaging_of((points.fit.chi2 / excess, half.fit.chi2 / excess, means.fit.chi2 / excess))
    along = found.sigma * (means.parameters - points.parameters)
    measured, aligned = at(found.share)
    return (
        replace(measured, averaging=found),
        replace(aligned, covariance=aligned.covariance + np.outer(along, along)),
    )


def _with_still_ends(
    recording: Recording,
    segments: Segments,
    measured: MoveMeasurements,
    aligned: Aligned,
    part: AccelerometerPart,
    gravity_m_s2: float,
    options: MoveOptions,
) -> tuple[MoveMeasurements, Aligned, MoveOptions]:
    """The zero that a step hides, told by what turns alone: at the ends of a move it stands in the readings too.

    An offset fitted to whole moves is too small by the part of their time in which nothing turned.
    """
    options = options.suited_to(measured)
    axes = measured.is_undithered
    if recording.gyroscope is None or segments.gyroscope_mean is None or not np.any(axes):
        return measured, aligned, options
    quantum, rest = recording.facts.of("gyroscope").step, medians(segments.gyroscope_mean)
    is_still = resting_ends(recording.gyroscope, quantum, rest, axes, measured.edges)
    is_still |= resting_axes(recording.gyroscope, quantum, rest, axes)
    still = np.mean(np.concatenate([is_still[a:b] for a, b in measured.edges.tolist()]), axis=0)
    rate = measured.rate
    passes = np.log(LEFT) / np.log(np.clip(still.max(), LEFT, 1.0 - LEFT))
    for _ in range(int(np.clip(np.ceil(passes), 2, MOST_PASSES))):
        S = np.asarray(aligned.fit.gyroscope_scale)
        hidden = np.linalg.pinv(S) @ np.asarray(aligned.fit.rate_offset)
        zero = measured.zero_mean - np.clip(hidden, -0.5 * quantum, 0.5 * quantum)
        read = np.where(is_still, zero, rate)
        variance = measured.reading_variance
        measured = replace(measured, still=still).of_rate(recording, segments, read, variance, options.rate_degree)
        aligned = align_screened(measured, part, gravity_m_s2, S[None], options)
    if is_asked_for_losses(recording.time_s, measured, aligned, aligned.fit.chi2, aligned.fit.dof):
        return measured, aligned, options
    return *_with_plateaus(recording, segments, measured, aligned, part, gravity_m_s2, options), options


def _with_plateaus(
    recording: Recording,
    segments: Segments,
    measured: MoveMeasurements,
    aligned: Aligned,
    part: AccelerometerPart,
    gravity_m_s2: float,
    options: MoveOptions,
) -> tuple[MoveMeasurements, Aligned]:
    """Once moves agree among themselves: what they share where their rate stands still inside a step."""
    assert recording.gyroscope is not None
    assert segments.gyroscope_mean is not None
    quantum, rest = recording.facts.of("gyroscope").step, medians(segments.gyroscope_mean)
    shared = plateau_variance(recording.gyroscope, quantum, rest, measured.is_undithered)
    if shared is None:
        return measured, aligned
    variance = shared if measured.reading_variance is None else np.maximum(measured.reading_variance, shared)
    measured = measured.of_rate(recording, segments, measured.rate, variance, options.rate_degree)
    start = np.asarray(aligned.fit.gyroscope_scale)[None]
    fit = align(measured, part, gravity_m_s2, start, options, aligned.used)
    return measured, finished(fit, measured, part, aligned.used, aligned.outliers)


def _denies_cut(plain: Aligned, bridged: MoveMeasurements, measured: MoveMeasurements) -> bool:
    """Whether gravity is carried through the moves that look cut as only whole turns carry it."""
    S = np.asarray(plain.fit.gyroscope_scale)
    added = (bridged.rate - measured.rate) @ S.T * measured.nominal_step_s
    cut = bridged.clipped_s > 0.0
    short = np.array([np.linalg.norm(np.nansum(added[a:b], axis=0)) for a, b in measured.edges[cut]])
    missed = np.radians(predict(plain, measured, is_held_out=False).angle_deg[cut])
    return bool(np.median(missed) < DENIED * np.median(short))


def _measured(
    recording: Recording, segments: Segments, part: AccelerometerPart, options: MoveOptions, *, is_bridged: bool
) -> MoveMeasurements:
    return measure_moves(
        recording, segments, part.model, options.rate_degree, options.is_attitude_removed, is_bridged=is_bridged
    )


def _aligned(
    recording: Recording, measured: MoveMeasurements, part: AccelerometerPart, gravity_m_s2: float, options: MoveOptions
) -> Aligned:
    options = options.suited_to(measured)
    first = starts(recording, measured, part.model, options.nominal())
    found = align_screened(measured, part, gravity_m_s2, first, options)
    is_known = options.nominal() is not None or rate_to_si(recording.gyroscope_unit) is not None
    if is_known or not is_astray(found, measured):
        return found
    again = turned_starts(recording, measured, part.model, first[0])
    if again is None:
        return found
    other = align_screened(measured, part, gravity_m_s2, again, options)
    return other if missed_deg(other, measured) < missed_deg(found, measured) else found
