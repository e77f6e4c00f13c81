"""Two clocks become one: nothing is made up in gaps, and what interpolation does to the noise is said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trihedron.read.merge import merge, resample
from trihedron.records import FindingCode, Severity


def test_the_accelerometer_keeps_its_samples_and_a_ramp_is_interpolated_exactly():
    acc_t = np.arange(1000) / 100.0
    gyr_t = acc_t + 0.004
    acc = np.random.default_rng(1).standard_normal((1000, 3))
    gyr = np.column_stack([gyr_t, 2 * gyr_t, -gyr_t])
    merged = merge(acc, acc_t, 5.0, gyr, gyr_t - gyr_t[0], 5.004, "a and b")
    assert merged.base == "accelerometer"
    # The first accelerometer sample is older than any gyro sample.
    np.testing.assert_array_equal(merged.accelerometer, acc[1:])
    # Linear interpolation is exact on a straight line up to rounding of 10.
    np.testing.assert_allclose(merged.gyroscope[:, 0], acc_t[1:], atol=1e-12)
    assert merged.start_s == pytest.approx(5.01)


def test_the_stated_noise_factor_is_what_interpolation_does_to_white_noise():
    rng = np.random.default_rng(2)
    n = 200_000
    gyr_t = np.arange(n) / 100.0
    acc_t = gyr_t[:-1] + rng.uniform(0.05, 0.95, n - 1) / 100.0
    gyr = rng.standard_normal((n, 3))
    merged = merge(np.zeros((n - 1, 3)), acc_t - acc_t[0], acc_t[0], gyr, gyr_t, 0.0, "a and b")
    (finding,) = merged.findings
    # 3 n normal deviates: the relative sampling error of a variance is sqrt(2 / 3n) = 0.002 (correlation adds little).
    assert np.var(merged.gyroscope) == pytest.approx(finding.numbers["variance_factor"], rel=0.008)
    assert finding.numbers["variance_factor"] < 0.75


def test_same_ticks_are_taken_as_they_are():
    t = np.arange(500) / 100.0
    rng = np.random.default_rng(3)
    acc, gyr = rng.standard_normal((500, 3)), rng.standard_normal((500, 3))
    merged = merge(acc[3:], t[3:] - t[3], t[3], gyr[:-4], t[:-4] + 1e-5, 0.0, "a and b")
    np.testing.assert_array_equal(merged.accelerometer, acc[3:-4])
    np.testing.assert_array_equal(merged.gyroscope, gyr[3:-4])
    assert merged.findings[0].numbers["variance_factor"] == 1.0


def test_nothing_is_made_up_in_a_gap():
    acc_t = np.arange(1000) / 100.0
    keep = (acc_t < 3.0) | (acc_t > 3.5)
    gyr_t = acc_t[keep] + 0.003
    merged = merge(np.ones((1000, 3)), acc_t, 0.0, np.ones((len(gyr_t), 3)), gyr_t - gyr_t[0], gyr_t[0], "a and b")
    lost = np.isnan(merged.gyroscope).any(axis=1)
    times = merged.time_s + merged.start_s
    assert lost.sum() == pytest.approx(51, abs=2)
    assert times[lost].min() > 2.99
    assert times[lost].max() < 3.52
    assert np.isfinite(merged.accelerometer).all()
    assert merged.findings[0].numbers["lost_rows"] == lost.sum()


def test_a_faster_gyro_keeps_its_samples_and_that_is_a_warning():
    acc_t, gyr_t = np.arange(200) / 50.0, np.arange(1600) / 400.0
    gyr = np.random.default_rng(4).standard_normal((1600, 3))
    merged = merge(np.column_stack([acc_t] * 3), acc_t, 0.0, gyr, gyr_t, 0.0, "a and b")
    assert merged.base == "gyroscope"
    np.testing.assert_array_equal(merged.gyroscope, gyr[: len(merged.time_s)])
    np.testing.assert_allclose(merged.accelerometer[:, 0], merged.time_s, atol=1e-12)
    assert merged.findings[0].severity is Severity.WARNING
    assert merged.findings[0].code is FindingCode.CLOCKS_MERGED


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.floats(0.0, 2.0, allow_nan=False), min_size=2, max_size=40),
    st.lists(st.floats(-1.0, 3.0, allow_nan=False), min_size=1, max_size=40),
)
def test_interpolation_never_leaves_the_range_of_its_neighbours(source, target):
    time_s = np.sort(np.array(source))
    base_s = np.sort(np.array(target))
    values = np.random.default_rng(len(source)).standard_normal((len(time_s), 3))
    brought, factor = resample(time_s, base_s, values, 0.1)
    known = np.isfinite(brought).all(axis=1)
    assert np.all(brought[known] <= values.max(axis=0) + 1e-12)
    assert np.all(brought[known] >= values.min(axis=0) - 1e-12)
    assert np.all((factor[known] >= 0.5 - 1e-12) & (factor[known] <= 1.0))
    outside = (base_s < time_s[0] - 0.003) | (base_s > time_s[-1] + 0.003)
    assert not np.any(known & outside)
