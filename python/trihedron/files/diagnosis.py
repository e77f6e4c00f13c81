"""The diagnosis as JSON, checked against the schema in the package (docs/diagnosis.md)."""

from typing import Any

from trihedron.errors import InputError
from trihedron.files.calibration import plain, violation
from trihedron.records.diagnosis import Diagnosis


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """A diagnosis as plain JSON types, valid against the schema; a number that is not finite is ``null``.

    Raises ``InputError`` when it does not follow the schema: a defect of this program.
    """
    document: dict[str, Any] = plain(diagnosis.to_dict())
    complaint = violation(document, "diagnosis")
    if complaint:
        raise InputError(f"this diagnosis does not follow its own schema ({complaint}); please report this.")
    return document
