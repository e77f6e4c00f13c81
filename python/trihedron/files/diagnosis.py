"""The diagnosis as JSON, checked against the schema in the package (docs/diagnosis.md)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from trihedron.documents import read_json
from trihedron.errors import InputError
from trihedron.files.calibration import plain, violation
from trihedron.records.diagnosis import SCHEMA_VERSION, Diagnosis


class DiagnosisFileError(InputError):
    """A diagnosis that cannot be read. One sentence: which file, what is wrong, what to do."""


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """A diagnosis as plain JSON types, valid against the schema; a number that is not finite is ``null``.

    Raises ``InputError`` when it does not follow the schema: a defect of this program.
    """
    document: dict[str, Any] = plain(diagnosis.to_dict())
    complaint = violation(document, "diagnosis")
    if complaint:
        raise InputError(f"this diagnosis does not follow its own schema ({complaint}); please report this.")
    return document


def read_diagnosis(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read and check a diagnosis written by ``trihedron diagnose --json``.

    Raises ``InputError`` when the file is missing, is no JSON, or does not follow the schema.
    """
    path = Path(path)
    meant = "name a file written by `trihedron diagnose --json`"
    document = read_json(path, "diagnosis", meant, DiagnosisFileError)
    if not isinstance(document, dict) or "verdict" not in document:
        raise DiagnosisFileError(
            f"{path}: this JSON is not a diagnosis; name a file written by `trihedron diagnose --json`."
        )
    version = document.get("schema_version")
    if isinstance(version, int) and version != SCHEMA_VERSION:
        raise DiagnosisFileError(
            f"{path}: written in schema {version}, this version reads {SCHEMA_VERSION}; diagnose the log again."
        )
    complaint = violation(document, "diagnosis")
    if complaint:
        raise DiagnosisFileError(
            f"{path}: does not follow the diagnosis schema ({complaint}); it was changed or damaged."
        )
    return document
