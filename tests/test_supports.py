"""Supports that yield, told from biases that scatter and from biases that settle, by the readings of poses alone."""

import numpy as np
import pytest

from trihedron import _core
from trihedron.session.support import CERTAIN, Support

G, RATE_HZ = 9.81, 20.0
GYRO_RAD_S, ACCEL_M_S2 = np.radians(0.05), 0.006
"""White noise of a sample."""


def support(lean_rad=0.0, scatter_rad_s=0.0, settles_rad_s=0.0, *, pose_s=1.6, accel_m_s2=ACCEL_M_S2, tail_rad_s=0.0):
    """That of forty poses as ``diagnose`` finds it: leans and biases that settle have a time constant of 2 s; one pose
    begins in the tail of a move, with a rate ``tail_rad_s`` that gravity does not confirm."""
    rng, poses, n = np.random.default_rng(5), 40, round(pose_s * RATE_HZ)
    fade = np.exp(-np.arange(n) / RATE_HZ / 2.0)[:, None]
    up = rng.normal(size=(poses, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    rate, force = rng.normal(size=(poses, n, 3)) * GYRO_RAD_S, rng.normal(size=(poses, n, 3)) * accel_m_s2
    for k in range(poses):
        lean = lean_rad * rng.normal(size=3)
        rate[k] += lean / 2.0 * fade + scatter_rad_s * rng.normal(size=3) + settles_rad_s * rng.normal(size=3) * fade
        force[k] += G * (up[k] - np.cross(lean * (1.0 - fade), up[k]))
    rate[7] += tail_rad_s * np.exp(-np.arange(n) / RATE_HZ / 0.2)[:, None] * np.cross(up[7], [1.0, 0.0, 0.0])
    readings, spans = (rate.reshape(-1, 3), force.reshape(-1, 3)), np.arange(poses)[:, None] * n + [0, n]
    white = [np.full((poses, 3), sigma / np.sqrt(n)) for sigma in (GYRO_RAD_S, accel_m_s2)]
    found = _core.settling_of_poses(
        readings, (np.eye(3), np.eye(3)), tuple(white), up, (spans, spans),
        gravity_m_s2=G, step_s=1.0 / RATE_HZ, fewest=6, certain=CERTAIN,
    )  # fmt: skip
    assert found is not None
    return Support(*found)


@pytest.mark.parametrize(("lean_rad", "pose_s"), [(0.002, 1.6), (0.003, 0.75)])
def test_supports_that_yield_in_every_pose_do_so_in_short_poses_too(lean_rad, pose_s):
    assert support(lean_rad, pose_s=pose_s).score > CERTAIN


def test_biases_that_scatter_are_no_support_where_gravity_would_show_a_tilt():
    for pose_s in (1.6, 5.0):
        assert not support(scatter_rad_s=7e-4, pose_s=pose_s).yields
    assert not support().yields


def test_where_noise_hides_a_tilt_a_support_explains_what_scatter_would():
    # 0.5 mrad in 0.75 s, of which an accelerometer of this noise shows half a standard error.
    assert support(scatter_rad_s=7e-4, pose_s=0.75, accel_m_s2=0.02).yields


def test_a_bias_that_settles_is_no_support_nor_is_a_pose_in_the_tail_of_a_move_a_bias():
    settling = support(settles_rad_s=3e-3)
    assert settling.of_bias > CERTAIN
    assert not settling.yields
    assert support(0.0005, tail_rad_s=0.02).yields
