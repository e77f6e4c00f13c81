"""Calibrations in the file formats of other programs: written with their equation stated, and in most cases read.

Programs differ in the direction of the matrices: some store raw → true, some true → raw, some subtract the bias before
the matrix and some after it. The ``FORMATS`` of every module are found automatically. Writers are
tested by evaluating the target's equation, readers as the inverse of their writers.
"""

import os
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from trihedron.documents import read_text
from trihedron.errors import InputError
from trihedron.files.calibration import FORMAT as OWN
from trihedron.files.calibration import CalibrationFileError, read_calibration
from trihedron.files.formats.contract import ExportOptions as ExportOptions
from trihedron.files.formats.contract import Format, given
from trihedron.files.formats.contract import NoiseFigure as NoiseFigure
from trihedron.files.formats.contract import SensorNoise as SensorNoise
from trihedron.files.plausible import require_plausible
from trihedron.folders import modules_of
from trihedron.records import Calibration
from trihedron.sanitise import escaped


@cache
def formats() -> dict[str, Format]:
    """Every format by name."""
    found = [one for module in modules_of(__name__, __path__) for one in getattr(module, "FORMATS", ())]
    return {one.name: one for one in sorted(found, key=lambda one: one.name)}


def targets() -> list[str]:
    """Names of the formats in which a calibration can be written."""
    return list(formats())


def needs(one: Format) -> list[str]:
    """The options that a format requires, from the error that its writer raises without them."""
    identity = (np.eye(3), np.zeros(3))
    example = given("trihedron", {"accelerometer": identity, "gyroscope": identity})
    try:
        one.write(example, ExportOptions())
    except InputError as error:
        return list(dict.fromkeys(re.findall(r"--(?:noise|rate|current-parameters)", str(error))))
    return []


def export_files(calibration: Calibration, target: str, options: ExportOptions | None = None) -> dict[str, str]:
    """A calibration for ``target``, one of :func:`targets`: text by file name ending; ``""`` where there is one file.

    Raises ``InputError`` when the target is unknown, the calibration is not plausible, or it cannot be expressed in
    that convention.
    """
    one = formats().get(target)
    if one is None:
        raise InputError(f"there is no export to {target!r}; there are {', '.join(targets())}.")
    made = one.write(require_plausible(calibration), options or ExportOptions())
    texts = {"": made} if isinstance(made, str) else made
    # The texts contain file names, which may contain control characters.
    return {ending: escaped(text) for ending, text in texts.items()}


def any_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration file of trihedron or of another program; its format is recognised by content.

    Raises ``InputError`` when the file is missing or its format is not supported.
    """
    path = Path(path)
    text = read_text(path, "calibration file", CalibrationFileError)
    if f'"{OWN}"' in text:
        return read_calibration(path)
    try:
        found = _recognised(text, path)
    except InputError as error:
        raise CalibrationFileError(f"{path}: {error}") from None
    # An unrecognised file is a damaged own file or no calibration: the own reader reports which.
    return found or read_calibration(path)


def is_calibration(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a calibration, and not a log."""
    path = Path(path)
    try:
        text = read_text(path, "calibration file")
    except InputError:
        return False
    try:
        return f'"{OWN}"' in text or _recognised(text, path) is not None
    except InputError:
        # Another program's file without readings to correct: reading it as a calibration reports that.
        return True


LARGEST = 4_000_000
"""Characters, ten times those of a large calibration file; a longer file is a log."""


def _whole(text: str, path: Path, one: Format) -> str:
    """The text, joined with that of the other sensor's file where a format writes one file per sensor."""
    if one.pair is None or one.pair[0] not in path.name:
        return text
    beside = path.with_name(path.name.replace(*one.pair))
    return f"{text}\f{read_text(beside, 'calibration file')}" if beside.is_file() else text


def _recognised(text: str, path: Path) -> Calibration | None:
    if len(text) > LARGEST:
        return None
    for one in formats().values():
        found = None if one.read is None else one.read(_whole(text, path, one))
        if found is not None:
            return replace(found, recording_source=f"{path.name} ({one.name})")
    return None
