"""Spectra that noise terms alone do not describe: filters, processes, a hum, losses, an uneven level."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

import trihedron
from trihedron.estimate.noise.identify import identify_noise
from trihedron.records import Recording


@pytest.mark.parametrize(("correlation_time_s", "is_telegraph"), [(0.05, False), (0.05, True)])
def test_a_process_of_some_readings_is_no_low_pass_where_white_noise_stays_above_it(correlation_time_s, is_telegraph):
    rng, n, step_s = np.random.default_rng(3), 90_000, 0.01
    # Switches at twice the mean interval give a telegraph signal the spectrum of the process.
    holds = rng.exponential(2.0 * correlation_time_s, size=n)
    sign = 1.0 - 2.0 * (np.searchsorted(np.cumsum(holds), step_s * np.arange(n)) % 2)
    decay = np.exp(-step_s / correlation_time_s)
    smooth = lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], rng.normal(size=n))
    x = rng.normal(size=n) + (sign if is_telegraph else smooth)
    (axis,) = identify_noise(x[:, None], 1.0 / step_s).axes
    assert not {"spectrum-low-pass", "spectrum-unexplained"} & {finding.code for finding in axis.findings}
    assert axis.terms["N"].lower < 0.1 < axis.terms["N"].upper
    assert axis.gauss_markov.lower < 1.0 < axis.gauss_markov.upper
    # Some 9000 correlation times in the log, beside white noise of the same variance.
    assert axis.gauss_markov.correlation_time_s == pytest.approx(correlation_time_s, rel=0.1)


def test_a_filter_far_below_the_rate_leaves_n_trusted_and_no_line():
    rng = np.random.default_rng(1)
    # First-order filter of 0.5 Hz in a log at 100 Hz: gain 1 - d over 1 - d z.
    decay = np.exp(-2.0 * np.pi * 0.005)
    x = lfilter([1.0 - decay], [1.0, -decay], 10.0 * rng.normal(size=200_000))
    (axis,) = identify_noise(x[:, None], 100.0).axes
    assert [(f.code, f.severity.value) for f in axis.findings if f.code.startswith("spectr")] == [
        ("spectrum-low-pass", "warning")
    ]
    assert axis.terms["N"].lower < 1.0 < axis.terms["N"].upper


def test_a_hum_of_varying_frequency_is_no_low_pass():
    rng = np.random.default_rng(2)
    # 31 Hz, random by 0.3 Hz over a minute: too broad for one line.
    wander = lfilter([1.0], [1.0, -np.exp(-0.01 / 60.0)], rng.normal(size=180_000)) * 0.3 * np.sqrt(2 * 0.01 / 60.0)
    x = 0.1 * rng.normal(size=180_000) + 0.2 * np.sin(2.0 * np.pi * np.cumsum(31.0 + wander) * 0.01)
    (axis,) = identify_noise(x[:, None], 100.0).axes
    assert "spectrum-low-pass" not in {finding.code for finding in axis.findings}


def test_lost_samples_and_repeated_rows_of_a_static_log_are_each_stated_once_and_leave_it_usable():
    rng = np.random.default_rng(6)
    x = 0.01 * rng.normal(size=(60_000, 6)) + [0.0, 0.0, 9.81, 0.0, 0.0, 0.0]
    t = 0.01 * np.arange(60_000)
    kept = rng.random(60_000) > 0.1
    lost = trihedron.allan(Recording.from_arrays(t[kept], x[kept, :3], x[kept, 3:]))
    assert [(f.code, f.severity.value) for f in lost.findings if f.code == "time-gap"] == [("time-gap", "note")]
    assert lost.is_trustworthy
    assert all(axis.terms["N"].lower < 1e-3 < axis.terms["N"].upper for axis in lost.axes)
    held = np.repeat(x[::2], 2, axis=0)
    twice = trihedron.allan(Recording.from_arrays(t, held[:, :3], held[:, 3:]))
    assert [f.code for f in twice.findings].count("repeated-rows") == 1
    # A reading in two rows: half as many of them per second, each for as long as two.
    assert all(axis.terms["N"].lower < math.sqrt(2.0) * 1e-3 < axis.terms["N"].upper for axis in twice.axes)


def test_noise_whose_level_doubles_in_half_of_the_log_is_noticed_and_makes_no_lines():
    rng = np.random.default_rng(5)
    level = np.where(np.arange(200_000) < 100_000, 1.0, 2.5)
    x = 0.1 * level[:, None] * rng.normal(size=(200_000, 3))
    for axis in identify_noise(x, 100.0).axes:
        # Levels of 3125 readings are known to 1.5 %; of 32 pieces each the loudest and the quietest.
        assert [f.numbers["ratio"] for f in axis.findings if f.code == "log-uneven"] == [pytest.approx(2.6, rel=0.07)]
        assert not axis.lines
        # Nothing states which part of the log is the sensor's: 64 pieces of two levels know their mean power to 9 %.
        assert axis.terms["N"].lower < 0.01 * np.sqrt(3.625) < axis.terms["N"].upper
    (axis,) = identify_noise(0.1 * rng.normal(size=(50_000, 1)), 100.0).axes
    assert "log-uneven" not in {finding.code for finding in axis.findings}
