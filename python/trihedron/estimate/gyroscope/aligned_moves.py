"""Moves measured and aligned, with a gyro's apparent limit believed only where gravity does not deny it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.gyroscope.alignment import (
    AccelerometerPart,
    Aligned,
    MoveOptions,
    align,
    align_screened,
    finished,
)
from trihedron.estimate.gyroscope.common_errors import widened
from trihedron.estimate.gyroscope.lost_turns import is_asked_for_losses
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.estimate.gyroscope.resting_ends import resting_ends
from trihedron.estimate.gyroscope.rounding import plateau_variance, resting_axes, shared_errors
from trihedron.estimate.gyroscope.start import starts, turned_starts
from trihedron.estimate.gyroscope.verification import is_astray, missed_deg, predict
from trihedron.quantiles import medians
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.session.averaging import TRIED, averaging_of, sharpened
from trihedron.units import rate_to_si

DENIED = 0.1
"""Part of what peaks that were cut would be short of by which gravity is missed, and they were not."""

FIRST_TURN_RAD, MOST_TRIED, CLOSE = 3e-4, 12, 0.03
"""Turn hidden in a move that is tried first, how many are, and how near χ² comes to its degrees of freedom."""

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
    if np.any(measured.is_undithered):
        measured, aligned = session.with_still_ends(measured, aligned)
        measured, aligned = session.with_hidden_turns(measured, aligned)
    measured, aligned = session.averaged(measured, aligned)
    return measured, session.with_shared_rounding(measured, aligned), session.options


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
            rate = sharpened(measured.rate, measured.time_s, share)
            return self._again(self._read_as(measured, rate, measured.reading_variance), aligned)

        points, half, means = (at(share)[1] for share in TRIED)
        excess = max(aligned.inflation, 1.0)
        found = averaging_of((points.fit.chi2 / excess, half.fit.chi2 / excess, means.fit.chi2 / excess))
        along = found.sigma * (self._parameters(means) - self._parameters(points))
        measured, left = at(found.share)
        left = replace(left, excess=aligned.excess)
        return replace(measured, averaging=found), widened(left, measured, self.part, along[None])

    def with_still_ends(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """The zero that a step hides, told by what turns alone: at the ends of a move it stands in the readings too.

        An offset fitted to whole moves is too small by the part of their time in which nothing turned.
        """
        coarse = self._coarse(measured)
        quantum = coarse[1]
        is_still = (resting_ends(*coarse, measured.edges_in_log) | resting_axes(*coarse))[measured.rows]
        still = np.mean(np.concatenate([is_still[a:b] for a, b in measured.edges.tolist()]), axis=0)
        rate = measured.rate
        passes = np.log(LEFT) / np.log(np.clip(still.max(), LEFT, 1.0 - LEFT))
        for _ in range(int(np.clip(np.ceil(passes), 2, MOST_PASSES))):
            S = np.asarray(aligned.fit.gyroscope_scale)
            hidden = np.linalg.pinv(S) @ np.asarray(aligned.fit.rate_offset)
            zero = measured.bias_mean - np.clip(hidden, -0.5 * quantum, 0.5 * quantum)
            read = np.where(is_still, zero, rate)
            measured = self._read_as(measured, read, measured.reading_variance)
            aligned = align_screened(measured, self.part, self.gravity_m_s2, S[None], self.options)
        measured = replace(measured, still_response=self._still_response(measured, aligned, is_still))
        if is_asked_for_losses(self.recording.time_s, measured, aligned, aligned.fit.chi2, aligned.fit.dof):
            return measured, aligned
        # Once moves agree among themselves: what they share where their rate stands still inside a step.
        shared = plateau_variance(*coarse)
        variance = (
            measured.reading_variance if shared is None else np.maximum(_variance(measured), shared[measured.rows])
        )
        return self._again(self._read_as(measured, measured.rate, variance), aligned)

    def with_hidden_turns(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """Every move with a turn that its step hides, as a support makes that settles, of the rms that misses show.

        Its variance is the same in every move, however much rounding is charged there (Paule and Mandel 1982); a
        factor on all would leave those right that are charged least.
        """
        dof, before = aligned.fit.dof, aligned
        if dof < 1 or aligned.fit.chi2 <= dof:
            return measured, aligned
        # Samples lost unseen would be as good a reason for what moves miss.
        if is_asked_for_losses(self.recording.time_s, measured, aligned, aligned.fit.chi2, dof):
            return measured, aligned
        last = measured.edges[:, 1] - 2
        of_turn = np.zeros(measured.rate.shape)
        of_turn[last] = 1.0 / (measured.nominal_step_s * np.linalg.norm(aligned.fit.gyroscope_scale, 2)) ** 2
        start, low, high, turn2 = measured, 0.0, np.inf, FIRST_TURN_RAD**2
        for _ in range(MOST_TRIED):
            variance = _variance(start) + turn2 * of_turn
            measured, aligned = self._again(self._read_as(start, start.rate, variance), before)
            if abs(aligned.fit.chi2 / dof - 1.0) < CLOSE:
                break
            low, high = (turn2, high) if aligned.fit.chi2 > dof else (low, turn2)
            turn2 = 4.0 * turn2 if np.isinf(high) else np.sqrt(max(low, high / 16.0) * high)
        return measured, replace(aligned, excess=before.inflation)

    def with_shared_rounding(self, measured: MoveMeasurements, aligned: Aligned) -> Aligned:
        """The covariance with what rounding does to all moves alike."""
        if not np.any(measured.is_undithered):
            return aligned
        errors = (error[measured.rows] for error in shared_errors(*self._coarse(measured)))
        followed = self._followed(measured, aligned, errors)
        return widened(aligned, measured, self.part, followed)

    def _still_response(self, measured: MoveMeasurements, aligned: Aligned, is_still: BoolArray) -> FloatArray:
        """(p, p) by which errors grow: the offset that is fitted is in the readings at rest, which it was fitted to."""
        units = (np.where(np.arange(3) == k, is_still, 0.0) for k in range(3))
        response = self._followed(measured, aligned, units).T
        hidden = np.zeros((3, len(response)))
        hidden[:, -3:] = np.linalg.pinv(np.asarray(aligned.fit.gyroscope_scale))
        grown: FloatArray = np.eye(len(response)) - response @ np.linalg.solve(np.eye(3) + hidden @ response, hidden)
        return grown

    def _followed(self, measured: MoveMeasurements, aligned: Aligned, errors: Iterable[FloatArray]) -> FloatArray:
        """(m, p) by how much the fit's parameters follow ``m`` errors (samples, 3) of the readings."""
        rates = (measured.rate, *(measured.rate + error for error in errors))
        fits = [self._again(self._read_as(measured, rate, measured.reading_variance), aligned)[1] for rate in rates]
        first, *others = (self._parameters(fit) for fit in fits)
        return np.array(others).reshape(-1, len(first)) - first

    def _parameters(self, aligned: Aligned) -> FloatArray:
        """Those of the fit, (p,): along the accelerometer's free directions, ``S_ω``, the offset."""
        fit, free = aligned.fit, self.part.basis
        accelerometer = np.concatenate([np.ravel(fit.accelerometer_scale), fit.accelerometer_bias])
        along = np.linalg.lstsq(free, accelerometer, rcond=None)[0]
        offset = np.asarray(fit.rate_offset) if self.options.is_offset_free else np.zeros(0)
        return np.concatenate([along, np.ravel(fit.gyroscope_scale), offset])

    def _coarse(self, measured: MoveMeasurements) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Readings (n, 3), their steps (3,), those at rest (3,), and the axes (3,) that their noise does not dither."""
        readings, means = self.recording.gyroscope, self.segments.gyroscope_mean
        assert readings is not None
        assert means is not None
        return readings, self.recording.facts.of("gyroscope").step, medians(means), measured.is_undithered

    def _read_as(self, measured: MoveMeasurements, rate: FloatArray, variance: FloatArray | None) -> MoveMeasurements:
        return measured.of_rate(self.segments, rate, variance)

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
        again = turned_starts(measured, part.model, first[0])
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


def _variance(measured: MoveMeasurements) -> FloatArray:
    return np.zeros(measured.rate.shape) if measured.reading_variance is None else measured.reading_variance
