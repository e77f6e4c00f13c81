"""Static logs whose noise is no ideal process: filtered, heavy-tailed, warming up."""

import numpy as np
import pytest
from scipy.signal import lfilter

from trihedron import allan
from trihedron.records import Recording
from trihedron.records.noise import TermName

N, RATE = 360_000, 100.0
WHITE = 1e-4
"""N of readings that scatter by 1e-3 at 100 Hz."""


def axes_of(x):
    result = allan(Recording(np.arange(len(x)) / RATE, None, x, RATE, gyroscope_unit="rad/s"))
    return result, [axis.terms[TermName.WHITE] for axis in result.axes]


@pytest.mark.parametrize("low_pass", [([0.2], [1.0, -0.8]), ([0.2] * 5, [1.0])], ids=["recursive", "mean of five"])
def test_white_noise_behind_a_low_pass_lies_inside_its_interval(low_pass):
    x = lfilter(*low_pass, 1e-3 * np.random.default_rng(100).normal(size=(N, 3)), axis=0)
    for white in axes_of(x)[1]:
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
