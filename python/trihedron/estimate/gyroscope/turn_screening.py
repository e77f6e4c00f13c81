"""Turns that the others contradict, and findings of turns."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.gyroscope.findings import drift_findings
from trihedron.estimate.gyroscope.turn_angles import QUARTER, KnownTurn
from trihedron.estimate.gyroscope.turn_system import FALSE_ALARM, TurnSystem
from trihedron.probability import chdtri
from trihedron.records.finding import Finding, FindingCode


@dataclass(frozen=True, eq=False)
class Screened:
    """Result: ``used`` turns (k,), ``suspects`` that the others contradict, those of them that were ``removed``."""

    system: TurnSystem
    used: BoolArray
    suspects: tuple[int, ...]
    removed: tuple[int, ...]
    unchecked_axes: tuple[int, ...]


def screen(system: TurnSystem, used: BoolArray) -> Screened:
    """Find turns that the others contradict, and the standard error of a turn.

    Each turn is predicted by all others. The scatter of a turn is first estimated from the median of the prediction
    errors, which is robust to one wrong turn; a turn far beyond it is a suspect. It is removed when two others about
    its axis remain. The scatter is then that of the remaining turns, 0 where the rate noise explains it.
    """
    axes = np.argmax(np.abs(system.angles), axis=1)
    unchecked = tuple(axis for axis in range(3) if np.count_nonzero(used & (axes == axis)) < 2)
    suspects: list[int] = []
    removed: list[int] = []
    system = system.refined(used).tilted(used)
    while True:
        distance2 = np.nan_to_num(system.loosely(used).left_out(used)[2])
        limit = float(chdtri(3, FALSE_ALARM / max(int(np.count_nonzero(distance2)), 1)))
        worst = int(np.argmax(distance2))
        if distance2[worst] <= limit:
            break
        if np.count_nonzero(used & (axes == axes[worst])) < 3:
            suspects += np.flatnonzero((axes == axes[worst]) & (distance2 > limit)).tolist()
            break
        suspects.append(worst)
        removed.append(worst)
        used = used & (np.arange(len(used)) != worst)
    return Screened(system.scattered(used), used, tuple(suspects), tuple(removed), unchecked)


LOOSE_TURN_RAD = math.radians(1.0)
"""Scatter of turns above which it is reported: a square case against a wall repeats to some tenths of a degree."""


def turn_findings(
    known: Sequence[KnownTurn], screened: Screened, deviation: FloatArray, S: FloatArray, inflation: float, dof: int
) -> Iterator[Finding]:
    """Findings: turns that are no multiple of 90°, contradicting turns, axes with a single turn, handedness, drift."""
    yield from (_not_a_multiple(i, turn) for i, turn in enumerate(known) if _is_wrong(turn))
    for index in screened.suspects:
        one = known[index]
        yield Finding.of(
            FindingCode.TURN_NOT_A_MULTIPLE,
            "left-out" if index in screened.removed else "contradicted",
            turn=int(index),
            angle_rad=one.angle_rad,
            axis=one.turn.axis + 1,
            deviation_rad=np.linalg.norm(deviation[index]),
        )
    sigma = screened.system.sigma_turn
    if sigma > LOOSE_TURN_RAD:
        yield Finding.of(FindingCode.TURN_NOT_A_MULTIPLE, "scatter", sigma_turn_rad=sigma)
    if screened.unchecked_axes:
        yield Finding.of(FindingCode.TURN_UNCHECKED, axes=[axis + 1 for axis in screened.unchecked_axes])
    if np.linalg.det(S) < 0.0:
        yield Finding.of(FindingCode.LEFT_HANDED, "gyro", determinant=np.linalg.det(S))
    if inflation > 1.0:
        yield Finding.of(FindingCode.RESIDUAL_ABOVE_NOISE, "turns", chi2_per_dof=inflation, dof=dof)
    measured = screened.system.measured
    yield from drift_findings("turns", measured.static_rates, measured.bias_excess, S)


def _is_wrong(turn: KnownTurn) -> bool:
    # A move that is no turn (the case was set on another face) is reported only if it was stated as a turn.
    is_turn = turn.turn.angle_rad is not None or turn.off_axis_rad < math.radians(20.0)
    return not turn.is_used and is_turn and abs(turn.seen_rad) > 0.2


def _not_a_multiple(index: int, turn: KnownTurn) -> Finding:
    stated = turn.turn.angle_rad
    return Finding.of(
        FindingCode.TURN_NOT_A_MULTIPLE,
        "no-multiple" if stated is None else "not-the-stated",
        turn=index,
        axis=turn.turn.axis + 1,
        seen_rad=turn.seen_rad,
        wanted_rad=QUARTER if stated is None else stated,
    )
