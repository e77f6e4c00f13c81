"""Noise inside poses: simulated sessions of known figures, and one held against another."""

import numpy as np
import pytest
from scipy.signal import lfilter

from trihedron.channel_facts.pooled import ratio_of
from trihedron.estimate.noise.poses import noise_of_poses

RATE = 100.0


def session(rng, poses=20, seconds=4.0, N=1e-2, step=0.0, corner=0.0, scatter=0.0, impacts=0, line=0.0, rate=RATE):
    """Readings (n,) of one axis and windows of its poses, a second of handling between them."""
    parts, windows, at = [], [], 0
    for k in range(poses):
        n = int(rate * seconds * rng.uniform(0.7, 1.4))
        x = N * np.sqrt(rate) * np.exp(0.5 * scatter * rng.standard_normal()) * rng.standard_normal(n + 200)
        if corner:
            # First order, density at zero kept; a recursion has the spectrum of an analog filter that is sampled.
            decay = np.exp(-2 * np.pi * corner / rate)
            x = lfilter([1 - decay], [1, -decay], x)
        x = x[200:]
        if line:
            x = x + line * np.sin(2 * np.pi * 17.0 * np.arange(n) / rate + rng.uniform(0, 2 * np.pi))
        if k < impacts:
            x[n // 2 : n // 2 + 5] += 40 * N * np.sqrt(rate)
        x = x + rng.uniform(-10, 10)
        if step:
            x = np.round(x / step) * step
        parts += [x, 5.0 * rng.standard_normal(int(rate))]
        windows.append((at, at + n))
        at += n + int(rate)
    return np.concatenate(parts), windows


def of(rng, **options):
    readings, windows = session(rng, **options)
    return noise_of_poses(readings, RATE, windows)[0]


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


@pytest.mark.parametrize(("axes", "least"), [(4, 3), pytest.param(10, 8, marks=pytest.mark.slow)])
def test_a_filter_shows_its_corner_and_white_noise_none(axes, least):
    rng = np.random.default_rng(73)
    inside = dense = 0
    for _ in range(axes):
        axis = of(rng, corner=15.0)
        # The density is that below the corner: half of the mean squared difference is a quarter of it.
        dense += axis.white.lower <= 1e-2 <= axis.white.upper < 1.2e-2
        inside += axis.corner_hz is not None and axis.corner_hz.lower <= 15.0 <= axis.corner_hz.upper
        plain = of(rng)
        assert plain.corner_hz is None
        # Nothing below Nyquist, as far as twenty poses show.
        assert plain.corner_above_hz > 35.0
    # Of 4 at 95 % three or more with probability 0.986, of 10 eight or more with 0.988.
    assert inside >= least
    assert dense >= least


def test_a_line_common_to_the_holds_is_found_with_its_amplitude():
    rng = np.random.default_rng(74)
    (line,) = of(rng, poses=40, line=0.03).lines
    assert line.frequency_hz == pytest.approx(17.0, abs=0.4)
    assert line.amplitude.value == pytest.approx(0.03, rel=0.3)


def test_a_line_is_neither_white_noise_nor_a_corner_nor_the_noise_of_its_octave():
    ratios, corners = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        n, poses = 12000, [(k, k + 450) for k in range(0, 12000, 600)]
        clean = rng.normal(size=(n, 1))
        wave = 0.3 * np.sin(2.0 * np.pi * 18.34 * np.arange(n) / 100.0 + seed)[:, None]
        plain, lined = (noise_of_poses(x, 100.0, poses)[0] for x in (clean, clean + wave))
        assert (len(plain.lines), len(lined.lines)) == (0, 1)
        ratios.append(lined.white.value / plain.white.value)
        corners.append(lined.corner_hz)
        both = zip(plain.octaves, lined.octaves, strict=True)
        # The same noise: what the line's own two parameters a pose absorb, of some 70 in its octave.
        assert all(abs(np.log(b.density.value / a.density.value)) < 0.1 for a, b in both)
    # Left in, half its square would be 2 % of the density.
    assert np.abs(np.log(ratios)).max() < 0.01
    assert corners == [None] * 3
