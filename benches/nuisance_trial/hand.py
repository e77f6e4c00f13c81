"""Motion of a body through poses: five courses of a move, soft supports, disturbed poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from motion import minimum_jerk


def trapezoid(x):
    """A machine: constant acceleration, constant rate, constant deceleration, rounded by a tenth."""
    fine = np.linspace(0.0, 1.0, 2001)
    rate = np.clip(np.minimum(fine, 1.0 - fine) / 0.25, 0.0, 1.0)
    rate = np.convolve(rate, np.hanning(201) / np.hanning(201).sum(), mode="same")
    rate[0] = rate[-1] = 0.0
    path = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))])
    return np.interp(x, fine, path / path[-1])


def lognormal(x):
    """A ballistic stroke: quick start, long tail."""
    x = np.clip(x, 1e-9, 1.0)
    width, middle = 0.35, 0.32
    raw = ndtr(np.log(x / middle) / width)
    last = ndtr(np.log(1.0 / middle) / width)
    # A smooth window over the last fifth ends the tail.
    out = raw / last
    blend = minimum_jerk((x - 0.8) / 0.2)
    return out * (1.0 - blend) + blend


def two_strokes(x):
    """A stroke that falls short, and its correction."""
    return 0.8 * minimum_jerk(x / 0.6) + 0.2 * minimum_jerk((x - 0.5) / 0.5)


def overshoot(x):
    """Beyond the goal and back."""
    return 1.12 * minimum_jerk(x / 0.7) - 0.12 * minimum_jerk((x - 0.65) / 0.35)


COURSES = (minimum_jerk, trapezoid, lognormal, two_strokes, overshoot)


@dataclass
class Motion:
    """(n,) time, (n, 3, 3) world-to-body matrices, (n, 3) position in the world, on a fine clock."""

    t: np.ndarray
    C: np.ndarray
    position: np.ndarray
    poses: list


def rotations(vectors):
    """(n, 3, 3) rotation matrices of (n, 3) rotation vectors."""
    return Rotation.from_rotvec(vectors).as_matrix()


def random_pose(rng):
    w, x, y, z = rng.normal(size=4)
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def session(rng, fine_hz, n_poses, pose_s, move_s, how):
    """A session of poses and moves; ``how``: what the support and the hand do besides."""
    parts_t, parts_C, parts_p, poses, bumps = [], [], [], [], []
    now, C, p = 0.0, random_pose(rng), np.zeros(3)
    bumped = set(rng.choice(n_poses, how["bumps"], replace=False).tolist()) if how["bumps"] else set()
    for k in range(n_poses):
        length = pose_s * rng.uniform(0.8, 1.3) * (2.0 if k == 0 else 1.0)
        n = int(length * fine_hz)
        s = np.arange(n) / fine_hz
        lean = np.zeros((n, 3))
        place = np.zeros((n, 3))
        if how["soft"]:
            # The support yields, and sways a little after the hand lets go.
            direction, sway = rng.normal(size=3), rng.normal(size=3)
            f, tau = rng.uniform(2.0, 6.0), rng.uniform(0.15, 0.5)
            lean += how["soft"] * direction * (np.exp(-s / rng.uniform(1.0, 4.0)) - 1.0)[:, None]
            rise = minimum_jerk(s / 0.15)
            lean += (0.3 * how["soft"] * rise * np.exp(-s / tau) * np.sin(2 * np.pi * f * s))[:, None] * sway
        if how["jolt"] and k:
            f, tau = rng.uniform(8.0, 25.0), rng.uniform(0.03, 0.08)
            shape = minimum_jerk(s / 0.05) * np.exp(-s / tau) * np.sin(2 * np.pi * f * s)
            place += shape[:, None] * rng.normal(size=3) * how["jolt"] / (2 * np.pi * f) ** 2
        if k in bumped:
            at = rng.uniform(0.35, 0.65) * length
            push = minimum_jerk((s - at) / 0.25)
            lean += push[:, None] * rng.normal(size=3) * how["bump"]
            place += (push * (1 - push))[:, None] * rng.normal(size=3) * 0.003
            bumps.append(now + at)
        parts_t.append(now + s)
        held = rotations(lean) @ C
        parts_C.append(held)
        parts_p.append(p + place)
        poses.append((now, now + n / fine_hz))
        now += n / fine_hz
        C = held[-1]
        p = p + place[-1]
        if k == n_poses - 1:
            break
        n = int(move_s * rng.uniform(0.7, 1.4) * fine_hz)
        x = np.arange(n) / n
        goal = random_pose(rng)
        turn = Rotation.from_matrix(goal @ C.T).as_rotvec()
        other = rng.normal(size=3) * 0.4
        course, course2 = COURSES[rng.integers(5)], COURSES[rng.integers(5)]
        # A detour about another axis, out and back, changes the axis of rotation.
        detour = np.sin(np.pi * course2(x)) ** 2
        parts_t.append(now + x * n / fine_hz)
        path = rotations(detour[:, None] * other) @ rotations(course(x)[:, None] * turn) @ C
        parts_C.append(path)
        step = rng.normal(size=3) * how["reach"]
        lift = np.sin(np.pi * course2(x)) ** 2
        parts_p.append(p + course(x)[:, None] * step + lift[:, None] * rng.normal(size=3) * 0.5 * how["reach"])
        now += n / fine_hz
        C, p = rotations(turn[None])[0] @ C, p + step
    return Motion(np.concatenate(parts_t), np.concatenate(parts_C), np.concatenate(parts_p), poses), bumps


def body_signals(motion, fine_hz, gravity):
    """(n, 3) specific force at the body's origin and (n, 3) body rate, by differences on the fine clock."""
    C = motion.C
    rate = np.zeros((len(C), 3))
    for h, weight in ((1, 4.0 / 3.0), (2, -1.0 / 3.0)):  # fourth-order central difference of the attitude
        D = (C[2 * h :] - C[: -2 * h]) * (fine_hz / (2.0 * h))
        W = -D @ C[h : len(C) - h].transpose(0, 2, 1)
        own = 0.5 * np.stack([W[:, 2, 1] - W[:, 1, 2], W[:, 0, 2] - W[:, 2, 0], W[:, 1, 0] - W[:, 0, 1]], axis=1)
        rate[h : len(C) - h] += weight * own
    rate[:2] = rate[-2:] = 0.0
    p = motion.position
    acceleration = np.zeros_like(p)
    acceleration[1:-1] = (p[2:] - 2.0 * p[1:-1] + p[:-2]) * fine_hz**2
    force = np.einsum("nij,nj->ni", C, acceleration + np.array([0.0, 0.0, gravity]))
    return force, rate
