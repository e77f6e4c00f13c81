"""What the recording says, arranged for the twin: hold means with their noise, and the samples of every move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from trihedron.diagnose.residuals.aliasing import unresolved_variance
from trihedron.diagnose.residuals.coloured_noise import coloured_variance
from trihedron.records import Recording, Segments

FloatArray = npt.NDArray[np.float64]
LONGEST_MOVE_S = 180.0
"""A hand move takes seconds, a careful change of fixture minutes; over longer the bias decides what is integrated."""


@dataclass(frozen=True, eq=False)
class Observations:
    """Raw readings of one recording, centred, with the layout of its holds and moves.

    ``segments`` has its poses cut at bumps, ``whole`` as they were found.
    ``raw_force`` (n, 3), ``raw_rate`` (n, 3) are raw readings minus ``force_origin`` / ``rate_origin`` (the mean over
    the holds): counts around 32768 would cost the normal equations ten digits. ``hold_force``, ``hold_rate`` (h, 3) are
    the centred hold means, ``hold_force_sigma``, ``hold_rate_sigma`` (h, 3) their standard errors. ``move_ranges`` are
    half-open sample ranges that include the last sample of the hold before and the first of the hold after, so that
    neighbouring still samples bracket the whole motion; ``move_holds`` (m, 2) their holds. ``force_density`` and
    ``rate_density`` (3,) are white noise per √Hz in raw units. ``jitter_s`` is the scatter of sample instants about
    their stamps, once a diagnosis has found it; ``bumped_s`` are stretches of poses that were seen disturbed.
    ``unresolved`` maps a move's two holds to the variance of its integrals, (2, 3) force and rate in (raw unit · s)²,
    by motion faster than the samples and by noise slower than a move.
    ``is_scatter_free`` lets zeros scatter from hold to hold beside their walk, as far as the evidence goes.
    The two inflations widen the noise of moves that no known effect explains, so that they do not spoil the rest.
    """

    recording: Recording
    segments: Segments
    whole: Segments
    time_s: FloatArray
    raw_force: FloatArray
    raw_rate: FloatArray | None
    force_origin: FloatArray
    rate_origin: FloatArray
    hold_force: FloatArray
    hold_rate: FloatArray | None
    hold_force_sigma: FloatArray
    hold_rate_sigma: FloatArray | None
    hold_time_s: FloatArray
    move_ranges: tuple[tuple[int, int], ...]
    move_holds: npt.NDArray[np.intp]
    force_density: FloatArray
    rate_density: FloatArray | None
    jitter_s: float = 0.0
    bumped_s: tuple[tuple[float, float], ...] = ()
    unresolved: Mapping[tuple[int, int], FloatArray] = field(default_factory=dict)
    moves_inflation: float = 1.0
    dynamics_inflation: float = 1.0
    is_scatter_free: bool = False

    @property
    def n_holds(self) -> int:
        """Number of still poses."""
        return len(self.hold_force)

    @property
    def n_moves(self) -> int:
        """Number of moves between neighbouring poses."""
        return len(self.move_ranges)


def observe(recording: Recording, segments: Segments) -> Observations:
    """Arrange a segmented recording for the twin.

    Raises
    ------
    ValueError
        When the recording has no accelerometer or fewer than two still poses: there is nothing to hold a twin against.
    """
    recording = recording.with_distinct_stamps()
    if recording.accelerometer is None or segments.accelerometer_mean is None:
        raise ValueError("a diagnosis needs accelerometer readings: this recording has none")
    if segments.n_holds < 2:
        raise ValueError(
            f"a diagnosis needs still poses to hold the model against: {segments.n_holds} found, at least 2 are needed"
        )
    t = recording.time_s
    whole = segments if segments.whole is None else segments.whole
    bumped = tuple((float(t[a]), float(t[min(b, len(t) - 1)])) for hold in whole.holds for a, b in hold.disturbed)
    assert segments.accelerometer_sigma is not None
    assert segments.accelerometer_mean is not None
    assert segments.accelerometer_sigma_mean is not None
    step_s = 1.0 / recording.rate_hz
    force_origin = segments.accelerometer_mean.mean(axis=0)
    rate_origin = np.zeros(3)
    raw_rate = hold_rate = hold_rate_sigma = rate_density = None
    if recording.gyroscope is not None and segments.gyroscope_mean is not None:
        assert segments.gyroscope_sigma is not None
        rate_origin = segments.gyroscope_mean.mean(axis=0)
        raw_rate = recording.gyroscope - rate_origin
        hold_rate = segments.gyroscope_mean - rate_origin
        hold_rate_sigma = segments.gyroscope_sigma_mean
        rate_density = segments.gyroscope_sigma * np.sqrt(step_s)
    ranges, holds = [], []
    for move in segments.moves:
        start, stop = max(move.start - 1, 0), min(move.stop + 1, recording.n_samples)
        values = recording.accelerometer[start:stop]
        finite = np.isfinite(values).all() and (raw_rate is None or np.isfinite(raw_rate[start:stop]).all())
        # Hours between two poses are no move whose angle or velocity could be followed.
        is_short = recording.time_s[stop - 1] - recording.time_s[start] <= LONGEST_MOVE_S
        if finite and is_short and stop - start >= 3:
            ranges.append((start, stop))
            holds.append((move.hold_before, move.hold_after))
    spans = [(hold.start, hold.stop) for hold in segments.holds]
    variances = np.zeros((len(ranges), 2, 3))
    lasts = np.array([(hold.stop - hold.start) * step_s for hold in segments.holds])
    moves_last = np.array([recording.time_s[b - 1] - recording.time_s[a] for a, b in ranges])
    slow = (
        (segments.accelerometer_sigma_mean, segments.accelerometer_sigma * np.sqrt(step_s)),
        (hold_rate_sigma, rate_density),
    )
    for k, readings in enumerate((recording.accelerometer, recording.gyroscope)):
        if readings is not None:
            variances[:, k] = unresolved_variance(readings, tuple(ranges), spans, step_s)
        sigma, density = slow[k]
        if readings is not None and sigma is not None and density is not None and ranges:
            halves = np.array([_second_half_minus_first(readings[a:b]) for a, b in spans])
            variances[:, k] += coloured_variance(sigma, halves, density, lasts, moves_last)
    return Observations(
        recording=recording,
        segments=segments,
        whole=whole,
        time_s=recording.time_s,
        raw_force=recording.accelerometer - force_origin,
        raw_rate=raw_rate,
        force_origin=force_origin,
        rate_origin=rate_origin,
        hold_force=segments.accelerometer_mean - force_origin,
        hold_rate=hold_rate,
        hold_force_sigma=segments.accelerometer_sigma_mean,
        hold_rate_sigma=hold_rate_sigma,
        hold_time_s=np.array([0.5 * (t[hold.start] + t[hold.stop - 1]) for hold in segments.holds]),
        move_ranges=tuple(ranges) if raw_rate is not None else (),
        move_holds=np.array(holds if raw_rate is not None else [], dtype=np.intp).reshape(-1, 2),
        force_density=segments.accelerometer_sigma * np.sqrt(step_s),
        rate_density=rate_density,
        bumped_s=bumped,
        unresolved=dict(zip(holds, variances, strict=True)),
    )


def _second_half_minus_first(values: FloatArray) -> FloatArray:
    first, second = np.array_split(values, 2)
    out: FloatArray = np.nanmean(second, axis=0) - np.nanmean(first, axis=0)
    return out
