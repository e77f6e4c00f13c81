"""Each noise term has the Allan variance that defines it, and its own stream."""

import numpy as np
import pytest

from trihedron.simulate import NoiseTerms, make_noise
from twins_simulate import slow_allan_variance

DT = 0.02
N_SAMPLES = 4096
CLUSTERS = (1, 4, 16, 64, 256)
# Realisations: seeds times three axes.
N_SEEDS = 20


def flicker_expected(m):
    """(2/m²) ∫ sin⁴(ωm/2)/sin²(ω/2) S dω with S = B²/|ω| up to the Nyquist frequency, ∫ S = variance."""
    w = (np.arange(200_000) + 0.5) * np.pi / 200_000
    spectrum = 1.0 / (2.0 * np.pi * w)
    return 2.0 * 2.0 / m**2 * np.sum(np.sin(w * m / 2) ** 4 / np.sin(w / 2) ** 2 * spectrum) * np.pi / 200_000


# Exact discrete expectations at m samples of DT for a unit coefficient.
EXPECTED = {
    "Q": lambda m: 3.0 / (m * DT) ** 2,
    "N": lambda m: 1.0 / (m * DT),
    "B": flicker_expected,
    "K": lambda m: DT * (2.0 * m * m + 1.0) / (6.0 * m),
    "R": lambda m: 0.5 * (m * DT) ** 2,
}


def realisations(term, size=1.0):
    terms = NoiseTerms(**{term: (size, size, size)})
    return np.concatenate([make_noise(terms, N_SAMPLES, DT, seed, "gyroscope").T for seed in range(N_SEEDS)])


@pytest.mark.parametrize("term", list(EXPECTED))
def test_the_allan_variance_of_a_term_is_the_one_that_defines_it(term):
    series = realisations(term)
    for m in CLUSTERS:
        variances = np.array([slow_allan_variance(x, m) for x in series])
        error = variances.std(ddof=1) / np.sqrt(len(variances))
        # Four standard errors of the mean over realisations; the 1/f spectrum itself is made to 3 %, and the ramp has
        # no randomness but rounding.
        slack = {"B": 0.03, "R": 1e-9}.get(term, 0.0) * EXPECTED[term](m)
        assert abs(variances.mean() - EXPECTED[term](m)) < 4.0 * error + slack, (term, m)


def test_terms_axes_sensors_and_seeds_have_independent_streams():
    def draw(seed, sensor):
        return make_noise(NoiseTerms(N=(1.0, 1.0, 1.0)), 20_000, 1.0, seed, sensor)

    columns = [*draw(1, "gyroscope").T, *draw(1, "accelerometer").T, *draw(2, "gyroscope").T]
    correlation = np.corrcoef(columns) - np.eye(9)
    # 36 pairs of correlation coefficients of 1/√n each: 4.5 standard deviations leave 1e-4 for an accident.
    assert np.abs(correlation).max() < 4.5 / np.sqrt(20_000)


def test_a_negative_coefficient_is_refused():
    with pytest.raises(ValueError, match="noise term N"):
        NoiseTerms(N=(-1.0, 0.0, 0.0))
