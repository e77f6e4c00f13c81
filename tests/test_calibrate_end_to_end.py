"""Calibration as people use it from Python, and whether its uncertainties are valid end to end."""

import importlib
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import trihedron
from trihedron.api.calibrating import calibrate
from trihedron.api.demonstrating import compare_with_truth, truth_of_the_day
from trihedron.errors import InputError
from trihedron.estimate.verification import _beyond
from trihedron.records import Finding
from trihedron.simulate import hand_session, scenario_by_name, simulate, with_effect
from trihedron.units import STANDARD_GRAVITY_M_S2 as G

SHORT = hand_session(n_poses=18, pose_s=3.0, move_s=1.5, first_pose_s=5.0)
SCENARIO = replace(scenario_by_name("hand-session"), motion=SHORT)


@pytest.fixture(scope="module")
def recording():
    return simulate(SCENARIO, 11)[0]


@pytest.fixture(scope="module")
def result(recording):
    return trihedron.calibrate(recording, gravity_m_s2=G)


def test_errors_over_their_error_bars_are_standard_normal():
    """Six sessions of 21 parameters each, every stage included: segmentation, both sensors, the joint fit.

    χ² of one session in the metric of its covariance has 21 degrees of freedom; their sum is tested at 1e-4 each side.
    The estimated noise behind the weights (some 10 % per pose) makes χ² about 5 % wider, hence the factor 1.1.
    """
    totals = []
    for seed in range(6):
        recording, _ = simulate(SCENARIO, seed)
        truth = truth_of_the_day(SCENARIO, seed)
        done = trihedron.calibrate(recording, gravity_m_s2=truth.gravity_m_s2)
        totals.append(compare_with_truth(done.calibration, truth).chi2)
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], 21 * len(totals))
    assert low / 1.1 < sum(totals) < high * 1.1


def test_a_wrong_gravity_goes_into_the_scale_and_nowhere_else(recording, result):
    other = trihedron.calibrate(recording, segments=result.segments, gravity_m_s2=G * 1.002)
    np.testing.assert_allclose(other.accelerometer.S, 1.002 * result.accelerometer.S, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(other.accelerometer.b, 1.002 * result.accelerometer.b, rtol=1e-5)
    np.testing.assert_allclose(other.gyroscope.S, result.gyroscope.S, rtol=1e-6, atol=1e-11)


def test_both_methods_agree_within_their_error_bars_and_moves_sharpen_the_accelerometer(recording, result):
    apart = trihedron.calibrate(recording, segments=result.segments, gravity_m_s2=G, method="separate")
    for name in ("accelerometer", "gyroscope"):
        one, other = getattr(result, name), getattr(apart, name)
        sigma = np.where(other.sigma_S > 0, other.sigma_S, 1.0)
        # Same data: they differ by less than either's uncertainty.
        assert np.all(np.abs(one.S - other.S) < 2.0 * sigma)
    free = apart.accelerometer.sigma_S > 0.0
    ratio = (result.accelerometer.sigma_S[free] / apart.accelerometer.sigma_S[free]) ** 2
    # Estimated scatter of the two noise figures: a few per cent.
    assert ratio.max() < 1.1
    assert ratio.min() < 0.8


def test_a_frame_is_a_choice_of_axes_and_changes_no_norm(recording, result):
    symmetric = trihedron.calibrate(recording, segments=result.segments, gravity_m_s2=G, frame="symmetric")
    S = symmetric.accelerometer.S
    np.testing.assert_allclose(S, S.T, atol=1e-15)
    readings = result.segments.accelerometer_mean
    norms = [np.linalg.norm(readings @ r.accelerometer.S.T + r.accelerometer.b, axis=1) for r in (result, symmetric)]
    # Two fits of the same minimum, each stopped by its own inequality.
    np.testing.assert_allclose(norms[0], norms[1], atol=1e-5)


def test_a_recording_without_gyro_is_calibrated_alone_and_without_accelerometer_refused(recording):
    alone = trihedron.calibrate(replace(recording, gyroscope=None), gravity_m_s2=9.80665)
    assert alone.gyroscope is None
    with pytest.raises(ValueError, match="gyro alone"):
        trihedron.calibrate(replace(recording, accelerometer=None), gravity_m_s2=9.80665)


def test_verification_expects_what_it_sees_on_another_session_but_for_a_move_beyond_the_gyros_range(result):
    motion = hand_session(n_poses=16, pose_s=3.0, move_s=1.5, layout=3)
    other, truth = simulate(replace(SCENARIO, motion=motion), 12)
    judged = trihedron.verify(result, other).verification
    z = judged.norm_error / judged.norm_sigma
    # 16 poses: χ² within its 1e-4 limits.
    assert stats.chi2.ppf(1e-4, len(z)) < np.sum(z**2) < stats.chi2.ppf(1.0 - 1e-4, len(z))
    ratio = 2.0 * np.sum((judged.angle_deg / judged.angle_sigma_deg) ** 2)
    n = 2 * len(judged.angle_deg)
    assert stats.chi2.ppf(1e-4, n) < ratio < stats.chi2.ppf(1.0 - 1e-4, n)
    move = [part for part in truth.segments if part.kind == "move"][4]
    beyond = np.array(other.gyroscope)
    beyond[move.start + 40 : move.stop - 40] = [32767.0, -32768.0, 32767.0]
    verified = trihedron.verify(result, replace(other, gyroscope=beyond))
    assert verified.verification.moves_left_out == (4,)
    np.testing.assert_array_equal(verified.verification.moves, np.delete(judged.moves, 4))
    assert verified.verification.angle_rms_deg < 1.5 * judged.angle_rms_deg


def test_a_gyro_rate_from_pose_to_pose_is_judged_unless_an_effect_or_a_stated_drift_explains_it(result):
    """0.12 °/s per g, ten times a pose mean's noise and the Earth's rotation: one bias for the session leaves it."""
    matrix = ((2e-4, 4e-5, 0.0), (0.0, -2e-4, 1e-4), (1e-4, 0.0, 2e-4))
    (first, _), (other, _) = (simulate(with_effect(SCENARIO, "gyro-g-sensitivity", matrix=matrix), k) for k in (11, 12))
    alone = trihedron.calibrate(first, gravity_m_s2=G)
    of_gyro = alone.gyroscope.quality
    own = trihedron.verify(alone, first).verification
    np.testing.assert_allclose(own.angle_deg, of_gyro.angle_deg, rtol=1e-6)
    assert own.norm_rms == pytest.approx(alone.accelerometer.quality.rms, rel=1e-9)
    assert of_gyro.static_rate_rms > 8.0 * of_gyro.static_rate_floor
    healthy = result.gyroscope.quality
    assert healthy.static_rate_rms < 1.5 * healthy.static_rate_floor

    def judged(known, limit_deg=None):
        checked = trihedron.verify(known, other, limit_deg=limit_deg)
        return checked, [one for one in checked.findings if one.code == "static-rate-above-noise"]

    checked, (finding,) = judged(alone)
    # More than ten times what noise allows is not verified, whichever error it is, unless a limit accepts the gyro.
    assert not checked.is_passed
    checked, (finding,) = judged(alone, limit_deg=1.0)
    assert checked.is_passed
    assert finding.numbers["per_g_rad_s"] == pytest.approx(2.2e-3, rel=0.3)
    drift = Finding.of("gyro-bias-drift", "poses", change_rad_s=1e-2, axis=1, times=50.0)
    stated = replace(alone.calibration, findings=(*alone.findings, drift))
    for known in (trihedron.extend(alone), stated):
        assert judged(known)[1] == []
    other, _ = simulate(SCENARIO, 12)
    assert judged(result)[1] == []


def test_a_miss_far_beyond_what_was_expected_is_not_to_be_trusted_unless_a_limit_accepts_it(result):
    changed = replace(SCENARIO, accelerometer=replace(SCENARIO.accelerometer, b=(1.2, -0.3834, 0.1025)))
    other, _ = simulate(changed, 13)
    verified = trihedron.verify(result, other)
    finding = next(f for f in verified.findings if f.code == "residual-above-noise")
    assert finding.numbers["chi2_per_dof"] > 100.0
    assert finding.severity.value == "serious"
    # 0.9 m/s² more of one bias is an error of 50 mg rms: above a limit of 200 mg there is a remark only.
    wide = trihedron.verify(result, other, limit_mg=200.0)
    assert {f.severity.value for f in wide.findings if f.code == "residual-above-noise"} == {"warning"}
    # One pose has no others that would be as expected.
    assert not _beyond(np.array([100.0]), 1).is_single
    assert _beyond(np.array([100.0, 1.0, 1.0]), 1).is_single
    # A change of a few times the uncertainties is a warning.
    slightly = replace(SCENARIO, accelerometer=replace(SCENARIO.accelerometer, b=(0.303, -0.3834, 0.1025)))
    near, _ = simulate(slightly, 13)
    assert all(f.severity.value != "serious" for f in trihedron.verify(result, near).findings)


def test_a_check_predicts_the_error_bars_that_the_calibration_has(recording, result):
    checked = trihedron.check(recording)
    assert checked.is_fit
    np.testing.assert_allclose(checked.calibration.accelerometer.sigma_b, result.accelerometer.sigma_b, rtol=0.05)


@pytest.mark.parametrize("fit", ["calibrate_joint", "calibrate_moves"])
def test_a_defect_inside_a_fit_is_an_error_and_a_refusal_leaves_the_gyro_out(fit, recording, monkeypatch):
    methods = importlib.import_module("trihedron.api.calibrating_methods")
    method = "joint" if fit == "calibrate_joint" else "separate"

    def ends(error):
        def raising(*_, **__):
            raise error

        monkeypatch.setattr(methods, fit, raising)
        return calibrate(recording, method=method, gravity_m_s2=9.81)

    with pytest.raises(ValueError, match="broadcast"):
        ends(ValueError("operands could not be broadcast together with shapes (3,) (4,)"))
    for rejection in (InputError("the moves do not tell."), np.linalg.LinAlgError("Singular matrix")):
        result = ends(rejection)
        assert result.calibration.gyroscope is None
        said = str(rejection).rstrip(".").lower()
        assert any(said in finding.seen.lower() for finding in result.findings)
