"""What about a reference bears on the answer, as findings."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from trihedron.estimate.reference.clocks import Alignment
from trihedron.records import Finding, FindingCode, Severity
from trihedron.records.reference import AgainstReference

TILT_DEG = 10.0
"""A world whose z leans more than this from the plumb line is some other frame than a floor's."""
COLOURED = 3.0
"""Blocks that disagree three times more than the noise model says: something other than noise is left."""
LEFT_OUT = 0.05


def remarks(result: AgainstReference, found: Alignment, is_turned: bool) -> tuple[Finding, ...]:
    """Findings of a fit: which way is up, doubts of the clock, rows left out, what the noise model does not hold."""
    out = []
    if is_turned:
        out.append(
            Finding(
                FindingCode.REFERENCE_TURNED_ROUND,
                Severity.WARNING,
                "The reference's attitudes turn world into body: only so do they move as the log does.",
                "Two conventions of attitude.",
                "Nothing, unless another program will read this file.",
            )
        )
    if found.is_ambiguous:
        out.append(
            Finding(
                FindingCode.REFERENCE_LAG_AMBIGUOUS,
                Severity.WARNING,
                f"The motion repeats itself: more than one offset of the reference's clock fits as well as "
                f"{result.clock_offset_s[0]:.4g} s.",
                "Turns that are alike.",
                "Shake the unit once, irregularly, at the start.",
            )
        )
    if result.vertical is not None:
        out += _up(result)
    for name, fit in (("gyro", result.gyroscope), ("accelerometer", result.accelerometer)):
        if fit is None:
            continue
        if fit.widened > COLOURED:
            out.append(
                Finding(
                    FindingCode.REFERENCE_MISFIT,
                    Severity.WARNING,
                    f"Parts of the log disagree about the {name} by {fit.widened:.2g} times what its residuals' noise "
                    "explains; the error bars were widened by that.",
                    "A reference that wobbles or was corrected on the way, a zero that drifts, an effect.",
                    "Look at --report FILE.html for where; repeat the motion.",
                    MappingProxyType({"widened": fit.widened}),
                )
            )
        if fit.n_left_out > LEFT_OUT * fit.n_rows:
            out.append(
                Finding(
                    FindingCode.REFERENCE_OUTLIERS,
                    Severity.WARNING,
                    f"{fit.n_left_out} of {fit.n_rows} windows of the {name} were left out as outliers.",
                    "Jumps of a tracker that lost its markers, or knocks.",
                    "Look at the reference's own quality flags.",
                    MappingProxyType({"left_out": float(fit.n_left_out), "rows": float(fit.n_rows)}),
                )
            )
    return tuple(out)


def _up(result: AgainstReference) -> list[Finding]:
    assert result.vertical is not None
    up = result.vertical.value
    lean = float(np.degrees(np.arccos(np.clip(abs(up[2]), 0.0, 1.0))))
    numbers = MappingProxyType({"up_x": float(up[0]), "up_y": float(up[1]), "up_z": float(up[2])})
    if up[2] < -np.cos(np.radians(45.0)):
        return [
            Finding(
                FindingCode.REFERENCE_UPSIDE_DOWN,
                Severity.WARNING,
                "At rest the specific force points along -z of the reference's world.",
                "Its z points down (north, east, down), or the reference is mirrored, or the log's accelerometer shows "
                "gravity instead of specific force.",
                "If z is up there, turn the sign of one axis of the reference, or of the accelerometer.",
                numbers,
            )
        ]
    if lean > TILT_DEG:
        return [
            Finding(
                FindingCode.REFERENCE_UPSIDE_DOWN,
                Severity.WARNING,
                f"The plumb line leans {lean:.0f}° from the z of the reference's world.",
                "A world frame that is not level.",
                "Nothing, if you know that: the plumb line was estimated.",
                numbers,
            )
        ]
    return []
