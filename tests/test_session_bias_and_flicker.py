"""One bias of the accelerometer for a session, and how far 1/f noise carries it from pose to pose."""

import numpy as np

from confidence.motion import G
from confidence.sensor import recorded
from confidence.sessions import hand
from trihedron import diagnose
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.joint import calibrate_joint
from trihedron.records import Recording
from trihedron.simulate import Accelerometer, Gyroscope, NoiseTerms, Scenario, hand_session, simulate
from true_segments import segments_from_truth


def test_the_zero_of_a_session_is_that_of_its_middle():
    # A bias that drifts by 60 mm/s² over the session: the first pose's is 30 mm/s² from that of the middle.
    drift = 0.06
    away = []
    for seed in range(3):
        recording, truth = simulate(
            Scenario(
                motion=hand_session(20, pose_s=2.0, first_pose_s=3.0),
                accelerometer=Accelerometer(noise=NoiseTerms(N=(2e-3,) * 3)),
                gyroscope=Gyroscope(noise=NoiseTerms(N=(2e-4,) * 3)),
            ),
            seed,
        )
        part = np.linspace(-0.5, 0.5, recording.n_samples)[:, np.newaxis]
        drifting = Recording(
            recording.time_s, recording.accelerometer + drift * part, recording.gyroscope, recording.rate_hz,
            accelerometer_unit="m/s^2", gyroscope_unit="rad/s",
        )  # fmt: skip
        segments = segments_from_truth(drifting, truth)
        alone, _ = calibrate_norm(
            segments.accelerometer_mean, segments.accelerometer_sigma_mean, truth.gravity_m_s2, raw_unit="m/s^2"
        )
        found = calibrate_joint(drifting, segments, alone, truth.gravity_m_s2, "given")
        middle = np.mean([part[pose.start : pose.stop].mean() for pose in segments.poses])
        # f = S a' + b, so that b is minus the bias.
        away.append(found.accelerometer.b + drift * middle)
    # A third of what the bias of the first pose is away.
    assert np.sqrt(np.mean(np.square(away))) < drift / 2 / 3


def test_zeros_that_wander_as_consumer_parts_do_are_no_physics():
    f, w, rate, _, _ = hand(9002, move_s=1.5, gyro_flicker=np.radians(20.0 / 3600.0), accel_flicker=0.3e-3 * G)
    assert diagnose(recorded(f, w, rate), gravity_m_s2=G).verdict == "consistent"
