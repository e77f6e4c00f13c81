"""The ways a board is turned about: a person's arm, a tripod head or lazy susan, a box tipped over its edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from desk_trial.parts import Session
from desk_trial.turns import (
    DEGREE,
    TINY,
    Array,
    about,
    band_noise,
    conjugate,
    exponential,
    level,
    logarithm,
    minimum_jerk,
    product,
    stream,
    there_and_back,
    turned,
)

Path = tuple[Array, Array]
"""(N, 4) attitude body → room, (N, 3) place of the board in the room (m)."""
TREMOR_DEG = 0.06
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Timetable:
    """(n,) seconds at which poses begin and end; (N,) the fine clock."""

    begin: Array
    end: Array
    time: Array
    rate: float

    def hold(self, i: int) -> slice:
        return slice(int(self.begin[i] * self.rate), int(self.end[i] * self.rate) + 1)

    def move(self, i: int) -> tuple[slice, Array]:
        """Rows from pose i to the next, and how far on in the move each is (0 to 1)."""
        rows = slice(int(self.end[i] * self.rate), int(self.begin[i + 1] * self.rate))
        return rows, (self.time[rows] - self.end[i]) / (self.time[rows.stop - 1] - self.end[i])


def _spread(rng: np.random.Generator, n: int) -> Array:
    """(n, 3) up vectors near the faces and edges of a cube, each used once before any comes again."""
    grid = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]
    c = np.array([g for g in grid if any(g) and not all(g)], float)
    c /= np.linalg.norm(c, axis=1)[:, None]
    ups: list[Array] = []
    order = rng.permutation(len(c))
    while len(ups) < n:
        u = c[order[len(ups) % len(c)]] + 0.18 * rng.normal(size=3)
        ups.append(u / np.linalg.norm(u))
        if len(ups) % len(c) == 0:
            order = rng.permutation(len(c))
    return np.array(ups)


def _upright(rng: np.random.Generator, u: Array) -> Array:
    """An attitude with the body's u up, headed anywhere."""
    axis = np.cross(u, UP)
    s = float(np.linalg.norm(axis))
    axis = axis / s if s > TINY else np.array([1.0, 0, 0])
    return product(about(2, rng.uniform(-np.pi, np.pi)), exponential(axis * np.arctan2(s, u @ UP)))


def _arm_chain(j: Array) -> tuple[Array, Array, Array]:
    """Attitudes of upper arm, forearm and hand of (..., 7) joint angles (rad)."""
    upper = product(product(about(2, j[..., 0]), about(1, j[..., 1])), about(0, j[..., 2]))
    fore = product(upper, about(1, -j[..., 3]))
    hand = product(product(product(fore, about(0, j[..., 4])), about(1, j[..., 5])), about(2, j[..., 6]))
    return upper, fore, hand


def _reach(rng: np.random.Generator, x: Array, now: Array, then: Array) -> Array:
    """(rows, 7) joint angles on the way: every joint starts and ends in its own time, falls short and corrects."""
    out = np.empty((len(x), 7))
    for k in range(7):
        s0, s1 = rng.uniform(0, 0.2), rng.uniform(0.7, 0.9)
        part = rng.uniform(0.88, 1.04)
        y = part * minimum_jerk((x - s0) / (s1 - s0)) + (1 - part) * minimum_jerk((x - s1 + 0.05) / (1 - s1 + 0.05))
        out[:, k] = now[k] + (then[k] - now[k]) * y
    out[:, 1] -= rng.uniform(0.1, 0.3) * minimum_jerk(x / 0.4) * minimum_jerk((1 - x) / 0.4)
    out[:, 3] += rng.uniform(-0.1, 0.25) * there_and_back(x)
    return out


def _roll_in_fingers(rng: np.random.Generator, x: Array, now: Array, then: Array) -> Array:
    """(rows, 4) the board in the hand, in one stroke or two, along a bowed path."""
    way = logarithm(product(conjugate(now), then))
    in_two = rng.random() < 0.5
    mid = rng.uniform(0.35, 0.65)
    y = minimum_jerk((x - 0.05) / 0.9)
    if in_two:
        y = mid * minimum_jerk((x - 0.05) / 0.5) + (1 - mid) * minimum_jerk((x - 0.45) / 0.5)
    bow = rng.normal(size=3) * 0.25
    return product(now, product(exponential(way * y[:, None]), exponential(bow * there_and_back(x)[:, None])))


def arm(s: Session, seed: int, rng: np.random.Generator, table: Timetable) -> Path:
    n, N = s.poses, len(table.time)
    ups = _spread(rng, n)
    joints = np.array([0.2, 0.5, 0.1, 1.3, 0, 0, 0]) + rng.normal(size=(n, 7)) * np.array(
        [0.15, 0.1, 0.1, 0.15, 0.5, 0.25, 0.25]
    )
    goals = [_upright(rng, u) for u in ups]
    grips = np.array([product(conjugate(_arm_chain(joints[i])[2]), goals[i]) for i in range(n)])
    j, grip, shake = np.zeros((N, 7)), np.zeros((N, 4)), np.zeros(N)
    off_wrist = rng.normal(size=3) * 0.02
    for i in range(n):
        j[table.hold(i)], grip[table.hold(i)] = joints[i], grips[i]
        if i < n - 1:
            rows, x = table.move(i)
            j[rows] = _reach(rng, x, joints[i], joints[i + 1])
            grip[rows] = _roll_in_fingers(rng, x, grips[i], grips[i + 1])
            shake[rows] = minimum_jerk(x / 0.15) * minimum_jerk((1 - x) / 0.12)
    after = np.abs(grip).sum(1) == 0
    grip[after], j[after] = grips[-1], joints[-1]
    for k in range(7):
        j[:, k] += TREMOR_DEG * DEGREE * shake * band_noise(stream(seed, f"tremor{k}"), N, table.rate, 6, 11)
    upper, fore, hand = _arm_chain(j)
    q = product(hand, grip)
    links = [turned(part, np.array([length, 0, 0])) for part, length in ((upper, 0.31), (fore, 0.26), (hand, 0.09))]
    return q, links[0] + links[1] + links[2] + turned(q, off_wrist)


def _head_angles(s: Session, rng: np.random.Generator) -> Array:
    """(n, 3) rad: pan, tilt and roll of a tripod head; the slope and the turns of a lazy susan."""
    n = s.poses
    if s.style == "tripod":
        columns = [rng.uniform(-1.5, 1.5, n), rng.uniform(-100, 100, n) * DEGREE, rng.uniform(-100, 100, n) * DEGREE]
        return np.column_stack(columns)
    still = rng.uniform(-0.3, 0.3, n) * 0
    slope = np.full(n, rng.uniform(50, 85) * DEGREE)
    ways = rng.choice([-1, 1], n, p=[0.3, 0.7])
    return np.column_stack([still, slope, np.cumsum(ways * rng.uniform(35, 80, n) * DEGREE)])


def head(s: Session, seed: int, rng: np.random.Generator, table: Timetable) -> Path:
    """Axes one after the other; the board is mounted anew a few times."""
    n, N = s.poses, len(table.time)
    lever = rng.normal(size=3) * 0.05 + np.array([0.03, 0, 0.06])
    goals = _head_angles(s, rng)
    mountings = 3 if s.style == "tripod" else max(3, n // 5)
    mounts = [m / np.linalg.norm(m) for m in (rng.normal(size=4) for _ in range(mountings))]
    which = np.sort(np.arange(n) % mountings)
    if s.style == "susan":
        for a in range(mountings):
            goals[which == a, 1] = rng.uniform(40, 88) * DEGREE
    angle, mount, shake = np.zeros((N, 3)), np.zeros((N, 4)), np.zeros(N)
    for i in range(n):
        angle[table.hold(i)], mount[table.hold(i)] = goals[i], mounts[which[i]]
        if i == n - 1:
            continue
        rows, x = table.move(i)
        order = rng.permutation(3)
        for k in range(3):
            y = minimum_jerk((x - (order[k] * 0.27 + rng.uniform(0, 0.05))) / 0.4)
            angle[rows, k] = goals[i, k] + (goals[i + 1, k] - goals[i, k]) * y
        mount[rows] = mounts[which[i]]
        if which[i + 1] != which[i]:
            way = logarithm(product(conjugate(mounts[which[i]]), mounts[which[i + 1]]))
            turn = exponential(way * minimum_jerk((x - 0.05) / 0.9)[:, None])
            mount[rows] = product(mounts[which[i]], turn)
        shake[rows] = minimum_jerk(x / 0.15) * minimum_jerk((1 - x) / 0.15)
    after = np.abs(mount).sum(1) == 0
    mount[after], angle[after] = mounts[which[-1]], goals[-1]
    for k in range(3):
        noise = band_noise(stream(seed, f"tremor{k}"), N, table.rate, 4, 9)
        angle[:, k] += TREMOR_DEG * DEGREE * 0.4 * shake * noise
    last = about(0 if s.style == "tripod" else 2, angle[:, 2])
    turn = product(about(2, angle[:, 0]), product(about(1, angle[:, 1]), last))
    return product(turn, mount), turned(turn, lever)


EDGE_M = 0.05
"""Half the box's width: how far its edges are from the middle."""
Stage = tuple[Array, float, bool]
"""Axis in the room, angle (rad), whether about an edge."""


class _Tipping:
    """A box's heading and the lean that the next move has to undo."""

    def __init__(self) -> None:
        self.heading = 0.0
        self.lean: tuple[Array, float] | None = None

    def stages(self, rng: np.random.Generator) -> list[Stage]:
        """Undo the lean, tip over one or two edges, slide round, perhaps lean on a book."""
        tips = int(rng.integers(1, 3))
        out: list[Stage] = []
        if self.lean:
            out.append((-self.lean[0], self.lean[1], False))
        out += [(level(rng.integers(4) * np.pi / 2 + self.heading), np.pi / 2, True) for _ in range(tips)]
        yaw = rng.uniform(-0.7, 0.7)
        out.append((UP, yaw, False))
        self.heading += yaw
        self.lean = None
        if rng.random() < 0.62:
            axis = level(self.heading + rng.integers(4) * np.pi / 2)
            self.lean = (axis, rng.uniform(20, 65) * DEGREE)
            out.append((*self.lean, True))
        return out


def box(s: Session, _seed: int, rng: np.random.Generator, table: Timetable) -> Path:
    """The board is glued in askew."""
    n, N = s.poses, len(table.time)
    skew = exponential(rng.normal(size=3) * 0.5)
    board = rng.normal(size=3) * 0.015
    now, place, tipping = np.array([1.0, 0, 0, 0]), np.zeros(3), _Tipping()
    Q, P = np.zeros((N, 4)), np.zeros((N, 3))
    for i in range(n):
        Q[table.hold(i)], P[table.hold(i)] = now, place
        if i == n - 1:
            continue
        rows, x = table.move(i)
        q, p = np.broadcast_to(now, (len(x), 4)), np.broadcast_to(place, (len(x), 3)).copy()
        stages = tipping.stages(rng)
        each = len(stages) + 0.4
        for k, (axis, angle, is_edge) in enumerate(stages):
            turn = exponential(axis * (angle * minimum_jerk((x - k / each) / (1.4 / each)))[:, None])
            if is_edge:
                pivot = np.cross(UP, axis) * EDGE_M
                p = p + (turned(turn, -pivot) + pivot) * 0.9
            q = product(turn, q)
        p = p + np.array([0, 0, 0.03]) * there_and_back(x)[:, None]
        Q[rows], P[rows], now, place = q, p, q[-1], p[-1]
    after = np.abs(Q).sum(1) == 0
    Q[after], P[after] = now, place
    return product(Q, skew), P + turned(Q, board)


PATHS = {"arm": arm, "tripod": head, "susan": head, "box": box}
