"""Process noise of a filter from a log, the static noise of its sensors, and reference motion."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from contextlib import suppress

from trihedron.api.choices import settle_gravity
from trihedron.api.identifying import allan
from trihedron.api.reading import AnyRecording, read, recording_of, segment
from trihedron.api.referring import AnyReference, motion_of
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.estimate.filter_noise.beside_reference import Request, beside_reference
from trihedron.estimate.filter_noise.findings import noticed, too_sure, unlike_this_log
from trihedron.estimate.filter_noise.static_intervals import (
    between_intervals,
    static_noise,
    tilt_over_moves,
    unlike_axes,
)
from trihedron.files.noise import read_noise_axes, read_noise_findings
from trihedron.records import Finding, Noise, NoiseAxis, Recording, Segments, Severity
from trihedron.records.checked import WrongTypeError
from trihedron.records.filter_noise import (
    BiasModel,
    FilterNoise,
    IntervalCheck,
    SensorFilterNoise,
    StaticNoise,
    TiltCheck,
)
from trihedron.records.noise import LEAST_S, NOT_OF_THE_SENSOR
from trihedron.records.recording import as_arguments
from trihedron.records.words import words
from trihedron.units import rate_to_si

UNITS = {"gyroscope": "rad/s", "accelerometer": "m/s^2"}
HORIZONS_S = (1.0, 10.0, 60.0)
BAND_PART = 0.25
"""Vibration is measured above this fraction of the sampling rate, where rigid motion is negligible."""
Static = dict[str, StaticNoise]


def filter_noise(
    recording: AnyRecording,
    *,
    static: Noise | str | os.PathLike[str] | None = None,
    reference: AnyReference | None = None,
    reference_columns: str | None = None,
    band_hz: float | None = None,
    horizons_s: Sequence[float] = HORIZONS_S,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
) -> FilterNoise:
    """N and K with which a filter predicts its errors correctly, and the causes of these errors (docs/filter-noise.md).

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        The log in motion.
    static : Noise or path, optional
        Static noise: the result of ``trihedron.allan``, a static log, or the JSON of ``trihedron allan``. Without it
        the longest static interval of the log, if it lasts 20 s.
    reference : path, Recording or ReferenceMotion, optional
        Attitude, and with a position also for the accelerometer. Without it only static intervals and gravity are used.
    reference_columns : str
        Its columns where names do not state them.
    band_hz : float, optional
        Vibration is measured above this frequency; a quarter of the sampling rate by default.
    horizons_s : sequence of float
        Times [s] over which a filter predicts without updates.
    gravity_m_s2, latitude_deg, height_m : float, optional
        |g| [m/s²], or the place.

    Returns
    -------
    FilterNoise
        N [SI/√Hz] and K [SI/√s] of each sensor with 95 % intervals, shares by cause, and cross-validated NEES.

    Raises
    ------
    ValueError
        When a horizon or the band is impossible, the reference has no attitude, or there is neither a static interval
        nor a reference.

    Examples
    --------
    >>> found = trihedron.filter_noise("flight.csv", static="static.csv", reference="truth.csv")  # doctest: +SKIP
    >>> found.sensor("gyroscope").N.value  # doctest: +SKIP
    0.00017
    """
    recording = recording_of(recording)
    horizons = tuple(sorted(float(h) for h in horizons_s))
    _check(recording, horizons, band_hz)
    gravity, _, said = settle_gravity(gravity_m_s2, latitude_deg, height_m)
    band = BAND_PART * recording.rate_hz if band_hz is None else float(band_hz)
    if isinstance(static, str | os.PathLike) and not os.fspath(static).lower().endswith(".json"):
        static = allan(read(static))
    segments = None
    if static is None or reference is None:
        with suppress(*INPUT_ERRORS):
            segments = segment(recording)
    own = None if segments is None else _of_rest(recording, segments)
    # The log's own rest is no other log: its faults are those of the recording already.
    of_own = () if own is None else tuple(f for f in own.findings if f.code in NOT_OF_THE_SENSOR)
    rest = {} if own is None else _sensors(own.axes, own.findings)
    known, of_static, name = (rest, of_own, "") if static is None else _given(static)
    if reference is None and own is None:
        raise InputError(_no_noise(recording, segments, "" if known else _in_counts(name), has_static=bool(name)))
    if name and not known:
        raise InputError(f"{name}: {_in_counts(name)}.")
    findings = (*recording.findings, *of_static, *(said if reference is not None else ()))
    tilt, intervals, source = None, None, ""
    if reference is not None:
        motion = motion_of(reference, reference_columns)
        asked = Request(horizons, band, gravity, known.get("gyroscope"), known.get("accelerometer"))
        sensors, of_motion = beside_reference(recording, motion, asked)
        about = (finding for one in sensors for finding in noticed(one))
        source, findings = motion.source, (*findings, *motion.findings, *of_motion, *about)
    else:
        assert own is not None
        sensors = tuple(_static_sensor(own, sensor, one, known) for sensor, one in rest.items())
        if segments is not None:
            tilt, intervals = _between_intervals(recording, segments, known)
        findings = (*findings, Finding.of("filter-noise-static"), *too_sure(tilt))
    if static is not None:
        findings = (*findings, *unlike_this_log(known, rest, sensors, name))
    of_log = (recording.source, source, recording.rate_hz, band, recording.duration_s)
    return FilterNoise(sensors, *of_log, tilt, intervals, tuple(findings), name)


def _check(recording: Recording, horizons: Sequence[float], band_hz: float | None) -> None:
    if not horizons or not all(0.0 < h <= 3600.0 for h in horizons):
        raise InputError("horizons are seconds between 0 and 3600 over which a filter carries on alone, as in 1,10,60.")
    if band_hz is not None and not 0.0 < band_hz < 0.5 * recording.rate_hz:
        raise InputError(
            f"{recording.source}: vibration cannot be looked for above {band_hz:g} Hz at {recording.rate_hz:.4g} "
            f"samples/s; give --band between 0 and {0.5 * recording.rate_hz:.4g}."
        )


def _no_noise(recording: Recording, segments: Segments | None, in_counts: str, *, has_static: bool) -> str:
    """All that is missing where a log shows no noise of its own."""
    missing = []
    if rate_to_si(recording.gyroscope_unit) is None:
        missing.append("its readings are counts of unknown size (`trihedron apply CALIBRATION LOG` makes them SI)")
    if _longest_rest(recording, segments) is None:
        missing.append(f"the sensor is not static in it for {LEAST_S:.0f} s")
    why = ", and ".join(missing) or "its static interval has no white noise"
    remedy = "; for static values run `trihedron allan` on a static log of ten minutes or more"
    if has_static:
        remedy = "; static values alone are those of `trihedron allan`"
        remedy += f". Beside a reference, too, {in_counts}" if in_counts else ""
    return (
        f"{recording.source}: {why}, so it shows no noise of its own; noise in motion needs known motion "
        f"beside it (--reference){remedy}."
    )


def _longest_rest(recording: Recording, segments: Segments | None) -> slice | None:
    """Samples of the longest static interval; None where it is shorter than ``LEAST_S``."""
    poses = () if segments is None else segments.poses
    longest = max(poses, key=lambda pose: pose.stop - pose.start, default=None)
    if longest is None or recording.time_s[longest.stop - 1] - recording.time_s[longest.start] < LEAST_S:
        return None
    return slice(longest.start, longest.stop)


def _of_rest(recording: Recording, segments: Segments) -> Noise | None:
    """Noise of the longest static interval; None where none is long enough."""
    at = _longest_rest(recording, segments)
    if at is None:
        return None
    part = Recording.from_arrays(
        recording.time_s[at],
        None if recording.accelerometer is None else recording.accelerometer[at],
        None if recording.gyroscope is None else recording.gyroscope[at],
        accelerometer_unit=recording.accelerometer_unit,
        gyroscope_unit=recording.gyroscope_unit,
        temperature_degc=None if recording.temperature_degc is None else recording.temperature_degc[at],
    )
    with suppress(*INPUT_ERRORS):
        found = allan(part)
        return found if _sensors(found.axes, found.findings) else None
    return None


def _sensors(axes: Sequence[NoiseAxis], findings: Sequence[Finding]) -> Static:
    is_limit = any(finding.code in NOT_OF_THE_SENSOR for finding in findings)
    stated = {sensor: static_noise(axes, unit, is_limit=is_limit) for sensor, unit in UNITS.items()}
    return {sensor: one for sensor, one in stated.items() if one is not None}


def _given(static: Noise | str | os.PathLike[str]) -> tuple[Static, tuple[Finding, ...], str]:
    """Noise by sensor of a static log, findings on what makes it doubtful, and the log as an argument."""
    if isinstance(static, str | os.PathLike):
        name, said, axes = shlex.quote(os.fspath(static)), read_noise_findings(static), read_noise_axes(static)
    elif isinstance(static, Noise):
        name, said, axes = as_arguments(static.source), static.findings, static.axes
    else:
        raise WrongTypeError(
            f"static is what trihedron.allan found, or the name of a file, not {type(static).__name__}."
        )
    doubts = []
    for one in said:
        if one.severity is Severity.SERIOUS or one.code in NOT_OF_THE_SENSOR:
            is_grave, seen = one.severity is Severity.SERIOUS, words("quoted", sentence=one.seen)
            doubts.append(Finding.of("filter-noise-static", "doubted" if is_grave else "noted", name=name, seen=seen))
    return _sensors(axes, said), tuple(doubts), name


def _in_counts(name: str) -> str:
    return (
        f"the static log is in counts: give the JSON of `trihedron allan {name}` with --calibration FILE, or with "
        "--gyro-lsb and --accel-lsb, the sizes of a count"
    )


def _static_sensor(own: Noise, sensor: str, rest: StaticNoise, known: Static) -> SensorFilterNoise:
    """Filter noise of a sensor from this log's own static interval, ``rest``, with the static values.

    An interval of seconds bounds K loosely: K is the static log's where that is within the bound.
    """
    K, static = rest.K, known.get(sensor)
    if static is not None and K.is_limit and static.K.filter_value < K.upper:
        K = static.K
    return SensorFilterNoise(
        "gyroscope" if sensor == "gyroscope" else "accelerometer", UNITS[sensor], rest.N, K, static,
        BiasModel("walk", 0.0), unlike_axes(own.axes, UNITS[sensor]),
    )  # fmt: skip


def _between_intervals(
    recording: Recording, segments: Segments, known: Static
) -> tuple[TiltCheck | None, IntervalCheck | None]:
    scale = rate_to_si(recording.gyroscope_unit)
    if recording.gyroscope is None or scale is None or "gyroscope" not in known:
        return None, None
    stated = (recording, segments, scale, known["gyroscope"])
    return tilt_over_moves(*stated), between_intervals(*stated)
