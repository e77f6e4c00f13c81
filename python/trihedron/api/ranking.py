"""Rank calibrations of one unit, of any program, on a recording that they were not made from."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from trihedron.api.applying import AnyCalibration, calibration_of, check_units, without_effects
from trihedron.api.choices import settle_gravity
from trihedron.api.reading import AnyRecording, recording_of, segments_of
from trihedron.api.verifying import on_log, own_calibration
from trihedron.errors import InputError
from trihedron.estimate.ranking import densities, rms_interval, suspicions_of, with_bias_of_log
from trihedron.estimate.verification import verify_calibration
from trihedron.files.formats import any_calibration
from trihedron.files.formats.boards import as_logged
from trihedron.records import Calibration, Progress, Recording, Segments, Verification
from trihedron.records.ranking import Ranked, Ranking
from trihedron.segment import averaged
from trihedron.units import AccelerationUnit, RateUnit, acceleration_to_si, rate_to_si


def rank(
    calibrations: Sequence[AnyCalibration],
    recording: AnyRecording,
    *,
    segments: Segments | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    progress: Progress | None = None,
) -> Ranking:
    """Calibrations of one unit, from trihedron or any other program, in the order in which they fit a recording.

    Each is judged by gravity in static poses, tilt after rotations and the static rate, and ranked by log predictive
    density. For one that does not fit, a likely mistake is named, with which corrected it fits: the sign or unit of a
    bias, the direction of a matrix, its axes, the gravity it was made with.

    Parameters
    ----------
    calibrations : sequence of calibration, result or path
    recording : Recording, or what trihedron.read takes
    gravity_m_s2 or latitude_deg, height_m : float
        By default that of the trihedron calibrations.
    segments : Segments, found when not given
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    Ranking
        ``candidates``, the best first, each with verification, intervals and suspected mistakes; ``print`` shows it.

    Raises
    ------
    ValueError
        When fewer than two calibrations are given, units differ, or the recording has no pose.

    Examples
    --------
    >>> len(trihedron.rank([result, result], recording).candidates)
    2
    """
    if len(calibrations) < 2:
        raise InputError("a ranking needs two calibrations at least; one is judged by `trihedron verify`.")
    recording = recording_of(recording, latitude_deg)
    named = [_named(given, k) for k, given in enumerate(calibrations)]
    stated = [known.gravity_m_s2 for _, known in named if "maker" not in known.extensions]
    of_files = (float(np.median(stated)), "that of the calibrations") if stated else None
    gravity, source, _ = settle_gravity(gravity_m_s2, latitude_deg, height_m, of_files)
    segments = segments_of(segments, recording, progress)
    own = own_calibration(recording, segments, gravity)
    judged = []
    for name, known in named:
        known = _on_this_log(known, recording)
        if not known.extensions.get("effects"):
            known = with_bias_of_log(known, segments, gravity)
        judged.append((name, known, _judge(known, recording, segments, gravity, source, own)))
    points = densities([verification for _, _, verification in judged])
    out = [
        Ranked(
            name=name,
            maker=str(known.extensions.get("maker", "trihedron")),
            verification=verification,
            behind=0.0,
            behind_sigma=0.0,
            norm_interval=rms_interval(verification.norm_error),
            angle_interval=rms_interval(verification.angle_deg),
            suspicions=() if own is None else suspicions_of(known, own, recording, segments, gravity),
            without_bias=tuple(known.extensions.get("without_bias", ())),  # type: ignore[arg-type]
        )
        for name, known, verification in judged
    ]
    # A rejected calibration is not the best, however well it fits: it may have been made from this very log.
    best = points[min(range(len(out)), key=lambda k: (out[k].is_rejected, -points[k].sum()))]
    lost = [best - own_points for own_points in points]
    out = [
        replace(one, behind=float(by.sum()), behind_sigma=float(np.sqrt(len(by)) * by.std()))
        for one, by in zip(out, lost, strict=True)
    ]
    ordered = sorted(out, key=lambda one: (one.is_rejected, one.behind))
    return Ranking(recording.source, gravity, source, tuple(ordered))


def _judge(
    known: Calibration,
    recording: Recording,
    segments: Segments,
    gravity_m_s2: float,
    source: str,
    own: Calibration | None,
) -> Verification:
    check_units(known, recording)
    linear, more = without_effects(known, recording)
    if linear is not recording:
        # The same poses as those of the other calibrations, of the readings for which S and b are valid.
        recording, segments = linear, averaged(linear, segments)
        known = with_bias_of_log(known, segments, gravity_m_s2)
        own = own_calibration(recording, segments, gravity_m_s2)
    judged = verify_calibration(known, recording, segments, gravity_m_s2, source, own)
    return replace(judged, findings=on_log(known, recording, segments, (*judged.findings, *more)))


def _on_this_log(known: Calibration, recording: Recording) -> Calibration:
    """A calibration of another program in the units of the log, composed with the board's own corrections."""
    if "maker" not in known.extensions:
        return known
    known = as_logged(known, recording.onboard)
    accel, gyro = known.accelerometer, known.gyroscope
    to, of = acceleration_to_si(recording.accelerometer_unit), acceleration_to_si(AccelerationUnit(accel.raw_unit))
    if to is not None and of is not None:
        accel = replace(accel, S=accel.S * (to / of), raw_unit=recording.accelerometer_unit.value)
    if gyro is not None:
        to, of = rate_to_si(recording.gyroscope_unit), rate_to_si(RateUnit(gyro.raw_unit))
        if to is not None and of is not None:
            gyro = replace(gyro, S=gyro.S * (to / of), raw_unit=recording.gyroscope_unit.value)
    return replace(known, accelerometer=accel, gyroscope=gyro)


def _named(given: AnyCalibration, k: int) -> tuple[str, Calibration]:
    if isinstance(given, str | os.PathLike):
        return Path(given).name, any_calibration(given)
    return f"calibration {k + 1}", calibration_of(given)
