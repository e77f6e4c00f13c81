"""The sessions that are asked about: poses by hand, and faces on a table."""

import numpy as np

from confidence.motion import Step, attitude, move
from confidence.sensor import read_out

FACES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
EDGES = [(a, b, 0) for a in (1, -1) for b in (1, -1)] + [(a, 0, b) for a in (1, -1) for b in (1, -1)]
EDGES += [(0, a, b) for a in (1, -1) for b in (1, -1)]


def directions(n, rng):
    """n poses: edges and faces of a cube in a random order, set down a few degrees off; more at random."""
    known = [np.array(d, dtype=float) / np.linalg.norm(d) for d in EDGES + FACES]
    chosen = [known[k] for k in rng.permutation(18)[: min(n, 18)]]
    if n < 18:
        # Spread: the choice whose poses determine nine parameters best among some.
        best = -np.inf
        for _ in range(60):
            tried = [known[k] for k in rng.permutation(18)[:n]]
            rows = np.array([[*(u[:, None] * u)[np.tril_indices(3)], *u] for u in tried])
            worst = np.linalg.svd(rows, compute_uv=False)[-1]
            if worst > best:
                best, chosen = worst, tried
    chosen += [v / np.linalg.norm(v) for v in rng.normal(size=(max(n - 18, 0), 3))]
    return [d + 0.06 * rng.normal(size=3) for d in chosen]


def hand(seed, n_poses=18, move_s=2.0, pose_s=4.0, rate_hz=100.0, law=None, **sensor):
    """Counts, rate and truth of a session of poses set down by hand."""
    rng = np.random.default_rng([11, seed])
    # A brisk hand reaches a thousand degrees a second, and is given a gyro that follows it.
    sensor.setdefault("gyro_range", np.radians(500.0 if move_s >= 1.0 else 2000.0))
    targets = [attitude(d, rng.uniform(0, 2 * np.pi)) for d in directions(n_poses, rng)]
    steps = [Step(pose_s)]
    for k, target in enumerate(targets[1:]):
        which = law or ("minimum-jerk", "gaussian")[k % 2]
        steps += [Step(move_s * rng.uniform(0.8, 1.25), to=target, law=which), Step(pose_s * rng.uniform(0.85, 1.3))]
    motion, per = move(steps, targets[0], rng, rate_hz, tremor=np.radians(2.0) * min(1.0, 2.0 / move_s))
    return (*read_out(motion, per, rng, **sensor), motion)


def leaning(tilt_deg):
    """A table's tilt [rad], and the turn of the room that lays it level."""
    tilt = np.radians(tilt_deg)
    return tilt, np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])


def table(seed, turns=(90, -90), rate_deg_s=90.0, tilt_deg=1.0, pose_s=4.0, rate_hz=100.0, bases=FACES, **sensor):
    """Faces set down by hand on a table that is not level, turned there by known angles at a constant rate."""
    rng = np.random.default_rng([12, seed])
    sensor.setdefault("gyro_range", np.radians(500.0 if rate_deg_s < 300.0 else 2000.0))
    steps, first = [], None
    tilt, lean = leaning(tilt_deg)
    for up in bases:
        target = lean @ attitude(up, rng.uniform(0, 2 * np.pi))
        if first is None:
            first = target
        else:
            steps.append(Step(2.0, to=target))
        steps.append(Step(pose_s * rng.uniform(0.85, 1.3)))
        for angle in turns:
            steps += [Step(abs(angle) / rate_deg_s / 0.92, turn=angle), Step(pose_s * rng.uniform(0.85, 1.3))]
    motion, per = move(steps, first, rng, rate_hz, tilt=tilt, tremor=np.radians(2.0))
    return (*read_out(motion, per, rng, **sensor), motion)
