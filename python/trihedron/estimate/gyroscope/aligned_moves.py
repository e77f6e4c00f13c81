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
    is_astray,
    missed_deg,
    usually_missed_deg,
)
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.estimate.gyroscope.start import starts, turned_starts
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.session.averaging import TRIED, averaging_of, sharpened
from trihedron.units import rate_to_si

DENIED = 0.1
"""Part of what peaks that were cut would be short of by which gravity is missed, and they were not."""


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
            missed = missed_deg(plain, measured)
            if denies_cut(np.asarray(plain.fit.gyroscope_scale), missed, bridged, measured):
                return measured, plain
        return bridged, self._aligned(bridged)

    def averaged(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """Moves of a sensor that averages over its interval as far as they show it."""

        def at(share: float) -> tuple[MoveMeasurements, Aligned]:
            rate = sharpened(measured.rate, measured.time_s, share)
            return self._again(self._read_as(measured, rate, measured.reading_variance), aligned)

        excess = aligned.excess
        found = averaging_of([at(share)[1].fit.chi2 / excess for share in TRIED])
        again, left = at(found.share)
        return replace(again, averaging=found), left

    def _read_as(self, measured: MoveMeasurements, rate: FloatArray, variance: FloatArray | None) -> MoveMeasurements:
        return measured.of_rate(self.segments, rate, variance)

    def _again(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """The same moves used as before, from where the fit was."""
        start = np.asarray(aligned.fit.gyroscope_scale)[None]
        fit = align(measured, self.part, self.gravity_m_s2, start, self.options, aligned.used)
        return measured, replace(aligned, fit=fit)

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
        is_nearer = usually_missed_deg(other, measured) < usually_missed_deg(found, measured)
        return other if is_nearer else found


def denies_cut(S: FloatArray, missed_deg: FloatArray, bridged: MoveMeasurements, measured: MoveMeasurements) -> bool:
    """Whether gravity is carried through the moves that look cut as only whole turns carry it.

    ``missed_deg`` (m,) is by how much the readings as they are (``measured``) miss it, under the scale S.
    """
    added = (bridged.rate - measured.rate) @ S.T * measured.nominal_step_s
    cut = bridged.clipped_s > 0.0
    short = np.array([np.linalg.norm(np.nansum(added[a:b], axis=0)) for a, b in measured.edges[cut]])
    return bool(np.median(np.radians(missed_deg[cut])) < DENIED * np.median(short))
