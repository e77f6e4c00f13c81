"""Results as columns of a data frame: one row per parameter, pose, axis and term, or sample."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.arrays import AXES
from trihedron.errors import RefusedError
from trihedron.records import (
    PARAMETER_NAMES,
    AllanCurve,
    Calibration,
    Noise,
    Recording,
    Segments,
    TermName,
    Verification,
)
from trihedron.records.diagnosis import Diagnosis
from trihedron.report.noise_units import PER_UNIT

Columns = dict[str, Sequence[Any] | npt.NDArray[Any]]


def made_by(library: str, columns: Columns) -> Any:
    """A data frame of polars or pandas.

    Raises
    ------
    ValueError
        When the library is another one, or not installed.
    """
    if library not in {"polars", "pandas"}:
        raise RefusedError(f"a data frame is made by 'polars' or 'pandas', not by {library!r}.")
    from importlib import import_module

    try:
        frames = import_module(library)
    except ModuleNotFoundError:
        raise RefusedError(f"{library} is not installed: pip install {library}.") from None
    # Copies: polars warns about read-only NumPy arrays, and both libraries then own the data.
    owned = {
        name: np.array(values) if isinstance(values, np.ndarray) else list(values) for name, values in columns.items()
    }
    return frames.DataFrame(owned)


def of_rows(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> Columns:
    """Columns of these names from rows, of which there may be none."""
    return {name: [row[name] for row in rows] for name in names}


def recording_columns(recording: Recording) -> Columns:
    """A row per sample, units in the names."""
    columns: Columns = {"time_s": recording.time_s}
    for name, readings, unit in (
        ("accelerometer", recording.accelerometer, recording.accelerometer_unit.value),
        ("gyroscope", recording.gyroscope, recording.gyroscope_unit.value),
    ):
        if readings is not None:
            columns |= {f"{name}_{axis} [{unit}]": readings[:, k] for k, axis in enumerate(AXES)}
    if recording.temperature_degc is not None:
        columns["temperature_degc"] = recording.temperature_degc
    if recording.supply_v is not None:
        columns["supply_v"] = recording.supply_v
    return columns


def segments_columns(segments: Segments) -> Columns:
    """A row per pose: samples, duration, mean readings with standard errors in the unit of the log."""
    columns: Columns = {
        "pose": [pose.index for pose in segments.poses],
        "start": [pose.start for pose in segments.poses],
        "stop": [pose.stop for pose in segments.poses],
        "time_mid_s": segments.time_mid_s,
        "duration_s": segments.duration_s,
        "n_averaged": segments.n_averaged,
        "is_unsteady": [pose.is_unsteady for pose in segments.poses],
    }
    for name in ("accelerometer_mean", "accelerometer_sigma_mean", "gyroscope_mean", "gyroscope_sigma_mean"):
        values = getattr(segments, name)
        if values is not None:
            columns |= {f"{name}_{axis}": values[:, k] for k, axis in enumerate(AXES)}
    return columns


def calibration_columns(calibration: Calibration) -> Columns:
    """A row per parameter of each sensor: value, standard error, unit."""
    rows = []
    for name, sensor in (("accelerometer", calibration.accelerometer), ("gyroscope", calibration.gyroscope)):
        if sensor is None:
            continue
        values = (*sensor.S.ravel(), *sensor.b)
        sigmas = (*sensor.sigma_S.ravel(), *sensor.sigma_b)
        for parameter, value, sigma in zip(PARAMETER_NAMES, values, sigmas, strict=True):
            unit = sensor.si_unit if parameter.startswith("b") else f"{sensor.si_unit} per {sensor.raw_unit}"
            row = {"sensor": name, "parameter": parameter, "value": float(value), "sigma": float(sigma), "unit": unit}
            rows.append(row)
    return of_rows(rows, ("sensor", "parameter", "value", "sigma", "unit"))


def verification_columns(verification: Verification) -> Columns:
    """A row per pose [m/s²] and per move [deg]: error, its σ by noise, and σ with the calibration's uncertainty."""
    v = verification
    rows = []
    poses = range(len(v.norm_error))
    for kind, unit, told in (
        ("pose", "m/s^2", zip(poses, v.norm_error, v.norm_noise, v.norm_sigma, strict=True)),
        ("move", "deg", zip(v.moves.tolist(), v.angle_deg, v.angle_noise_deg, v.angle_sigma_deg, strict=True)),
    ):
        for k, error, noise, sigma in told:
            row = {"kind": kind, "index": k, "error": float(error), "noise": float(noise), "sigma": float(sigma)}
            rows.append({**row, "unit": unit})
    return of_rows(rows, ("kind", "index", "error", "noise", "sigma", "unit"))


def diagnosis_columns(diagnosis: Diagnosis) -> Columns:
    """A row per parameter of every accepted effect."""
    rows = [
        {"effect": effect.id, **parameter.to_dict()} for effect in diagnosis.effects for parameter in effect.parameters
    ]
    names = list(rows[0]) if rows else ["effect", "name", "value", "std", "unit"]
    return of_rows(rows, names)


def noise_columns(noise: Noise) -> Columns:
    """A row per axis and term: value (0 where absent), standard error, 95 % interval, unit."""
    rows = []
    for axis in noise.axes:
        for term in TermName:
            found = axis.terms[term]
            rows.append(
                {
                    "axis": axis.name,
                    "term": term.value,
                    "is_present": found.is_present,
                    "value": found.value,
                    "sigma": _finite(found.sigma),
                    "lower": _finite(found.lower),
                    "upper": _finite(found.upper),
                    "unit": f"{axis.unit}{PER_UNIT[term]}",
                }
            )
    return of_rows(rows, ("axis", "term", "is_present", "value", "sigma", "lower", "upper", "unit"))


def curve_columns(curve: AllanCurve) -> Columns:
    """A row per averaging time and channel: deviation with its interval."""
    k, channels = len(curve.clusters), curve.n_channels
    columns: Columns = {
        "channel": [name for name in curve.names for _ in range(k)],
        "tau_s": np.tile(curve.tau_s, channels),
        "cluster": np.tile(curve.clusters, channels),
    }
    for name in ("deviation", "lower", "upper", "edf"):
        columns[name] = getattr(curve, name).reshape(k, -1).T.ravel()
    columns["unit"] = [unit for unit in curve.units for _ in range(k)]
    return columns


def _finite(value: float | None) -> float:
    return math.nan if value is None else float(value)
