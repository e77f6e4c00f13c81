"""Moves measured and aligned, with a gyro's apparent limit believed only where gravity does not deny it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
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
from trihedron.session.averaging import TRIED, averaging_of, sharpened
from trihedron.units import rate_to_si

DENIED = 0.1
"""Part of what peaks that were cut would be short of by which gravity is missed, and they were not."""

LEFT, MOST_PASSES = 0.01, 12
"""What is to be left of the error of a bias inside its step after fitting it and the readings at rest that stand for it
in turn: a pass leaves the part of a move that is still, a tenth where all axes turn, two thirds where one does."""


def measured_and_aligned(
    recording: Recording, segments: Segments, part: AccelerometerPart, gravity_m_s2: float, options: MoveOptions
) -> tuple[MoveMeasurements, Aligned, MoveOptions]:
    """Moves of a session, their alignment, and the options that suit them.

    A machine that always turns at one speed, seen through an ADC coarser than its noise, ends at one code, as a
    gyro at its limit does. Had peaks been cut there, the readings as they are would fall short by what bridges them.
    Where gravity is carried far better than that, nothing was cut, unless the code is the end of an ADC's word.
    """
    session = _Session(recording, segments, part, gravity_m_s2, options)
    measured, aligned = session.aligned_as_cut_or_not()
    session = replace(session, options=options.suited_to(measured))
    measured, aligned = session.with_still_ends(measured, aligned)
    return *session.averaged(measured, aligned), session.options


@dataclass(frozen=True)
class _Session:
    """What moves are measured in and aligned with."""

    recording: Recording
    segments: Segments
    part: AccelerometerPart
    gravity_m_s2: float
    options: MoveOptions

    def aligned_as_cut_or_not(self) -> tuple[MoveMeasurements, Aligned]:
        bridged = self._measured(is_bridged=True)
        is_word = any(limit.is_word for limit in self.recording.facts.of("gyroscope").limits)
        if np.any(bridged.clipped_s > 0.0) and not is_word:
            measured = self._measured(is_bridged=False)
            plain = self._aligned(measured)
            missed = predict(plain, measured, is_held_out=False).angle_deg
            if denies_cut(np.asarray(plain.fit.gyroscope_scale), missed, bridged, measured):
                return measured, plain
        return bridged, self._aligned(bridged)

    def averaged(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """Moves of a sensor that averages over its interval as far as they show it, and what they leave open of it."""

        def at(share: float) -> tuple[MoveMeasurements, Aligned]:
            rate = sharpened(measured.rate, self.recording.time_s, share)
            return self._again(self._read_as(measured, rate, measured.reading_variance), aligned)

        points, half, means = (at(share)[1] for share in TRIED)
        excess = max(aligned.inflation, 1.0)
        found = averaging_of((points.fit.chi2 / excess, half.fit.chi2 / excess, means.fit.chi2 / excess))
        along = found.sigma * (means.parameters - points.parameters)
        measured, aligned = at(found.share)
        return (
            replace(measured, averaging=found),
            replace(aligned, covariance=aligned.covariance + np.outer(along, along)),
        )

    def with_still_ends(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """The zero that a step hides, told by what turns alone: at the ends of a move it stands in the readings too.

        An offset fitted to whole moves is too small by the part of their time in which nothing turned.
        """
        recording, axes = self.recording, measured.is_undithered
        if recording.gyroscope is None or self.segments.gyroscope_mean is None or not np.any(axes):
            return measured, aligned
        quantum, rest = recording.facts.of("gyroscope").step, medians(self.segments.gyroscope_mean)
        is_still = resting_ends(recording.gyroscope, quantum, rest, axes, measured.edges)
        is_still |= resting_axes(recording.gyroscope, quantum, rest, axes)
        still = np.mean(np.concatenate([is_still[a:b] for a, b in measured.edges.tolist()]), axis=0)
        rate = measured.rate
        passes = np.log(LEFT) / np.log(np.clip(still.max(), LEFT, 1.0 - LEFT))
        for _ in range(int(np.clip(np.ceil(passes), 2, MOST_PASSES))):
            S = np.asarray(aligned.fit.gyroscope_scale)
            hidden = np.linalg.pinv(S) @ np.asarray(aligned.fit.rate_offset)
            zero = measured.bias_mean - np.clip(hidden, -0.5 * quantum, 0.5 * quantum)
            read = np.where(is_still, zero, rate)
            measured = self._read_as(replace(measured, still=still), read, measured.reading_variance)
            aligned = align_screened(measured, self.part, self.gravity_m_s2, S[None], self.options)
        if is_asked_for_losses(recording.time_s, measured, aligned, aligned.fit.chi2, aligned.fit.dof):
            return measured, aligned
        # Once moves agree among themselves: what they share where their rate stands still inside a step.
        shared = plateau_variance(recording.gyroscope, quantum, rest, axes)
        if shared is None:
            return measured, aligned
        variance = shared if measured.reading_variance is None else np.maximum(measured.reading_variance, shared)
        return self._again(self._read_as(measured, measured.rate, variance), aligned)

    def _read_as(self, measured: MoveMeasurements, rate: FloatArray, variance: FloatArray | None) -> MoveMeasurements:
        return measured.of_rate(self.recording, self.segments, rate, variance)

    def _again(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """The same moves used as before, from where the fit was."""
        start = np.asarray(aligned.fit.gyroscope_scale)[None]
        fit = align(measured, self.part, self.gravity_m_s2, start, self.options, aligned.used)
        return measured, finished(fit, measured, self.part, aligned.used, aligned.outliers)

    def _measured(self, *, is_bridged: bool) -> MoveMeasurements:
        return measure_moves(self.recording, self.segments, self.part.model, is_bridged=is_bridged)

    def _aligned(self, measured: MoveMeasurements) -> Aligned:
        options, part, gravity = self.options.suited_to(measured), self.part, self.gravity_m_s2
        first = starts(self.recording, measured, part.model, options.nominal())
        found = align_screened(measured, part, gravity, first, options)
        is_known = options.nominal() is not None or rate_to_si(self.recording.gyroscope_unit) is not None
        if is_known or not is_astray(found, measured):
            return found
        again = turned_starts(self.recording, measured, part.model, first[0])
        if again is None:
            return found
        other = align_screened(measured, part, gravity, again, options)
        return other if missed_deg(other, measured) < missed_deg(found, measured) else found


def denies_cut(S: FloatArray, missed_deg: FloatArray, bridged: MoveMeasurements, measured: MoveMeasurements) -> bool:
    """Whether gravity is carried through the moves that look cut as only whole turns carry it.

    ``missed_deg`` (m,) is by how much the readings as they are (``measured``) miss it, under the scale S.
    """
    added = (bridged.rate - measured.rate) @ S.T * measured.nominal_step_s
    cut = bridged.clipped_s > 0.0
    short = np.array([np.linalg.norm(np.nansum(added[a:b], axis=0)) for a, b in measured.edges[cut]])
    return bool(np.median(np.radians(missed_deg[cut])) < DENIED * np.median(short))
