"""References as files, and what their truths are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron
from reference_rig import G, turn
from reference_truths import truth
from trihedron.estimate.reference.fit import fit_reference
from trihedron.read.reference.motion import read_reference
from trihedron.records.reference import ReferenceMotion

T = np.arange(0, 4, 0.02)
A, B, C = 0.3 * np.sin(T), 0.2 * np.sin(1.7 * T), 0.4 * np.sin(0.9 * T)
TRUE = turn(2, A) @ turn(1, B) @ turn(0, C)  # yaw, pitch, roll
Q = np.roll(Rotation.from_matrix(TRUE).as_quat(), 1, axis=1)  # w x y z


def written(tmp_path, columns, header=""):
    path = tmp_path / "motion.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9f")
    return path


@pytest.mark.parametrize(
    ("columns", "header", "said"),
    [
        ((T, Q), "t,qw,qx,qy,qz", None),
        ((T, Q[:, [1, 2, 3, 0]]), "time [s],qx,qy,qz,qw", None),
        ((T, Q[:, [1, 2, 3, 0]]), "", "t,qx,qy,qz,qw"),
        ((1e3 * T, Q), "time_ms,q_w,q_x,q_y,q_z", None),
        ((T, TRUE.reshape(-1, 9)), "t,r00,r01,r02,r10,r11,r12,r20,r21,r22", None),
        ((T, TRUE.reshape(-1, 9)), "t,R11,R12,R13,R21,R22,R23,R31,R32,R33", None),
        ((T, np.degrees(C), np.degrees(B), np.degrees(A)), "t,roll [deg],pitch [deg],yaw [deg]", None),
        ((T, C, B, A), "t,roll_rad,pitch_rad,yaw_rad", None),
        ((T, A, B, C), "", "t,rot_z [rad],rot_y [rad],rot_x [rad]"),
    ],
)
def test_one_attitude_in_every_way_of_writing_it(tmp_path, columns, header, said):
    motion = read_reference(written(tmp_path, columns, header), said)
    # Nine decimals; timestamps are even, and may be laid anew to a hundredth of a step.
    assert np.allclose(motion.attitude, TRUE, atol=1e-6)
    assert np.allclose(motion.time_s, T, atol=2e-4)


def test_rates_and_positions_carry_their_unit_and_slow_rows_are_commands(tmp_path):
    p = np.column_stack([A, B, C])
    motion = read_reference(written(tmp_path, (T, Q, 1e3 * p), "t,qw,qx,qy,qz,px [mm],py [mm],pz [mm]"))
    assert np.allclose(motion.position, p, atol=1e-8)
    rate = np.array([[0, 0, 0], [30, 0, 0], [0, -60, 0], [0, 0, 0.0]])
    motion = read_reference(written(tmp_path, (np.arange(4) * 10.0, rate), "t [s],wx [deg/s],wy [deg/s],wz [deg/s]"))
    assert motion.is_stepwise
    assert np.allclose(motion.rate, np.radians(rate))


@pytest.mark.parametrize(
    ("columns", "header", "said", "complaint"),
    [
        ((T, Q), "", None, "no names; name them in file order"),
        ((T, A, B, C), "t,wx,wy,wz", None, "unit of the reference's rate is not stated"),
        ((T, A, B, C), "t,roll,pitch,yaw", None, "unit of the angles is not stated"),
        ((T, Q[:, :3]), "t,qw,qx,qy", None, "needs one column each of qw, qx, qy, qz"),
        ((T, 2.0 * Q), "t,qw,qx,qy,qz", None, "length 2, not 1"),
        ((T, (TRUE * [1, -1, 1]).reshape(-1, 9)), "t,r00,r01,r02,r10,r11,r12,r20,r21,r22", None, "mirrored"),
        ((T, (1.3 * TRUE).reshape(-1, 9)), "t,r00,r01,r02,r10,r11,r12,r20,r21,r22", None, "no rotation"),
        ((Q,), "qw,qx,qy,qz", None, "no column of this reference is its time"),
        ((T, Q), "t,qw,qx,qy,qz", "t,qw,qx,qy,qq", "does not know 'qq'"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_sentence(tmp_path, columns, header, said, complaint):
    with pytest.raises(ValueError, match=complaint) as caught:
        read_reference(written(tmp_path, columns, header), said)
    assert "motion.csv" in str(caught.value)


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
    apart = found.gyroscope.b + np.linalg.solve(trial.unit.M, trial.unit.c)
    assert np.abs(apart / np.sqrt(np.diag(found.gyroscope.covariance)[9:])).max() < 4.5


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
    assert np.degrees(np.linalg.norm(found.mounting.std)) > 0.3
    # That turn is common to both: of their joint covariance every combination has a positive variance.
    joint = np.block(
        [
            [found.accelerometer.covariance, found.cross_covariance],
            [found.cross_covariance.T, found.gyroscope.covariance],
        ]
    )
    scale = np.sqrt(np.diag(joint))
    assert np.linalg.eigvalsh(joint / np.outer(scale, scale)).min() > -1e-9  # rounding
    assert np.abs(found.cross_covariance / np.outer(scale[:12], scale[12:])).max() > 0.5
    assert np.abs(np.diag(off @ trial.unit.N)).max() < 1e-3


def test_the_bias_over_time_follows_the_bias_that_walked_and_poses_that_a_robot_repeats_are_no_jump_of_the_clock():
    trial = truth(2, "robot", seconds=40, size_deg=0.03, lasting_s=6.0)
    bias = fit_reference(trial.log, trial.motion, G).bias
    at = 0.01 * np.arange(len(trial.walked))
    for k in range(3):
        walked = np.interp(bias.time_s, at, trial.walked[:, k])
        # b takes it off; a walk of one standard error is shrunk, and never turned round.
        assert np.corrcoef(bias.value[:, k], -walked)[0, 1] > 0.5
