"""Errors about the input, separate from defects of the program: only the former may end in "was not calibrated".

A defect raises an ordinary ``ValueError`` of NumPy or Python and must stay visible as one; so must a record built
inconsistently by a stage (``records/segments.py``, the arrays of a calibration or of an Allan curve). Every error about
a file, a value or a request is an ``InputError``.
"""

from numpy.linalg import LinAlgError

from trihedron._core import InputError

__all__ = ["INPUT_ERRORS", "InputError"]

INPUT_ERRORS: tuple[type[ValueError], ...] = (InputError, LinAlgError)
"""Errors about the input; a singular system of equations is one of them, since the readings cause it."""
