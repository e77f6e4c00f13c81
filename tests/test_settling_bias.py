"""A bias of the accelerometer that settles after moves is found; tilt that settles and drift are not taken for it."""

import numpy as np
import pytest

import trihedron
from trihedron.records import FindingCode

RATE_HZ, POSE_S, MOVE_S, N_POSES = 100.0, 5.0, 1.5, 18
NOISE = 0.02


def log(seed, size=(0.0, 0.0, 0.0), tau_s=2.0, drift=0.0, tilt_rad=0.0):
    """Accelerometer (n, 3) of poses in random directions: a bias ``size`` that decays after moves, a ``drift`` [m/s²]
    over the log, and supports that give way by ``tilt_rad``."""
    rng = np.random.default_rng(seed)
    up = rng.normal(size=(N_POSES, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    parts = []
    for before, here in zip(np.vstack([up[:1], up[:-1]]), up, strict=True):
        x = np.linspace(0.0, 1.0, int(MOVE_S * RATE_HZ))[:, None]
        path = before * (1.0 - x) + here * x + 0.3 * np.sin(np.pi * x) * rng.normal(size=3)
        t = np.arange(POSE_S * RATE_HZ)[:, None] / RATE_HZ
        across = np.cross(here, rng.normal(size=3))
        across /= np.linalg.norm(across)
        lean = tilt_rad * rng.choice([-1.0, 1.0]) * np.exp(-t / 1.5)
        rest = here * np.cos(lean) + across * np.sin(lean)
        parts += [
            9.81 * path / np.linalg.norm(path, axis=1)[:, None],
            9.81 * rest + np.array(size) * np.exp(-t / tau_s),
        ]
    force = np.concatenate(parts[1:])
    force = force + drift * np.linspace(0.0, 1.0, len(force))[:, None] + NOISE * rng.normal(size=force.shape)
    time_s = np.arange(len(force)) / RATE_HZ
    return trihedron.Recording(time_s, force, None, RATE_HZ, accelerometer_unit="m/s^2")


def found(recording):
    """The finding, if any."""
    findings = trihedron.segment(recording).findings
    return next((one for one in findings if one.code is FindingCode.BIAS_SETTLING), None)


@pytest.mark.parametrize("seed", range(3))
def test_a_bias_that_settles_has_its_size_and_marks_the_calibration(seed):
    recording = log(seed, size=(0.05, 0.0, -0.03))
    one = found(recording)
    assert one is not None
    size = np.array([one.numbers[f"{axis}_mg"] for axis in "xyz"]) * 9.81e-3
    # The time constants tried are a factor of two apart: the size at the start is known to about a quarter.
    assert np.abs(size - [0.05, 0.0, -0.03]).max() < 0.025
    assert not trihedron.calibrate(recording, gravity_m_s2=9.81).is_trustworthy


def test_drift_noise_and_yielding_supports_are_no_settling_bias():
    logs = [log(seed, drift=0.05, tilt_rad=2e-3 * (seed % 2)) for seed in range(100, 120)]
    # Each is a false alarm once in a thousand.
    assert sum(found(one) is not None for one in logs) == 0
