"""Method 1 with ADCs whose noise is below the LSB: a steady rate inside one LSB is misread all along."""

import numpy as np
import pytest

from trihedron.estimate.accelerometer.faces import calibrate_faces
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.estimate.gyroscope.turns import calibrate_turns
from trihedron.records import Recording
from trihedron.segment.means import BIAS_VARIANCE, NOISE_TRIED

RATE_HZ = 100.0
DEG = np.pi / 180.0
POSE_S = 3.0
SLOW = ((True, 1.0), (False, 4.0), (True, 4.0), (False, 1.0))


def steady_turns(rng, step_deg_s, rate_deg_s, noise_deg_s=0.05, is_table=True):
    """Readings [deg/s] of twelve half turns at a steady rate, there and back twice about each axis; the truth."""
    mix, zero = np.eye(3) + 0.01 * rng.normal(size=(3, 3)), rng.normal(size=3) * 3.0
    rates, turns, at = [np.zeros((round(POSE_S * RATE_HZ), 3))], [], round(POSE_S * RATE_HZ)
    for axis in range(3):
        for sense in (1.0, -1.0, -1.0, 1.0):
            peak = rate_deg_s * (1.0 if is_table else rng.uniform(0.7, 1.4))
            ramp = np.linspace(0.0, 1.0, 12, endpoint=False)
            n = round(180.0 / peak * RATE_HZ) - len(ramp)
            shape = np.concatenate([ramp, np.ones(n), 1.0 - ramp])
            shape *= sense * 180.0 * RATE_HZ / shape.sum()
            rates += [shape[:, None] * np.eye(3)[axis], np.zeros((round(POSE_S * RATE_HZ), 3))]
            turns.append(Turn(at - 5, at + len(shape) + 5, tuple(np.eye(3)[axis]), sense * np.pi))
            at += len(shape) + len(rates[-1])
    rates = np.concatenate(rates)
    seen = rates @ mix.T + zero + noise_deg_s * rng.normal(size=rates.shape)
    seen = step_deg_s * np.round(seen / step_deg_s)
    edges = [0, *(x for turn in turns for x in (turn.start, turn.stop)), len(rates)]
    zeros = list(zip(edges[::2], edges[1::2], strict=True))
    recording = Recording(np.arange(len(seen)) / RATE_HZ, None, seen, RATE_HZ, "counts", "deg/s")
    back = np.linalg.inv(mix)
    return recording, turns, zeros, back * DEG, -back @ zero * DEG


@pytest.mark.parametrize(
    ("is_table", "step", "logs"),
    [(True, 4.0, 12), (False, 1.0, 12), *(pytest.param(*o, 25, marks=pytest.mark.slow) for o in SLOW)],
)
def test_known_turns_of_a_coarse_gyro_lie_within_their_error_bars(step, is_table, logs):
    rng = np.random.default_rng([31, round(step), is_table])
    scores = []
    for _ in range(logs):
        recording, turns, zeros, S, b = steady_turns(rng, step, 60.0, is_table=is_table)
        found, _ = calibrate_turns(recording, turns, zeros)
        scores.append(np.concatenate([(found.S - S).ravel() / found.sigma_S.ravel(), (found.b - b) / found.sigma_b]))
    scores = np.array(scores)
    # Errors of steps are uniform, few at a time: fewer than normal ones lie outside. 12 scores a log, those of one axis
    # related: four binomial deviations below 95 %. Before: rms 20 (S), 40 (b).
    assert np.mean(np.abs(scores) < 1.96) > 0.90
    assert np.sqrt(np.mean(scores[:, :9] ** 2)) > 0.4
    assert np.abs(scores).max() < 5.0


def test_faces_of_a_coarse_accelerometer_lie_within_their_error_bars():
    rng = np.random.default_rng(17)
    scores = []
    faces = np.repeat([1, -1, 2, -2, 3, -3], 3)
    part = float(np.interp(0.1, NOISE_TRIED, BIAS_VARIANCE))
    for _ in range(60):
        S_a = np.diag([13.0, 13.1, 12.9]) @ (np.eye(3) + 0.01 * rng.normal(size=(3, 3)))
        zero = rng.normal(size=3) * 5.0
        f = 9.81 * np.sign(faces)[:, None] * np.eye(3)[np.abs(faces) - 1]
        for k in range(0, 18, 3):
            across = np.eye(3)[np.abs(faces[k]) - 1] == 0.0
            lean = rng.normal(size=(2, 3)) * 0.2 * across
            f[k : k + 3] += lean[[0, 1, 0]]
        places = f @ S_a.T + zero
        values = np.array([np.round(p + 0.1 * rng.normal(size=(400, 3))).mean(axis=0) for p in places])
        found, _ = calibrate_faces(values, np.full(3, np.sqrt(part)), 9.81, up=faces.tolist(), shared=np.full(3, part))
        S = np.linalg.inv(S_a)
        # The zero: no lean of a table reaches it, each face stands as it happens to.
        scores.append(((found.S - S) / found.sigma_S)[np.diag_indices(3)])
    # 180 scores of scales, uniform errors of two faces each; 1 % is what chance leaves below 90 %.
    assert np.mean(np.abs(scores) < 1.96) > 0.90
    assert np.sqrt(np.mean(np.square(scores))) < 1.2
