"""Plan: uncertainties to expect from an experiment."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.accelerometer.poses import CANDIDATES, PoseDesign, pose_in_words
from trihedron.estimate.gyroscope.turn_design import design_moves, design_turns
from trihedron.records.plan import ExperimentPlan, MovePlan, PosePlan, PoseWorth
from trihedron.records.segments import LEAST_POSE_S
from trihedron.units import STANDARD_GRAVITY_M_S2, m_s2_from_micro_g, radians_from_degrees

_KINDS = np.count_nonzero(np.abs(CANDIDATES) > 1e-9, axis=1)
POSE_SETS = {
    "6 faces": CANDIDATES[_KINDS == 1],
    "9 poses": CANDIDATES[[17, 23, 8, 9, 6, 1, 22, 10, 11]],
    "12 edges": CANDIDATES[_KINDS == 2],
    "18 poses: faces and edges": CANDIDATES[_KINDS <= 2],
    "26 poses: faces, edges and corners": CANDIDATES,
}
"""Upward unit vectors (n, 3) by name. The nine minimise the largest standard error: no exchange of one improves it."""


def plan(
    *,
    turns_deg: Sequence[float] = (90.0, -90.0),
    turn_s: float = 2.0,
    pose_s: float = 4.0,
    gyroscope_density: float = radians_from_degrees(0.005),
    accelerometer_density: float = m_s2_from_micro_g(150.0),
    sigma_turn_rad: float = 0.0,
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2,
) -> ExperimentPlan:
    """Uncertainties to expect from known turns about each axis, from sets of poses, and from moves between poses.

    Parameters
    ----------
    turns_deg : sequence of float
        Turns about each of the three axes [°].
    turn_s : float
        Duration of one turn [s].
    pose_s : float
        Duration of a pose, and of the static interval before the turns [s].
    gyroscope_density, accelerometer_density : float
        White noise [rad/s/√Hz, m/s²/√Hz]; that of a consumer part by default.
    sigma_turn_rad : float
        Standard error of a turn's angle [rad].
    gravity_m_s2 : float
        |g| [m/s²].

    Returns
    -------
    ExperimentPlan
        Uncertainties to expect from turns, poses and moves.

    Raises
    ------
    ValueError
        When a figure is not positive or the turns determine nothing.

    Examples
    --------
    >>> longer = trihedron.plan(turns_deg=(1440.0, -1440.0), turn_s=8.0)
    >>> longer.turns.scale < trihedron.plan().turns.scale
    True
    """
    for name, value in (("turn time", turn_s), ("pose", pose_s), ("accelerometer noise", accelerometer_density)):
        if not value > 0.0:
            raise InputError(f"the {name} must be a positive number, got {value:g}")
        if not 1e-15 < value < 1e9:
            raise InputError(f"a {name} of {value:g} is that of no experiment")
    if pose_s < LEAST_POSE_S:
        raise InputError(f"a pose of {pose_s:g} s is not found in a log: plan with {LEAST_POSE_S:g} s or more")
    turns = design_turns(turns_deg, turn_s, pose_s, gyroscope_density, sigma_turn_rad)
    sigma = accelerometer_density / math.sqrt(pose_s) / gravity_m_s2
    angle_noise = math.hypot(math.sqrt(2.0) * sigma, gyroscope_density * math.sqrt(turn_s))
    return ExperimentPlan(
        gyroscope_density=gyroscope_density,
        accelerometer_density=accelerometer_density,
        gravity_m_s2=gravity_m_s2,
        pose_s=pose_s,
        sigma_turn_rad=sigma_turn_rad,
        turns=turns,
        poses=tuple(_poses(name, up, sigma, gravity_m_s2) for name, up in POSE_SETS.items()),
        moves=_moves(angle_noise),
    )


def _poses(name: str, up: FloatArray, sigma: float, gravity_m_s2: float) -> PosePlan:
    sigmas = np.full(len(up), sigma)
    design = PoseDesign.of(up, sigmas)
    errors = np.sqrt(np.diag(design.covariance))
    worst = float(errors.max())
    worth = []
    for k in range(len(up)):
        rest = PoseDesign.of(np.delete(up, k, axis=0), np.delete(sigmas, k))
        loss = float(np.sqrt(np.diag(rest.covariance)).max()) / worst if rest.rank == 9 else math.inf
        worth.append(PoseWorth(pose_in_words(up[k]), loss))
    worth.sort(key=lambda pose: -pose.loss)
    if design.rank < 9:
        return PosePlan(name, len(up), design.rank, math.inf, math.inf, math.inf, ())
    return PosePlan(
        name=name,
        n_poses=len(up),
        rank=design.rank,
        scale=float(errors[[0, 2, 5]].max()),
        angle=float(errors[[1, 3, 4]].max()),
        bias=float(errors[6:].max()) * gravity_m_s2,
        worth=tuple(worth),
    )


def _moves(angle_noise: float) -> tuple[MovePlan, ...]:
    axes = np.eye(3)
    quarter, eighth = 0.5 * math.pi * axes, 0.25 * math.pi * axes
    up = np.roll(axes, 1, axis=0)
    aside = np.cross(up, axes)
    half_way = math.sqrt(0.5) * (up + aside)
    single = list(zip(up, quarter, strict=True))
    halves = [*zip(up, eighth, strict=True), *zip(half_way, eighth, strict=True)]
    back = [*single, *zip(aside, -quarter, strict=True)]
    both = [*back, *zip(-aside, quarter, strict=True)]
    sets = (
        ("three quarter turns about level axes", single),
        ("the same, each with a stop half way", halves),
        ("the same quarter turns, there and back", back),
        ("there, back, and from another side", both),
    )
    return tuple(MovePlan(name, len(moves), *design_moves(moves, angle_noise)) for name, moves in sets)
