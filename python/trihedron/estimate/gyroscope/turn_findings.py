"""Findings of method 1 on the turns."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.turn_angles import QUARTER, KnownTurn
from trihedron.estimate.gyroscope.turn_screening import FALSE_ALARM, Screened
from trihedron.probability import chdtrc
from trihedron.records.finding import Finding, FindingCode

LOOSE_TURN_RAD = math.radians(1.0)
"""Scatter of turns above which it is reported: a square case against a wall repeats to some tenths of a degree."""


def turn_findings(
    known: Sequence[KnownTurn],
    screened: Screened,
    deviation: FloatArray,
    S: FloatArray,
    inflation: float,
    dof: int,
) -> tuple[Finding, ...]:
    """Findings: turns that are no multiple of 90°, contradicting turns, axes with a single turn, handedness, drift."""
    found = [_not_a_multiple(i, turn) for i, turn in enumerate(known) if _is_wrong(turn)]
    for index in screened.suspects:
        turn = known[index]
        found.append(
            Finding.of(
                FindingCode.TURN_NOT_A_MULTIPLE,
                "left-out" if index in screened.removed else "contradicted",
                turn=int(index),
                angle_rad=turn.angle_rad,
                axis=turn.axis + 1,
                deviation_rad=np.linalg.norm(deviation[index]),
            )
        )
    sigma = screened.system.sigma_turn
    if sigma > LOOSE_TURN_RAD:
        found.append(Finding.of(FindingCode.TURN_NOT_A_MULTIPLE, "scatter", sigma_turn_rad=sigma))
    if screened.unchecked_axes:
        found.append(Finding.of(FindingCode.TURN_UNCHECKED, axes=[axis + 1 for axis in screened.unchecked_axes]))
    if np.linalg.det(S) < 0.0:
        found.append(Finding.of(FindingCode.LEFT_HANDED, "gyro", determinant=np.linalg.det(S)))
    if inflation > 1.0:
        found.append(Finding.of(FindingCode.RESIDUAL_ABOVE_NOISE, "turns", chi2_per_dof=inflation, dof=dof))
    found += _drift(screened)
    return tuple(found)


def _is_wrong(turn: KnownTurn) -> bool:
    # A move that is no turn (the case was set on another face) is reported only if it was stated as a turn.
    return not turn.is_used and (turn.was_given or turn.off_axis_rad < math.radians(20.0)) and abs(turn.seen_rad) > 0.2


def _not_a_multiple(index: int, turn: KnownTurn) -> Finding:
    return Finding.of(
        FindingCode.TURN_NOT_A_MULTIPLE,
        "not-the-stated" if turn.was_given else "no-multiple",
        turn=index,
        axis=turn.axis + 1,
        seen_rad=turn.seen_rad,
        wanted_rad=turn.angle_rad if turn.was_given else QUARTER,
    )


def _drift(screened: Screened) -> list[Finding]:
    measured = screened.system.measured
    dof = len(measured.static_duration_s) - 1
    if dof < 1 or chdtrc(dof, float(measured.bias_excess.max())) > FALSE_ALARM / 3.0:
        return []
    axis = int(np.argmax(measured.bias_excess))
    return [
        Finding.of(
            FindingCode.GYRO_BIAS_DRIFT,
            "turns",
            times=np.sqrt(measured.bias_excess[axis] / dof),
            axis=axis + 1,
            chi2_per_dof=measured.bias_excess[axis] / dof,
        )
    ]
