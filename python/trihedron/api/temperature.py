"""Temperature when a calibration is applied: polynomials followed inside their range, and the range enforced."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.records import Calibration, Finding, FindingCode, Recording
from trihedron.thermal_model import parameters_at

KNOTS = 257
"""S and b are exact at so many temperatures of the range and linear between: a cubic over the whole range is followed
to 1e-5 of its swing."""
TOLERANCE_DEGC = 1.0
"""Beyond the range by less is the thermometer's resolution, not another temperature."""
ROWS = 1 << 17


def check_range(calibration: Calibration, recording: Recording) -> tuple[Finding, ...]:
    """A serious finding where a log was recorded outside the temperatures that a calibration was made for.

    Raises
    ------
    ValueError
        When the calibration's range is not two numbers.
    """
    stated = calibration.extensions.get("valid_range")
    if not isinstance(stated, Mapping) or "temperature_degc" not in stated:
        return ()
    try:
        low, high = (float(value) for value in stated["temperature_degc"])
    except (TypeError, ValueError):
        raise RefusedError("the calibration's valid_range is not two temperatures: calibrate again.") from None
    T = recording.temperature_degc
    if T is None or not np.isfinite(T).any():
        return (_missing(low, high),) if "thermal" in calibration.extensions else ()
    known = T[np.isfinite(T)]
    outside = int(np.sum((known < low - TOLERANCE_DEGC) | (known > high + TOLERANCE_DEGC)))
    if outside == 0:
        return ()
    return (
        Finding.of(
            FindingCode.OUTSIDE_VALID_RANGE,
            ends_are_held="thermal" in calibration.extensions,
            n_outside=outside,
            n_samples=len(known),
            low_degc=low,
            high_degc=high,
            log_low_degc=known.min(),
            log_high_degc=known.max(),
        ),
    )


def _missing(low: float, high: float) -> Finding:
    return Finding.of(FindingCode.TEMPERATURE_MISSING, low_degc=low, high_degc=high)


def thermally_corrected(
    calibration: Calibration, recording: Recording
) -> tuple[FloatArray | None, FloatArray | None] | None:
    """Specific force and rate (n, 3) by S(T), b(T) of every sample; ``None`` where the calibration does not follow
    temperature or the log has none.

    Outside the range the ends are held. Samples without a temperature take that between their neighbours.
    """
    thermal = calibration.extensions.get("thermal")
    T = recording.temperature_degc
    if not isinstance(thermal, Mapping) or T is None or not np.isfinite(T).any():
        return None
    low, high = (float(v) for v in calibration.extensions["valid_range"]["temperature_degc"])  # type: ignore[index]
    known = np.isfinite(T)
    whole = T if known.all() else np.interp(np.arange(len(T)), np.flatnonzero(known), T[known])
    knots = np.linspace(low, max(high, low + 1e-9), KNOTS)
    table = np.array([parameters_at(calibration, float(t)) for t in knots])
    place = (np.clip(whole, low, high) - low) / (knots[1] - knots[0])
    return (
        _followed(recording.accelerometer, table[:, :12], place),
        _followed(recording.gyroscope, table[:, 12:], place) if table.shape[1] == 24 else None,
    )


def _followed(readings: FloatArray | None, table: FloatArray, place: FloatArray) -> FloatArray | None:
    if readings is None:
        return None
    out = np.empty_like(readings)
    for start in range(0, len(readings), ROWS):
        rows = slice(start, start + ROWS)
        below = np.minimum(np.floor(place[rows]).astype(np.int64), len(table) - 2)
        share = (place[rows] - below)[:, None]
        parameters = (1.0 - share) * table[below] + share * table[below + 1]
        S = parameters[:, :9].reshape(-1, 3, 3)
        out[rows] = np.einsum("nij,nj->ni", S, readings[rows]) + parameters[:, 9:]
    return out
