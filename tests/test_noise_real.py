"""Noise of real static logs and published curves, and of simulated parts whose noise is no ideal process."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import trihedron
from trihedron.api.identifying import allan, noise_of_curve
from trihedron.records import Recording
from trihedron.records.finding import FindingCode
from trihedron.records.noise import TermName
from true_segments import codes

N, RATE = 360_000, 100.0
WHITE = 1e-4
"""N of readings that scatter by 1e-3 at 100 Hz."""


@pytest.fixture(scope="module")
def adis(real_data):
    recording = trihedron.read(real_data / "adis16405" / "adis16405_imu1.npz")
    return allan(recording, gyroscope_lsb="0.05 deg/s", accelerometer_lsb="3.33 mg")


def test_the_white_noise_of_the_adis16405_is_the_published_one(adis):
    for axis, published in zip(adis.axes[:3], (0.041, 0.043, 0.039), strict=True):
        assert np.degrees(axis.value("N")) == pytest.approx(published, rel=0.05)
        assert np.degrees(np.sqrt(axis.allan_variance(1.0)[0])) == pytest.approx(published, rel=0.05)


def test_what_else_the_adis16405_log_holds_is_found(adis):
    for axis in adis.axes:
        # Its own filter takes half the power at Nyquist; Q is never quoted through it.
        assert FindingCode.SPECTRUM_LOW_PASS in codes(axis)
        assert axis.highest_hz < 25.0
        assert axis.terms[TermName.BIAS_INSTABILITY].is_present
    for axis in adis.axes[3:]:
        assert any(abs(line.frequency_hz - 0.564) < 0.002 for line in axis.lines)


def test_colouring_of_the_phone_log_is_recognised_and_terms_come_from_below(real_data):
    whole = trihedron.read(real_data / "galaxy_s5" / "samsung_galaxy_s5.csv.gz", rate_hz=10.0)
    # Two hours of six.
    found = allan(replace(whole, **{s: getattr(whole, s)[:72_000] for s in ("time_s", "accelerometer", "gyroscope")}))
    assert FindingCode.REPEATED_ROWS in {finding.code for finding in found.findings}
    for axis in found.axes:
        assert FindingCode.SPECTRUM_LOW_PASS in codes(axis)
        # The spectrum falls to 0.4 % by 5 Hz and is flat below 0.15 Hz.
        assert axis.highest_hz < 0.2
        assert not axis.terms[TermName.QUANTISATION].is_present


def test_terms_of_the_published_curve_agree_with_those_of_the_log(adis, real_data, tmp_path):
    # Without its accelerometers, of which nothing is stated here.
    lines = (real_data / "allan_curves" / "adis_av.csv").read_text().splitlines()
    (tmp_path / "curve.csv").write_text("\n".join(lines[:1] + [line for line in lines if "Gyro" in line]) + "\n")
    curve = noise_of_curve(tmp_path / "curve.csv", gyroscope_unit="deg/s")
    for axis, logged in zip(curve.axes, adis.axes[:3], strict=True):
        # The filter still takes 1 % where the curve is believed.
        assert axis.value("N") == pytest.approx(logged.value("N"), rel=0.02)
        mine, theirs = axis.terms[TermName.BIAS_INSTABILITY], logged.terms[TermName.BIAS_INSTABILITY]
        assert abs(mine.value - theirs.value) < 3.0 * np.hypot(mine.sigma, theirs.sigma)


def axes_of(x):
    result = allan(Recording(np.arange(len(x)) / RATE, None, x, RATE, gyroscope_unit="rad/s"))
    return result, [axis.terms[TermName.WHITE] for axis in result.axes]


@pytest.mark.parametrize("low_pass", [([0.2], [1.0, -0.8]), ([0.2] * 5, [1.0])], ids=["recursive", "mean of five"])
def test_white_noise_behind_a_low_pass_lies_inside_its_interval(low_pass):
    x = lfilter(*low_pass, 1e-3 * np.random.default_rng(100).normal(size=(N, 3)), axis=0)
    result, found = axes_of(x)
    for axis, white in zip(result.axes, found, strict=True):
        assert FindingCode.SPECTRUM_LOW_PASS in codes(axis)
        assert axis.highest_hz < RATE / 10.0
        # It was 1 to 3 % low, by four to eight of its standard errors.
        assert white.lower < WHITE < white.upper
        assert white.estimate == pytest.approx(WHITE, rel=0.02)


def test_readings_far_out_that_belong_to_the_noise_are_not_cut_from_it():
    x = 1e-3 * np.random.default_rng(0).standard_t(3, size=(N, 3)) / np.sqrt(3.0)
    result, found = axes_of(x)
    # 384 of them were disturbances, and N was 6 % low with an uncertainty of 0.1 %. A few of the largest still are.
    assert len(result.excluded_s) < 30
    for white in found:
        assert abs(white.estimate - WHITE) < 3.0 * white.sigma
        assert white.sigma < 0.02 * WHITE


def test_a_bias_that_warms_up_is_no_random_walk():
    t = np.arange(N) / RATE
    x = 1e-3 * np.random.default_rng(1).normal(size=(N, 3)) + 5e-4 * (1.0 - np.exp(-t / 600.0))[:, None]
    result, _ = axes_of(x)
    for axis in result.axes:
        said = [one for one in axis.findings if one.code.value == "log-drift"]
        assert [round(float(one.numbers["time_s"]) / 600.0, 1) for one in said] == pytest.approx([1.0], abs=0.2)
        # K and R were named, eight and four of their standard errors from nothing.
        assert not axis.terms[TermName.RATE_RANDOM_WALK].is_present
        assert not axis.terms[TermName.RATE_RAMP].is_present
