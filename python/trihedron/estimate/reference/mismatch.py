"""Checks that a reference and a log fit together; each error is one sentence."""

from dataclasses import replace

import numpy as np

from trihedron.arrays import XYZ, FloatArray, sigmas_of
from trihedron.errors import InputError
from trihedron.estimate.reference.beside import places
from trihedron.estimate.reference.likelihood import Problem, most_likely, together
from trihedron.estimate.reference.motion import MotionFit
from trihedron.estimate.reference.start import Start
from trihedron.records import Recording
from trihedron.records.reference import NAMED_FROM, ReferenceMotion
from trihedron.units import rate_to_si

STRANGERS = 0.6
"""Residual share of the reference's rate above which there is no shared motion, whatever the correlation."""


def reject_strangers(start: Start, motion: ReferenceMotion) -> None:
    """Raise ``InputError`` where the rates agree in magnitude, but no mounting rotation makes them equal."""
    if start.share_left > STRANGERS and not motion.is_stepwise:
        raise InputError(
            f"{motion.source}: this reference and the log share no motion: their turning rates look alike in size, but "
            f"no mounting makes them one ({100 * start.share_left:.0f} % of the rate is left); name the reference of "
            "this very log."
        )


def reject_units(recording: Recording, start: Start, motion: ReferenceMotion) -> None:
    """Raise ``InputError`` where the rates differ by a factor of units: 57.3, 1000, 60 or 9.55 (rpm)."""
    nominal = rate_to_si(recording.gyroscope_unit)
    if nominal is None:
        return
    scale = float(np.exp(np.mean(np.log(np.linalg.svd(start.S, compute_uv=False))))) / nominal
    for factor, words in (
        (np.degrees(1.0), "its angles or rates are in deg"),
        (np.radians(1.0), "its angles or rates are in rad"),
        (1000.0, "it is in thousandths"),
        (0.001, "it is in thousandths"),
        (2.0 * np.pi / 60.0, "it is in rpm"),
        (60.0 / (2.0 * np.pi), "it is in rpm"),
        (60.0, "it is in rpm or per minute"),
    ):
        if abs(scale / factor - 1.0) < 0.2:
            raise InputError(
                f"{motion.source}: the reference turns {scale:.3g} times as fast as the gyro says: {words}, or the "
                "log's unit is misread; name the unit in its columns ('wx [deg/s]', --reference-columns) or with "
                "--gyro-unit."
            )


def reject_still(motion: ReferenceMotion, S: FloatArray, covariance: FloatArray) -> None:
    """Raise ``InputError`` for axes of S (9,) whose relative σ by its covariance (9, 9) is 0.5 or more."""
    sigma = sigmas_of(covariance).reshape(3, 3)
    size = np.linalg.norm(S.reshape(3, 3), axis=0)
    weak = [XYZ[j] for j in range(3) if not np.linalg.norm(sigma[:, j]) < 0.5 * size[j]]
    if weak:
        raise InputError(
            f"{motion.source}: the log's gyro axis {' and '.join(weak)} hardly turns while the reference is there, and "
            "its scale stays open: turn the unit about every axis (a rate table: one mounting for each)."
        )


# Two clock offsets that the motion does not separate.


REACH_S, SHIFT_S = 0.3, 0.02
"""Range and step of the shifts that are tried: larger ones are excluded by the alignment of the rates' magnitudes."""


def reject_two_clocks(found: MotionFit, k: int) -> None:
    """Raise ``InputError`` with both offsets where the evidence of another is within ``NAMED_FROM`` of the best."""
    if "clock" not in found.places[k]:
        return
    side, point = found.sides[k], found.points[k]
    where = places([side], ("S", "b", "earth"))[0]
    strengths = found.fitted.strengths[k : k + 1]
    shifts = SHIFT_S * np.arange(-round(REACH_S / SHIFT_S), round(REACH_S / SHIFT_S) + 1)

    def problem(shift: float) -> Problem:
        return side.problem(replace(point, offset_s=point.offset_s + float(shift)), where, {})

    heights = np.array([together([problem(shift)], strengths).evidence for shift in shifts])
    inner = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:])) + 1
    others = [i for i in inner if abs(shifts[i]) > SHIFT_S]
    if not others:
        return
    best = max(others, key=lambda i: heights[i])
    spread = found.fitted.spread()[k : k + 1]
    there = most_likely([problem(shifts[best])], strengths, spread)[1]
    here = most_likely([problem(0.0)], strengths, spread)[1]
    if 2.0 * (here - there) < NAMED_FROM:
        at = float(found.value(k, "clock")[0])
        raise InputError(
            f"{side.reference.motion.source}: the motion fits two offsets of the reference's clock, {at:+.4g} s and "
            f"{at + shifts[best]:+.4g} s (evidence {2.0 * (here - there):.1f} apart, {NAMED_FROM:g} needed): shake the "
            "unit once, irregularly, or give the reference timestamps of the log's own clock."
        )
