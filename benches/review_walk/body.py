"""Where a body is, how it turns and what it feels: attitude in closed form piece by piece; NumPy only."""

from dataclasses import dataclass, field

import numpy as np

G = 9.8132
# Half a step [s] of the central difference that makes a rate of attitudes: it is right to 1e-9 rad/s.
H = 1e-4


def turn(v):
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    v = np.asarray(v, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K = np.zeros((*v.shape[:-1], 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        K[..., i, j], K[..., j, i] = -v[..., k], v[..., k]
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.eye(3) + a * K + b * (K @ K)


def log(R):
    """Rotation vectors (..., 3) of rotations by less than π."""
    v = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1) / 2.0
    s = np.linalg.norm(v, axis=-1)
    angle = np.arctan2(s, (np.trace(R, axis1=-2, axis2=-1) - 1.0) / 2.0)
    return v * np.where(s > 0.0, angle / np.where(s > 0.0, s, 1.0), 1.0)[..., None]


def attitude(up, heading):
    """World from body, with the body's direction `up` upwards."""
    up = np.asarray(up, dtype=float) / np.linalg.norm(up)
    axis = np.cross(up, (0.0, 0.0, 1.0))
    s = np.linalg.norm(axis)
    if s < 1e-9:
        tip = np.eye(3) if up[2] > 0.0 else np.diag([1.0, -1.0, -1.0])
    else:
        tip = turn(axis / s * np.arctan2(s, up[2]))
    return turn([0.0, 0.0, heading]) @ tip


def septic(u):
    """From 0 to 1 with three derivatives that vanish at both ends."""
    u = np.clip(u, 0.0, 1.0)
    return u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)


def cosine(u):
    """From 0 to 1 at a rate that is a raised cosine."""
    u = np.clip(u, 0.0, 1.0)
    return u - np.sin(2.0 * np.pi * u) / (2.0 * np.pi)


def steady(u, ramp=0.08):
    """From 0 to 1 at one rate, which is reached and left within a share `ramp` of the time, with a bounded jerk."""
    u = np.clip(u, 0.0, 1.0)
    rate = 1.0 / (1.0 - ramp)
    x = np.minimum(u, 1.0 - u) / ramp
    eased = ramp * rate * np.where(x < 1.0, x**3 - x**4 / 2.0, 0.5 + (x - 1.0))
    return np.where(u < 0.5, eased, 1.0 - eased)


@dataclass
class Motion:
    """Pieces of a session, one after the other."""

    R: np.ndarray
    at: float = 0.0
    pieces: list = field(default_factory=list)
    holds: list = field(default_factory=list)
    turns: list = field(default_factory=list)

    def _add(self, seconds, pose, place):
        self.pieces.append((self.at, seconds, pose, place))
        self.at += seconds

    def hold(self, seconds):
        """Stand still."""
        R = self.R
        self.holds.append((self.at, self.at + seconds))
        self._add(seconds, lambda t: np.broadcast_to(R, (len(t), 3, 3)), None)

    def move(self, to, seconds, law, rng, wobble=0.05, reach=0.1):
        """By hand to an attitude: the law of its angle, a wobble [rad] in between, the place changed by `reach` [m]."""
        start = self.R
        by = log(start.T @ to)
        n = np.arange(1, 4)
        size, phase = rng.normal(size=(3, 3)) * wobble, rng.uniform(0.0, 2.0 * np.pi, (3, 3))
        way = rng.normal(size=3) * reach

        def pose(t):
            u = np.clip(t / seconds, 0.0, 1.0)
            bump = np.sin(np.pi * u) ** 4
            waves = np.sin(2.0 * np.pi * u[:, None, None] * n + phase)
            return start @ turn(law(u)[:, None] * by) @ turn(bump[:, None] * np.sum(size * waves, axis=-1))

        self._add(seconds, pose, lambda t: septic(t / seconds)[:, None] * way)
        self.R = start @ turn(by)

    def rotate(self, degrees, seconds, normal, off_m=0.02, law=steady):
        """On a table about its normal; the sensor stands `off_m` beside the axis."""
        start, axis = self.R, np.asarray(normal, dtype=float)
        beside = np.cross(axis, (0.0, 1.0, 0.3)) * off_m
        angle = np.radians(degrees)
        self.turns.append(degrees)
        self._add(
            seconds,
            lambda t: turn(law(t / seconds)[:, None] * angle * axis) @ start,
            lambda t: turn(law(t / seconds)[:, None] * angle * axis) @ beside,
        )
        self.R = turn(angle * axis) @ start

    def sense(self, t):
        """Rate [rad/s] and specific force [m/s²] in the body (n, 3) at times t."""
        w, f = np.zeros((len(t), 3)), np.zeros((len(t), 3))
        for start, seconds, pose, place in self.pieces:
            inside = (t >= start) & (t < start + seconds)
            if not inside.any():
                continue
            here = t[inside] - start
            w[inside] = log(np.swapaxes(pose(here - H), 1, 2) @ pose(here + H)) / (2.0 * H)
            a = np.zeros((inside.sum(), 3))
            if place is not None:
                # Wider than for rates: a second difference loses twice the digits.
                d = 10.0 * H
                a = (place(here + d) - 2.0 * place(here) + place(here - d)) / d**2
            f[inside] = np.einsum("nji,nj->ni", pose(here), a + np.array([0.0, 0.0, G]))
        return w, f


FACES = [np.array(v, dtype=float) for v in ((0, 0, 1), (1, 0, 0), (0, -1, 0), (-1, 0, 0), (0, 0, -1), (0, 1, 0))]
EDGES = [np.array(v, dtype=float) for v in ((1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0), (0, 1, 1), (0, -1, 1))]
EDGES += [np.array(v, dtype=float) for v in ((0, -1, -1), (0, 1, -1), (1, 0, 1), (-1, 0, 1), (-1, 0, -1), (1, 0, -1))]


def by_hand(rng, poses=18, move_s=2.0, hold_s=4.0, off_deg=6.0, reach=0.1):
    """Faces and edges of a cube in any order, some degrees off, more at random, and the moves between them."""
    known = FACES + EDGES
    ups = [known[k] for k in rng.permutation(len(known))[:poses]]
    ups += [rng.normal(size=3) for _ in range(poses - len(ups))]
    off = np.radians(off_deg)
    to = [turn(rng.normal(size=3) * off) @ attitude(up, rng.uniform(0, 2 * np.pi)) for up in ups]
    motion = Motion(to[0])
    motion.hold(2.0 * hold_s)
    for k, R in enumerate(to[1:]):
        law = (septic, cosine)[k % 2]
        motion.move(R, move_s * rng.uniform(0.8, 1.3), law, rng, wobble=0.05 * min(1.0, move_s), reach=reach)
        motion.hold(hold_s * rng.uniform(0.8, 1.4))
    return motion


def on_table(
    rng, angles, rate_deg_s=60.0, tilt_deg=1.0, hold_s=4.0, ups=FACES, loose_deg=0.0, headings=None, hand_s=2.5
):
    """Faces put on a leaning table and turned there by the angles given; `loose_deg`: how badly a face lies."""
    tilt = np.radians(tilt_deg)
    about = rng.uniform(0, 2 * np.pi)
    lean = turn(np.array([np.cos(about), np.sin(about), 0.0]) * tilt)
    normal = lean @ np.array([0.0, 0.0, 1.0])
    motion = None
    for k, up in enumerate(ups):
        heading = rng.uniform(0, 2 * np.pi) if headings is None else headings[k % len(headings)]
        to = lean @ turn([*(rng.normal(size=2) * np.radians(loose_deg)), 0.0]) @ attitude(up, heading)
        if motion is None:
            motion = Motion(to)
        else:
            motion.move(to, hand_s, cosine, rng)
        motion.hold(hold_s * rng.uniform(0.9, 1.3))
        for angle in angles:
            motion.rotate(angle, abs(angle) / rate_deg_s / 0.92, normal)
            motion.hold(hold_s * rng.uniform(0.9, 1.3))
    return motion
