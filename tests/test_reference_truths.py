"""Truths that drift beside walks, flights and robots: nothing sound is rejected, and what is said is covered."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron
from reference_rig import G, turn
from reference_truths import truth
from trihedron.estimate.reference.fit import fit_reference, laid_beside
from trihedron.records.reference import NAMED_FROM, ReferenceMotion


def z_of_bias(found, trial):
    """(3,) standard scores of the gyro's bias."""
    b = -np.linalg.solve(trial.unit.M, trial.unit.c)
    return (found.gyroscope.b - b) / np.sqrt(np.diag(found.gyroscope.covariance)[9:])


# Beside a tracker at rest: tests/test_reference.py.
@pytest.mark.slow
def test_a_drone_under_a_tracker_of_attitudes_has_the_g_sensitivity_that_it_has():
    # It leans into its acceleration: its accelerometer's parameters are not stated, and what its gyro feels still is.
    trial = truth(4, "drone", seconds=40, has_g_sensitivity=True, size_deg=0.1)
    found = fit_reference(trial.log, trial.motion, G)
    one = found.effects["gyro-g-sensitivity"]
    assert one.score > NAMED_FROM
    assert np.abs((one.value - trial.unit.g_sensitivity.ravel()) / one.std).max() < 4.5
    assert np.abs(z_of_bias(found, trial)).max() < 4.5


def test_what_a_reference_is_too_poor_to_show_is_said_with_the_size_from_which_it_would():
    fine, poor = (
        fit_reference(trial.log, trial.motion, G).effects["gyro-g-sensitivity"]
        for trial in (truth(2, "robot", seconds=14, size_deg=size, lasting_s=6.0) for size in (0.03, 2.0))
    )
    # Λ of the numbers falls with the square of the truth's error, which is seventy times as large.
    assert 3.0 * fine.shown_from < poor.shown_from


def test_two_places_of_the_clock_are_both_said_and_refused():
    # Shaken at 5 Hz all along under a tracker that lacks both ends: a fifth of a second more or less fits as well.
    trial = truth(5, "shaken", seconds=25)
    inside = (trial.motion.time_s > 4.0) & (trial.motion.time_s < 21.0)
    t = trial.motion.time_s[inside]
    motion = ReferenceMotion(t - t[0], attitude=trial.motion.attitude[inside], source="tracker.csv")
    with pytest.raises(ValueError, match=r"fits two offsets of the reference's clock, .* s and .* s"):
        fit_reference(trial.log, motion, G)


def test_a_stretch_in_which_the_truth_is_wrong_is_said_and_the_rest_is_used():
    trial = truth(8, "robot", seconds=40, size_deg=0.05, lasting_s=6.0)
    wrong = (trial.motion.time_s > 20.0) & (trial.motion.time_s < 25.0)
    attitude = trial.motion.attitude.copy()
    attitude[wrong] = turn(0, np.radians([6.0]))[0] @ attitude[wrong]
    found = fit_reference(trial.log, replace(trial.motion, attitude=attitude), G)
    assert any(start < 21.5 and end > 18.5 for start, end in found.error.apart_s)
    # The attitude begins anew after it: its error there is that of the reference, not the step of 6 degrees.
    assert np.degrees(np.nanmax(np.abs(found.apart.angle))) < 1.0
    assert np.abs(z_of_bias(found, trial)).max() < 4.5


def test_stretches_of_even_flight_are_no_poses(real_data):
    log, beside = (real_data / "euroc" / f"MH_03_medium.{what}.csv.gz" for what in ("log", "truth"))
    found = trihedron.diagnose(log, reference=beside, gravity_m_s2=9.807)
    assert found.verdict == "consistent"
    assert not found.effects


def test_a_truth_that_wanders_in_the_body_leaves_the_accelerometer_within_its_uncertainty():
    # The gyro shows how the truth's error of 0.85° changes, and no motion shows its mean: that turns both sensors.
    trial = truth(1006, "walk", has_path=True)
    found = fit_reference(trial.log, trial.motion, G)
    S = np.linalg.inv(trial.unit.N)
    off = found.accelerometer.S - S
    sigma = np.sqrt(np.diag(found.accelerometer.covariance)[:9])
    assert np.abs(off.ravel() / sigma).max() < 4.5  # 9 with the truth's attitudes as they are
    # A turn of all axes is not known to half a degree, and scales are to some 1e-4.
    assert np.degrees(np.sqrt(np.trace(found.frame_covariance))) > 0.3
    assert np.abs(np.diag(off @ trial.unit.N)).max() < 1e-3


def test_poses_that_a_robot_repeats_are_no_jump_of_the_clock():
    trial = truth(2, "robot", seconds=40, size_deg=0.03, lasting_s=6.0)
    assert laid_beside(trial.log, trial.motion, G).grid is not None
