"""One zero of the accelerometer for a session, and how far 1/f noise carries it from pose to pose."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

from confidence.motion import G
from confidence.sessions import hand
from trihedron import _core, diagnose
from trihedron.diagnose.zeros.flicker import flicker_of
from trihedron.diagnose.zeros.process import ZeroReadings
from trihedron.estimate.accelerometer import calibrate_norm
from trihedron.estimate.gyroscope import MoveOptions
from trihedron.estimate.joint import calibrate_joint
from trihedron.records import Recording
from trihedron.session.flicker import expected_scatter
from trihedron.simulate import Accelerometer, Gyroscope, NoiseTerms, Scenario, hand_session, simulate
from true_segments import segments_from_truth

RATE_HZ, POSES, HOLD, MOVE = 100.0, 18, 400, 200
UP = np.tile([0.6, 0.0, 0.8], (POSES, 1))


def test_the_zero_of_a_session_is_that_of_its_middle():
    # A zero that drifts by 60 mm/s² over the session: the first pose's is 30 mm/s² from that of the middle.
    drift = 0.06
    away = []
    for seed in range(6):
        recording, truth = simulate(
            Scenario(
                motion=hand_session(20, hold_s=2.0, first_hold_s=3.0),
                accelerometer=Accelerometer(noise=NoiseTerms(N=(2e-3,) * 3)),
                gyroscope=Gyroscope(noise=NoiseTerms(N=(2e-4,) * 3)),
            ),
            seed,
        )
        part = np.linspace(-0.5, 0.5, recording.n_samples)[:, np.newaxis]
        drifting = Recording(
            recording.time_s, recording.accelerometer + drift * part, recording.gyroscope, recording.rate_hz,
            accelerometer_unit="m/s^2", gyroscope_unit="rad/s",
        )  # fmt: skip
        segments = segments_from_truth(drifting, truth)
        alone, _ = calibrate_norm(
            segments.accelerometer_mean, segments.accelerometer_sigma_mean, truth.gravity_m_s2, raw_unit="m/s^2"
        )
        found = calibrate_joint(drifting, segments, alone, truth.gravity_m_s2, "given", MoveOptions(n_folds=0))
        middle = np.mean([part[hold.start : hold.stop].mean() for hold in segments.holds])
        # f = S a' + b, so that b is minus the zero.
        away.append(found.accelerometer.b + drift * middle)
    # A third of what the zero of the first pose is away.
    assert np.sqrt(np.mean(np.square(away))) < drift / 2 / 3


def noisy(rng, flicker, white=1.0):
    """(n, 3) readings of white noise (1/√Hz) and a flicker of density h/f, and the ranges of the poses."""
    n = POSES * (HOLD + MOVE)
    f = np.fft.rfftfreq(2 * n, 1.0 / RATE_HZ)
    gain = np.zeros_like(f)
    gain[1:] = np.sqrt(flicker / f[1:])
    spectrum = np.fft.rfft(rng.normal(size=(2 * n, 3)) * np.sqrt(RATE_HZ), axis=0) * gain[:, np.newaxis] / np.sqrt(2.0)
    slow = np.fft.irfft(spectrum, 2 * n, axis=0)[:n]
    starts = np.arange(POSES) * (HOLD + MOVE)
    readings = slow + white * np.sqrt(RATE_HZ) * rng.normal(size=(n, 3))
    return readings, np.stack([starts, starts + HOLD], axis=1), slow


def test_flicker_inside_poses_says_how_far_zeros_scatter_between_them():
    rng = np.random.default_rng(5)
    said, true = [], []
    for _ in range(60):
        readings, spans, slow = noisy(rng, flicker=1.0)
        said.append(expected_scatter(readings, spans, UP))
        means, _ = _core.means_by_owner(slow, spans, np.arange(POSES), POSES)
        true.append(np.std(means @ UP[0], ddof=1))
    # Eighteen differences of halves tell a size to 17 %; in 60 sessions one standard error of the mean ratio is 3 %.
    assert 0.8 < np.sqrt(np.mean(np.square(said))) / np.sqrt(np.mean(np.square(true))) < 1.25
    # Halves differ by 2.2 times what eighths lead to expect; fewer than a sixth of eighteen come out below 1.3.
    assert np.mean(np.array(said) > 0.0) > 0.7


def test_white_noise_and_a_hand_that_shakes_single_poses_let_expect_nothing():
    rng = np.random.default_rng(6)
    said = []
    for _ in range(60):
        readings, spans, _ = noisy(rng, flicker=0.0)
        for hold in rng.choice(POSES, 2, replace=False):
            middle = (spans[hold, 0] + spans[hold, 1]) // 2
            readings[middle : spans[hold, 1]] += 5.0
        said.append(expected_scatter(readings, spans, UP) > 0.0)
    # One standard error above by chance: one in six, three times 4.8 % of chance in 60 sessions above.
    assert np.mean(said) < 0.31
    assert expected_scatter(readings, spans[:4], UP[:4]) == 0.0
    assert expected_scatter(readings, spans, np.full_like(UP, np.nan)) == 0.0


PARTS = 8


def parts_of(readings, poses=POSES):
    """Means of eighths of every pose, as the process of the zeros takes them."""
    edges = (np.arange(poses)[:, np.newaxis] * (HOLD + MOVE) + np.arange(PARTS + 1) * HOLD // PARTS).astype(int)
    start, stop = edges[:, :-1].ravel(), edges[:, 1:].ravel()
    values = np.array([readings[a:b].mean(axis=0) for a, b in zip(start, stop, strict=True)]).T
    n = len(start)
    return ZeroReadings(
        values, np.ones_like(values), 0.5 * (start + stop) / RATE_HZ, (stop - start) / RATE_HZ,
        np.repeat(np.arange(poses), PARTS), np.ones((n, 1)), np.ones((n, 1)),
    )  # fmt: skip


def test_zeros_that_flicker_are_told_from_zeros_that_do_anything_else():
    rng = np.random.default_rng(8)
    size = np.array([1.0, 3.0, 0.2])  # axes of noises of their own
    said, true = [], []
    for _ in range(40):
        readings, spans, slow = noisy(rng, flicker=1.0)
        found = flicker_of(parts_of(readings * size), [0])
        if found is not None:
            said.append(found / size)
            means, _ = _core.means_by_owner(slow, spans, np.arange(POSES), POSES)
            true.append(np.std(means, axis=0, ddof=1))
    # Halves of poses differ by 2.2 times what white noise makes them; all parts together tell that in nine of ten.
    assert len(said) >= 34
    # 34 sessions of three axes, each size known to 17 % from its own poses.
    assert 0.8 < np.sqrt(np.mean(np.square(said))) / np.sqrt(np.mean(np.square(true))) < 1.25


def drawn(kind, rng):
    """Zeros (n, 3) of a session that are no flicker, as large against white noise of 1/√Hz as matters."""
    n = POSES * (HOLD + MOVE)
    part = np.linspace(0.0, 1.0, n)[:, np.newaxis]
    if kind == "scatter":
        return np.repeat(2.0 * rng.normal(size=(POSES, 3)), HOLD + MOVE, axis=0)
    if kind == "walk":
        return 8.0 * np.cumsum(rng.normal(size=(n, 3)), axis=0) / np.sqrt(n)
    if kind == "warm-up":
        return 6.0 * np.exp(-3.0 * part) * rng.normal(size=3)
    return 0.0 * part


@pytest.mark.parametrize("kind", ["scatter", "walk", "warm-up", "nothing"])
def test_what_is_no_flicker_is_not_taken_for_it(kind):
    rng = np.random.default_rng(9)
    taken = []
    for _ in range(25):
        readings, _, _ = noisy(rng, flicker=0.0)
        found = flicker_of(parts_of(readings + drawn(kind, rng)), [0])
        # White noise alone is the flicker of strength 0, or one that is small beside the errors of the means, 0.5.
        taken.append(found is not None and np.sqrt(np.mean(found**2)) > 0.5)
    # Two of 25 where one in fifty is to be expected.
    assert sum(taken) <= 2


def test_flicker_beside_scatter_is_not_all_there_is():
    rng = np.random.default_rng(10)
    found = [flicker_of(parts_of(noisy(rng, flicker=0.3)[0] + 2.0 * drawn("scatter", rng)), [0]) for _ in range(20)]
    assert sum(one is not None for one in found) <= 1


@pytest.mark.parametrize("seed", [9002, 9031])
def test_zeros_that_wander_as_consumer_parts_do_are_no_physics(seed):
    f, w, rate, _, _ = hand(seed, move_s=1.5, gyro_flicker=np.radians(20.0 / 3600.0), accel_flicker=0.3e-3 * G)
    recording = Recording(np.arange(len(f)) / rate, f, w, rate, accelerometer_unit="counts", gyroscope_unit="counts")
    assert diagnose(recording, gravity_m_s2=G).verdict == "consistent"
