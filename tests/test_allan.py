"""Allan curves: published values, slow counterparts, an independent tool, precision, gaps, streams."""

import allantools
import numpy as np
import pytest
from scipy.stats import chi2

from trihedron import _core
from trihedron.estimate.noise.allan import KINDS, TYPES, allan_deviation
from trihedron.estimate.noise.streamed import stream_noise

NINE = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0]


def by_definition(x, m, d):
    """Sums of ``d`` times neighbouring means over the readings present, squared; weight Σd² / (m Σ(d²/n))."""
    total = weight = 0.0
    for k in range(len(x) - len(d) * m + 1):
        parts = [x[k + i * m : k + (i + 1) * m] for i in range(len(d))]
        parts = [part[np.isfinite(part)] for part in parts]
        if all(map(len, parts)):
            w = d @ d / (m * np.sum(d**2 / list(map(len, parts))))
            total += w * (d @ [part.mean() for part in parts]) ** 2
            weight += w
    return total / (d @ d * weight)


# NIST SP 1065 (2008), tables 30 and 31, as printed: seven digits.
@pytest.mark.parametrize(
    ("kind", "m", "value"),
    [
        ("overlapping", 1, 91.22945),
        ("non-overlapping", 2, 115.8082),
        ("overlapping", 2, 85.95287),
        ("modified", 2, 74.78849),
        ("total", 1, 91.22945),
        ("total", 2, 93.90379),
        ("hadamard", 1, 70.80607),
        ("hadamard", 2, 85.61487),
    ],
)
def test_the_nine_nbs_frequencies_give_the_printed_values(kind, m, value):
    assert allan_deviation(NINE, 1.0, [m], kind).deviation[0] == pytest.approx(value, abs=6e-5)


@pytest.mark.parametrize(
    ("kind", "oracle"),
    [
        ("overlapping", allantools.oadev),
        ("non-overlapping", allantools.adev),
        ("modified", allantools.mdev),
        ("hadamard", allantools.ohdev),
        ("total", allantools.totdev),
    ],
)
def test_every_kind_agrees_with_allantools(kind, oracle):
    rng = np.random.default_rng(11)
    x = rng.normal(size=20000) + 0.01 * np.cumsum(rng.normal(size=20000))
    clusters = [1, 2, 3, 7, 10, 33, 100, 511, 1000, 3000, 6000]
    curve = allan_deviation(x, 50.0, clusters, kind)
    taus, deviation, _, n_terms = oracle(x, rate=50.0, data_type="freq", taus=curve.tau_s)
    assert len(taus) == len(clusters)
    if kind == "overlapping":
        assert curve.n_terms.tolist() == n_terms.tolist()
    # 95 % of a χ² with the curve's own degrees of freedom; a total variance has a bias besides.
    lower = curve.variance * curve.edf / chi2.ppf(0.975, curve.edf)
    assert kind == "total" or curve.lower**2 == pytest.approx(lower, rel=1e-9)
    # The oracle keeps the mean in its running sum: 1e-10 leaves room for its rounding, ours is far below.
    assert curve.deviation == pytest.approx(deviation, rel=1e-10)


def test_a_bias_of_ten_thousand_times_the_noise_costs_no_digits():
    rng = np.random.default_rng(4)
    x = 1e4 + rng.normal(size=1_000_000)
    clusters = [1, 10, 1000, 30000, 400000]
    curve = allan_deviation(x, 100.0, clusters)
    # By a running sum in extended precision, the mean removed first.
    wide = x.astype(np.longdouble)
    p = np.concatenate([[0], np.cumsum(wide - wide.mean())])
    for m, variance in zip(clusters, curve.variance, strict=True):
        d = p[2 * m :] - 2 * p[m:-m] + p[: -2 * m]
        assert variance == pytest.approx(float(np.sum(d * d) / (2 * np.longdouble(m) ** 2 * len(d))), rel=1e-9)


def test_counts_are_read_in_their_own_type():
    counts = np.random.default_rng(5).integers(-3000, 3000, size=(5000, 3))
    wide = allan_deviation(counts.astype(np.float64), 100.0)
    for kind in (np.int16, np.int32, np.int64, np.float32):
        assert np.allclose(allan_deviation(counts.astype(kind), 100.0).deviation, wide.deviation, rtol=1e-13)


def test_missing_readings_are_weighted_as_defined():
    rng = np.random.default_rng(6)
    x = rng.normal(size=400).cumsum()
    x[rng.random(400) < 0.1] = np.nan
    x[200:260] = np.nan
    # The kernel weighs; the scatter of means of a few readings is subtracted afterwards (the next two tests).
    column = x[:, np.newaxis]
    for m in (1, 5, 40, 120):
        weighted = _core.allan_variance(column, [m], _core.AllanKind.Overlapping)[0]
        assert weighted[0, 0] == pytest.approx(by_definition(x, m, np.array([-1.0, 1.0])), rel=1e-11)
        hadamard = _core.allan_variance(column, [m], _core.AllanKind.Hadamard)[0]
        assert hadamard[0, 0] == pytest.approx(by_definition(x, m, np.array([1.0, -2.0, 1.0])), rel=1e-11)


@pytest.mark.parametrize("kind", ["overlapping", "non-overlapping", "hadamard"])
def test_readings_lost_here_and_there_bias_neither_white_noise_nor_a_random_walk(kind):
    share = 0.3
    rng = np.random.default_rng(9)
    clusters = [1, 2, 5, 20, 100, 500]
    for make in (lambda: rng.normal(size=20_000), lambda: 0.02 * np.cumsum(rng.normal(size=20_000))):
        ratio = []
        for _ in range(12):
            x = make()
            whole = allan_deviation(x, 1.0, clusters, kind).variance
            x[rng.random(len(x)) < share] = np.nan
            ratio.append(allan_deviation(x, 1.0, clusters, kind).variance / whole)
        error = np.std(ratio, axis=0, ddof=1) / 5.0
        # Against the same readings with none lost: before, 1/(1 - share) for white noise.
        assert np.all(np.abs(np.mean(ratio, axis=0) - 1.0) < 4.5 * error + 0.02), (np.mean(ratio, axis=0), error)


def test_a_stream_beyond_its_memory_thins_only_the_long_clusters():
    x = np.random.default_rng(9).normal(size=1_500_000)
    clusters = [1, 100, 65536, 100_000, 300_000]
    streamed = stream_noise([x[:, None]], 100.0, clusters=clusters, budget_bytes=8 << 18).curve
    whole = allan_deviation(x[:, np.newaxis], 100.0, streamed.clusters)
    assert streamed.stride == 8
    assert streamed.deviation[:3] == pytest.approx(whole.deviation[:3], rel=1e-11)
    assert streamed.edf == pytest.approx(whole.edf, rel=1e-2)
    # Every eighth start of 1e5: the information is the same, the sum is not.
    assert streamed.deviation == pytest.approx(whole.deviation, rel=1e-3)


@pytest.mark.parametrize("kind", ["overlapping", "non-overlapping", "modified", "hadamard"])
@pytest.mark.parametrize("alpha", [2, 0, -1, -2])
def test_degrees_of_freedom_agree_with_an_independent_implementation(kind, alpha):
    # White noise and a walk of *readings* are exact at every cluster; the oracle's averaged phase joins them at many.
    is_exact = alpha in (0, -2) and kind != "modified"
    for m in (64, 1024) if is_exact else (1, 4, 64, 1024):
        oracle = allantools.edf_greenhall(
            alpha=alpha,
            d=3 if kind == "hadamard" else 2,
            m=m,
            N=10001,
            overlapping=kind != "non-overlapping",
            modified=kind == "modified",
            verbose=False,
        )
        # The oracle's closed approximations for long sums are good to 2 %; ours are the sums themselves.
        assert _core.allan_degrees(10000, m, TYPES[alpha], KINDS[kind]) == pytest.approx(oracle, rel=0.02)


@pytest.mark.parametrize("alpha", [2, 0, -2])
@pytest.mark.parametrize("kind", ["overlapping", "non-overlapping", "hadamard"])
def test_degrees_of_freedom_of_readings_are_those_of_the_quadratic_form(alpha, kind):
    n = 60
    to_phase = np.tril(np.ones((n + 1, n)), -1)
    drive = {2: np.diff(np.eye(n + 1), axis=0), 0: np.eye(n), -2: np.tril(np.ones((n, n)))}[alpha]
    order = 3 if kind == "hadamard" else 2
    for m in (1, 2, 5, 12):
        p = to_phase
        for _ in range(order):
            p = p[m:] - p[:-m]
        covariance = (p @ drive) @ (p @ drive).T
        if kind == "non-overlapping":
            covariance = covariance[::m, ::m]
        # V = zᵀz has mean tr C and variance 2 tr C²; the tool adds only rounding.
        exact = np.trace(covariance) ** 2 / np.sum(covariance**2)
        assert _core.allan_degrees(n, m, TYPES[alpha], KINDS[kind]) == pytest.approx(max(1.0, exact), rel=1e-9)


@pytest.mark.parametrize(
    ("question", "words"),
    [
        (lambda: allan_deviation([1.0], 1.0), "at least 2 readings"),
        (lambda: allan_deviation(NINE, 0.0), "rate_hz"),
        (lambda: allan_deviation(NINE, 1.0, [0]), "whole numbers"),
        (lambda: allan_deviation(NINE, 1.0, [1.5]), "whole numbers"),
        (lambda: allan_deviation(NINE, 1.0, [5]), "longer log"),
        (lambda: allan_deviation([np.nan] * 9, 1.0), "no finite reading"),
        (lambda: allan_deviation([*NINE, np.nan], 1.0, kind="modified"), "not defined where readings are missing"),
        (lambda: allan_deviation(np.zeros((3, 3, 3)), 1.0), "shape"),
        (lambda: stream_noise([], 1.0), "no chunk"),
        (lambda: stream_noise([[1.0, np.inf, 2.0]], 1.0), "reading 1"),
    ],
)
def test_a_malformed_question_is_refused_in_words(question, words):
    with pytest.raises(ValueError, match=words):
        question()


def test_intervals_of_the_total_deviation_hold_the_allan_deviation_under_quantisation_noise():
    rng = np.random.default_rng(10)
    n, clusters = 1024, np.array([16, 64, 256, 500])
    truth = 3.0 / clusters.astype(float) ** 2
    inside = np.zeros(len(clusters))
    runs = 200
    for _ in range(runs):
        curve = allan_deviation(np.diff(rng.normal(size=n + 1)), 1.0, clusters, "total")
        inside += (curve.lower**2 <= truth) & (truth <= curve.upper**2)
    # 95 % of 200, four binomial errors of 1.5 % either way; before, 40 % at the longest.
    assert np.all(np.abs(inside / runs - 0.95) < 0.062), inside / runs
