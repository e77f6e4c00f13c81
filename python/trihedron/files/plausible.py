"""Plausibility checks of a calibration from any file, before its numbers are used."""

import numpy as np

from trihedron.errors import InputError
from trihedron.records import Calibration

LARGEST_CONDITION = 100.0
"""Largest condition number of S with unit columns: two axes 0.6 degrees apart. A larger one is a mistake."""

LARGEST_SI_FACTOR = 5.0
"""Largest scale (or 1/scale) where raw and true unit are the same: deg for rad is a factor of 57, g for m/s^2 of 10."""

LARGEST_NUMBER = 1e12
"""Largest element of S and b in SI; no sensor has it, and single precision overflows beyond 1e38."""

ROUNDING = 1e-9
"""Negative eigenvalue, per column, of a correlation matrix that counts as rounding error."""


def require_plausible(calibration: Calibration) -> Calibration:
    """The calibration, if it is plausible for a sensor.

    Raises ``InputError`` when S is (nearly) singular, a scale is wrong by the factor of a unit, a number is larger
    than any sensor's, or a covariance is invalid (a negative variance, correlations beyond one).
    """
    for name, sensor in calibration.sensors:
        largest = max(float(np.abs(sensor.S).max()), float(np.abs(sensor.b).max()))
        if not largest < LARGEST_NUMBER:
            raise InputError(f"the {name} contains {largest:.3g} among S and b: the file is damaged; calibrate again.")
        lengths = np.linalg.norm(sensor.S, axis=0)
        if not np.all(lengths > 0.0) or np.linalg.cond(sensor.S / lengths) > LARGEST_CONDITION:
            raise InputError(
                f"the {name}'s S is singular or nearly so (two of its axes are parallel): this is no sensor's "
                "calibration; calibrate again with more poses."
            )
        if sensor.raw_unit == sensor.si_unit:
            sizes = np.linalg.svd(sensor.S, compute_uv=False)
            if sizes[0] > LARGEST_SI_FACTOR or sizes[-1] < 1.0 / LARGEST_SI_FACTOR:
                raise InputError(
                    f"the {name}'s S turns {sensor.raw_unit} into {sensor.si_unit} by a factor of "
                    f"{sizes[0] if sizes[0] > LARGEST_SI_FACTOR else sizes[-1]:.3g}: the unit of the readings was "
                    "mistaken; calibrate again with their unit said."
                )
        _require_covariance(name, sensor.covariance)
    _require_covariance("whole", calibration.covariance)
    return calibration


def has_one_handedness(calibration: Calibration) -> bool:
    """Whether both triads are right-handed or both left-handed; one part rarely mixes them."""
    signs = {bool(np.linalg.det(sensor.S) > 0.0) for _, sensor in calibration.sensors}
    return len(signs) < 2


def _require_covariance(name: str, covariance: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> None:
    variance = np.diag(covariance)
    if np.any(variance < 0.0):
        raise InputError(f"the {name} covariance has a negative variance: the file is damaged; calibrate again.")
    known = variance > 0.0
    sigma = np.sqrt(variance[known])
    correlation = covariance[np.ix_(known, known)] / np.outer(sigma, sigma)
    if known.any() and np.linalg.eigvalsh(correlation)[0] < -ROUNDING * len(sigma):
        raise InputError(
            f"the {name} covariance is none (its correlations contradict one another): the file is damaged; "
            "calibrate again."
        )
