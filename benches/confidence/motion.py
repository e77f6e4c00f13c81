"""How a body is moved: rates in closed form on a fine grid, attitudes by products of small rotations.

The body is turned by a hand (minimum jerk, or a Gaussian rate, whose tails extend into the poses), or on a table
at a constant rate. Nothing here is taken from ``trihedron.simulate``.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from motion import running_product

G = 9.8137
EARTH_RAD_S = 7.2921e-5 * np.array([np.cos(0.87), 0.0, np.sin(0.87)])
"""The Earth's rotation in the room, its X axis northward, at a latitude of 50°."""


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
    """Rate ``w`` (n, 3) of the body, the Earth's included, at the middle of each step, attitudes ``q`` (n + 1,) at its
    ends, linear acceleration ``a`` (n, 3) in the room; ``rests`` are times [s]."""

    step: float
    w: np.ndarray
    q: Rotation
    a: np.ndarray
    rests: list[tuple[float, float]] = field(default_factory=list)
    turns: list[tuple[float, float, float]] = field(default_factory=list)


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
    q = Rotation.from_matrix(start)
    rates, pushes, blocks = [], [], [q]
    rests, turns, clock = [], [], 0.0
    for step in steps:
        n = max(round(step.seconds / (dt * per)) * per, per)
        u = (np.arange(n) + 0.5) / n
        w, a = np.zeros((n, 3)), np.zeros((n, 3))
        if step.turn is not None:
            w = np.radians(step.turn) / (n * dt) * speed("table", u)[:, None] * q.inv().apply(normal)
            turns.append((clock, clock + n * dt, step.turn))
        elif step.to is not None:
            envelope = speed(step.law, u)[:, None] / (n * dt)
            to = Rotation.from_matrix(step.to)
            phi = (q.inv() * to).as_rotvec()
            sway = rng.normal(size=3) * 0.15 * np.linalg.norm(phi) * np.sin(2 * np.pi * u)[:, None] * envelope
            wanted, aim, coarse = phi, to, slice(None, None, max(n // 400, 1))
            for _ in range(8):
                # The sway turns the axis on the way: aim so that the case arrives where it should.
                w = wanted * envelope + sway
                end = q * running_product(w[coarse] * (n * dt / len(w[coarse])))[-1]
                aim = aim * end.inv() * to
                new = (q.inv() * aim).as_rotvec()
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
        path = q * running_product(w * dt)
        q = path[-1]
        rates.append(w + path.inv().apply(EARTH_RAD_S))
        pushes.append(a)
        blocks.append(path)
        clock += n * dt
    return Motion(dt, np.vstack(rates), Rotation.concatenate(blocks), np.vstack(pushes), rests, turns), per
