"""Velocity of an accelerometer beside a path, block by block."""

from types import SimpleNamespace

import numpy as np

from trihedron.estimate.filter_noise.velocity import velocity_stretches

G, HZ = 9.81, 100.0


def test_a_path_without_noise_leaves_nothing_of_the_velocity():
    # Swings of 0.3 m/s: summed half a sample ahead of the path they left 2 mm/s rms.
    t = np.arange(6000) / HZ
    w, size = 2.0 * np.pi * np.array([0.23, 0.41, 0.67]), np.array([0.3, 0.2, 0.1])

    def path(at):
        return size * np.sin(w * at[:, None])

    force = -(w**2) * path(t) + [0.0, 0.0, G]
    reference = SimpleNamespace(
        covers=lambda at: np.ones(len(at), dtype=bool), attitude=lambda at: np.tile(np.eye(3), (len(at), 1, 1)),
        position=path,
    )  # fmt: skip
    side = SimpleNamespace(
        grid=SimpleNamespace(time_s=t, step_s=1.0 / HZ), force=force, seen=np.ones(len(t), dtype=bool),
        reference=reference,
    )  # fmt: skip
    point = SimpleNamespace(rate=0.0, offset_s=0.0, mounting=np.eye(3))
    (stretch,) = velocity_stretches(side, point, 25.0, 0.0, G, 1e-6)
    # Gravity, a bias and the velocity at the start are not what is asked here; S may not make up for anything.
    free = stretch.columns[:, 9:18]
    left = stretch.observed - free @ np.linalg.lstsq(free, stretch.observed, rcond=None)[0]
    assert np.abs(left).max() < 5e-5
