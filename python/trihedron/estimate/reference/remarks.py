"""What about a reference bears on the answer, as findings."""

from __future__ import annotations

import numpy as np

from trihedron.estimate.reference.clocks import Alignment
from trihedron.records import Finding, FindingCode
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
        out.append(Finding.of(FindingCode.REFERENCE_TURNED_ROUND))
    if found.is_ambiguous:
        out.append(Finding.of(FindingCode.REFERENCE_LAG_AMBIGUOUS, offset_s=result.clock_offset_s[0]))
    if result.vertical is not None:
        out += _up(result)
    for name, fit in (("gyro", result.gyroscope), ("accelerometer", result.accelerometer)):
        if fit is None:
            continue
        if fit.widened > COLOURED:
            out.append(Finding.of(FindingCode.REFERENCE_MISFIT, sensor=name, widened=fit.widened))
        if fit.n_left_out > LEFT_OUT * fit.n_rows:
            out.append(
                Finding.of(FindingCode.REFERENCE_OUTLIERS, left_out=fit.n_left_out, rows=fit.n_rows, sensor=name)
            )
    return tuple(out)


def _up(result: AgainstReference) -> list[Finding]:
    assert result.vertical is not None
    up = result.vertical.value
    lean = float(np.degrees(np.arccos(np.clip(abs(up[2]), 0.0, 1.0))))
    if up[2] < -np.cos(np.radians(45.0)):
        return [Finding.of(FindingCode.REFERENCE_UPSIDE_DOWN, "down", up_x=up[0], up_y=up[1], up_z=up[2])]
    if lean > TILT_DEG:
        return [
            Finding.of(FindingCode.REFERENCE_UPSIDE_DOWN, "leans", lean_deg=lean, up_x=up[0], up_y=up[1], up_z=up[2])
        ]
    return []
