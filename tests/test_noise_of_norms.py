"""Noise in poses: of readings inside them, of the lengths of gravity in them; two sessions are compared."""

from dataclasses import replace

import numpy as np
import pytest

from trihedron import _core
from trihedron.channel_facts.pooled import ratio_of
from trihedron.estimate.noise.poses import noise_of_poses
from trihedron.estimate.noise.slow import PoseBiases, compare_slow
from trihedron.quantiles import median, medians, quantile, quantiles

N, POSE_S, GAP_S, POSES, RATE_HZ = 4e-3, 4.5, 2.0, 26, 20.0
RATE = 100.0


def session(seed, walk, scatter=0.0, poses=POSES):
    """Norms of poses whose biases are random walks, sample by sample; ``walk`` of all axes or of each [m/s²/√s]."""
    rng = np.random.default_rng(seed)
    every, length = int((POSE_S + GAP_S) * RATE_HZ), int(POSE_S * RATE_HZ)
    up = rng.standard_normal((poses, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    steps = np.broadcast_to(walk, 3) / np.sqrt(RATE_HZ) * rng.standard_normal((poses * every, 3))
    zero = np.cumsum(steps, axis=0)
    means = np.array([zero[k * every : k * every + length].mean(axis=0) for k in range(poses)])
    sigma = np.full(poses, N / np.sqrt(POSE_S))
    norms = (up * means).sum(axis=1) + np.hypot(sigma, scatter) * rng.standard_normal(poses)
    t = np.arange(poses) * (POSE_S + GAP_S)
    return [PoseBiases(norms, sigma, t, np.full(poses, POSE_S), up)]


def test_sessions_of_one_unit_are_not_told_apart_and_the_walk_is_inside_its_interval():
    inside, p = [], []
    for k, walk in enumerate((0.0, 4e-4, 4e-3, (4e-3, 4e-4, 1e-4))):
        for seed in range(2):
            found = compare_slow(session([k, seed], walk), session([k, 50 + seed], walk, scatter=1e-3))
            p.append(found.p_value)
            true = np.sqrt(np.mean(np.square(walk)))
            inside += [side["K"].lower <= true <= side["K"].upper for (side,) in (found.first, found.second)]
    # Eight pairs of one unit: two below 1 % happen in 0.3 %.
    assert np.sum(np.array(p) < 0.01) <= 1
    # 95 % of 16 figures: fewer than 13 happen in 0.7 %.
    assert sum(inside) >= 13


@pytest.mark.parametrize(("pairs", "least", "most"), [(3, 2, 0), pytest.param(5, 3, 1, marks=pytest.mark.slow)])
def test_a_walk_ten_times_as_large_is_told_from_the_other_and_scatter_is_no_walk(pairs, least, most):
    # Seventeen contrasts of one number a pose: most pairs, not all.
    found = [compare_slow(session(s, 1e-2), session(100 + s, 4e-4)) for s in range(pairs)]
    told = [f for f in found if f.p_value < 0.01]
    assert len(told) >= least
    assert {f.term for f in told} == {"K"}
    assert all(axis["K"].upper < 4e-3 for f in told for axis in f.second)
    jumps = [compare_slow(session(s, 0.0, scatter=2e-2), session(100 + s, 0.0)).p_value for s in range(pairs)]
    assert np.sum(np.array(jumps) < 0.01) <= most


def test_figures_do_not_hang_on_how_the_accelerometer_was_calibrated():
    (one,), other = session(1, 4e-3), session(2, 4e-4)
    x, y, z = one.up.T
    moved = replace(one, values=one.values + 0.03 * x - 0.02 * y + 0.01 * z * z + 0.005 * x * y)
    first, second = compare_slow([one], other), compare_slow([moved], other)
    assert first.first[0]["K"].value == pytest.approx(second.first[0]["K"].value, rel=1e-6)
    assert first.p_value == pytest.approx(second.p_value, rel=1e-6)


@pytest.mark.parametrize("shape", [(1, 1), (4, 6), (5, 1), (137, 6)])
@pytest.mark.parametrize("width", [1, 4, 5, 200])
def test_rolling_means_are_those_of_windows_cut_out(shape, width):
    values = np.random.default_rng(width).normal(size=shape)
    n, inside = len(values), min(width, len(values))
    first = np.clip(np.arange(n) - inside // 2, 0, n - inside)
    twin = np.array([values[a : a + inside].mean(axis=0) for a in first])
    # Differences of running sums of at most 137 numbers about one.
    np.testing.assert_allclose(_core.rolling_mean(values, width), twin, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 3, 10, 1001, 4096])
def test_medians_and_quantiles_are_numpys_to_the_last_bit(n):
    rng = np.random.default_rng(n)
    rows = np.round(rng.normal(size=(n, 3)), 2) * np.array([1.0, 1e-300, 1e300])
    at = [0.0, 0.002, 0.1, 0.5, 0.75, 0.998, 1.0, *rng.random(20)]
    assert np.array_equal(medians(rows), np.median(rows, axis=0))
    assert np.array_equal(quantiles(rows, at), np.quantile(rows, at, axis=0))
    assert median(rows[:, 1]) == np.median(rows[:, 1])
    assert [quantile(rows[::-1, 2], q) for q in at] == np.quantile(rows[:, 2], at).tolist()


def test_a_missing_value_has_no_place_and_no_quantile_lies_outside():
    rows = np.array([[1.0, np.nan], [3.0, 4.0]])
    assert medians(rows)[0] == 2.0
    assert np.isnan(medians(rows)[1])
    assert np.isnan(median(np.zeros(0)))
    assert np.isnan(quantile(rows[:, 1], 0.5))
    for outside in (-0.1, 1.1, float("nan")):
        with pytest.raises(ValueError, match="between 0 and 1"):
            quantile(rows[:, 0], outside)


def of(rng, poses=20, seconds=4.0, N=1e-2, step=0.0, scatter=0.0, impacts=0, rate=RATE):
    """Noise of one axis in poses, a second of handling between them."""
    parts, windows, at = [], [], 0
    for k in range(poses):
        n = int(rate * seconds * rng.uniform(0.7, 1.4))
        x = N * np.sqrt(rate) * np.exp(0.5 * scatter * rng.standard_normal()) * rng.standard_normal(n)
        if k < impacts:
            x[n // 2 : n // 2 + 5] += 40 * N * np.sqrt(rate)
        x = x + rng.uniform(-10, 10)
        if step:
            x = np.round(x / step) * step
        parts += [x, 5.0 * rng.standard_normal(int(rate))]
        windows.append((at, at + n))
        at += n + int(rate)
    return noise_of_poses(np.concatenate(parts)[:, None], rate, windows)[0]


@pytest.mark.parametrize("options", [{"step": 0.2}, {"scatter": 0.2, "impacts": 2}], ids=str)
def test_the_white_density_and_the_ratio_of_two_are_inside_their_intervals(options):
    rng = np.random.default_rng(71)
    inside = covered = false = 0
    for _ in range(4):
        one, other = of(rng, N=1.25e-2, **options), of(rng, **options)
        inside += other.white.lower <= 1e-2 <= other.white.upper
        ratio = ratio_of(one.white, other.white)
        covered += ratio.lower <= 1.25 <= ratio.upper
        false += ratio_of(other.white, of(rng, **options).white).p_value < 0.01
    # Of 4 at 95 %: 3 or more with probability 0.986; two false alarms of 4 at 1 % once in 1700.
    assert inside >= 3
    assert covered >= 3
    assert false <= 1


def test_a_line_is_neither_white_noise_nor_a_corner_nor_noise_of_its_octave():
    ratios, corners = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        n, poses = 12000, [(k, k + 450) for k in range(0, 12000, 600)]
        clean = rng.normal(size=(n, 1))
        wave = 0.3 * np.sin(2.0 * np.pi * 18.34 * np.arange(n) / 100.0 + seed)[:, None]
        plain, lined = (noise_of_poses(x, 100.0, poses)[0] for x in (clean, clean + wave))
        ratios.append(lined.white.value / plain.white.value)
        corners.append(lined.corner_hz)
        both = zip(plain.octaves, lined.octaves, strict=True)
        # The same noise: what the line's own two parameters a pose absorb, of some 70 in its octave.
        assert all(abs(np.log(b.density.value / a.density.value)) < 0.1 for a, b in both)
    # Left in, half its square would be 2 % of the density.
    assert np.abs(np.log(ratios)).max() < 0.01
    assert corners == [None] * 3
