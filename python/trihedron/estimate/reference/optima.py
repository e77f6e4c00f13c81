"""Detection of two clock offsets that the motion does not separate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.reference.likelihood import Problem, equations, most_likely, together
from trihedron.estimate.reference.motion import MotionFit
from trihedron.records.reference import NAMED_FROM

REACH_S, STEP_S = 0.3, 0.02
"""Range and step of the shifts that are tried: larger ones are excluded by the alignment of the rates' magnitudes."""


def refuse_two_clocks(found: MotionFit, k: int) -> None:
    """Raise ``RefusedError`` with both offsets where the evidence of another is within ``NAMED_FROM`` of the best."""
    if "clock" not in found.places[k]:
        return
    side, point = found.sides[k], found.points[k]
    names = {name: at for name, at in found.places[k].items() if name in ("S", "b", "earth")}
    index = np.cumsum([0, *(len(at) for at in names.values())])
    where = {name: np.arange(a, b) for name, a, b in zip(names, index[:-1], index[1:], strict=True)}
    strengths = found.fitted.strengths[k : k + 1]
    shifts = STEP_S * np.arange(-round(REACH_S / STEP_S), round(REACH_S / STEP_S) + 1)

    def problem(shift: float) -> Problem:
        return side.problem(replace(point, offset_s=point.offset_s + float(shift)), where, {})

    heights = np.array([_height(problem(shift), strengths) for shift in shifts])
    inner = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:])) + 1
    others = [i for i in inner if abs(shifts[i]) > STEP_S]
    if not others:
        return
    best = max(others, key=lambda i: heights[i])
    spread = found.fitted.spread()[k : k + 1]
    there = most_likely([problem(shifts[best])], strengths, spread)[1]
    here = most_likely([problem(0.0)], strengths, spread)[1]
    if 2.0 * (here - there) < NAMED_FROM:
        at = float(found.value(k, "clock")[0])
        raise RefusedError(
            f"{side.reference.motion.source}: the motion fits two offsets of the reference's clock, {at:+.4g} s and "
            f"{at + shifts[best]:+.4g} s (evidence {2.0 * (here - there):.1f} apart, {NAMED_FROM:g} needed): shake the "
            "unit once, irregularly, or give the reference timestamps of the log's own clock."
        )


def _height(problem: Problem, strengths: FloatArray) -> float:
    return together([problem], [equations(problem, strengths[0])]).evidence
