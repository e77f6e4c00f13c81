"""Turns that the others contradict, and the scatter of turns and faces."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.gyroscope.turn_angles import QUARTER, KnownTurn
from trihedron.estimate.gyroscope.turn_system import TurnSystem, left_out, solve
from trihedron.probability import MEDIAN_CHI2, chdtrc, chdtri
from trihedron.records.finding import Finding, FindingCode

FALSE_ALARM = 1e-3
"""False alarm rate of each kind of statistical finding on turns."""

LARGEST_SIGMA_TURN = math.radians(20.0)
FLATNESS_RAD, FLATNESS_SPREAD = math.radians(0.05), 0.9
"""Prior of a face's deviation from its nominal plane, one component: 0.04 mm over 50 mm, within a factor of 2.5 either
way (turned and moulded cases: 0.02 to 0.1°); the second is σ of the logarithm."""


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
    counts = {axis: int(np.count_nonzero(used & (axes == axis))) for axis in range(3)}
    unchecked = tuple(axis for axis in range(3) if counts[axis] < 2)
    suspects: list[int] = []
    removed: list[int] = []
    system = _with_tilts(replace(system, S_w=solve(system, used).S_w), used)
    while True:
        distance2 = left_out(_with_robust_scatter(system, used), used).distance2
        distances = {int(i): float(distance2[i]) for i in np.flatnonzero(np.isfinite(distance2))}
        if not distances:
            break
        limit = float(chdtri(3, FALSE_ALARM / len(distances)))
        worst = max(distances, key=lambda index: distances[index])
        if distances[worst] <= limit:
            break
        if np.count_nonzero(used & (axes == axes[worst])) < 3:
            suspects += [i for i in distances if axes[i] == axes[worst] and distances[i] > limit and i not in suspects]
            break
        suspects.append(worst)
        removed.append(worst)
        used = used.copy()
        used[worst] = False
    return Screened(_with_scatter(system, used), used, tuple(suspects), tuple(removed), unchecked)


def _with_robust_scatter(system: TurnSystem, used: BoolArray) -> TurnSystem:
    """The system with the scatter of a turn's angle from the median squared prediction error."""
    for _ in range(3):
        along2, noise2 = _along(system, left_out(system, used).residual)
        known = used & np.isfinite(along2)
        if not np.any(known):
            return system
        system = replace(system, sigma_turn=_beyond(float(np.median(along2[known])) / MEDIAN_CHI2[1], noise2))
    return system


def _with_scatter(system: TurnSystem, used: BoolArray) -> TurnSystem:
    """The system with the scatter of turn angles by moments, where noise and tilts do not explain the residuals."""
    system = _with_tilts(replace(system, sigma_turn=0.0, sigma_tilt=0.0), used)
    fit = solve(system, used)
    if fit.dof < 1 or chdtrc(fit.dof, fit.chi2) > FALSE_ALARM:
        return system
    k = int(np.count_nonzero(used))
    for _ in range(3):
        along2, noise2 = _along(system, system.residuals(solve(system, used)))
        # One parameter per axis is fitted along the turns.
        system = replace(system, sigma_turn=_beyond(float(np.sum(along2[used])) / max(k - 3, 1), noise2))
        system = _with_tilts(system, used)
    return system


def _with_tilts(system: TurnSystem, used: BoolArray) -> TurnSystem:
    """The system with the tilt of faces, which has a prior, and the tilt that differs from turn to turn: posterior mean
    variances of both by restricted likelihood on a grid.

    Turns on one face share its tilt, which their scatter does not show; opposite faces differ by it. With one face
    alone the prior is kept. Where faces are unknown, every turn has its own tilt.
    """
    _, noise2 = _along(system, system.residuals(solve(system, used)))
    own_scale = math.sqrt(noise2)
    log_faces, log_owns = np.zeros(1), np.linspace(-2.0, 7.0, 7)
    flatness = 0.0
    if system.faces is not None and np.all(system.faces[used] != 0):
        log_faces, flatness = np.linspace(-3.0, 3.0, 9) * FLATNESS_SPREAD, FLATNESS_RAD
    log_weights = np.empty((len(log_faces), len(log_owns)))
    for i, log_face in enumerate(log_faces):
        for j, log_own in enumerate(log_owns):
            tried = replace(system, sigma_face=flatness * math.exp(log_face), sigma_tilt=own_scale * math.exp(log_own))
            prior = -0.5 * (log_face / FLATNESS_SPREAD) ** 2 + log_own - math.log1p(math.exp(2.0 * log_own))
            log_weights[i, j] = prior + _restricted_likelihood(tried, used)
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    face2 = float(weights.sum(axis=1) @ np.exp(2.0 * log_faces)) * flatness**2
    own2 = float(weights.sum(axis=0) @ np.exp(2.0 * log_owns)) * noise2
    return replace(system, sigma_face=math.sqrt(face2), sigma_tilt=math.sqrt(own2))


def _restricted_likelihood(system: TurnSystem, used: BoolArray) -> float:
    matrix, side = system.whitened(used)
    q, r = np.linalg.qr(matrix)
    rest = side - q @ (q.T @ side)
    log_factor = float(np.sum(np.log(np.abs(np.diag(system.factor(used))))))
    return log_factor - float(np.sum(np.log(np.abs(np.diag(r))))) - 0.5 * float(rest @ rest)


def _along(system: TurnSystem, raw: FloatArray) -> tuple[FloatArray, float]:
    """Squared deviations (k,) along each turn, rad², from raw ones (k, 3), and the variance per component by noise."""
    to_si = np.linalg.inv(system.S_w)
    along = np.einsum("ki,ki->k", raw @ to_si.T, system.axes)
    noise = np.einsum("kii->k", to_si @ system.noise() @ to_si.T) / 3.0
    return along**2, float(np.median(noise))


def _beyond(mean_square: float, noise2: float) -> float:
    return min(math.sqrt(max(mean_square - noise2, 0.0)), LARGEST_SIGMA_TURN)


LOOSE_TURN_RAD = math.radians(1.0)
"""Scatter of turns above which it is reported: a square case against a wall repeats to some tenths of a degree."""


def turn_findings(
    known: Sequence[KnownTurn], screened: Screened, deviation: FloatArray, S: FloatArray, inflation: float, dof: int
) -> Iterator[Finding]:
    """Findings: turns that are no multiple of 90°, contradicting turns, axes with a single turn, handedness, drift."""
    yield from (_not_a_multiple(i, turn) for i, turn in enumerate(known) if _is_wrong(turn))
    for index in screened.suspects:
        turn = known[index]
        yield Finding.of(
            FindingCode.TURN_NOT_A_MULTIPLE,
            "left-out" if index in screened.removed else "contradicted",
            turn=int(index),
            angle_rad=turn.angle_rad,
            axis=turn.axis + 1,
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
    yield from _drift(screened)


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


def _drift(screened: Screened) -> Iterator[Finding]:
    measured = screened.system.measured
    dof = len(measured.static_duration_s) - 1
    if dof < 1 or chdtrc(dof, float(measured.bias_excess.max())) > FALSE_ALARM / 3.0:
        return
    axis = int(np.argmax(measured.bias_excess))
    yield Finding.of(
        FindingCode.GYRO_BIAS_DRIFT,
        "turns",
        times=np.sqrt(measured.bias_excess[axis] / dof),
        axis=axis + 1,
        chi2_per_dof=measured.bias_excess[axis] / dof,
    )
