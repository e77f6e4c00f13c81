"""Every parameter of a calibration against its estimate from a recording, and readings without a calibration."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from trihedron import probability
from trihedron.arrays import FloatArray, rms_of, sigmas_of
from trihedron.estimate.sessions.changes import DRIFT_DOF, bias_drift
from trihedron.estimate.sessions.numbers import numbers_with_covariance
from trihedron.invariants import Anchor, anchor_of, invariants
from trihedron.records import Calibration, Finding, Recording, Segments, SensorCalibration
from trihedron.records.diagnosis import RELATIVE
from trihedron.records.sessions import PARAMETERS
from trihedron.records.verification import JudgedParameter
from trihedron.sensor_model import in_frame
from trihedron.session.noise import NOISE_DOF
from trihedron.units import acceleration_to_si, rate_to_si

TOO_VAGUE = 10.0
"""A parameter is not judged where the log's uncertainty of it exceeds this many times the stated one."""
LISTED = 8
"""Most parameters that a finding lists."""


def judge_parameters(known: Calibration, own: Calibration | None, segments: Segments) -> tuple[JudgedParameter, ...]:
    """Differences (file less log) of parameters that do not depend on the frame, with both standard uncertainties.

    ``own`` is the calibration of the log itself, ``None`` where the log does not determine one: only the gyro bias is
    then judged, always by the mean of the poses. The log's uncertainty of a bias includes twice its drift between
    sessions (eq. 9.3), as in ``diagnose``: the file does not contain that of its own session.
    """
    numbers, covariance, anchor = numbers_with_covariance(known)
    n, sigma = len(numbers), sigmas_of(covariance)
    other, other_sigma = np.full(n, np.nan), np.full(n, np.inf)
    if own is not None:
        if (own.gyroscope is None) != (known.gyroscope is None):
            # Of one that only one side has nothing is compared.
            own, anchor = replace(own, gyroscope=None, covariance=own.covariance[:12, :12]), Anchor(anchor.signs, None)
        seen, covariance, _ = numbers_with_covariance(own, anchor)
        other[: len(seen)], other_sigma[: len(seen)] = seen, sigmas_of(covariance)
    if n > 9 and known.gyroscope is not None and segments.gyroscope_mean is not None:
        other[9:12], other_sigma[9:12] = _resting(known.gyroscope, segments.gyroscope_mean)
    drift = bias_drift(known if own is None else own, segments, n)
    other_sigma = np.sqrt(other_sigma**2 + 2.0 * drift)
    out = []
    for k, parameter in enumerate(PARAMETERS[:n]):
        apart = float(numbers[k] - other[k])
        vague = not np.isfinite(other[k]) or not np.isfinite(other_sigma[k])
        vague = vague or (sigma[k] > 0.0 and other_sigma[k] > TOO_VAGUE * sigma[k])
        out.append(
            JudgedParameter(
                id=parameter.id,
                name=parameter.name,
                unit=parameter.unit,
                # Scales are logarithms: their difference relative to the file.
                difference=-float(np.expm1(-apart)) if parameter.id in RELATIVE else apart,
                sigma_file=float(sigma[k]),
                sigma_log=float(other_sigma[k]),
                is_judged=not vague,
            )
        )
    return tuple(out)


def shifted_parameters(parameters: tuple[JudgedParameter, ...]) -> list[JudgedParameter]:
    """Parameters that differ by more than chance allows, the farthest first, where the file states uncertainties."""
    judged = [one for one in parameters if one.is_judged]
    if not judged or not any(one.sigma_file > 0.0 for one in parameters):
        return []
    chance = 1.0 - 0.5 * probability.FALSE_ALARM / len(judged)
    limits = [probability.stdtrit(2.0 * DRIFT_DOF if one.id.endswith("bias") else NOISE_DOF, chance) for one in judged]
    beyond = [one for one, limit in zip(judged, limits, strict=True) if abs(one.times_sigma) > limit]
    return sorted(beyond, key=lambda one: -abs(one.times_sigma))


SHARE = 0.05
"""Difference of a scale from the common one, relative to it, that is no change of its own."""


def common_factor(parameters: tuple[JudgedParameter, ...], name: str) -> float | None:
    """Relative change (log less file) that the scales ``name`` of all axes share; ``None`` without one.

    One factor on all axes of a gyro is that of a clock as well as of its sensitivity.
    """
    scales = [one for one in parameters if one.id == name and one.is_judged and one.sigma > 0.0]
    if len(scales) < len("xyz"):
        return None
    changes = np.array([-one.difference for one in scales])
    weights = np.array([one.sigma**-2 for one in scales])
    common = float(weights @ changes / weights.sum())
    if common**2 * weights.sum() < -2.0 * np.log(probability.FALSE_ALARM):
        return None
    apart = changes - common
    is_alike = np.max(np.abs(apart)) < SHARE * abs(common)
    is_alike |= probability.chdtrc(len(scales) - 1, float(weights @ apart**2)) > probability.FALSE_ALARM
    return common if is_alike else None


def shift_findings(parameters: tuple[JudgedParameter, ...]) -> Iterator[Finding]:
    """Finding with the parameters that differ by more than chance allows."""
    shifted = shifted_parameters(parameters)
    if not shifted:
        return
    others = sum(one.id != "gyro-bias" for one in shifted)
    amounts = [(-one.difference, one.sigma, one.unit) for one in shifted]
    named = [(f"{one.id}-{one.name}", amount, one.name) for one, amount in zip(shifted, amounts, strict=True)]
    yield Finding.of(
        "calibration-shift",
        "" if others else "gyro-bias-alone",
        parameters=named[:LISTED],
        first=named[0][0],
        n_others=others,
        n_parameters=len(shifted),
        n_judged=sum(one.is_judged for one in parameters),
        times_sigma=abs(shifted[0].times_sigma),
    )


def uncalibrated(known: Calibration, own: Calibration | None, recording: Recording) -> Calibration:
    """Calibration of ideal axes without bias, with the unit's nominal scale; for counts, the log's own mean scale."""
    accel = acceleration_to_si(recording.accelerometer_unit)
    gyro = rate_to_si(recording.gyroscope_unit)
    base = own or known
    if accel is None:
        accel = float(np.cbrt(abs(np.linalg.det(base.accelerometer.S))))
    sensors = [replace(known.accelerometer, S=accel * np.eye(3), b=np.zeros(3), covariance=np.zeros((12, 12)))]
    if known.gyroscope is not None:
        scale_of = (own.gyroscope if own is not None and own.gyroscope is not None else known.gyroscope).S
        if gyro is None:
            gyro = float(np.cbrt(abs(np.linalg.det(scale_of))))
        zero = np.zeros(3)
        turned = Anchor(np.ones(3), None)
        lower = in_frame(base, "lower")
        if lower.gyroscope is not None:
            turned = anchor_of(lower.accelerometer.S, lower.gyroscope.S)
        triad = np.eye(3) if turned.triad is None else turned.triad.T
        sensors.append(replace(known.gyroscope, S=gyro * triad, b=zero, covariance=np.zeros((12, 12))))
    n = 12 * len(sensors)
    return replace(
        known,
        accelerometer=sensors[0],
        gyroscope=sensors[1] if len(sensors) > 1 else None,
        covariance=np.zeros((n, n)),
        frame="case",
    )


def _resting(gyroscope: SensorCalibration, means: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean static rate along each axis [rad/s] (3,), and its standard uncertainty from the scatter of the poses."""
    k = np.exp(invariants(gyroscope.S, gyroscope.b).log_scale)
    rates = means / k
    n = len(rates)
    scatter = rates.std(axis=0, ddof=1) if n > 1 else np.full(3, np.inf)
    return rates.mean(axis=0), scatter / np.sqrt(n)


def imprecision_findings(error: FloatArray, angle_deg: FloatArray, own: Calibration | None) -> Iterator[Finding]:
    """Finding where errors within the stated uncertainty are larger than those of the log's own calibration, each pose
    and move predicted by the others: F test of the mean squares."""
    quality = {name: sensor.quality for name, sensor in (() if own is None else own.sensors) if sensor.quality}
    pairs = [(1, "static", error, quality["accelerometer"].held_out)] if "accelerometer" in quality else []
    if "gyroscope" in quality:
        pairs.append((2, "moves", angle_deg, quality["gyroscope"].held_out_angle_deg))
    for n_components, case, errors, held_out in pairs:
        held = np.zeros(0) if held_out is None else held_out[np.isfinite(held_out)]
        if len(errors) and held.any():
            times = rms_of(errors) / rms_of(held)
            p = probability.fdtrc(n_components * len(errors), n_components * len(held), times**2)
            if p < probability.FALSE_ALARM:
                yield Finding.of("calibration-imprecise", case, times=times, p=p)
