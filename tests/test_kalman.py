"""Calibration by Kalman filter in known attitudes: against closed forms, exact arithmetic and simulated truth."""

import functools

import numpy as np
import pytest
from scipy import stats

import twins_kalman as twins
from trihedron import _core
from trihedron.estimate.kalman.per_axis import calibrate_with_references, check_innovations, shaping_model
from trihedron.records import AxisNoise, PoseTable

SIGMA = 0.11 * 0.032002 / twins.GRAVITY
"""The article's ADC noise of 0.11 m/s² in volts."""
START, POSE = 10.0 * np.arange(324), np.full(324, 5.0)
ARTICLE_MIX = AxisNoise(white=0.9 * SIGMA * 5**0.5, flicker=0.3 * SIGMA, walk=SIGMA / 60.0, ramp=SIGMA / 3000.0)
WALKING = AxisNoise(white=SIGMA * 5**0.5, walk=SIGMA / 4.0)


def compiled(*, rates=(0.01,), averages=True, ramp_frequency=1e-4, **terms):
    names = "quantisation white flicker walk ramp gauss_markov gauss_markov_rate resolution dither"
    named = dict.fromkeys(names.split(), 0.0)
    named |= terms | {"flicker_rates": list(rates), "ramp_frequency": ramp_frequency, "ramp_damping": 0.7}
    return _core.AxisKalmanModel(**named, averages=averages)


def session(seed, n):
    rng = np.random.default_rng(seed)
    pose = rng.uniform(1.0, 8.0, n)
    pause = np.where(rng.random(n) < 0.3, 0.0, rng.uniform(0.5, 40.0, n))
    start = 100.0 + np.cumsum(np.concatenate([[0.0], (pose + pause)[:-1]]))
    f = rng.standard_normal((n, 3))
    return start, pose, twins.GRAVITY * f / np.linalg.norm(f, axis=1)[:, None], rng


MIXES = {
    "white": {"white": 0.02},
    "quantisation": {"quantisation": 0.05, "white": 0.001},
    "walk": {"white": 0.02, "walk": 0.004},
    "ramp": {"white": 0.02, "ramp": 0.001, "ramp_frequency": 1e-11},
    "flicker": {"white": 0.02, "flicker": 0.02, "rates": (0.003, 0.03, 0.3)},
    "Gauss-Markov": {"white": 0.02, "gauss_markov": 0.03, "gauss_markov_rate": 0.02},
}
MIXES["everything"] = {
    **MIXES["walk"],
    **MIXES["ramp"],
    **MIXES["flicker"],
    **MIXES["Gauss-Markov"],
    "quantisation": 0.03,
}


@pytest.mark.parametrize("mix", MIXES.values(), ids=MIXES)
def test_the_filter_is_generalised_least_squares_on_every_prefix_under_the_covariance_of_integrals_by_hand(mix):
    start, pose, f, rng = session(4, 30)
    readings = f @ [0.1, -0.02, 0.01] + 2.0 + 0.05 * rng.standard_normal(30)
    model, diffuse = compiled(**mix), np.full(4, 1e7)
    constants, sigma, *_ = _core.kalman_track(
        model,
        _core.KalmanStart(np.zeros(4), diffuse, np.zeros(4)),
        _core.KalmanPoses(readings, f, start, pose, np.zeros(30)),
    )
    terms = dict(mix)
    terms.pop("ramp_frequency", None)
    terms["slope"] = terms.pop("ramp", 0.0)
    flicker, rates = terms.pop("flicker", 0.0), terms.pop("rates", ())
    each = flicker * np.sqrt(np.log(10.0) / np.pi)
    ends = {min(rates, default=0.0), max(rates, default=0.0)}
    # The slowest and fastest process also represent what lies beyond them.
    alone = (terms.pop("gauss_markov_rate", 0.0), terms.pop("gauss_markov", 0.0))
    processes = [(beta, each * np.sqrt(1.25 if beta in ends else 1.0)) for beta in rates]
    covariance = twins.covariance_of_pose_means(start, pose, gauss_markov=processes + [alone] * (alone[1] > 0), **terms)
    got = _core.kalman_noise_covariance(model, start, pose, np.zeros(30))
    # The second-order ramp with ω₀ = 1e-11 rad/s departs from a straight line by ω₀ t ~ 1e-8 over 600 s.
    np.testing.assert_allclose(got, covariance, rtol=1e-7, atol=1e-14)
    for n in (5, 12, 30):
        expected, cov = twins.generalised_least_squares(f[:n], readings[:n], covariance[:n, :n])
        stated = np.sqrt(np.diag(cov))
        # 1e-5 σ: rounding of the dense inverse, and the ramp's ω₀ where few poses separate it from U0.
        np.testing.assert_allclose((constants[n - 1] - expected) / stated, 0.0, atol=1e-5)
        np.testing.assert_allclose(sigma[n - 1], stated, rtol=1e-5)


def test_the_smoother_is_the_conditional_expectation_given_all_readings():
    start, pose, f, rng = session(5, 40)
    readings = f @ [0.1, -0.02, 0.01] + 2.0 + 0.05 * rng.standard_normal(40)
    model = compiled(white=0.02, walk=0.004, flicker=0.02, rates=(0.003, 0.03), averages=False)
    begun = _core.KalmanStart(np.zeros(4), np.full(4, 1e7), np.zeros(4))
    poses = _core.KalmanPoses(readings, f, start, pose, np.zeros(40))
    _, _, drift, drift_sigma = _core.kalman_smooth(model, begun, poses)
    total = _core.kalman_noise_covariance(model, start, pose, np.zeros(40))
    slow = total - np.diag([model.white_variance(h) for h in pose])
    constants, cov = twins.generalised_least_squares(f, readings, total)
    h = np.column_stack([f, np.ones(40)])
    gain = slow @ np.linalg.inv(total)
    expected = gain @ (readings - h @ constants)
    spread = slow - gain @ slow + gain @ h @ cov @ h.T @ gain.T
    np.testing.assert_allclose(drift, expected, atol=1e-9)
    # The start is 1e4 final standard errors wide: 1e-8 of the information.
    np.testing.assert_allclose(drift_sigma, np.sqrt(np.diag(spread)), rtol=1e-6)


def test_constants_that_walk_forget():
    start, pose, f, _ = session(6, 50)
    poses = _core.KalmanPoses(f @ [0.1, -0.02, 0.01] + 2.0, f, start, pose, np.zeros(50))
    still, walking = (
        _core.kalman_track(compiled(white=0.01), _core.KalmanStart(np.zeros(4), np.full(4, 1e6), walk), poses)[1]
        for walk in (np.zeros(4), np.array([0.0, 0.0, 0.0, 0.1]))
    )
    assert walking[-1, 3] > 2.0 * still[-1, 3]


def test_dither_removes_the_rounding_error_from_a_mean():
    step = 0.3
    hidden = [compiled(resolution=step, dither=share * step).white_variance(1.0) for share in (0.0, 0.5, 0.25)]
    assert hidden[0] == pytest.approx(step**2 / 12.0, abs=1e-16)
    assert hidden[1] < 1e-4 * step**2 / 12.0
    # Direct: the error of the mean of round(x + noise) is the sawtooth convolved with the noise.
    u = np.linspace(-6.0, 6.0, 4001)
    v = (np.arange(400)[:, None] + 0.5) / 400.0 * step + u * 0.25 * step
    error = np.average(np.round(v / step) * step - v, axis=1, weights=np.exp(-0.5 * u**2))
    # Trapezoid over a sawtooth with 4001 cells: jumps cost 1e-3 of the step.
    assert hidden[2] == pytest.approx(np.mean(error**2), rel=0.01)


@functools.cache
def noise_factor(noise):
    """(324, 324) root of the covariance of the article's poses: 5 s each with 5 s between."""
    model = shaping_model(noise, session_s=float(START[-1] + 5.0), pose_s=5.0)
    return np.linalg.cholesky(_core.kalman_noise_covariance(model, START, POSE, np.zeros(324)))


def article_readings(seed, noise):
    """References and readings of the article's session, noise drawn from the model of pose means."""
    draws = noise_factor(noise) @ np.random.default_rng(seed).standard_normal((324, 3))
    table = PoseTable.from_angles(*twins.DIVIDING_HEAD_ANGLES_DEG.T, gravity_m_s2=twins.GRAVITY)
    scales, biases = np.split(twins.ARTICLE_CONSTANTS, [3], axis=1)
    return table, table.specific_force @ scales.T + biases[:, 0] + draws, START, POSE


def test_the_articles_experiment_gives_its_constants_back_with_honest_error_bars():
    nees, z = [], []
    for seed in range(20):
        table, readings, start, pose = article_readings(seed, ARTICLE_MIX)
        result = calibrate_with_references(readings, table, ARTICLE_MIX, start_s=start, pose_s=pose, raw_unit="V")
        for axis in result.axes:
            error = axis.constants - twins.ARTICLE_CONSTANTS[axis.axis]
            nees.append(twins.normalised_error_squared(error, axis.covariance))
            z.append(error / axis.sigma)
    # 60 independent draws of chi-square with 4 degrees of freedom; two-sided 99.9 % limits of their sum.
    low, high = stats.chi2.ppf([0.0005, 0.9995], 4 * len(nees))
    assert low < np.sum(nees) < high
    # Largest of 240 standard normals: beyond 4.8 once in 2600 such tests.
    assert np.max(np.abs(z)) < 4.8


@pytest.mark.parametrize(
    ("true", "believed", "code"),
    [
        (ARTICLE_MIX, ARTICLE_MIX, None),
        (ARTICLE_MIX, ARTICLE_MIX.scaled(0.5), "innovations-too-large"),
        (ARTICLE_MIX, ARTICLE_MIX.scaled(2.0), "innovations-too-small"),
        (WALKING, AxisNoise(white=1.5 * SIGMA * 5**0.5), "innovations-correlated"),
    ],
    ids=["right", "half", "double", "white only"],
)
def test_wrong_noise_shows_in_the_innovations_and_right_noise_does_not(true, believed, code):
    reported = {}
    for seed in range(10):
        table, readings, start, pose = article_readings(50 + seed, true)
        result = calibrate_with_references(readings, table, believed, start_s=start, pose_s=pose, raw_unit="V")
        for finding in result.findings:
            reported[finding.code] = reported.get(finding.code, 0) + 1
    if code is None:
        # 30 axes × 3 one-per-cent tests: more than 5 alarms has probability 0.001.
        assert sum(reported.values()) <= 5
    else:
        assert reported[code] >= 27


def test_the_pose_from_which_innovations_are_beyond_chance_is_named():
    """A reference that slips is wrong from one pose on."""
    z = np.random.default_rng(3).normal(size=24)
    assert check_innovations(z, np.ones(24), 4).first_beyond == 0
    z[12:] += 30.0
    # The first four start the filter.
    sigma = np.concatenate([np.full(4, 1e6), np.ones(20)])
    assert check_innovations(z, sigma, 4).first_beyond == 13
