"""Poses with a line through them, and the shift that goes with it, from a generator of this file's own."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import trihedron
from diagnosed_session import simulated
from trihedron.records import Pose, Recording, Segments
from trihedron.session.static_lines import means_beside_lines

RATE_HZ = 100.0
SIGMA = 0.02


def poses(seed, n_poses, amplitude, colour=0.0):
    """Poses of one accelerometer, every second one shaken by a line that is half a cycle short of whole."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(120, 700, n_poses)
    edges = np.concatenate([[0], np.cumsum(lengths)])
    truth = rng.normal(0.0, 5.0, (n_poses, 3))
    x = np.repeat(truth, lengths, axis=0) + rng.normal(0.0, SIGMA, (edges[-1], 3))
    shaken = np.arange(n_poses) % 2 == 1
    for k in range(n_poses):
        here = slice(edges[k], edges[k + 1])
        x[here] += colour * np.cumsum(rng.normal(0.0, SIGMA, (lengths[k], 3)), axis=0)
        if shaken[k]:
            cycles = rng.integers(8, int(0.4 * lengths[k])) + 0.5
            phase = 2.0 * np.pi * cycles * np.arange(lengths[k]) / lengths[k] + rng.uniform(0.0, 2.0 * np.pi)
            x[here] += amplitude * np.sin(phase)[:, None] * rng.choice([-1.0, 1.0], 3) * rng.uniform(0.5, 1.5, 3)
    recording = Recording(
        time_s=np.arange(len(x)) / RATE_HZ, accelerometer=x, gyroscope=None, rate_hz=RATE_HZ,
    )  # fmt: skip
    mean = np.array([x[a:b].mean(axis=0) for a, b in pairwise(edges)])
    error = SIGMA / np.sqrt(lengths)[:, None] * np.ones(3)
    segments = Segments(
        poses=tuple(Pose(k, int(a), int(b), int(a), int(b)) for k, (a, b) in enumerate(pairwise(edges))),
        moves=(), accelerometer_sigma=np.full(3, SIGMA), gyroscope_sigma=None, accelerometer_mean=mean,
        gyroscope_mean=None, accelerometer_sigma_mean=error, gyroscope_sigma_mean=None, n_averaged=lengths,
        time_mid_s=0.5 * (edges[:-1] + edges[1:]) / RATE_HZ, duration_s=lengths / RATE_HZ,
    )  # fmt: skip
    return recording, segments, truth, shaken


def test_a_line_neither_biases_a_mean_nor_widens_its_error():
    recording, segments, truth, shaken = poses(41, 80, 1.0)
    found, _ = means_beside_lines(recording, segments)
    white = segments.accelerometer_sigma_mean
    plain = (segments.accelerometer_mean - truth)[shaken] / white[shaken]
    z = ((found.accelerometer_mean - truth) / found.accelerometer_sigma_mean)[shaken]
    assert plain.std() > 3.0
    # 120 normal numbers: their spread is ± 6.5 %, three times that; 1.96 leaves out 6 of them, 13 once in 200.
    assert 0.8 < z.std() < 1.2
    assert (np.abs(z) > 1.96).sum() <= 13
    # A constant beside a sinusoid of eight cycles or more is known as well as alone, to a few per cent.
    assert np.median(found.accelerometer_sigma_mean[shaken] / white[shaken]) < 1.1


@pytest.mark.parametrize("colour", [0.0, 0.05])
def test_poses_without_a_line_keep_their_means(colour):
    recording, segments, _, _ = poses(42, 150, 0.0, colour)
    found, swing = means_beside_lines(recording, segments)
    assert found is segments
    assert not swing.any()


def session(seed, shaken_share, gain, rate_line):
    """A hand session; in a share of its poses 1 m/s² of shaking with ``gain`` times its square, a line in rates.

    The truth's own poses are shaken from end to end, at a frequency that is no whole number of cycles of any.
    """
    recording, truth = simulated(seed=seed, n_poses=18, grade="tactical")
    rng = np.random.default_rng(seed)
    force, rate, t = recording.accelerometer.copy(), recording.gyroscope.copy(), recording.time_s
    rests = [part for part in truth.segments if part.kind == "pose"]
    f = rng.uniform(0.12, 0.35) * recording.rate_hz
    for k in rng.choice(len(rests), round(shaken_share * len(rests)), replace=False):
        here = slice(rests[k].start, rests[k].stop)
        shake = np.sin(2.0 * np.pi * f * t[here] + rng.uniform(0.0, 6.3))[:, None] * np.array([1.1, -0.8, 0.9])
        force[here] += (shake + gain * shake**2) @ np.linalg.inv(np.asarray(truth.accelerometer_S)).T
    rate += rate_line * np.outer(np.sin(2.0 * np.pi * f * t), np.linalg.solve(truth.gyroscope_S, np.ones(3)))
    log = replace(recording, accelerometer=force, gyroscope=rate)
    return trihedron.diagnose(log, gravity_m_s2=truth.gravity_m_s2)


@pytest.mark.parametrize(
    ("seed", "shaken_share", "gain", "rate_line", "named"),
    # 0.005 of a mean square of 1.1²/2 m²/s⁴ is 3 mm/s², of 0.8²/2 half of that.
    [(1, 0.35, 0.005, 0.0, "vibration-rectification"), (4, 0.0, 0.0, 3e-3, "periodic-interference")],
)
def test_a_few_mm_s2_that_go_with_the_shaking_are_rectification_and_a_line_in_every_pose_is_interference(
    seed, shaken_share, gain, rate_line, named
):
    assert [effect.id for effect in session(seed, shaken_share, gain, rate_line).effects] == [named]
