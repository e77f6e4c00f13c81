"""A recording of arrays, audited like a log."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.api.reading import read
from trihedron.arrays import AXES
from trihedron.read import ReadError
from trihedron.records import Recording
from trihedron.records.checked import WrongTypeError, number_of
from trihedron.report.in_python import asked_in_python
from trihedron.units import AccelerationUnit, RateUnit


def of_arrays(
    time_s: npt.ArrayLike | None,
    accelerometer: npt.ArrayLike | None,
    gyroscope: npt.ArrayLike | None,
    *,
    accelerometer_unit: str | AccelerationUnit,
    gyroscope_unit: str | RateUnit,
    rate_hz: float | None,
    temperature_degc: npt.ArrayLike | None,
    supply_v: npt.ArrayLike | None,
) -> Recording:
    """See :meth:`trihedron.Recording.from_arrays`."""
    if time_s is None and rate_hz is None:
        raise ReadError("from_arrays needs time_s (n,) in seconds, or rate_hz where the samples are evenly spaced.")
    if accelerometer is None and gyroscope is None:
        raise ReadError("from_arrays needs accelerometer (n, 3) or gyroscope (n, 3).")
    for name, given in (
        *(("time_s", time_s), ("accelerometer", accelerometer), ("gyroscope", gyroscope)),
        *(("temperature_degc", temperature_degc), ("supply_v", supply_v)),
    ):
        _check_even(name, given)
    if rate_hz is not None:
        number_of("rate_hz", rate_hz)
    if time_s is not None and np.ndim(time_s) != 1:
        raise ReadError(f"time_s must have shape (n,), got {np.shape(time_s)}.")
    columns: dict[str, Any] = {} if time_s is None else {"time [s]": time_s}
    mapping = ["time=time [s]"] if time_s is not None else ["time=none"]
    for name, letter, readings in (("accelerometer", "a", accelerometer), ("gyroscope", "g", gyroscope)):
        if readings is None:
            continue
        array: Any = np.ma.asanyarray(readings)
        if array.ndim != 2 or array.shape[1] != 3:
            raise ReadError(f"{name} must have shape (n, 3), got {array.shape}.")
        columns |= {f"{name} {axis}": array[:, k] for k, axis in enumerate(AXES)}
        mapping += [f"{letter}{axis}={name} {axis}" for axis in AXES]
    for name, role, values in (("temperature", "temperature", temperature_degc), ("supply", "supply", supply_v)):
        if values is not None:
            columns[name] = values
            mapping.append(f"{role}={name}")
    # Wrapped here: a class method does not go through the argument checks of the package's functions.
    recording: Recording = asked_in_python(read)(
        columns,
        columns=",".join(mapping),
        rate_hz=rate_hz,
        accelerometer_unit=None if accelerometer is None else accelerometer_unit,
        gyroscope_unit=None if gyroscope is None else gyroscope_unit,
    )
    return recording


def _check_even(name: str, given: Any) -> None:
    try:
        np.ma.asanyarray(given)
    except (TypeError, ValueError):
        raise WrongTypeError(f"{name} is an array of numbers, and its rows have different lengths.") from None
