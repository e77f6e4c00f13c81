"""The calibration file: JSON that states its equation, direction, units and uncertainty (docs/calibration-file.md).

Numbers are written with all digits, so that reading a file returns exactly what was written. A file is checked against
the schema in the package before any of its content is used.
"""

from __future__ import annotations

import json
import math
import os
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.documents import read_json
from trihedron.errors import InputError
from trihedron.files.output import write_whole
from trihedron.records import PARAMETER_NAMES, Calibration, Finding, FitQuality, Observability, SensorCalibration
from trihedron.records.diagnosis import Diagnosis
from trihedron.records.plain import as_plain, from_plain
from trihedron.sanitise import escaped_json

FORMAT = "trihedron calibration"
FORMAT_VERSION = 1

EQUATION = "truth = S * raw + b"
DIRECTION = (
    "raw to true: multiply the raw reading (column of three, in raw_unit) by S, row by row, then add b; the result "
    "is in si_unit, in the body frame. S is not to be inverted and b is not to be subtracted. Both sensors share one "
    "body frame."
)
FRAME_MEANING = {
    "lower": "X of the body frame lies along accelerometer X, Y in the plane of accelerometer X and Y; S of the "
    "accelerometer is lower-triangular",
    "symmetric": "the body frame nearest to the accelerometer's axes; S of the accelerometer is symmetric",
    "case": "axes normal to three faces of the case; S is full",
}


class CalibrationFileError(InputError):
    """A calibration file that cannot be read. One sentence: which file, what is wrong, what to do."""


def write_calibration(calibration: Calibration, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a calibration file in one step; an existing file is replaced only with ``overwrite``.

    Raises
    ------
    OutputError
        (a ``ValueError``) when the file exists or cannot be written.
    """
    write_whole(path, calibration_text(calibration), overwrite=overwrite)


def read_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read and check a calibration file.

    Parameters
    ----------
    path : file
        JSON as ``write_calibration`` writes it.

    Returns
    -------
    Calibration
        The calibration that ``write_calibration`` or the command wrote, to the last bit.

    Raises
    ------
    CalibrationFileError
        When the file is missing, is not JSON, is not a calibration, or is of a newer format than this version reads.

    Examples
    --------
    >>> trihedron.write_calibration(result, "calibration.json", overwrite=True)
    >>> trihedron.read_calibration("calibration.json").gyroscope.si_unit
    'rad/s'
    """
    path = Path(path)
    meant = "name a calibration file (`trihedron calibrate LOG -o calibration.json`); it comes before the log"
    document = read_json(path, "calibration file", meant, CalibrationFileError)
    return calibration_from_document(document, str(path))


def calibration_text(calibration: Calibration) -> str:
    """The content of a calibration file."""
    return escaped_json(_folded(calibration_document(calibration))) + "\n"


def calibration_document(calibration: Calibration) -> dict[str, Any]:
    """A calibration as plain JSON types.

    Raises ``InputError`` when a sensor's covariance differs from its block of the full one: the file stores each
    number once.
    """
    sensors = {"accelerometer": calibration.accelerometer, "gyroscope": calibration.gyroscope}
    for k, (name, sensor) in enumerate(sensors.items()):
        if sensor is None:
            continue
        block = calibration.covariance[12 * k : 12 * k + 12, 12 * k : 12 * k + 12]
        if not np.array_equal(block, sensor.covariance):
            raise InputError(f"the {name}'s covariance is not its block of the full covariance")
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "written_by": written_by(),
        "equation": EQUATION,
        "direction": DIRECTION,
        "frame": calibration.frame,
        "frame_meaning": FRAME_MEANING[calibration.frame],
        "gravity_m_s2": calibration.gravity_m_s2,
        "gravity_source": calibration.gravity_source,
        "averaging": calibration.averaging,
        "is_trustworthy": calibration.is_trustworthy,
        "accelerometer": _sensor_document(calibration.accelerometer),
        "gyroscope": None if calibration.gyroscope is None else _sensor_document(calibration.gyroscope),
        "parameter_order": _parameter_order(calibration.gyroscope is not None),
        "covariance": plain(calibration.covariance),
        "findings": [finding.to_dict() for finding in calibration.findings],
        "recording": {"source": calibration.recording_source, "sha256": calibration.recording_sha256},
        "extensions": plain(dict(calibration.extensions)),
    }


def calibration_from_document(document: object, source: str = "document") -> Calibration:
    """The calibration in a document; ``source`` is its name in error messages.

    Raises ``InputError`` when it does not follow the schema or its content is invalid.
    """
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise CalibrationFileError(
            f"{source}: this JSON is not a calibration; `trihedron calibrate LOG -o calibration.json` writes one."
        )
    stated = document.get("format_version")
    if isinstance(stated, int) and stated > FORMAT_VERSION:
        raise CalibrationFileError(
            f"{source}: written in format {stated}, this version reads up to {FORMAT_VERSION}; update trihedron."
        )
    complaint = violation(document, "calibration")
    if complaint:
        raise CalibrationFileError(
            f"{source}: does not follow the calibration schema ({complaint}); the file was changed by hand or damaged."
        )
    if document["equation"] != EQUATION:
        raise CalibrationFileError(
            f"{source}: states the equation {document['equation']!r}, not {EQUATION!r}; convert S and b to it first."
        )
    try:
        return _from_checked(document)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise CalibrationFileError(f"{source}: {error}; the file was changed by hand or damaged.") from None


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of a kind of document."""
    text = files("trihedron.files").joinpath("schema", f"{kind}.schema.json").read_text(encoding="utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


def violation(document: object, kind: str) -> str:
    """Where and how a document violates the schema of its kind; empty when it follows it."""
    # Imported here because the import takes longer than reading the file.
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    error = best_match(Draft202012Validator(schema_of(kind)).iter_errors(document))
    if error is None:
        return ""
    place = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in error.absolute_path).lstrip(".")
    return f"{place or 'the document'}: {error.message[:120]}"


def plain(value: Any) -> Any:
    """Arrays, tuples and mappings as JSON types; a number that is not finite becomes ``null``."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict | MappingProxyType):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if value is None or isinstance(value, str | int | bool):
        return value
    raise TypeError(f"{type(value).__name__} has no place in a calibration file")


def _parameter_order(has_gyroscope: bool) -> list[str]:
    sensors = ("accelerometer", "gyroscope") if has_gyroscope else ("accelerometer",)
    return [f"{sensor}.{parameter}" for sensor in sensors for parameter in PARAMETER_NAMES]


def written_by() -> str:
    """Name and version of the program."""
    try:
        return f"trihedron {version('trihedron')}"
    except PackageNotFoundError:
        return "trihedron (not installed)"


def _sensor_document(sensor: SensorCalibration) -> dict[str, Any]:
    return {
        "S": plain(sensor.S),
        "b": plain(sensor.b),
        "sigma_S": plain(sensor.sigma_S),
        "sigma_b": plain(sensor.sigma_b),
        "raw_unit": sensor.raw_unit,
        "si_unit": sensor.si_unit,
        "method": sensor.method,
        "residuals": None if sensor.quality is None else plain(as_plain(sensor.quality)),
        "observability": None if sensor.observability is None else plain(as_plain(sensor.observability)),
    }


def _sensor(document: dict[str, Any], covariance: FloatArray) -> SensorCalibration:
    quality, observability = document["residuals"], document["observability"]
    if observability is not None and observability["condition"] is None:
        observability = {**observability, "condition": math.inf}
    return SensorCalibration(
        S=np.array(document["S"]),
        b=np.array(document["b"]),
        covariance=covariance,
        raw_unit=document["raw_unit"],
        si_unit=document["si_unit"],
        method=document["method"],
        quality=None if quality is None else from_plain(quality, FitQuality),
        observability=None if observability is None else from_plain(observability, Observability),
    )


def _from_checked(document: dict[str, Any]) -> Calibration:
    covariance = np.array(document["covariance"], dtype=np.float64)
    if document["parameter_order"] != _parameter_order(document["gyroscope"] is not None):
        raise InputError("parameter_order is not S row by row, then b, accelerometer first")
    n = 12 if document["gyroscope"] is None else 24
    if covariance.shape != (n, n):
        raise InputError(f"covariance must be {n} x {n}, got {' x '.join(map(str, covariance.shape))}")
    return Calibration(
        accelerometer=_sensor(document["accelerometer"], covariance[:12, :12]),
        gyroscope=None if n == 12 else _sensor(document["gyroscope"], covariance[12:, 12:]),
        covariance=covariance,
        frame=document["frame"],
        gravity_m_s2=document["gravity_m_s2"],
        gravity_source=document["gravity_source"],
        recording_source=document["recording"]["source"],
        recording_sha256=document["recording"]["sha256"],
        findings=tuple(from_plain(finding, Finding) for finding in document["findings"]),
        extensions=MappingProxyType(document["extensions"]),
        averaging=document.get("averaging", 0.0),
    )


def _folded(value: Any, indent: str = "") -> str:
    """JSON with one line per row of numbers, so that a matrix is readable."""
    inner = indent + "  "
    if isinstance(value, dict) and value:
        items = (f"{inner}{json.dumps(key)}: {_folded(item, inner)}" for key, item in value.items())
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, list | dict) for item in value):
        return "[\n" + ",\n".join(inner + _folded(item, inner) for item in value) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """A diagnosis as plain JSON types, valid against the schema; a number that is not finite is ``null``.

    Raises ``InputError`` when it does not follow the schema: a defect of this program.
    """
    document: dict[str, Any] = plain(diagnosis.to_dict())
    complaint = violation(document, "diagnosis")
    if complaint:
        raise InputError(f"this diagnosis does not follow its own schema ({complaint}); please report this.")
    return document
