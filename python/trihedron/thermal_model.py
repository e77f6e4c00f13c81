"""S and b as functions of temperature, from a calibration of several recordings `--by temperature`.

Polynomials are evaluated inside their range, and clamped at its limits.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.invariants import Anchor, model_vector, numbers_of
from trihedron.records import Calibration, Finding, Recording, SensorCalibration
from trihedron.records.sessions import PARAMETERS
from trihedron.sensor_model import in_frame, reframing

KNOTS = 257
"""Number of temperatures of the range at which S and b are exact, linear between: the error for a cubic over the range
is 1e-5 of its total change."""
TOLERANCE_DEGC = 1.0
"""Excess over the range that the thermometer's resolution explains."""
ROWS = 1 << 17


def parameters_at(calibration: Calibration, degc: float) -> FloatArray:
    """(12,) or (24,) S row by row, then b, of each sensor at one temperature [°C], in the calibration's frame.

    The polynomials are ``calibration.extensions["thermal"]`` (docs/calibration-file.md).
    """
    thermal: Any = calibration.extensions["thermal"]
    signs = np.array(thermal["axis_signs"], dtype=np.float64)
    triad = None if thermal.get("triad") is None else np.array(thermal["triad"], dtype=np.float64)
    anchor = Anchor(signs, triad)
    base = in_frame(calibration, "lower")
    accel, gyro = base.accelerometer, base.gyroscope
    numbers = numbers_of(accel.S, accel.b, None if gyro is None else gyro.S, None if gyro is None else gyro.b, anchor)
    t = degc - float(thermal["reference_degc"])
    for term in thermal["terms"]:
        picked = [k for k, parameter in enumerate(PARAMETERS[: len(numbers)]) if parameter.id == term["id"]]
        if picked:
            coefficients = np.array(term["coefficients"], dtype=np.float64)
            numbers[picked] += (t ** np.arange(1, len(coefficients))) @ coefficients[1:]
    parameters = model_vector(numbers, anchor)
    if calibration.frame != "lower":
        # The frame is defined by the axes at this temperature, as at the reference temperature.
        turn = reframing(parameters[:9].reshape(3, 3), parameters[9:12], calibration.frame).rotation
        for first in range(0, len(parameters), 12):
            parameters[first : first + 9] = (turn @ parameters[first : first + 9].reshape(3, 3)).ravel()
            parameters[first + 9 : first + 12] = turn @ parameters[first + 9 : first + 12]
    return parameters


def check_range(calibration: Calibration, recording: Recording) -> tuple[Finding, ...]:
    """A serious finding where a log was recorded outside the temperatures that a calibration was made for.

    Raises ``InputError`` when the calibration's range is not two numbers.
    """
    stated = calibration.extensions.get("valid_range")
    if not isinstance(stated, Mapping) or "temperature_degc" not in stated:
        return ()
    try:
        low, high = (float(value) for value in stated["temperature_degc"])
    except (TypeError, ValueError):
        raise InputError("the calibration's valid_range is not two temperatures: calibrate again.") from None
    T = recording.temperature_degc
    if T is None or not np.isfinite(T).any():
        missing = Finding.of("temperature-missing", low_degc=low, high_degc=high)
        return (missing,) if "thermal" in calibration.extensions else ()
    known = T[np.isfinite(T)]
    outside = int(np.sum((known < low - TOLERANCE_DEGC) | (known > high + TOLERANCE_DEGC)))
    if outside == 0:
        return ()
    return (
        Finding.of(
            "outside-valid-range",
            ends_are_held="thermal" in calibration.extensions,
            n_outside=outside,
            n_samples=len(known),
            low_degc=low,
            high_degc=high,
            log_low_degc=known.min(),
            log_high_degc=known.max(),
        ),
    )


def at_reference(calibration: Calibration, recording: Recording) -> Recording:
    """The raw readings at the reference temperature that S(T), b(T) of every sample make of them; the recording itself
    where the calibration has no temperature model or the log no temperature.

    Outside the range S and b keep their values at its limits. Missing temperatures are interpolated.
    """
    T = recording.temperature_degc
    if not isinstance(calibration.extensions.get("thermal"), Mapping) or T is None or not np.isfinite(T).any():
        return recording
    low, high = (float(v) for v in calibration.extensions["valid_range"]["temperature_degc"])  # type: ignore[index]
    known = np.isfinite(T)
    whole = T if known.all() else np.interp(np.arange(len(T)), np.flatnonzero(known), T[known])
    knots = np.linspace(low, max(high, low + 1e-9), KNOTS)
    table = np.array([parameters_at(calibration, float(t)) for t in knots])
    return replace(
        recording,
        accelerometer=_followed(recording.accelerometer, calibration.accelerometer, (whole, knots, table[:, :12])),
        gyroscope=_followed(recording.gyroscope, calibration.gyroscope, (whole, knots, table[:, 12:])),
    )


def _followed(
    readings: FloatArray | None, sensor: SensorCalibration | None, followed: tuple[FloatArray, FloatArray, FloatArray]
) -> FloatArray | None:
    if readings is None or sensor is None:
        return readings
    degc, knots, table = followed
    of_reading = np.linalg.solve(sensor.S, table[:, :9].reshape(-1, 3, 3)).reshape(-1, 9)
    constant = np.linalg.solve(sensor.S, (table[:, 9:] - sensor.b).T)
    out = np.empty_like(readings)
    for start in range(0, len(readings), ROWS):
        rows = slice(start, start + ROWS)
        each = np.array([np.interp(degc[rows], knots, column) for column in (*of_reading.T, *constant)])
        out[rows] = np.einsum("ijn,nj->ni", each[:9].reshape(3, 3, -1), readings[rows]) + each[9:].T
    return out
