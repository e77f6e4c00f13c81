"""Findings on a reference that affect the result."""

from __future__ import annotations

import numpy as np

from trihedron.records import Finding, FindingCode
from trihedron.records.reference import AgainstReference

TILT_DEG = 10.0
"""Largest angle of the world's z axis from the vertical without a finding."""
COLOURED = 3.0
"""Factor on the accelerometer's uncertainties above which its residuals are not explained by the noise model."""
LEFT_OUT = 0.05


def remarks(result: AgainstReference, is_turned: bool) -> tuple[Finding, ...]:
    """Findings of a fit: independence of the reference, direction of up, outliers, deviating intervals, misfit."""
    error, out = result.error, []
    if is_turned:
        out.append(Finding.of(FindingCode.REFERENCE_TURNED_ROUND))
    if result.vertical is not None:
        out += _up(result)
    if error.signs:
        seen = {sign.kind: sign.seen for sign in error.signs}
        out.append(
            Finding.of(
                FindingCode.REFERENCE_NOT_INDEPENDENT,
                is_quiet="quieter-than-gyro" in seen,
                is_square="mounted-without-error" in seen,
                angle_rad=seen.get("mounted-without-error", float("nan")),
                varies="S-depends-on-duration" in seen,
            )
        )
    if error.rows_left_out > LEFT_OUT * (error.rows + error.rows_left_out):
        rows = error.rows + error.rows_left_out
        out.append(Finding.of(FindingCode.REFERENCE_OUTLIERS, left_out=error.rows_left_out, rows=rows))
    for start, end in error.apart_s:
        out.append(Finding.of(FindingCode.REFERENCE_APART, start_s=start, end_s=end))
    force = result.accelerometer
    if force is not None and force.widened > COLOURED:
        out.append(Finding.of(FindingCode.REFERENCE_MISFIT, sensor="accelerometer", widened=force.widened))
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
