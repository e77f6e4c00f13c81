"""Only the error along the vertical enters |f|: a support that gives does not hide the accelerometer."""

import numpy as np

import trihedron

G = 9.81
RATE_HZ, POSE_S = 100.0, 3.0
NOISE = 0.01
"""m/s² per sample."""


def directions(rng, n):
    up = rng.normal(size=(n, 3))
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def settling_log(rng, n=16, settles_rad=1.5e-3):
    """Poses on a pad: each goes on turning, about a horizontal axis, by ``settles_rad`` while it is held."""
    force = []
    n_pose, n_move = int(POSE_S * RATE_HZ), int(RATE_HZ)
    up = directions(rng, n)
    for here, there in zip(up, np.roll(up, -1, axis=0), strict=True):
        across = np.cross(here, rng.normal(size=3))
        across /= np.linalg.norm(across)
        angle = settles_rad * rng.choice([-1.0, 1.0]) * np.exp(-np.linspace(0.0, 3.0, n_pose))
        force.append(G * (here * np.cos(angle)[:, None] + across * np.sin(angle)[:, None]))
        x = np.linspace(0.0, 1.0, n_move)[:, None]
        way = here + (there - here) * x + 0.3 * np.cross(here, there) * np.sin(np.pi * x)
        force.append(G * way / np.linalg.norm(way, axis=1, keepdims=True))
    true = np.vstack(force)
    reading = true * [1.01, 0.99, 1.005] + [0.1, -0.05, 0.08]
    return trihedron.Recording.from_arrays(
        np.arange(len(true)) / RATE_HZ, accelerometer=reading + NOISE * rng.normal(size=reading.shape)
    )


def test_error_along_the_vertical_is_the_noise_alone_where_poses_settle():
    white = NOISE / np.sqrt(POSE_S * RATE_HZ)
    found = [trihedron.segment(settling_log(np.random.default_rng(seed))) for seed in range(5)]
    # Settling by 15 mm/s² shows on the axes. Along the vertical the relation of 16 poses is ± 10 %, but one session
    # in thirty looks like flicker and counts twice: the middle one of five.
    assert min(np.median(one.accelerometer_sigma_mean) for one in found) > 2.0 * white
    along = [np.median(one.accelerometer_sigma_up) for one in found]
    assert 0.85 * white < np.median(along) < 1.3 * white


def test_calibration_on_a_soft_pad_counts_the_norms_by_their_own_errors():
    reduced = []
    for seed in range(10, 16):
        quality = trihedron.calibrate(settling_log(np.random.default_rng(seed)), gravity_m_s2=G).accelerometer.quality
        reduced.append(quality.chi2 / quality.dof)
    # Six sessions of at least seven degrees of freedom: their mean strays by 0.22 (one sigma). By the axes' errors it
    # is below 0.2.
    assert 0.5 < np.mean(reduced) < 1.7
