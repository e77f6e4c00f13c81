"""How a body is moved: rates in closed form on a fine grid, attitudes by products of small rotations.

The body is turned by a hand (minimum jerk, or a Gaussian rate, whose tails extend into the poses), or on a table
at a constant rate. Nothing here is taken from ``trihedron.simulate``.
"""

from dataclasses import dataclass, field

import numpy as np

G = 9.8137


@dataclass
class Step:
    """A rest of ``seconds``, a turn by ``turn`` degrees about the table's normal, or a move by hand to attitude ``to``
    (3, 3, body to room)."""

    seconds: float
    to: np.ndarray | None = None
    turn: float | None = None
    law: str = "minimum-jerk"


@dataclass
class Motion:
    """Fine grid ``t`` (n,), rate ``w`` (n, 3) in the body at the middle of each step, attitude ``q`` (n + 1, 4) at its
    ends, linear acceleration ``a`` (n + 1, 3) in the room; ``rests`` are times [s]."""

    step: float
    w: np.ndarray
    q: np.ndarray
    a: np.ndarray
    rests: list[tuple[float, float]] = field(default_factory=list)
    turns: list[tuple[float, float, float]] = field(default_factory=list)


def multiply(p, q):
    """Hamilton products of quaternions (..., 4), scalar first."""
    a, b = p[..., :1], q[..., :1]
    u, v = p[..., 1:], q[..., 1:]
    return np.concatenate([a * b - np.sum(u * v, axis=-1, keepdims=True), a * v + b * u + np.cross(u, v)], axis=-1)


def exponential(vector):
    """Quaternions of rotation vectors (..., 3)."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), 0.5 * vector * np.sinc(angle / (2.0 * np.pi))], axis=-1)


def matrix(q):
    """Rotation matrices (..., 3, 3), body to room, of quaternions."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )


def vector_of(R):
    """Rotation vector of a matrix, by its quaternion (safe near half a turn)."""
    k = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
            [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
            [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)],
        ]
    )
    _, vectors = np.linalg.eigh(k / 3.0)
    x, y, z, w = vectors[:, -1] * np.sign(vectors[3, -1] or 1.0)
    axis = np.array([x, y, z])
    size = np.linalg.norm(axis)
    return axis / size * 2.0 * np.arctan2(size, w) if size > 0 else np.zeros(3)


def product(q):
    """The product q_1 q_2 ... q_n, pair by pair."""
    while len(q) > 1:
        even = multiply(q[: len(q) // 2 * 2 : 2], q[1::2])
        q = np.concatenate([even, q[len(q) // 2 * 2 :]])
    return q[0]


def running_product(vectors):
    """Quaternions e_1, e_1 e_2, ... of rotation vectors (n, 3), by doubling."""
    products = exponential(vectors)
    if not np.any(vectors):
        return products
    reach = 1
    while reach < len(products):
        products[reach:] = multiply(products[:-reach], products[reach:])
        reach *= 2
    return products


def attitude(up, heading):
    """A body-to-room matrix with the room's vertical along ``up`` of the body."""
    up = np.asarray(up, dtype=float) / np.linalg.norm(up)
    side = np.cross(up, [0.31, -0.87, 0.42])
    side /= np.linalg.norm(side)
    R = np.stack([side, np.cross(up, side), up])
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ R


def speed(law, u):
    """Rate of a move on u in (0, 1), integral one."""
    if law == "minimum-jerk":
        return 30.0 * u**2 * (1.0 - u) ** 2
    if law == "gaussian":
        bump = np.exp(-0.5 * ((u - 0.5) * 8.0) ** 2)
        return bump / bump.mean()
    ramp = np.clip(np.minimum(u, 1.0 - u) / 0.08, 0.0, 1.0)
    # Nothing that has a mass starts with a kink, which no sampling could integrate.
    ramp = ramp**2 * (3.0 - 2.0 * ramp)
    return ramp / ramp.mean()


def move(steps, start, rng, rate_hz, tremor=0.0, tilt=0.0, push=0.3):
    """Motion through the steps from attitude ``start``.

    ``tremor`` [rad/s] of the hand while it moves, ``tilt`` [rad] of the table's normal from the vertical, ``push``
    [m/s²] of the hand.
    """
    shortest = min(s.seconds for s in steps if s.to is not None or s.turn is not None)
    fine = max(rate_hz, min(4000.0, 500.0 / shortest))
    per = int(np.ceil(fine / rate_hz))
    dt = 1.0 / (rate_hz * per)
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    rates, pushes, q, blocks = [], [], exponential(vector_of(start)), [exponential(vector_of(start))[None]]
    rests, turns, clock = [], [], 0.0
    for step in steps:
        n = max(round(step.seconds / (dt * per)) * per, per)
        u = (np.arange(n) + 0.5) / n
        w, a = np.zeros((n, 3)), np.zeros((n, 3))
        if step.turn is not None:
            w = np.radians(step.turn) / (n * dt) * speed("table", u)[:, None] * (matrix(q).T @ normal)
            turns.append((clock, clock + n * dt, step.turn))
        elif step.to is not None:
            envelope = speed(step.law, u)[:, None] / (n * dt)
            phi = vector_of(matrix(q).T @ step.to)
            sway = rng.normal(size=3) * 0.15 * np.linalg.norm(phi) * np.sin(2 * np.pi * u)[:, None] * envelope
            wanted, aim, coarse = phi, step.to, slice(None, None, max(n // 400, 1))
            for _ in range(8):
                # The sway turns the axis on the way: aim so that the case arrives where it should.
                w = wanted * envelope + sway
                small = exponential(w[coarse] * (n * dt / len(w[coarse])))
                end = multiply(exponential(vector_of(matrix(q))), product(small))
                aim = aim @ matrix(end).T @ step.to
                new = vector_of(matrix(q).T @ aim)
                if np.linalg.norm(new - wanted) > np.pi:
                    new = new * (1.0 - 2.0 * np.pi / np.linalg.norm(new))
                wanted = new
            shake = (envelope / envelope.max())[:, 0]
            t = np.arange(n) * dt
            for _ in range(2):
                f, phase = rng.uniform(6.0, 11.0), rng.uniform(0, 2 * np.pi, 3)
                w += tremor * shake[:, None] * np.sin(2 * np.pi * f * t[:, None] + phase)
            a = push * rng.normal(size=3) * (np.sin(2 * np.pi * u) * shake)[:, None] * min(1.0, 4.0 / step.seconds**2)
        else:
            rests.append((clock, clock + n * dt))
        path = multiply(np.broadcast_to(q, (n, 4)), running_product(w * dt))
        path /= np.linalg.norm(path, axis=1, keepdims=True)
        q = path[-1]
        rates.append(w)
        pushes.append(a)
        blocks.append(path)
        clock += n * dt
    return Motion(dt, np.vstack(rates), np.vstack(blocks), np.vstack(pushes), rests, turns), per
