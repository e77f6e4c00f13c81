"""Motions of typical calibration sessions."""

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from trihedron.errors import InputError
from trihedron.simulate.motion.attitude import attitude_with_up
from trihedron.simulate.motion.steps import Motion, MoveTo, Pose, Step, Turn
from trihedron.simulate.noise import stream
from trihedron.simulate.readout import triple

FACES: tuple[tuple[float, float, float], ...] = (
    (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.0),
)
"""Body direction that points up when the cube stands on the opposite face."""

EDGES: tuple[tuple[float, float, float], ...] = tuple(
    (a, b, c) for a, b, c in itertools.product((0.0, 1.0, -1.0), repeat=3) if [a, b, c].count(0.0) == 1
)
"""Body direction that points up when the cube balances on one of its 12 edges."""


def hand_session(
    n_poses: int = 24,
    pose_s: float = 4.0,
    move_s: float = 2.0,
    first_pose_s: float = 20.0,
    wobble_deg: float = 6.0,
    travel_m: float = 0.1,
    arm_m: float = 0.0,
    layout: int = 0,
) -> Motion:
    """Poses on faces, on edges, then at random tilts; moves by hand with wobble, travel and a change of heading.

    ``layout`` seeds the order, tilts, durations and headings, separately from the noise. The wrist, which is the pivot
    of the moves, lies ``arm_m`` behind the case (along -X).
    """
    if not (isinstance(n_poses, int) and n_poses >= 1):
        raise InputError(f"n_poses must be a whole number of at least 1 pose, got {n_poses!r}")
    rng = stream(layout, "hand session")
    fixed = [*FACES, *(EDGES[i] for i in rng.permutation(len(EDGES)))]
    directions = [np.array(d) for d in fixed[:n_poses]]
    while len(directions) < n_poses:
        directions.append(rng.normal(size=3))
    order = [0, *(1 + rng.permutation(n_poses - 1))]
    steps: list[Step] = []
    for count, k in enumerate(order):
        d = directions[k]
        up = triple(d)
        if count:
            travel = travel_m * rng.normal(size=3)
            steps.append(
                MoveTo(
                    up,
                    duration_s=move_s * float(rng.uniform(0.7, 1.5)),
                    heading_deg=float(rng.uniform(-120.0, 120.0)),
                    wobble_deg=wobble_deg,
                    travel_m=(float(travel[0]), float(travel[1]), 0.3 * float(travel[2])),
                    arm_m=(arm_m, 0.0, 0.0),
                )
            )
        duration = first_pose_s if count == 0 else pose_s * float(rng.uniform(0.8, 1.3))
        steps.append(Pose(duration, name=f"pose {count + 1}"))
    return Motion(tuple(steps), start=attitude_with_up(directions[order[0]]))


def poses_in_order(
    ups: Sequence[tuple[float, float, float]],
    pose_s: float = 5.0,
    move_s: float = 3.0,
    wobble_deg: float = 3.0,
    arrive: bool = False,
) -> Motion:
    """One pose for each body direction in ``ups``, pointing up; ``arrive`` adds a move before the first pose."""
    if len(ups) == 0:
        raise InputError("a session of poses needs at least one direction that is held up")
    steps: list[Step] = []
    for count, up in enumerate(ups):
        if count or arrive:
            steps.append(MoveTo(up, move_s, wobble_deg=wobble_deg))
        steps.append(Pose(pose_s, name="up " + " ".join(f"{c:+.0f}" for c in up)))
    return Motion(tuple(steps), start=attitude_with_up(ups[0]))


def six_faces(repeats: int = 1, pose_s: float = 5.0, move_s: float = 3.0) -> Motion:
    """The cube on each of its six faces in turn, ``repeats`` times."""
    if not (isinstance(repeats, int) and repeats >= 1):
        raise InputError(f"repeats must be a whole number of at least 1 round, got {repeats!r}")
    return poses_in_order(FACES * repeats, pose_s, move_s)


def table_turns(
    turns_deg: tuple[float, ...] = (90.0, -90.0, 180.0, -180.0, 360.0, -360.0),
    pose_s: float = 3.0,
    speed_deg_s: float = 90.0,
    faces: tuple[tuple[float, float, float], ...] = FACES[::2],
    error_deg: float = 0.0,
    layout: int = 0,
) -> Motion:
    """Turns about the vertical on a table, aligned with a wall, with each body direction in ``faces`` up in turn.

    ``error_deg`` is the standard deviation of the true angle from the stated one, seeded by ``layout``.
    """
    if len(faces) == 0:
        raise InputError("turns on a table need at least one face that the case stands on")
    if not speed_deg_s > 0.0:
        raise InputError(f"speed_deg_s must be positive, got {speed_deg_s!r}")
    rng = stream(layout, "table turns")
    steps: list[Step] = [Pose(10.0, name="static")]
    for count, face in enumerate(faces):
        if count:
            steps += [MoveTo(face, 3.0, wobble_deg=3.0), Pose(pose_s, name="static")]
        for turn in turns_deg:
            duration = max(1.0, abs(turn) / speed_deg_s * 1.25)
            error = error_deg * float(rng.standard_normal())
            turned = Turn(face, turn, duration, error_deg=error, name=f"turn {turn:+g} deg")
            steps += [turned, Pose(pose_s, name="static")]
    return Motion(tuple(steps), start=attitude_with_up(faces[0]))


def dividing_head(pose_s: float = 2.0, move_s: float = 1.0) -> Motion:
    """The 324 poses of an optical dividing head: pitch 0..350 deg by 10, roll 0..80 deg by 10.

    In the pose ``pitch P roll R`` the body direction ``(-sin P, cos P sin R, cos P cos R)`` points up.
    """
    steps: list[Step] = []
    start = (0.0, 0.0, 1.0)
    for roll in range(0, 90, 10):
        for pitch in range(0, 360, 10):
            p, r = math.radians(pitch), math.radians(roll)
            up = (-math.sin(p), math.cos(p) * math.sin(r), math.cos(p) * math.cos(r))
            if steps:
                steps.append(MoveTo(up, move_s))
            steps.append(Pose(pose_s, name=f"pitch {pitch} roll {roll}"))
    return Motion(tuple(steps), start=attitude_with_up(start))


def rate_table(
    rates_deg_s: tuple[float, ...] = (30.0, 60.0, 120.0, 240.0),
    plateau_s: float = 6.0,
    ramp_s: float = 2.0,
    axes: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Motion:
    """Constant rates of both signs about each body axis, which points up, with smooth ramps before and after."""
    steps: list[Step] = [Pose(5.0, name="static")]
    for axis in axes:
        steps += [MoveTo(axis, 3.0), Pose(3.0, name="static")]
        for rate in rates_deg_s:
            for sign in (1.0, -1.0):
                duration = plateau_s + 2.0 * ramp_s
                angle = sign * rate * (plateau_s + ramp_s)
                name = f"rate {sign * rate:+g} deg/s"
                steps += [
                    Turn(axis, angle, duration, ramp=ramp_s / duration, arm_m=arm_m, name=name),
                    Pose(2.0, name="static"),
                ]
    return Motion(tuple(steps))


def long_static(duration_s: float = 3600.0, up: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Motion:
    """One static pose, for Allan variance."""
    return Motion((Pose(duration_s, name="static"),), start=attitude_with_up(up))


def manual_session() -> Motion:
    """The laboratory manual's: six faces and twelve edges, then turns by ±8π on three faces."""
    poses = poses_in_order([*FACES, *EDGES], pose_s=6.0, move_s=3.0, wobble_deg=4.0)
    steps = list(poses.steps)
    for face in FACES[::2]:
        steps += poses_in_order([face], pose_s=4.0, move_s=3.0, arrive=True).steps
        for angle in (1440.0, -1440.0):
            steps += [Turn(face, angle, 16.0, ramp=0.25, wobble_deg=0.4), Pose(4.0, "static")]
    return Motion(tuple(steps), start=poses.start)


SESSIONS: dict[str, Callable[..., Motion]] = {
    "hand": hand_session,
    "six-faces": six_faces,
    "table-turns": table_turns,
    "dividing-head": dividing_head,
    "rate-table": rate_table,
    "manual": manual_session,
    "static": long_static,
}
"""Sessions that a scenario file can name, and the functions that make them."""
