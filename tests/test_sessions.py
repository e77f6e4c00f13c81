"""Many recordings of one unit: what is common, what repeats how far, what changed, and temperature."""

import json
from dataclasses import replace

import numpy as np
import pytest

import trihedron
from hand_made_sessions import G, Instrument, recorded
from small_session import rejected
from trihedron.api.sessions import several_devices
from trihedron.cli import main
from trihedron.estimate.sessions.changes import changes_among
from trihedron.estimate.sessions.spread import next_session, repeated_parameters, spread_between, spread_within
from trihedron.estimate.sessions.thermal import thermal_model
from trihedron.estimate.verification import reference_findings
from trihedron.estimate.verified_parameters import common_factor
from trihedron.files.calibration import read_calibration
from trihedron.invariants import anchor_of, model_jacobian, model_of_numbers, numbers_jacobian, numbers_of
from trihedron.records import Recording, Severity
from trihedron.records.sessions import PARAMETERS, Session

UNIT = Instrument()


@pytest.fixture(scope="module")
def four_sessions():
    """One unit on four days; on the third its gyro bias is 0.01 rad/s away, ten times its error."""
    units = [UNIT, UNIT, UNIT.moved(b_g=[0.01, 0.0, 0.0]), UNIT]
    return [recorded(unit, seed) for seed, unit in enumerate(units, 1)]


@pytest.fixture(scope="module")
def first(four_sessions):
    """The calibration of the first of them."""
    return trihedron.calibrate(four_sessions[0], gravity_m_s2=G)


def test_numbers_free_of_the_frame_give_back_the_model_that_they_were_taken_from():
    rng = np.random.default_rng(0)
    for _ in range(20):
        signs = rng.choice([-1, 1], 3)
        S_a = np.tril(np.diag(signs * rng.uniform(0.5, 2, 3)) + 0.05 * rng.normal(size=(3, 3)))
        # Axes as boards have them: permuted, some turned round, a little out of true.
        Q = np.eye(3)[rng.permutation(3)] * rng.choice([-1, 1], 3)
        S_g = Q @ (np.diag(rng.uniform(0.5, 2, 3)) + 0.05 * rng.normal(size=(3, 3)))
        b_a, b_g = rng.normal(size=3), rng.normal(size=3)
        anchor = anchor_of(S_a, S_g)
        S_later = S_g + 0.01 * rng.normal(size=(3, 3))
        numbers = numbers_of(S_a, b_a, S_later, b_g, anchor)
        for found, wanted in zip(model_of_numbers(numbers, anchor), (S_a, b_a, S_later, b_g), strict=True):
            # Rounding of a 3 x 3 inverse and a square root.
            np.testing.assert_allclose(found, wanted, atol=1e-12)
        at_anchor = numbers_of(S_a, b_a, S_g, b_g, anchor)
        product = numbers_jacobian(S_a, b_a, S_g, b_g) @ model_jacobian(at_anchor, anchor)
        # The rotation is taken as a vector from where it is, not from the nearest axes: second order in 0.05 rad.
        np.testing.assert_allclose(product, np.eye(21), atol=0.1)
        np.testing.assert_allclose(product[:18], np.eye(21)[:18], atol=1e-6)


@pytest.mark.parametrize("n", [3, 10])
def test_intervals_of_a_spread_hold_the_truth_in_95_of_100_cases(n):
    rng = np.random.default_rng(n)
    held = 0
    trials = 150
    for _ in range(trials):
        own = np.exp(rng.uniform(-0.5, 0.5, n))
        y = 3.0 + 1.5 * rng.normal(size=n) + own * rng.normal(size=n)
        spread = spread_within(y, own**2, ["unit"] * n)
        held += spread.low <= 1.5 <= spread.high
    # Binomial: 95 % of 150 is 142.5 ± 2.7; four standard deviations below.
    assert held >= 132


def test_days_and_turn_ons_are_told_apart():
    rng = np.random.default_rng(4)
    groups = [day for day in range(8) for _ in range(4)]
    day = 5.0 * rng.normal(size=8)
    y = day[groups] + 0.5 * rng.normal(size=32) + 0.2 * rng.normal(size=32)
    own = np.full(32, 0.04)
    within, between = spread_within(y, own, groups), spread_between(y, own, groups)
    assert within.low < 0.5 < within.high < 1.0
    assert between.low < 5.0 < between.high
    assert between.low > 2.0


def made(numbers, covariance, **more):
    return Session("s", "", numbers, covariance, np.zeros(len(numbers)), **more)


@pytest.mark.parametrize(("units", "most"), [(30, 3), pytest.param(100, 6, marks=pytest.mark.slow)])
def test_a_unit_that_did_not_change_is_rarely_called_changed(units, most):
    rng = np.random.default_rng(5)
    sigma = np.full(21, 1e-3)
    false = 0
    for _ in range(units):
        sessions = [made(sigma * rng.normal(size=21), np.diag(sigma**2)) for _ in range(5)]
        false += any(change.significant for change in changes_among([sessions], alpha=0.01))
    # 1 % of 100 is 1; 6 has a chance of 1e-3 under it, and 3 of 30 has 4e-3.
    assert false <= most


def test_the_common_model_and_the_session_that_is_apart_are_found(four_sessions):
    result = trihedron.calibrate_sessions(four_sessions, gravity_m_s2=G)
    changed = [change for change in result.model.changes if change.significant]
    assert [(c.id, c.kind, c.where) for c in changed] == [("gyro-bias", "apart", "session-3.csv")]
    size = np.array(changed[0].size)
    # Five of its own standard errors: the truth of the bias along the axis, with its sign (b is added to S w').
    np.testing.assert_allclose(size, [-0.01, 0.0, 0.0], atol=5 * max(changed[0].std) + 1e-4)
    accel = result.calibration.accelerometer
    z = (accel.S - UNIT.S_a)[np.tril_indices(3)] / accel.sigma_S[np.tril_indices(3)]
    assert np.abs(z).max() < 4.0
    zero_x = next(one for one in result.model.repeated if one.parameter.id == "gyro-bias")
    # 0.01 in one of four is a standard deviation of 0.005.
    assert zero_x.within.low < 0.005 < zero_x.within.high
    labels = ["mon", "mon", "tue", "tue"]
    dated = trihedron.calibrate_sessions(four_sessions, by="date", labels=labels, gravity_m_s2=G)
    assert all(one.between is not None for one in dated.model.repeated)


def test_a_recording_that_cannot_be_calibrated_is_left_out_and_dates_that_logs_lack_are_asked_for(four_sessions):
    still = Recording(np.arange(500) / 50.0, np.tile([0.0, 0.0, G], (500, 1)) + 1e-3, None, 50.0, source="still.csv")
    result = trihedron.calibrate_sessions([*four_sessions[:2], still], gravity_m_s2=G)
    assert result.model.left_out[0][0] == "still.csv"
    assert result.findings == result.model.findings
    assert len(result.model.sessions) == 2
    with pytest.raises(ValueError, match="two recordings at least"):
        trihedron.calibrate_sessions([four_sessions[0], still], gravity_m_s2=G)
    with pytest.raises(ValueError, match="give labels"):
        trihedron.calibrate_sessions(four_sessions, by="date", gravity_m_s2=G)


def at(degc):
    t = degc - 20.0
    return UNIT.moved(b_a=[2e-3 * t, 0.0, 1e-4 * t**2], b_g=[0.0, 1e-4 * t, 0.0])


@pytest.fixture(scope="module")
def thermal():
    temperatures = [-10.0, 0.0, 10.0, 20.0, 30.0, 40.0, 50.0]
    sessions = [recorded(at(T), 40 + k, temperature_degc=T) for k, T in enumerate(temperatures)]
    return trihedron.calibrate_sessions(sessions, by="temperature", gravity_m_s2=G)


def test_a_thermal_model_has_the_order_and_size_that_the_unit_has(thermal):
    terms = {term.id: term for term in thermal.model.thermal.terms}
    orders = {name: term.order for name, term in terms.items()}
    assert orders["accel-bias"] == 2
    assert orders["gyro-bias"] == 1
    assert all(order == 0 for name, order in orders.items() if not name.endswith("bias"))
    slope, sigma = terms["gyro-bias"].coefficients[1], np.sqrt(terms["gyro-bias"].covariance[:, 1, 1])
    # Zero along the axis is -(M b): -1e-4 per degree over a scale near one; four standard errors.
    np.testing.assert_allclose(slope[1], -1e-4, atol=4 * sigma[1] + 2e-6)


def test_apply_follows_temperature_inside_the_range_and_says_so_outside(thermal, tmp_path):
    path = tmp_path / "thermal.json"
    trihedron.write_calibration(thermal.calibration, path)
    known = read_calibration(path)
    log = recorded(at(35.0), 90, temperature_degc=35.0)
    done = trihedron.apply(known, log)
    still = done.accelerometer[:500].mean(axis=0)
    # 600 readings of 0.01: 0.4 mm/s²; the model's own error is some mm/s². Without temperature z is 22 mm/s² away.
    np.testing.assert_allclose(still, [0.0, 0.0, G], atol=6e-3)
    assert not any(f.severity is Severity.SERIOUS for f in done.findings)
    hot = trihedron.apply(known, replace(log, temperature_degc=np.full(log.n_samples, 90.0)))
    assert [f.code for f in hot.findings if f.severity is Severity.SERIOUS] == ["outside-valid-range"]
    at_end = trihedron.apply(known, replace(log, temperature_degc=np.full(log.n_samples, 50.0)))
    np.testing.assert_array_equal(hot.accelerometer, at_end.accelerometer)
    without = trihedron.apply(known, replace(log, temperature_degc=None))
    assert [f.code for f in without.findings if f.severity is Severity.SERIOUS] == ["temperature-missing"]


def test_a_calibration_that_follows_temperature_is_verified_and_ranked_at_the_temperature_of_the_log(thermal):
    log = recorded(at(45.0), 91, temperature_degc=45.0)
    own = trihedron.calibrate(recorded(at(45.0), 92, temperature_degc=45.0), gravity_m_s2=G)
    judged = trihedron.verify(thermal, log)
    # S and b of the reference temperature, 20 °C, are 50 mm/s² away.
    assert judged.is_passed
    assert judged.verification.norm_rms < 6e-3
    ranking = trihedron.rank([own, thermal], log, gravity_m_s2=G)
    assert not any(one.is_rejected for one in ranking.candidates)
    hot = trihedron.verify(thermal, replace(log, temperature_degc=np.full(log.n_samples, 90.0)))
    assert "outside-valid-range" in [f.code for f in hot.findings]


def test_hysteresis_between_heating_and_cooling_is_found_and_not_invented():
    rng = np.random.default_rng(8)
    picked = [k for k, p in enumerate(PARAMETERS) if p.id == "gyro-bias"]
    found = {}
    for size in (0.0, 4e-4):
        sessions = []
        for k, T in enumerate(np.linspace(-10, 50, 12)):
            y = 1e-4 * rng.normal(size=21)
            branch = 1 if k % 2 else -1
            y[picked] += 1e-5 * T + size * branch
            at_T = {"temperature_degc": T, "temperature_range_degc": (T, T), "branch": branch}
            sessions.append(made(y, np.eye(21) * 1e-8, **at_T))
        found[size] = {term.id: term.hysteresis for term in thermal_model(sessions).terms}
    assert all(value is None for value in found[0.0].values())
    # Twelve sessions of 1e-4: 3e-5; four standard errors.
    np.testing.assert_allclose(found[4e-4]["gyro-bias"], 4e-4, atol=1.2e-4)


def test_several_logs_on_the_command_line_make_one_calibration(four_sessions, tmp_path, capsys):
    paths = []
    for k, recording in enumerate(four_sessions[:3]):
        paths.append(tmp_path / f"day-{k}.csv")
        trihedron.convert(recording, paths[-1])
    out = tmp_path / "unit.json"
    status = main(["calibrate", *map(str, paths), "--gravity", str(G), "-o", str(out), "--json"])
    document = json.loads(capsys.readouterr().out)
    assert status == 0
    assert {change["id"] for change in document["changes"] if change["significant"]} == {"gyro-bias"}
    known = read_calibration(out)
    assert len(known.extensions["sessions"]) == 3
    assert main(["apply", str(out), str(paths[0]), "-o", str(tmp_path / "si.csv")]) == 0
    capsys.readouterr()
    assert "several logs" in rejected(capsys, "calibrate", "a.csv", "b.csv", "--faces", "1,-1")
    assert main(["calibrate", "a.csv", "--labels", "x"]) == 1
    assert "there is no such file" in rejected(capsys, "calibrate", tmp_path / "a.csv", tmp_path / "b.csv")


@pytest.mark.parametrize(("n", "trials"), [(2, 20), *(pytest.param(n, 60, marks=pytest.mark.slow) for n in (2, 3, 6))])
def test_the_covariance_of_the_next_recording_holds_it_however_few_there_were(n, trials):
    rng = np.random.default_rng(n)
    before, now = [], []
    for _ in range(trials):
        # Errors of one, repeating within 0.7 to 2 times that.
        true = rng.uniform(0.7, 2.0, 7).repeat(3)
        numbers = rng.normal(size=(n, 21)) * np.hypot(true, 1.0)
        sessions = [Session(str(k), str(k), one, np.eye(21), np.zeros(21), 0.0) for k, one in enumerate(numbers)]
        repeated = repeated_parameters(sessions)
        spread, error = next_session(sessions, repeated)
        away = np.abs(rng.normal(size=21) * true - [one.value for one in repeated])
        now.append(away / np.hypot(spread, error))
        before.append(away / np.hypot([one.within.sd for one in repeated], [one.std for one in repeated]))
    # The likeliest spread, often zero, held 77 to 89 %. Numbers come in kinds of three that share a spread: seven
    # independent ones a trial, and two standard deviations of a share of 95 % are 2 % in 60 trials.
    allowed = 0.02 * np.sqrt(60 / trials)
    assert np.mean(np.array(before) < 1.96) < 0.9
    assert 0.95 - allowed < np.mean(np.array(now) < 1.96) < 0.995


def test_a_recording_in_another_unit_is_named_and_the_common_parameters_are_not_trusted(four_sessions):
    odd = replace(four_sessions[3], accelerometer=1.1 * four_sessions[3].accelerometer)
    result = trihedron.calibrate_sessions([*four_sessions[:2], odd], gravity_m_s2=G)
    changed = next(one for one in result.model.changes if one.id == "accel-common-scale")
    assert (changed.kind, changed.where) == ("apart", four_sessions[3].source)
    # Readings are 1.1 times as large; a percent is far beyond the uncertainty of a scale.
    assert np.exp(changed.size[0]) == pytest.approx(1.1, rel=0.01)
    assert not result.is_trustworthy


def test_a_calibration_applied_to_readings_two_percent_off_is_warned_of_and_to_its_own_it_is_not(four_sessions, first):
    def severity(scale):
        log = replace(four_sessions[1], accelerometer=scale * four_sessions[1].accelerometer)
        found = [f for f in trihedron.apply(first, log).findings if f.code == "static-force"]
        return [one.severity for one in found]

    assert severity(1.0) == [Severity.NOTE]
    assert severity(1.02) == [Severity.WARNING]
    assert severity(1.5) == [Severity.SERIOUS]


@pytest.mark.parametrize(("factor", "is_common"), [([1.01] * 3, True), ([1.01, 1.0, 1.0], False), ([1.0] * 3, False)])
def test_one_factor_on_all_axes_of_a_gyro_is_told_from_a_change_of_one_axis(four_sessions, first, factor, is_common):
    log = replace(four_sessions[1], gyroscope=four_sessions[1].gyroscope * np.array(factor))
    verified = trihedron.verify(first, log)
    common = common_factor(verified.verification.parameters, "gyro-scale")
    assert (common is not None) is is_common


def test_a_scale_of_one_axis_two_percent_off_is_of_another_unit_in_every_command_and_a_common_one_is_not():
    first, alike, factor = np.zeros(21), np.zeros(21), np.zeros(21)
    other = first.copy()
    other[12] = 0.02  # gyro scale X
    alike[12] = 0.004
    factor[12:15] = 0.02
    covariance = np.eye(21) * 1e-8
    for numbers, is_several in ((other, True), (alike, False), (factor, False)):
        pair = [made(one, covariance) for one in (first, numbers)]
        found = several_devices(pair, changes_among([pair], alpha=0.01))
        assert [one.code for one in found] == ["several-devices"] * is_several


def test_errors_within_a_wide_uncertainty_and_above_the_own_calibrations_are_no_verification(four_sessions, first):
    known = first.calibration
    covariance = known.covariance + np.diag(np.repeat([0.0, 0.05**2, 0.0], [9, 3, 12]))
    accel = replace(known.accelerometer, b=known.accelerometer.b + 0.05, covariance=covariance[:12, :12])
    wide = replace(known, accelerometer=accel, covariance=covariance)
    for calibration, is_less_certain in ((known, False), (wide, True)):
        verified = trihedron.verify(calibration, four_sessions[1])
        codes = [one.code for one in verified.findings]
        assert "residual-above-noise" not in codes
        assert ("calibration-imprecise" in codes) == is_less_certain


def test_a_calibration_that_leaves_its_own_poses_no_smaller_error_is_said_to_be_no_improvement(first):
    good = first.calibration
    bad = replace(good, accelerometer=replace(good.accelerometer, b=good.accelerometer.b + 1.0))
    for calibration, codes in ((good, []), (bad, ["worse-than-uncalibrated"])):
        said = reference_findings(calibration, first.recording, first.segments)
        assert [one.code for one in said] == codes


def test_the_same_file_given_twice_does_not_count_twice(four_sessions):
    first, other = (replace(one, sha256=name) for one, name in zip(four_sessions[:2], "ab", strict=True))
    copy = replace(first, source="copy.csv")
    for together in (trihedron.calibrate_sessions, trihedron.diagnose_sessions):
        with pytest.raises(trihedron.InputError, match=r"copy\.csv: the same recording as"):
            together([first, copy, other], gravity_m_s2=G)
