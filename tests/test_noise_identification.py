"""Noise terms from simulated logs: names and intervals; what disturbs a log is found and named."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from noise_coverage import in_time
from trihedron.estimate.noise.binned import binned
from trihedron.estimate.noise.identify import identify_noise
from trihedron.estimate.noise.slow_changes import EXPONENTIAL, slow_changes
from trihedron.estimate.noise.spectrum import Ordinates
from trihedron.files.noise import noise_figures
from trihedron.records.finding import Severity
from trihedron.records.noise import TermName
from trihedron.report.noise import noise_report
from trihedron.report.noise_files import noise_record

RATE = 100.0


def present(axis):
    found = {term.value for term, value in axis.terms.items() if value.is_present}
    return found | ({"G"} if axis.gauss_markov else set())


def codes(noise):
    return {finding.code for axis in noise.axes for finding in axis.findings} | {f.code for f in noise.findings}


@pytest.mark.parametrize("rate_hz", [50.0, pytest.param(400.0, marks=pytest.mark.slow)])
def test_the_published_setting_is_recovered_near_its_bound_and_absent_terms_have_limits_and_no_value(rate_hz):
    # Four axes of the published setting: 400 Hz, or an eighth of it, 11 000 s.
    rng, n = np.random.default_rng(21), int(11_000 * rate_hz)
    axes = [identify_noise(in_time(rng, n, rate_hz, N=2.502e-3, K=6.972e-5), rate_hz).axes[0] for _ in range(4)]
    N = np.array([axis.value("N") for axis in axes]) / 2.502e-3
    K = np.array([axis.value("K") for axis in axes]) / 6.972e-5
    # Bounds for an axis: 0.14 % of N at 50 Hz, 8.1 % of K; four standard errors of the mean and deviation of four.
    assert np.abs(N - 1.0).max() < 0.01
    assert abs(K.mean() - 1.0) < 4 * 0.081 / np.sqrt(4)
    assert K.std(ddof=1) < 0.081 * np.sqrt(chi2.ppf(0.9999, 3) / 3)
    for term in (axis.terms[TermName(symbol)] for axis in axes for symbol in ("Q", "B", "R")):
        assert term.is_present or (term.value == 0.0 and 0.0 < term.limit < np.inf)


@pytest.mark.parametrize("truth", ["B", "NK", "QN", "NKR"])
def test_the_terms_present_are_found(truth):
    rng = np.random.default_rng(23)
    size = {"Q": 3e-4, "N": 1e-2, "B": 4e-3, "K": 1.2e-3, "R": 6e-4}
    found = [
        present(identify_noise(in_time(rng, 1 << 16, RATE, **{s: size[s] for s in truth}), RATE).axes[0])
        for _ in range(6)
    ]
    assert sum(f == set(truth) for f in found) >= 4, found  # at 95 % each: a probability of 0.998


def with_process(rng, n, rate_hz, tau_s, sigma, white):
    """(n,) readings of a Gauss-Markov process beside white noise."""
    decay = np.exp(-1.0 / (rate_hz * tau_s))
    drive = sigma * np.sqrt(1 - decay**2) * rng.normal(size=n)
    process, _ = lfilter([1.0], [1.0, -decay], drive, zi=[decay * sigma * rng.normal()])
    return in_time(rng, n, rate_hz, N=white) + process


def test_intervals_beside_a_strong_process_hold_whatever_its_correlation_time():
    rng = np.random.default_rng(31)
    x = np.stack([with_process(rng, 1 << 16, 200.0, 0.05, 1e-2, 1e-3) for _ in range(6)], axis=1)
    axes = identify_noise(x, 200.0).axes
    # A log determines the time to 5 %: in steps of 9 % all would have one of two or three times.
    times_s = [axis.gauss_markov.correlation_time_s for axis in axes]
    assert len(set(times_s)) > 3
    assert np.mean(times_s) == pytest.approx(0.05, rel=0.08)  # four standard errors of the mean of six
    white, process = [axis.terms[TermName.WHITE] for axis in axes], [axis.gauss_markov for axis in axes]
    # Five of six, at 95 % each, with a probability of 0.97 in either.
    assert sum(term.lower <= 1e-3 <= term.upper for term in white) >= 5
    assert sum(one.lower <= 1e-2 <= one.upper for one in process) >= 5


def test_a_gauss_markov_process_beside_a_warm_up_is_named_and_its_interval_holds():
    rng, inside, named = np.random.default_rng(27), 0, 0
    t = np.arange(36_000) / 10.0
    for _ in range(12):
        x = with_process(rng, len(t), 10.0, 20.0, 1.0, 1.0) + 30.0 * np.exp(-t / 400.0)
        axis = identify_noise(x, 10.0).axes[0]
        (warm_up,) = [f.numbers["time_s"] for f in axis.findings if "time_s" in f.numbers]
        assert warm_up == pytest.approx(400.0, rel=0.2)
        named += present(axis) == {"N", "G"}
        process = axis.gauss_markov
        inside += process is not None and process.lower <= 1.0 <= process.upper
    # At 95 % each: ten of twelve or more have a probability of 0.98.
    assert named >= 10
    assert inside >= 10


@pytest.fixture(scope="module")
def quiet():
    return in_time(np.random.default_rng(26), 300_000, RATE, N=1e-3, K=3e-5)


def test_a_step_is_found_and_does_not_become_a_random_walk(quiet):
    stepped = quiet.copy()
    stepped[170_000:] += 5e-3
    noise = identify_noise(stepped, RATE)
    assert "log-jump" in codes(noise)
    assert noise.breaks_s[0] == pytest.approx(1700.0, abs=20.0)
    # A clean log has nothing to report.
    clean = identify_noise(quiet, RATE)
    assert clean.findings == clean.axes[0].findings == ()
    assert noise.axes[0].value("K") == pytest.approx(clean.axes[0].value("K"), rel=0.15)


@pytest.mark.parametrize(("size", "lasts"), [(0.02, 1.0), (0.03, 0.12)])
def test_a_step_too_small_for_its_edge_to_show_is_found_in_means_and_leaves_no_walk(size, lasts):
    # A fifth of the noise of a reading for good, or a third for an eighth of the log: means of thousands show it.
    n, at = 65_536, np.arange(65_536) / 65_536
    x = in_time(np.random.default_rng(3), n, RATE, N=1e-2) + size * ((at > 0.37) & (at < 0.37 + lasts))
    noise = identify_noise(x, RATE)
    ends = [end for end in (0.37, 0.37 + lasts) if end < 1.0]
    assert noise.breaks_s == pytest.approx([end * n / RATE for end in ends], abs=0.01 * n / RATE)
    assert "log-jump" in codes(noise)
    assert present(noise.axes[0]) == {"N"}
    # With the step in it a walk of 7e-4 would be named.
    assert noise.axes[0].terms[TermName.RATE_RANDOM_WALK].limit < 5e-4


@pytest.mark.parametrize("is_scattered", [False, True])
def test_n_of_noise_with_two_levels_is_that_of_both(is_scattered):
    rng, n = np.random.default_rng(8), 60_000
    is_loud = np.repeat(rng.random(n // 200) < 0.1, 200) if is_scattered else np.arange(n) < 0.1 * n
    noise = identify_noise(0.1 * np.where(is_loud, 3.0, 1.0) * rng.normal(size=n), RATE)
    assert "log-uneven" in codes(noise)
    # A wide excursion among loud seconds may be excluded, not these.
    assert "log-motion" not in codes(noise)
    white, truth = noise.axes[0].terms[TermName.WHITE], 0.01 * np.sqrt(1.0 + 8.0 * is_loud.mean())
    assert white.estimate == pytest.approx(truth, rel=0.03)
    assert white.lower < truth < white.upper


def test_the_best_averaging_time_lies_in_its_interval():
    rng, inside = np.random.default_rng(5), 0
    for _ in range(8):
        (axis,) = identify_noise(in_time(rng, 36_000, 10.0, N=1e-2, K=1e-3), 10.0).axes
        lower, upper = axis.averaging_ends_s
        assert lower < axis.optimal_averaging()[0] < upper < 2.0 * lower
        # N²/τ + K²τ/3 is least at √3 N/K.
        inside += lower < math.sqrt(3.0) * 10.0 < upper
    assert inside >= 6  # of eight at 95 %: a probability of 0.994
    assert identify_noise(in_time(rng, 36_000, 10.0, N=1e-2), 10.0).axes[0].averaging_ends_s[1] == math.inf


def test_knocks_and_shaking_are_left_out_and_named(quiet):
    knocked = quiet.copy()
    knocked[1000] += 1.0
    knocked[200_000:200_005] -= 0.2
    away = [np.arange(len(quiet)) / RATE - at for at in range(200, 3000, 300)]
    ringing = quiet + 0.2 * sum(np.sin(40.0 * t) * np.exp(-5.0 * np.abs(t)) for t in away)
    shaken = quiet.copy()
    shaken[100_000:103_000] += 0.05 * np.random.default_rng(1).normal(size=3000)
    for x, first, code in ((knocked, 10, "log-impact"), (ringing, 200, "log-impact"), (shaken, 1015, "log-motion")):
        noise = identify_noise(x, RATE)
        assert codes(noise) >= {code, "stretches-excluded"}
        assert noise.axes[0].value("N") == pytest.approx(1e-3, rel=0.01)
        assert present(noise.axes[0]) == {"N", "K"}
        assert any(start <= first <= stop for start, stop in noise.excluded_s)


@pytest.mark.parametrize(("white", "tilt", "is_moving"), [(0.004, 0.0, False), (0.05, 0.0, False), (0.004, 0.3, True)])
def test_a_log_that_moves_is_not_to_be_trusted(white, tilt, is_moving):
    """Noise of 0.4 and 5 mg/√Hz beside a bias that warms by 0.1 g; a hand that tilts all the time makes no event."""
    rng, n, t = np.random.default_rng(5), 12_000, np.arange(12_000) / RATE
    angle = tilt * np.sin(2 * np.pi * 0.21 * t) * np.sin(2 * np.pi * 0.034 * t)
    force = 9.81 * np.column_stack([np.sin(angle), 0.1 * t / t[-1], np.cos(angle)])
    force += white * np.sqrt(RATE) * rng.normal(size=(n, 3))
    found = identify_noise(force, RATE, names=("accel x", "accel y", "accel z"))
    assert any(f.code == "log-motion" and f.severity is Severity.SERIOUS for f in found.findings) is is_moving


def of_imu(rng, n, walk=1e-4, up=(0.0, 0.0, 9.81)):
    """An accelerometer at rest and its names for identify_noise."""
    x = np.column_stack([in_time(rng, n, 10.0, N=1e-3, K=walk) for _ in range(3)]) + up
    return x, {"names": ["accel x", "accel y", "accel z"], "units": ["m/s^2"] * 3}


@pytest.mark.parametrize(("per_kelvin", "is_followed"), [(0.02, True), (0.0, False)])
def test_a_bias_that_follows_a_logged_temperature_is_named(per_kelvin, is_followed):
    x, named = of_imu(np.random.default_rng(11), 36_000)
    temperature = 25.0 + 20.0 * np.sin(np.linspace(0.0, 5.0, len(x)))
    x[:, 1] += per_kelvin * (temperature - 25.0)
    # Logged once a second, and the ends left out by hand: half of the log is enough.
    temperature[np.arange(len(x)) % 10 > 0] = np.nan
    found = identify_noise(x, 10.0, **named, temperature_degc=temperature, exclude_s=[(0.0, 1800.0)])
    said = [one.seen for one in found.findings if one.code == "temperature-driven"]
    assert [("accel Y" in one, "accel X" in one) for one in said] == ([(True, False)] if is_followed else [])
    assert found.has_slow_noise_only is not is_followed
    text, figures = str(noise_report(found)), noise_figures(noise_record(found))[0]
    assert ("N alone" in text) is is_followed
    # What a filter's file gets as K is an upper limit then, and N is what it was.
    assert not figures["accelerometer"].N.is_limit
    assert figures["accelerometer"].K.is_limit or not is_followed


def test_a_unit_that_is_turned_over_during_the_log_is_named_with_the_stretch_to_keep():
    x, named = of_imu(np.random.default_rng(12), 18_000)
    x[12_000:] += (9.81, 0.0, -9.81)
    (said,) = [one for one in identify_noise(x, 10.0, **named).findings if one.code == "log-turned"]
    stop_s = said.numbers["stop_s"]
    assert 1150.0 < stop_s <= 1200.0
    assert said.action.endswith(f"--exclude {stop_s:.0f}:`.")
    whole = identify_noise(x, 10.0, **named, exclude_s=[(stop_s, np.inf)])
    assert whole.has_slow_noise_only


def test_a_move_at_the_end_is_excluded_from_the_axes_that_show_less_of_it(quiet):
    moved = np.column_stack([quiet, quiet[::-1]])
    moved[-300:, 0] += 0.1 * np.random.default_rng(4).normal(size=300)
    moved[-200:, 1] += 0.1 * np.random.default_rng(5).normal(size=200)
    alone, both = identify_noise(moved[:, 1], RATE), identify_noise(moved, RATE)
    assert both.excluded_s[-1][0] < alone.excluded_s[-1][0]
    assert both.axes[1].n_samples == both.axes[0].n_samples < alone.axes[0].n_samples


@pytest.mark.parametrize("times_s", [(372.0,), (403.0,), (60.0, 540.0)])
def test_a_warm_up_hundreds_of_times_the_noise_leaves_no_walk(times_s):
    # A time constant that is off by per cents, as between two that are tried, would leave many times the flicker.
    t = np.arange(36_000) / 10.0
    x = np.random.default_rng(3).normal(size=len(t)) - 100.0 * np.exp(-t[:, None] / times_s).sum(axis=1)
    found = sorted((one.time_s, one.size) for one in slow_changes(x, 10.0)[0])
    assert found == [pytest.approx((time_s, 100.0), rel=3e-3) for time_s in times_s]
    assert present(identify_noise(x, 10.0).axes[0]) == {"N"}


def test_two_exponentials_of_nearly_one_time_have_no_sizes_beyond_what_they_explain():
    t = np.arange(36_000) / 10.0
    hump = 30.0 * np.exp(1.0) * t / 300.0 * np.exp(-t / 300.0)
    (found, *_) = slow_changes(hump + np.random.default_rng(4).normal(size=len(t)), 10.0)
    short, long = sorted(one.time_s for one in found if one.kind == EXPONENTIAL)[:2]
    assert long > 1.3 * short
    assert max(one.size for one in found) < 20.0 * 30.0


def test_a_log_too_short_for_what_its_filter_leaves_is_refused_with_a_length():
    one = np.linspace(0.1, 1.0, 10)
    band = Ordinates(one, one, one, one[None], one[None], np.arange(10), 100, 0.01, 1)
    with pytest.raises(ValueError, match=r"1 s are too short.* record 20 s or more"):
        binned([band], 0.05, [one < 0.0])


def test_a_periodic_line_is_found_with_its_amplitude(quiet):
    t = np.arange(len(quiet)) / RATE
    noise = identify_noise(quiet + 1e-3 * np.sin(2 * np.pi * 7.3 * t), RATE)
    (line,) = noise.axes[0].lines
    assert line.frequency_hz == pytest.approx(7.3, abs=0.01)
    assert line.amplitude == pytest.approx(1e-3, rel=0.1)
    assert present(noise.axes[0]) == {"N", "K"}


def test_rows_written_twice_are_told_from_coarse_readings(quiet):
    held = np.repeat(quiet[::4], 4)
    noise = identify_noise(np.column_stack([held, held[::-1]]), RATE)
    assert "repeated-rows" in codes(noise)
    coarse = np.round(np.column_stack([quiet, quiet[::-1]]) / 0.02) * 0.02
    assert "repeated-rows" not in codes(identify_noise(coarse, RATE))


def test_a_coarse_converter_clipping_and_a_channel_that_never_changes_are_serious_and_no_error(quiet):
    coarse = identify_noise(np.round(quiet / 0.05) * 0.05, RATE)
    assert "quantisation-dead" in codes(coarse)
    clipped = identify_noise(np.clip(quiet, None, np.quantile(quiet, 0.95)), RATE)
    assert any(f.code == "clipping" and f.severity is Severity.SERIOUS for f in clipped.axes[0].findings)
    dead = identify_noise(np.column_stack([quiet, np.full(len(quiet), 3.0)]), RATE)
    assert {(term.estimate, term.fitted) for term in dead.axes[1].terms.values()} == {(0.0, 0.0)}
    assert dead.axes[0].value("N") == pytest.approx(1e-3, rel=0.01)
    assert not any(noise.is_trustworthy for noise in (coarse, clipped, dead))


@pytest.mark.parametrize(
    ("question", "words"),
    [
        (lambda x: identify_noise(x[:100], RATE), "too few"),
        (lambda x: identify_noise(x, -1.0), "rate_hz"),
        (lambda x: identify_noise(x, RATE, exclude_s=[(5.0, 2.0)]), "earlier to a later"),
        (lambda x: identify_noise(x, RATE, exclude_s=[(1e6, 2e6)]), "outside the log"),
        (lambda x: identify_noise(x, RATE, names=("a", "b")), "as many names"),
        (lambda x: identify_noise(np.full_like(x, np.nan), RATE), "no finite reading"),
    ],
)
def test_a_malformed_question_is_refused_in_words(quiet, question, words):
    with pytest.raises(ValueError, match=words):
        question(quiet)


def test_intervals_hold_whatever_is_named():
    rng = np.random.default_rng(62)
    truth = {"N": 1e-2, "B": 3e-3, "K": 6e-4}
    inside = dict.fromkeys("QNBKR", 0)
    for _ in range(20):
        axis = identify_noise(in_time(rng, 1 << 15, 100.0, **truth), 100.0).axes[0]
        for s in inside:
            term = axis.terms[TermName(s)]
            assert term.limit == term.upper
            inside[s] += term.lower <= truth.get(s, 0.0) <= term.upper
    assert min(inside.values()) >= 16, inside  # of 20 intervals of 95 %: a probability of 0.997


@pytest.mark.parametrize(
    "truth", [{"N": 1e-2, "K": 6e-4}, {"N": 1e-2}, pytest.param({"N": 1e-3, "B": 2e-2}, marks=pytest.mark.slow)]
)
def test_scattered_loss_leaves_the_terms_where_they_are_and_holes_make_no_process(truth):
    rng = np.random.default_rng(65)
    inside = 0
    for _ in range(6):
        x = in_time(rng, 60_000, 100.0, **truth)
        holes = np.isin(np.arange(len(x)) // 700, rng.integers(0, 80, 3))
        x[rng.random(len(x)) < 0.3 if len(truth) > 1 else holes] = np.nan
        noise = identify_noise(x, 100.0)
        assert noise.breaks_s == ()
        terms = noise.axes[0].terms
        inside += sum(terms[TermName(s)].lower <= v <= terms[TermName(s)].upper for s, v in truth.items())
        assert len(truth) > 1 or present(noise.axes[0]) == {"N"}
    # Of intervals of 95 % three quarters or more hold, with a probability of 0.99 at least.
    assert inside >= 4.5 * len(truth)


@pytest.mark.parametrize("kind", ["wave", "levels", "walk", "flicker", "white"])
def test_a_wave_of_few_periods_and_a_level_that_switches_are_named_and_no_walk_is_taken_for_them(kind):
    rng, n = np.random.default_rng(7), 65_536
    noise = {"walk": {"K": 0.02}, "flicker": {"B": 0.1}}.get(kind, {})
    x = in_time(rng, n, RATE, N=0.1, **noise)
    if kind == "wave":
        x += 0.2 * np.sin(2.0 * np.pi * 3.2 * np.arange(n) / n)
    if kind == "levels":
        # Each held for 2000 readings on average.
        x += 0.3 * (np.searchsorted(np.cumsum(rng.exponential(2000, size=4 * n // 2000 + 9)), np.arange(n)) % 2)
    found = identify_noise(x, RATE, automatic=kind != "levels")
    waves = [f for axis in found.axes for f in axis.findings if "period_s" in f.numbers]
    assert bool(waves) is (kind == "wave")
    assert ("two-levels" in codes(found)) is (kind == "levels")
    if waves:
        assert waves[0].numbers["period_s"] == pytest.approx(n / RATE / 3.2, rel=0.05)
        assert "K" not in present(found.axes[0])


def test_a_second_process_that_no_term_describes_is_named_once_and_widens_the_intervals():
    rng = np.random.default_rng(2)
    slow, fast = (with_process(rng, 360_000, 10.0, tau_s, 5e-2, 0.0) for tau_s in (300.0, 3.0))
    (axis,) = identify_noise(slow + fast + in_time(rng, 360_000, 10.0, N=1e-2), 10.0).axes
    # The time of the faster one is named; the walk beside it has no corner at 300 s, for eight octaves by little each.
    (unexplained,) = [one for one in axis.findings if one.code == "spectrum-unexplained"]
    assert unexplained.numbers["frequency_hz"] < 1.0 / (2.0 * np.pi * 300.0)
    assert unexplained.numbers["deviation"] < -0.3
    assert axis.covariance_scale > 10.0


def test_a_wave_of_little_more_than_a_period_is_one_change_of_its_size():
    n, rate_hz = 36_000, 1.0
    x = np.random.default_rng(1).normal(0.0, 0.01, n) + 0.02 * np.sin(2.0 * np.pi * np.arange(n) / 28_800.0 + 1.0)
    (axis,) = identify_noise(x, rate_hz).axes
    (wave,) = [finding.numbers for finding in axis.findings if finding.code == "log-drift"]
    # One and a quarter periods, whose ends a straight line may take: an eighth of either.
    assert wave["amplitude"] == pytest.approx(0.02, rel=0.125)
    assert wave["period_s"] == pytest.approx(28_800.0, rel=0.125)
    assert present(axis) == {"N"}


def test_a_steady_drift_of_a_hundred_times_the_noise_has_no_jumps():
    n = 360_000
    x = 1e-3 * np.random.default_rng(1).normal(size=n) + 0.1 * np.arange(n) / n
    (axis,) = identify_noise(x, rate_hz=100.0).axes
    assert "log-jump" not in {one.code for one in axis.findings}
    assert axis.terms[TermName.RATE_RAMP].estimate == pytest.approx(0.1 / 3600.0, rel=1e-3)


def test_the_best_averaging_time_is_that_of_a_minimum_which_the_log_shows(quiet):
    (axis,) = identify_noise(quiet[:20_000], RATE).axes
    longest_s = axis.duration_s / 2.0
    for times, is_shown in ((0.9, False), (1.1, False), (2.0, True)):
        # The minimum of N²/τ + K²τ/3 lies at √3 N/K; at 1.2 times it the variance is 2 % larger.
        walk = math.sqrt(3.0) * 1e-3 * times / longest_s
        sizes = {TermName.WHITE: 1e-3, TermName.RATE_RANDOM_WALK: walk}
        terms = {name: replace(term, fitted=sizes.get(name, 0.0)) for name, term in axis.terms.items()}
        found = replace(axis, terms=terms, gauss_markov=None).optimal_averaging()
        assert (found is not None) is is_shown
        assert not is_shown or found[0] == pytest.approx(longest_s / times, rel=0.01)
