"""What method 1 noticed about the turns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from trihedron.estimate.gyroscope.turn_angles import KnownTurn
from trihedron.estimate.gyroscope.turn_system import FALSE_ALARM, Screened
from trihedron.records.finding import Finding, FindingCode, Severity
from trihedron.units import degrees_from_radians

FloatArray = npt.NDArray[np.float64]

LOOSE_TURN_RAD = math.radians(1.0)
"""A square case pushed against a wall repeats within some tenths of a degree."""


def turn_findings(
    known: Sequence[KnownTurn],
    screened: Screened,
    deviation: FloatArray,
    S: FloatArray,
    inflation: float,
    dof: int,
    quantum_rad: float,
    *,
    is_sigma_given: bool,
) -> tuple[Finding, ...]:
    """Turns that are no multiple, turns that contradict each other, turns nobody checks, handedness, drift."""
    found = [_not_a_multiple(i, turn, quantum_rad) for i, turn in enumerate(known) if _is_wrong(turn)]
    for index in screened.suspects:
        turn = known[index]
        off = degrees_from_radians(float(np.linalg.norm(deviation[index])))
        left = "it is left out" if index in screened.removed else "no third turn tells which of them is wrong"
        found.append(
            Finding(
                FindingCode.TURN_NOT_A_MULTIPLE,
                Severity.WARNING if index in screened.removed else Severity.SERIOUS,
                f"turn {index}, taken for {degrees_from_radians(turn.angle_rad):.0f} deg about axis {turn.axis + 1}, "
                f"is off by {off:.2g} deg against the others; {left}.",
                "the case was not pushed home against the wall, or the turn was another one",
                "Repeat this turn.",
                MappingProxyType({"turn": float(index), "deviation_rad": float(np.linalg.norm(deviation[index]))}),
            )
        )
    sigma = screened.system.sigma_turn
    if not is_sigma_given and sigma > LOOSE_TURN_RAD:
        found.append(
            Finding(
                FindingCode.TURN_NOT_A_MULTIPLE,
                Severity.WARNING,
                f"the turns scatter by {degrees_from_radians(sigma):.2g} deg about the multiples they were taken for; "
                "the error bars contain it.",
                "turned by eye, without a wall",
                "Push the case against a wall before and after each turn.",
                MappingProxyType({"sigma_turn_rad": sigma}),
            )
        )
    if screened.unchecked_axes:
        names = " and ".join(str(axis + 1) for axis in screened.unchecked_axes)
        found.append(
            Finding(
                FindingCode.TURN_UNCHECKED,
                Severity.WARNING,
                f"only one turn about axis {names}: nothing would show if its angle was wrong.",
                "a wrong angle goes into the scale unseen",
                "Turn there and back at least once about every axis.",
            )
        )
    if np.linalg.det(S) < 0.0:
        found.append(
            Finding(
                FindingCode.LEFT_HANDED,
                Severity.WARNING,
                "the gyro's axes as logged form a left-handed triad (det S < 0).",
                "one documented gyro axis is reversed, or two are exchanged",
                "Check the axis directions of the board; the calibration itself corrects them.",
                MappingProxyType({"determinant": float(np.linalg.det(S))}),
            )
        )
    if inflation > 1.0:
        found.append(
            Finding(
                FindingCode.RESIDUAL_ABOVE_NOISE,
                Severity.WARNING,
                f"the turns are missed by more than their noise explains: χ²/dof = {inflation:.1f} with {dof} degrees "
                "of freedom; the error bars are widened by its root.",
                "turns that were not the stated angle, a table that is not level, or a drifting zero",
                "Repeat the turns against a wall.",
                MappingProxyType({"chi2_per_dof": inflation, "dof": float(dof)}),
            )
        )
    found += _drift(screened)
    return tuple(found)


def _is_wrong(turn: KnownTurn) -> bool:
    # A move that is no turn at all (the case was set on another face) is not worth a finding when nobody called it one.
    return not turn.is_used and (turn.was_given or turn.off_axis_rad < math.radians(20.0)) and abs(turn.seen_rad) > 0.2


def _not_a_multiple(index: int, turn: KnownTurn, quantum_rad: float) -> Finding:
    seen = degrees_from_radians(turn.seen_rad)
    wanted = (
        f"the stated {degrees_from_radians(turn.angle_rad):.0f} deg"
        if turn.was_given
        else f"any multiple of {degrees_from_radians(quantum_rad):.0f} deg"
    )
    return Finding(
        FindingCode.TURN_NOT_A_MULTIPLE,
        Severity.WARNING,
        f"turn {index} about axis {turn.axis + 1} is {seen:.1f} deg, far from {wanted}; it is left out.",
        "turned without a wall, or the nominal scale is far off",
        "Repeat it against a wall, or give its angle.",
        MappingProxyType({"turn": float(index), "seen_rad": turn.seen_rad}),
    )


def _drift(screened: Screened) -> list[Finding]:
    measured = screened.system.measured
    dof = len(measured.zero_duration_s) - 1
    if dof < 1 or chdtrc(dof, float(measured.zero_excess.max())) > FALSE_ALARM / 3.0:
        return []
    axis = int(np.argmax(measured.zero_excess))
    return [
        Finding(
            FindingCode.GYRO_BIAS_DRIFT,
            Severity.NOTE,
            f"the gyro's zero reading differs between still stretches by "
            f"{np.sqrt(measured.zero_excess[axis] / dof):.1f} times its noise (axis {axis + 1}).",
            "warm-up, slow noise, or a zero reading that depends on attitude (g-sensitivity)",
            "Let the sensor warm up; keep still before and after every turn.",
            MappingProxyType({"chi2_per_dof": float(measured.zero_excess[axis] / dof)}),
        )
    ]
