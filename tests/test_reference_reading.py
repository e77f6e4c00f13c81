"""References as files: what their columns are, and one sentence where nothing states it."""

import numpy as np
import pytest

from reference_rig import turn
from trihedron.read.reference.motion import read_reference

T = np.arange(0, 4, 0.02)
A, B, C = 0.3 * np.sin(T), 0.2 * np.sin(1.7 * T), 0.4 * np.sin(0.9 * T)
TRUE = turn(2, A) @ turn(1, B) @ turn(0, C)  # yaw, pitch, roll


def half(axis, angle):
    q = np.zeros((len(angle), 4))
    q[:, 0], q[:, 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return q


def product(p, q):
    w = p[:, 0] * q[:, 0] - np.sum(p[:, 1:] * q[:, 1:], axis=1)
    v = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([w, v])


# (n, 4) w x y z by half angles, apart from any library.
Q = product(product(half(2, A), half(1, B)), half(0, C))


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


def test_rates_carry_their_unit_and_slow_rows_are_commands(tmp_path):
    rate = np.array([[0, 0, 0], [30, 0, 0], [0, -60, 0], [0, 0, 0.0]])
    motion = read_reference(written(tmp_path, (np.arange(4) * 10.0, rate), "t [s],wx [deg/s],wy [deg/s],wz [deg/s]"))
    assert motion.is_stepwise
    assert np.allclose(motion.rate, np.radians(rate))


def test_a_pose_has_its_position_in_metres(tmp_path):
    p = np.column_stack([A, B, C])
    motion = read_reference(written(tmp_path, (T, Q, 1e3 * p), "t,qw,qx,qy,qz,px [mm],py [mm],pz [mm]"))
    assert np.allclose(motion.position, p, atol=1e-8)


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
