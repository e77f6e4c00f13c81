"""Findings of the fit of moves."""

from collections.abc import Iterator

import numpy as np

from trihedron import _core
from trihedron.arrays import AXES, TINY, FloatArray, sigmas_of
from trihedron.estimate.gyroscope.biases import pool_biases
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.carried import Carried
from trihedron.estimate.session.fit import SessionSolution
from trihedron.estimate.session.start import ASTRAY_DEG, usual_deg
from trihedron.gravity import EARTH_RATE_RAD_S
from trihedron.probability import FALSE_ALARM, chdtrc, fdtrc
from trihedron.records import (
    Finding,
    Observability,
    Recording,
    SensorCalibration,
    Severity,
)
from trihedron.records.words import Words, words
from trihedron.sensor_model import order_and_reversed, orientation
from trihedron.session.noise import NOISE_DOF
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians


def findings_of(
    outliers: tuple[int, ...],
    measured: MoveMeasurements,
    solution: SessionSolution,
    gyroscope: SensorCalibration,
    seen: Carried,
    recording: Recording,
) -> Iterator[Finding]:
    """All findings of the fit of moves of a recording; ``outliers`` are the moves that were excluded."""
    S, observability = gyroscope.S, gyroscope.observability
    assert observability is not None
    yield from audit_moves(measured)
    yield from handedness(S, solution.S_a, recording, worst_sigma(gyroscope.covariance[:9, :9], S))
    yield from observability_findings(observability, gyroscope.covariance[:9, :9], S, measured)
    if not solution.is_converged:
        yield Finding.of("not-converged", "session", stopped_because=solution.stopped_because)
    yield from _outlier_findings(outliers, measured, seen)
    dof = max(solution.moves_dof, 1.0)
    chi2_per_dof = solution.moves_chi2 / dof
    if fdtrc(dof, NOISE_DOF, chi2_per_dof) < FALSE_ALARM:
        # Widened uncertainties do not cover convergence to a wrong minimum: large tilt errors are serious.
        is_astray = usual_deg(seen.angle_deg, measured, solution.S_a, solution.b_a) > ASTRAY_DEG
        yield Finding.of(
            "residual-above-noise",
            "moves",
            severity=Severity.SERIOUS if is_astray else Severity.WARNING,
            chi2_per_dof=chi2_per_dof,
            dof=solution.moves_dof,
        )
    yield from _g_sensitivity_findings(measured, solution)
    # A random walk of b is part of the model; a curve says that b of this log is not b of the next.
    is_curve = "gyro-bias-drift" in solution.observed.causes and _is_material(np.ptp(measured.bias, axis=0), measured)
    yield from drift_findings("drifts" if is_curve else "poses", measured, S)


def handedness(
    S: FloatArray, S_accelerometer: FloatArray, recording: Recording | None = None, sigma: float = 0.0
) -> Iterator[Finding]:
    """LEFT_HANDED when the gyro's axes are not the accelerometer's axes of the same name.

    ``M = S_a⁻¹ S_ω`` holds the gyro's axes in those of the accelerometer. Where the handedness of the accelerometer is
    another one than stated, a reflection ``R`` of its frame makes ``S_ω → −R S_ω``: ``M = −1`` is a reflection that
    both sensors share, two reversed axes are the third one of the accelerometer, and a negative exchange of two axes
    is one of the accelerometer's columns. The ``--columns`` that mends an order are named where no sign is wrong.
    A gyro along none of them is named by its angle, where the directions in S are known to ``sigma`` that is small.
    """
    M = np.asarray(np.linalg.solve(S_accelerometer, S), dtype=np.float64)
    found = order_and_reversed(M)
    if found is None:
        if sigma < HARDLY_SEEN:
            yield _turned(orientation(M))
        return
    order, against = found
    others = [i + 1 for i in against]
    mapping = ""
    if recording is not None and len(against) in (0, 3):
        mapping = recording.mapping_with("a" if against else "g", order)
    match list(order) == [0, 1, 2], len(others):
        case True, 0:
            return
        case True, 1:
            yield Finding.of("left-handed", "gyro-reversed", axis=others[0])
        case True, 2:
            (right,) = {0, 1, 2} - set(against)
            signs = "".join("-" if (S_accelerometer[i, i] < 0.0) != (i == right) else "+" for i in range(3))
            yield Finding.of("left-handed", "accelerometer-reversed", axis=right + 1, axes=others, signs=signs)
        case True, 3:
            is_stated = float(np.linalg.det(S_accelerometer)) < 0.0
            yield Finding.of(
                "left-handed",
                "both-sensors",
                severity=Severity.SERIOUS if is_stated else Severity.WARNING,
                is_stated=is_stated,
            )
        case _:
            # All three reversed: the accelerometer's columns are exchanged.
            directions = [(i in against and len(against) < 3, order[i] + 1) for i in range(3)]
            yield Finding.of(
                "left-handed",
                "gyro-other-axes",
                directions=directions,
                has_columns=bool(mapping),
                mapping=mapping,
            )


def _turned(axes: FloatArray) -> Finding:
    """LEFT_HANDED for the gyro's ``axes`` (3, 3), orthonormal, turned or mirrored against the accelerometer's."""
    if np.linalg.det(axes) < 0.0:
        return Finding.of("left-handed", "gyro-mirrored")
    vector = _core.vector_from_rotation(axes[None])[0]
    angle = float(np.linalg.norm(vector))
    return Finding.of(
        "left-handed", "gyro-turned", angle_deg=degrees_from_radians(angle), about=(vector / angle).tolist()
    )


def _outlier_findings(outliers: tuple[int, ...], measured: MoveMeasurements, seen: Carried) -> Iterator[Finding]:
    for index in outliers:
        before, after = (int(k) for k in measured.links[index])
        sigma = float(np.sqrt(seen.covariance[index].trace() / 2.0))
        size = float(np.linalg.norm(seen.residual[index]))
        yield Finding.of(
            "outlier-move",
            "gap" if measured.is_gapped[index] else "timed",
            move=int(index) + 1,
            before=before + 1,
            after=after + 1,
            start_s=float(measured.time_s[measured.edges[index, 0]]),
            residual_deg=degrees_from_radians(size / STANDARD_GRAVITY_M_S2),
            times=size / sigma,
        )


def _g_sensitivity_findings(measured: MoveMeasurements, solution: SessionSolution) -> Iterator[Finding]:
    if solution.g_sensitivity is None:
        return
    G, sigma = (of_g * STANDARD_GRAVITY_M_S2 for of_g in solution.g_sensitivity)
    rate, force = (int(k) for k in np.unravel_index(int(np.argmax(np.abs(G))), (3, 3)))
    is_material = _is_material(np.abs(np.linalg.solve(solution.S_w, G)).max(axis=1), measured)
    yield Finding.of(
        "gyro-g-sensitivity",
        severity=Severity.WARNING if is_material else Severity.NOTE,
        per_g_rad_s=abs(G[rate, force]),
        sigma_per_g_rad_s=sigma[rate, force],
        rate_axis=rate + 1,
        force_axis=force + 1,
        # Its vertical part turns with gravity as a bias in proportion to it does.
        may_be_earth=bool(np.abs(G).max() <= EARTH_RATE_RAD_S),
        earth_rad_s=EARTH_RATE_RAD_S,
        numbers={f"G_{AXES[k]}{AXES[m]}": float(G[k, m]) / STANDARD_GRAVITY_M_S2 for k, m in np.ndindex(3, 3)},
    )


def _is_material(change: FloatArray, measured: MoveMeasurements) -> bool:
    """Whether a change of the raw bias (3,) turns a move of usual length by more than its noise."""
    lasts_s = np.median(measured.durations_s)
    return bool(np.any(change * lasts_s > measured.noise_density * np.sqrt(lasts_s)))


def drift_findings(case: str, measured: MoveMeasurements, S: FloatArray) -> Iterator[Finding]:
    """Finding where the biases of the poses differ (``case``: poses, drifts)."""
    bias, excess = measured.bias, pool_biases(measured.bias_read, measured.var_bias_read)[1]
    dof = len(bias) - 1
    if dof < 1 or chdtrc(dof, float(excess.max())) > FALSE_ALARM / 3.0:
        return
    # An axis that moves hardly determine may have no scale of its own on the diagonal.
    change = np.ptp(bias, axis=0) * np.linalg.norm(S, axis=0)
    axis = int(np.argmax(excess))
    yield Finding.of(
        "gyro-bias-drift",
        case,
        change_rad_s=change[axis],
        axis=axis + 1,
        times=np.sqrt(excess[axis] / dof),
    )


def audit_moves(measured: MoveMeasurements) -> Iterator[Finding]:
    """Findings on clipped moves and on gaps inside moves."""
    if np.any(measured.clipped_s > 0.0):
        which = [int(i) + 1 for i in np.flatnonzero(measured.clipped_s > 0.0)]
        lost = int(np.count_nonzero(measured.is_lost))
        yield Finding.of(
            "clipping",
            "moves",
            moves=len(which),
            n_moves=measured.n_moves,
            which=which,
            longest_s=measured.clipped_s.max(),
            bridged=len(which) - lost,
            left_out=lost,
        )
    if np.any(measured.is_gapped):
        which = [int(i) + 1 for i in np.flatnonzero(measured.is_gapped)]
        yield Finding.of("time-gap", "moves", moves=len(which), n_moves=measured.n_moves, which=which)


# Which parameters the moves determine, in words, with the moves to add.


WEAK = 0.03
"""Relative standard uncertainty of a direction in ``S_ω`` above which it is weak: the accuracy of data sheets."""
HARDLY_SEEN = 10.0 * WEAK
"""Relative standard uncertainty above which a direction counts as not observable."""


def describe(covariance: FloatArray, S: FloatArray) -> Observability:
    """``Observability`` of ``S_ω`` (row by row) from its covariance (9, 9).

    A move shows ``δS_ω ∫w' dt`` only across the vertical: the element ``S_ij`` needs a rotation about body axis ``j``
    during which axis ``i`` is not vertical, and, for ``i ≠ j``, by an angle that is not a multiple of 360°.
    """
    scale = np.maximum(np.linalg.norm(S, axis=0), np.finfo(float).tiny)
    share = sigmas_of(covariance).reshape(3, 3) / scale
    rate, axis = (int(k) for k in np.unravel_index(np.argmax(share), (3, 3)))
    weakest = words("gyro-scale" if rate == axis else "gyro-share", axis=axis + 1, rate=rate + 1)
    size = max(float(np.linalg.norm(S, 2)), np.finfo(float).tiny)
    singular = size / np.sqrt(np.maximum(np.linalg.eigvalsh(covariance), TINY))
    # The fit has a prior as wide as the scale: below √2 the moves add less information than the prior.
    rank = int(np.count_nonzero(singular > np.sqrt(2.0)))
    condition = float(singular[0] / singular[-1]) if rank == 9 else float("inf")
    is_weak = rank < 9 or worst_sigma(covariance, S) > WEAK
    advice = (_advice(covariance, size),) if is_weak else ()
    return Observability(rank, 9, condition, singular, weakest, advice)


def worst_sigma(covariance: FloatArray, S: FloatArray) -> float:
    """Standard uncertainty of the least determined direction in ``S_ω``, relative to its norm."""
    size = float(np.linalg.norm(S, 2))
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0))) / size if size > 0 else float("inf")


def _advice(covariance: FloatArray, size: float) -> Words:
    """Turns to add, axes of one protocol together; an axis's own element S_ij shows while axis i is level, so that its
    turn starts with the third axis up."""
    sigma = sigmas_of(covariance).reshape(3, 3) / size
    turns: dict[tuple[bool, bool, int], list[int]] = {}
    for axis in range(3):
        weak = [rate for rate in range(3) if sigma[rate, axis] > WEAK]
        if not weak:
            continue
        across = next((rate for rate in weak if rate != axis), axis)
        start = len(weak) < 3 and across != axis
        upright = 3 - axis - across + 1 if start else 0
        turns.setdefault((start, len(weak) == 3, upright), []).append(axis + 1)
    if not turns:
        return words("moves-about-all")
    return words("turns-about", turns=[(axes, *how) for how, axes in turns.items()])


def observability_findings(
    observability: Observability, covariance: FloatArray, S: FloatArray, measured: MoveMeasurements
) -> Iterator[Finding]:
    """NOT_OBSERVABLE or WEAKLY_OBSERVABLE with the moves to add, or none; with slower ones where most clipped."""
    advice, lost = observability.advice, int(np.count_nonzero(measured.is_lost))
    rank, weakest = observability.rank, observability.weakest
    if rank < observability.n_parameters:
        n, n_moves = observability.n_parameters, measured.n_moves
        if 2 * lost > n_moves:
            yield Finding.of(
                "not-observable",
                "moves-clipped",
                rank=rank,
                n_parameters=n,
                weakest=weakest,
                left_out=lost,
                n_moves=n_moves,
            )
        else:
            yield Finding.of("not-observable", "moves-rank", rank=rank, n_parameters=n, weakest=weakest, advice=advice)
        return
    worst = worst_sigma(covariance, S)
    if worst > HARDLY_SEEN:
        yield Finding.of("not-observable", "moves-weak", weakest=observability.weakest, advice=advice)
    elif worst > WEAK:
        yield Finding.of("weakly-observable", "moves", weakest=observability.weakest, advice=advice)
