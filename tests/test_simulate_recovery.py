"""A simulated instrument: its truth, its labels, its streams of noise, and the linear one given back by calibration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from trihedron import _core
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.session.solved import calibrate_moves
from trihedron.simulate import Clock, NoiseTerms, make_noise, scenario_by_name, simulate
from true_segments import segments_from_truth

DT = 0.02


@pytest.mark.parametrize(
    ("rate_hz", "gyro_tolerance"),
    # Poses have no sampling error; the integral over a sampled move has one, of about fourth order in the step. Moves
    # exclude that the sensor averages over its interval to a few 10^-9 of the scale at 800 Hz.
    [(100.0, 1e-6), pytest.param(800.0, 2e-9, marks=pytest.mark.slow)],
)
def test_calibration_of_the_linear_noiseless_instrument_recovers_the_truth(rate_hz, gyro_tolerance, monkeypatch):
    # A fit ends at a thousandth of its uncertainty: here nothing turns below it.
    monkeypatch.setattr("trihedron.gravity.EARTH_RATE_RAD_S", 0.0)
    scenario = replace(scenario_by_name("linear-noiseless"), clock=Clock(rate_hz))
    recording, truth = simulate(scenario)
    segments = segments_from_truth(recording, truth)
    # Errors of the means are zero; equal weights instead.
    equal = np.full_like(segments.accelerometer_mean, 1e-3)
    segments = replace(segments, accelerometer_sigma_mean=equal, gyroscope_sigma_mean=equal)
    accel, _ = calibrate_norm(segments.accelerometer_mean, equal, truth.gravity_m_s2)
    assert np.abs(np.linalg.solve(truth.accelerometer_S, accel.S) - np.eye(3)).max() < 1e-9
    assert np.abs(accel.b - truth.accelerometer_b).max() < 1e-9
    gyro, _ = calibrate_moves(recording, segments, accel, truth.gravity_m_s2)
    assert np.abs(np.linalg.solve(truth.gyroscope_S, gyro.S) - np.eye(3)).max() < gyro_tolerance
    assert np.abs(gyro.b - truth.gyroscope_b).max() < gyro_tolerance


def test_switching_one_term_leaves_every_other_sample_by_sample():
    scenario = scenario_by_name("linear-noiseless")
    noisy = replace(scenario, gyroscope=replace(scenario.gyroscope, noise=NoiseTerms(N=(1e-4, 0, 0))))
    plain, _ = simulate(scenario, seed=1)
    changed, _ = simulate(noisy, seed=1)
    assert np.array_equal(plain.accelerometer, changed.accelerometer)
    assert np.array_equal(plain.gyroscope[:, 1:], changed.gyroscope[:, 1:])
    assert not np.array_equal(plain.gyroscope[:, 0], changed.gyroscope[:, 0])


def test_labels_cover_the_recording_and_holds_stand_still():
    recording, truth = simulate(scenario_by_name("hand-session"), seed=2)
    assert truth.segments[0].start == 0
    assert truth.segments[-1].stop == recording.n_samples
    for before, after in zip(truth.segments, truth.segments[1:], strict=False):
        assert before.stop == after.start
    for pose in truth.poses:
        rows = slice(pose.start, pose.stop)
        assert not truth.angular_rate_rad_s[rows].any()
        assert np.ptp(truth.specific_force_m_s2[rows], axis=0).max() == 0.0
        assert np.linalg.norm(truth.specific_force_m_s2[pose.start]) == pytest.approx(truth.gravity_m_s2, rel=1e-14)


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


@pytest.mark.parametrize("term", list(EXPECTED))
def test_the_allan_variance_of_a_term_is_the_one_that_defines_it(term):
    terms = NoiseTerms(**{term: (1.0,) * 3})
    # Realisations: seeds times three axes.
    series = np.concatenate([make_noise(terms, 4096, DT, seed, "gyroscope").T for seed in range(20)])
    for m in (1, 4, 16, 64, 256):
        # Overlapping, by block means, straight from its definition.
        means = np.lib.stride_tricks.sliding_window_view(series, m, axis=1).mean(axis=2)
        variances = 0.5 * np.mean((means[:, m:] - means[:, :-m]) ** 2, axis=1)
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


def test_white_noise_has_the_normal_distribution():
    x = make_noise(NoiseTerms(N=(1.0,) * 3), 700_000, 1.0, 11, "gyroscope").ravel()
    n = len(x)
    # The last two reach into the ziggurat's tail. Four standard deviations of a binomial count.
    for edge in (-1.0, 0.0, 0.3, 2.0, 3.7, -4.2):
        p = stats.norm.cdf(edge)
        assert abs(np.sum(x < edge) - n * p) < 4.0 * np.sqrt(n * p * (1.0 - p)), edge
    assert abs(x.mean()) < 4.0 / np.sqrt(n)
    assert abs(np.mean(x**2) - 1.0) < 4.0 * np.sqrt(2.0 / n)


def three(values):
    """(n, 3) one signal in three channels."""
    return np.tile(np.reshape(values, (-1, 1)), 3).astype(float)


def test_a_resonator_settles_on_a_step_as_its_closed_form_says():
    dt, f0, q = 1e-3, 12.0, 2.5
    w = 2.0 * np.pi * f0
    damping, ringing, c = w / (2.0 * q), w * np.sqrt(1.0 - 1.0 / (4.0 * q * q)), 1.0 / (q * w)

    def integral(t):
        """Of the step's response."""
        swing = c * np.cos(ringing * t) + (c * damping - 1.0) / ringing * np.sin(ringing * t)
        return np.where(t > 0.0, t - c + np.exp(-damping * t) * swing, 0.0)

    t = dt * np.arange(400)
    found = _core.simulate_second_order(three(t > 0.0), dt, [f0] * 3, [q] * 3)
    # Straight lines between samples: the step is a ramp of one dt.
    np.testing.assert_allclose(found[:, 0], (integral(t) - integral(t - dt)) / dt, rtol=0, atol=1e-11)


def test_stages_rest_at_rest_and_far_too_stiff_ones_follow_at_once():
    x = _core.simulate_second_order(np.full((50, 3), 3.0), 0.01, [5.0] * 3, [0.7] * 3)
    x = _core.simulate_creep(_core.simulate_first_order(x, 0.01, [1.0] * 3), 0.01, [0.01] * 3, [20.0] * 3)
    np.testing.assert_allclose(_core.simulate_play(x, [1.0] * 3, [0.1] * 3), 3.0, rtol=0, atol=1e-12)
    # Mismatched plates: rest stays at zero, the small-signal gain at one.
    plates = _core.simulate_bridge(three([0.0, 1e-3, -1e-3]), [1e-3] * 3, [0.0] * 3, [0.0] * 3, [0.05, -0.1, 0.0])
    np.testing.assert_allclose(plates[0], 0.0, atol=1e-12)
    np.testing.assert_allclose((plates[1] - plates[2]) / 2e-3, 1.0, rtol=0, atol=1e-9)
    # 5 kHz and Q = 0.02: the slow root of an overdamped pair sits at 100 Hz, still settled within one 0.1 s step.
    ramp = _core.simulate_second_order(three(np.arange(50)), 0.1, [5000.0] * 3, [0.02] * 3)
    assert ramp[40, 1] == pytest.approx(40.0 - 1.0 / (0.02 * 2.0 * np.pi * 5000.0) / 0.1, abs=1e-9)
    with pytest.raises(ValueError, match=r"\w"):
        _core.simulate_second_order(ramp, 0.1, [0.0] * 3, [1.0] * 3)
    with pytest.raises(ValueError, match=r"\w"):
        _core.simulate_first_order(ramp, 0.1, [-1.0] * 3)


def test_resampling_is_exact_for_cubics_and_refuses_what_lies_outside():
    f = np.polynomial.Polynomial([1.0, 2.0, -0.5, 0.25])
    signal, times = three(f(0.1 * np.arange(20) - 0.3)), np.array([-0.3, -0.25, 0.0, 0.777, 1.5, 1.6])
    found = _core.simulate_resample(signal, -0.3, 0.1, times)
    np.testing.assert_allclose(found[:, 0], f(times), rtol=0, atol=1e-13)
    for few, at in ((signal, 1.7), (signal[:3], 0.0)):
        with pytest.raises(ValueError, match=r"\w"):
            _core.simulate_resample(few, -0.3, 0.1, np.array([at]))
