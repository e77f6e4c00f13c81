"""What is refused on purpose, told from what goes wrong: only the former may end in "was not calibrated".

A wrong shape or a wrong key in the program raises a ``ValueError`` of NumPy or Python, and is to be seen as the defect
that it is; so does a record of a stage's own making (``records/segments.py``, the arrays of a calibration or of an
Allan curve) that does not fit together. Every other refusal, of a file, a value or a question, is a ``RefusedError``.
"""

from __future__ import annotations

from numpy.linalg import LinAlgError

from trihedron._core import RefusedError

__all__ = ["REFUSALS", "RefusedError"]

REFUSALS: tuple[type[ValueError], ...] = (RefusedError, LinAlgError)
"""A system that readings leave singular is their answer too."""
