"""Results as columns of a data frame: one row per parameter, pose, axis and term, or sample."""

import math
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.arrays import AXES
from trihedron.errors import InputError
from trihedron.records import PARAMETER_NAMES, Calibration, Noise, Recording, Segments, TermName, Verification
from trihedron.records.diagnosis import Diagnosis
from trihedron.records.sessions import SessionsModel
from trihedron.report.noise_units import PER_UNIT
from trihedron.report.segments import logged_sensors

Columns = dict[str, Sequence[Any] | npt.NDArray[Any]]


def made_by(library: str, columns: Columns) -> Any:
    """A data frame of polars or pandas.

    Raises
    ------
    ValueError
        When the library is another one, or not installed.
    """
    if library not in {"polars", "pandas"}:
        raise InputError(f"a data frame is made by 'polars' or 'pandas', not by {library!r}.")
    try:
        frames = import_module(library)
    except ModuleNotFoundError:
        raise InputError(f"{library} is not installed: pip install {library}.") from None
    # Copies: polars warns about read-only NumPy arrays, and both libraries then own the data.
    owned = {name: np.array(of) if isinstance(of, np.ndarray) else list(of) for name, of in columns.items()}
    return frames.DataFrame(owned)


def of_rows(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> Columns:
    """Columns of these names from rows, of which there may be none."""
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def recording_columns(recording: Recording) -> Columns:
    """A row per sample, units in the names."""
    columns: Columns = {"time_s": recording.time_s}
    for name, readings, unit in logged_sensors(recording):
        columns |= {f"{name}_{axis} [{unit}]": readings[:, k] for k, axis in enumerate(AXES)}
    for name in ("temperature_degc", "supply_v"):
        if (values := getattr(recording, name)) is not None:
            columns[name] = values
    return columns


def segments_columns(segments: Segments) -> Columns:
    """A row per pose: samples, duration, mean readings with standard errors in the unit of the log."""
    names = {"pose": "index", "start": "start", "stop": "stop"}
    columns: Columns = {key: [getattr(pose, name) for pose in segments.poses] for key, name in names.items()}
    columns |= {name: getattr(segments, name) for name in ("time_mid_s", "duration_s", "n_averaged")}
    columns["is_unsteady"] = [pose.is_unsteady for pose in segments.poses]
    for name in ("accelerometer_mean", "accelerometer_sigma_mean", "gyroscope_mean", "gyroscope_sigma_mean"):
        values = getattr(segments, name)
        if values is not None:
            columns |= {f"{name}_{axis}": values[:, k] for k, axis in enumerate(AXES)}
    return columns


def calibration_columns(calibration: Calibration) -> Columns:
    """A row per parameter of each sensor: value, standard error, unit."""
    rows = []
    for name, sensor in calibration.sensors:
        values = (*sensor.S.ravel(), *sensor.b)
        sigmas = (*sensor.sigma_S.ravel(), *sensor.sigma_b)
        for parameter, value, sigma in zip(PARAMETER_NAMES, values, sigmas, strict=True):
            unit = sensor.si_unit if parameter.startswith("b") else f"{sensor.si_unit} per {sensor.raw_unit}"
            rows.append((name, parameter, float(value), float(sigma), unit))
    return of_rows(("sensor", "parameter", "value", "sigma", "unit"), rows)


def verification_columns(verification: Verification) -> Columns:
    """A row per pose [m/s²] and per move [deg]: error, its σ by noise, and σ with the calibration's uncertainty."""
    v = verification
    rows = []
    poses = range(len(v.norm_error))
    for kind, unit, each in (
        ("pose", "m/s^2", zip(poses, v.norm_error, v.norm_noise, v.norm_sigma, strict=True)),
        ("move", "deg", zip(v.moves.tolist(), v.angle_deg, v.angle_noise_deg, v.angle_sigma_deg, strict=True)),
    ):
        rows += [(kind, k, *map(float, sizes), unit) for k, *sizes in each]
    return of_rows(("kind", "index", "error", "noise", "sigma", "unit"), rows)


def diagnosis_columns(diagnosis: Diagnosis) -> Columns:
    """A row per parameter of every accepted effect."""
    names = ("name", "value", "std", "unit")
    rows = [
        (effect.id, *(getattr(parameter, name) for name in names))
        for effect in diagnosis.effects
        for parameter in effect.parameters
    ]
    return of_rows(("effect", *names), rows)


def noise_columns(noise: Noise) -> Columns:
    """A row per axis and term: value (0 where absent), standard error, 95 % interval, unit."""
    rows = []
    for axis in noise.axes:
        for term in TermName:
            found, unit = axis.terms[term], f"{axis.unit}{PER_UNIT[term]}"
            sizes = (found.sigma, found.lower, found.upper)
            known = (math.nan if size is None else float(size) for size in sizes)
            rows.append((axis.name, term.value, found.is_present, found.value, *known, unit))
    return of_rows(("axis", "term", "is_present", "value", "sigma", "lower", "upper", "unit"), rows)


def sessions_columns(model: SessionsModel) -> Columns:
    """A row per parameter: common value, standard error, spreads with their intervals (SI)."""
    columns: dict[str, list[Any]] = {
        name: [getattr(one.parameter, name) for one in model.repeated] for name in ("id", "name", "unit")
    }
    columns |= {name: [getattr(one, name) for one in model.repeated] for name in ("value", "std")}
    for kind in ("within", "between"):
        for part in ("sd", "low", "high"):
            columns[f"{kind}_{part}"] = [getattr(getattr(one, kind), part, None) for one in model.repeated]
    return dict(columns)
