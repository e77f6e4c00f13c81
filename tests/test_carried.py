"""Tilt error after moves: what noise allows it to miss is no negative variance."""

from dataclasses import replace

import numpy as np

from trihedron.estimate.gyroscope.measurements import measure_moves
from trihedron.estimate.session.carried import carried
from trihedron.records import SensorCalibration
from trihedron.simulate import Accelerometer, Gyroscope, Motion, MoveTo, NoiseTerms, Pose, Scenario, Turn, simulate
from true_segments import segments_from_truth

FACES = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.6, -0.8))


def measured_session(noise=1e-3):
    steps = [Pose(3.0)]
    for k, face in enumerate(FACES * 2):
        steps += [MoveTo(face, 1.5), Pose(2.0), Turn(face, 720.0 * (-1) ** k, 3.0, ramp=0.5), Pose(2.0)]
    accelerometer = Accelerometer(noise=NoiseTerms(N=(noise,) * 3))
    gyroscope = Gyroscope(
        S=((1.0, 0.2, 0.1), (0.0, 1.1, -0.1), (0.05, 0.0, 0.9)), noise=NoiseTerms(N=(0.1 * noise,) * 3)
    )
    recording, truth = simulate(Scenario(Motion(tuple(steps)), "", accelerometer, gyroscope), 5)
    segments = segments_from_truth(recording, truth)
    known = SensorCalibration(
        truth.accelerometer_S, truth.accelerometer_b, np.zeros((12, 12)), "m/s^2", "m/s^2", "given"
    )
    return recording, segments, measure_moves(recording, segments, known), truth


def seen(segments, measured, truth):
    middle = segments.time_mid_s[measured.links]
    return carried(measured, middle, truth.accelerometer_S, truth.accelerometer_b, truth.gyroscope_S)


def test_two_turns_about_the_vertical_with_stamps_that_stray_have_no_negative_variance():
    _, segments, measured, truth = measured_session(1e-12)
    # Timestamps alone: an error along the axis turned about, which is the vertical, and none across it.
    zero = np.zeros_like(measured.bias)
    alone = replace(measured, sigma_time_s=1e-3, var_bias=zero, var_reading=zero, noise_density=np.zeros(3))
    out = seen(segments, alone, truth)
    assert (out.floor2 >= 0.0).all()
    assert (out.by_calibration2(np.eye(24)) >= 0.0).all()
    assert np.isfinite(out.sigma).all()


def test_variances_of_independent_causes_add_up():
    _, segments, measured, truth = measured_session()
    measured = replace(measured, sigma_time_s=1e-4)
    zero = np.zeros_like(measured.bias)
    nothing = {"sigma_time_s": 0.0, "var_bias": zero, "var_reading": zero, "noise_density": np.zeros(3)}
    whole = seen(segments, measured, truth)
    parts = [seen(segments, replace(measured, **(nothing | {name: getattr(measured, name)})), truth)
             for name in nothing]  # fmt: skip
    # Sums of some hundred squares: rounding alone.
    assert np.allclose(whole.floor2, sum(part.floor2 for part in parts), rtol=1e-9)
    assert np.allclose(whole.sigma**2, sum(part.sigma**2 for part in parts), rtol=1e-9)
