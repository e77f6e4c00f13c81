"""Healthy logs at 20 to 50 Hz with ordinary low-pass filters and quick hand moves need no effect."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, lfilter_zi

import trihedron
from confidence.motion import G
from confidence.sensor import DEG, lower, recorded
from confidence.sessions import hand
from trihedron.diagnose.effects.timing_jitter import common_time_variance
from trihedron.diagnose.session.observations import observe
from trihedron.probability import SURE

FINE_HZ = 1000
MEAN, POLE = (np.ones(4) / 4, [1.0]), ([0.72], [1.0, -0.28])
"""A running mean over four samples, and a first-order low-pass, of the samples themselves."""


def made(seed, rate_hz, move_s, before=([1.0], [1.0]), after=([1.0], [1.0]), late=0.0, only=None):
    """A log of twelve poses and its truth: filtered ``before`` and ``after`` it is sampled, at instants that scatter by
    ``late`` of the interval; of one sensor ``only``."""
    few = FINE_HZ // rate_hz
    # What is sampled has the noise of the whole band; what is filtered still dithers the LSB.
    noise = {"gyro_density": 0.005 * DEG / np.sqrt(few), "accel_density": 1.2e-3 / np.sqrt(few)}
    bits = {"gyro_bits": 18, "accel_bits": 18}
    force, rate, _, truth, _ = hand(seed, n_poses=12, move_s=move_s, rate_hz=FINE_HZ, **noise, **bits)
    n = len(force) // few
    at = few * np.arange(n) + np.round(late * few * np.random.default_rng(seed).normal(size=n)).astype(int)
    at = np.clip(at, 0, len(force) - 1)

    def filtered(x, b, a):
        begun = lfilter_zi(b, a)[:, None] * x[0] if max(len(a), len(b)) > 1 else None
        return x if begun is None else lfilter(b, a, x, axis=0, zi=begun)[0]

    nothing = [1.0], [1.0]
    each = [(before, after) if only in (None, sensor) else (nothing, nothing) for sensor in range(2)]
    read = [
        np.round(filtered(filtered(x, *first)[at], *then)) for x, (first, then) in zip((force, rate), each, strict=True)
    ]
    return recorded(*read, float(rate_hz), np.arange(n) / rate_hz), lower(truth)


@pytest.mark.parametrize(
    "how",
    [(1, 20, 1.4, ([1.0], [1.0]), MEAN), (2, 20, 1.4, ([1.0], [1.0]), POLE), (3, 50, 1.2, butter(2, 15.0, fs=FINE_HZ))],
    ids=["running mean over four samples", "first order", "second order"],
)
def test_filtered_samples_of_quick_moves_are_explained_without_an_effect(how):
    recording, truth = made(*how)
    result = trihedron.diagnose(recording, gravity_m_s2=G)
    # The Earth turns below the body, and may show.
    assert {one.id for one in result.effects} <= {"earth-rate"}
    found = result.calibration.gyroscope
    # Nine parameters, of which one in 10⁴ exceeds four standard errors.
    assert (np.abs(found.S - truth.S_w) < 4.0 * found.sigma_S).all()


def pole(time_s):
    """A low-pass of first order at the fine rate, and its lag: half a fine sample less than its time constant."""
    decay = np.exp(-1.0 / (time_s * FINE_HZ))
    return ([1.0 - decay], [1.0, -decay]), decay / (1.0 - decay) / FINE_HZ


@pytest.mark.parametrize(("sensor", "n_poles", "seed"), [(0, 1, 1), (1, 1, 2), (0, 2, 3), (1, 2, 4)])
def test_a_low_pass_of_one_sensor_has_its_lag_and_smoothing_and_no_delay_beside_it(sensor, n_poles, seed):
    one, lag = pole(0.016 / n_poles)
    both = (np.convolve(one[0], one[0]), np.convolve(one[1], one[1])) if n_poles == 2 else one
    result = trihedron.diagnose(made(seed, 100, 1.2, before=both, only=sensor)[0], gravity_m_s2=G)
    (effect,) = (one for one in result.effects if one.id != "earth-rate")
    found = {p.name.rpartition("_")[2]: p for p in effect.parameters}
    assert effect.id == "sensor-lag"
    # Of normal errors one in 10⁴ exceeds four standard deviations; the next term of the response is of third order, a
    # percent of the lag squared.
    assert abs(found["lag"].value - n_poles * lag) < 4.0 * found["lag"].std
    assert found["smoothing"].value == pytest.approx(1.0 / n_poles, rel=0.2, abs=4.0 * found["smoothing"].std)


def test_averaging_is_the_variance_of_the_filter():
    calibration = trihedron.calibrate(made(1, 20, 0.9, after=MEAN)[0], gravity_m_s2=G).calibration
    # (n² - 1)/12 squared intervals for n samples; its error in such a log is about a tenth.
    assert calibration.averaging == pytest.approx(15.0, rel=0.3)


@pytest.mark.parametrize(("move_s", "late"), [(2.0, 0.0), (1.0, 0.0), (2.0, 0.04), (1.0, 0.1)])
def test_jitter_is_seen_beside_the_tremor_of_a_hand_which_is_none(move_s, late):
    recording, _ = made(14, 50, move_s, late=late)
    value, spread, _ = common_time_variance(observe(recording, trihedron.segment(recording)))
    assert (value / spread > SURE) == (late > 0.0)
