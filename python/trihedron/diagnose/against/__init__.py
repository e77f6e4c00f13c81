"""A given model held against what the recording says of itself: numbers first, physics on top of them."""

from trihedron.diagnose.against.as_read import as_read
from trihedron.diagnose.against.fitted import FittedModel, model_of_calibration, model_of_diagnosis
from trihedron.diagnose.against.mechanisms import FREE_CURVES, compare_effects, left_open_by
from trihedron.diagnose.against.numbers import compare_numbers

__all__ = [
    "FREE_CURVES",
    "FittedModel",
    "as_read",
    "compare_effects",
    "compare_numbers",
    "left_open_by",
    "model_of_calibration",
    "model_of_diagnosis",
]
