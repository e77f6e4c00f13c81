"""A given calibration whose errors in a log are within its uncertainty, yet far above the noise of the log."""

from collections.abc import Mapping

import numpy as np

from trihedron.arrays import TINY, rms_of
from trihedron.records import Verification
from trihedron.records.diagnosis import Diagnosis
from trihedron.report.names import MEANING
from trihedron.report.numbers import listed, plain_number

FAR_ABOVE = 3.0
"""Error over noise alone from which "within uncertainty" says more of the uncertainty than of the sensor."""


def imprecise_in_verification(v: Verification) -> str:
    """How many times noise alone the errors are, where far above it; else empty."""
    pairs = [("static-accel", v.norm_error, v.norm_noise), ("moves", v.angle_deg, v.angle_noise_deg)]
    return _in_words({name: rms_of(error / np.maximum(noise, TINY)) for name, error, noise in pairs if len(error)})


def imprecise_in_diagnosis(diagnosis: Diagnosis) -> str:
    """As :func:`imprecise_in_verification`, of the model as it was given; empty without one."""
    given = (one.domains for one in diagnosis.stages if one.stage == "as-given")
    return _in_words({d.domain: d.chi2_per_dof**0.5 for stage in given for d in stage if d.chi2_per_dof is not None})


def _in_words(times: Mapping[str, float]) -> str:
    far = [f"{MEANING[k]} is {plain_number(x, 2)} times noise alone" for k, x in times.items() if x > FAR_ABOVE]
    return f", but {listed(far)}: the calibration is that uncertain" if far else ""
