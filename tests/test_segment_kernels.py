"""Edges of poses, means over ranges and moments of moves: kernels of the core against NumPy twins."""

import itertools

import numpy as np
import pytest

from trihedron import _core
from trihedron.ranges import ranges_of
from trihedron.segment.channels import Channels
from trihedron.segment.noise import MeanNoise
from trihedron.segment.recording import LEAST_TURN_RAD, USUAL, radians_per_reading
from trihedron.segment.runs import EDGE_BLOCKS, EdgeNoise, Run, trim_edges
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate

NOISE = MeanNoise(np.array([0.1, 0.2, 0.0]), np.array([1e-3, 0.0, 0.0]), np.array([1e-4, 0.0, 0.0]))


def channels_of(mean, is_gyroscope=(False, False, False), is_valid=None):
    quantum = np.full(mean.shape[1], 0.01)
    is_valid = np.ones(len(mean), dtype=bool) if is_valid is None else is_valid
    return Channels(10, 0.1, mean, np.ones_like(mean), is_valid, quantum, np.array(is_gyroscope))


def clean_twin(off, most, variance, limit):
    for start in range(most + 1):
        stretches = [(off[start : start + k], v) for k, v in zip(EDGE_BLOCKS, variance, strict=True) if k <= most]
        whole = [(rows.mean(axis=0), v) for (rows, v), k in zip(stretches, EDGE_BLOCKS, strict=False) if len(rows) == k]
        if all(np.sum(mean[v > 0.0] ** 2 / v[v > 0.0]) <= limit for mean, v in whole):
            return min(2 * start + 1, most)
    return most


def ends_twin(channels, run, edges):
    n = run.last - run.first
    good = np.ones(n, dtype=bool)
    for a, b in run.bumps:
        good[a - run.first : b - run.first] = False
    core = good & (np.arange(n) >= n // 4) & (np.arange(n) < n - n // 4)
    core = core if core.sum() >= 2 else good
    mean = channels.mean[run.first : run.last]
    off = np.where(good[:, None], mean - mean[core].mean(axis=0), 0.0)
    known = edges.variance + NOISE.variance(core.sum() * channels.step_s) + channels.quantisation_variance
    variance = np.where(edges.live, known, 0.0)
    start, tail = (clean_twin(side, n // 3, variance, edges.limit) for side in (off, off[::-1]))
    return (0, 0) if start + tail > n // 2 else (start, tail)


@pytest.mark.parametrize("seed", range(40))
def test_ends_are_trimmed_as_by_a_plain_loop(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 90))
    mean = 1e3 + rng.normal(size=(n + 9, 3))
    # Soft ends of any size and length, on the sides of a pose that begins at the fifth block.
    ramp = np.exp(-np.minimum(np.arange(n), np.arange(n)[::-1]) / rng.uniform(0.5, 10.0))
    mean[5 : 5 + n] += 10.0 ** rng.uniform(-2.0, 2.0) * ramp[:, None]
    bumps = ((5 + n // 2, 5 + n // 2 + 3),) if n > 20 and seed % 2 else ()
    mean[[a for a, _ in bumps]] = np.nan
    channels = channels_of(mean)
    run, edges = Run(5, 5 + n, bumps), EdgeNoise.of(channels, NOISE)
    trimmed = trim_edges(channels, run, edges)
    assert trimmed.trimmed == ends_twin(channels, run, edges)
    assert (trimmed.outer_first, trimmed.outer_last) == (run.first, run.last)


def test_means_over_ranges_pass_over_what_is_no_number():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(50, 4))
    values[rng.random((50, 4)) < 0.1] = np.nan
    values[30:35, 2] = np.nan
    ranges, owner = np.array([[0, 10], [10, 10], [20, 30], [30, 35], [40, 50]]), np.array([1, 0, 1, 2, 4])
    found = _core.column_means(values, ranges, owner, 5)
    for k, rows in ((1, np.vstack([values[:10], values[20:30]])), (4, values[40:])):
        # Twenty numbers in the order of the twin.
        np.testing.assert_allclose(found[k], np.nanmean(rows, axis=0), rtol=1e-14)
    assert np.isnan(found[[0, 3]]).all()
    assert np.isnan(found[2]).tolist() == [False, False, True, False]
    for wrong in ([[0, 51]], [[-1, 3]], [[3, 1]]):
        with pytest.raises(ValueError, match="50 rows"):
            _core.column_means(values, np.array(wrong), np.array([0]), 1)


def test_the_scale_of_turns_is_that_of_a_loop_over_moves():
    rng = np.random.default_rng(5)
    quiet = np.arange(400) % 40 < 25
    pose = rng.normal(size=(10, 3))
    mean = np.hstack([9.81 * np.repeat(pose / np.linalg.norm(pose, axis=1)[:, None], 40, axis=0), np.zeros((400, 3))])
    mean[:, 3:] = 100.0 + rng.normal(size=(400, 3)) + np.where(quiet, 0.0, 5e3)[:, None] * rng.normal(size=(400, 3))
    is_valid = quiet | (rng.random(400) > 0.1)
    mean[~is_valid] = np.nan
    mean[25:40] = mean[24]  # a gyro that misses a move
    profile = profile_by_name("mpu")
    accelerometer, gyroscope = profile.unit(0)
    counts, _ = simulate(Scenario(hand_session(n_poses=2), "counts", accelerometer, gyroscope, profile.clock))
    channels = channels_of(mean, [False] * 3 + [True] * 3, is_valid)
    ranges, ratios = ranges_of(quiet), []
    for (a, b), (c, d) in itertools.pairwise(ranges):
        f, g = mean[b - 1, :3], mean[c, :3]
        angle = np.arccos(np.clip(f @ g / np.linalg.norm(f) / np.linalg.norm(g), -1.0, 1.0))
        zero = 0.5 * (mean[a:b, 3:].mean(axis=0) + mean[c:d, 3:].mean(axis=0))
        path = np.nansum(np.linalg.norm(mean[b:c, 3:] - zero, axis=1)) * channels.step_s
        ratios += [angle / path] if angle >= LEAST_TURN_RAD else []
    assert len(ratios) >= 6
    found = radians_per_reading(counts, channels, ranges, np.zeros(3))
    assert found == pytest.approx(np.quantile(ratios, USUAL), rel=1e-12)
    assert radians_per_reading(counts, channels, ranges[:1], np.zeros(3)) is None


def test_moments_of_moves_are_trapezoids_over_the_rows_that_are_numbers():
    rng = np.random.default_rng(7)
    time = np.cumsum(rng.uniform(0.005, 0.02, 120))
    reading, rate, zero = 3e4 + 1e3 * rng.normal(size=(120, 3)), rng.normal(size=(120, 3)), rng.normal(size=(4, 3))
    reading[17], rate[[18, 55, 56, 58]] = np.nan, np.inf
    S, b = rng.normal(size=(3, 3)), 1e4 * rng.normal(size=3)
    moves = np.array([[0, 50], [54, 58], [60, 61], [60, 120]])
    found = _core.move_moments(time, reading, S, b, rate, moves, zero)
    for k in (0, 1, 3):
        a, z = moves[k]
        keep = a + np.flatnonzero(np.isfinite(reading[a:z]).all(axis=1) & np.isfinite(rate[a:z]).all(axis=1))
        product = np.einsum("ni,nj->nij", reading[keep] @ S.T + b, rate[keep] - zero[k])
        twin = np.trapezoid(product, time[keep], axis=0)
        # Sixty products of one size.
        np.testing.assert_allclose(found[k], twin, rtol=0.0, atol=1e-12 * np.abs(product).max())
    assert found[2] is None
