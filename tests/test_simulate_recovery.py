"""A linear instrument without noise is recovered exactly: simulation and estimators agree on what S and b mean."""

from dataclasses import replace

import numpy as np
import pytest

from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.session.solved import calibrate_moves
from trihedron.simulate import Clock, scenario_by_name, simulate
from true_segments import segments_from_truth


def relative(S, truth):
    return np.abs(np.linalg.solve(truth, S) - np.eye(3)).max()


@pytest.mark.parametrize(
    ("rate_hz", "gyro_tolerance"),
    # Poses have no sampling error; the integral over a sampled move has one, of about fourth order in the step. Moves
    # exclude that the sensor averages over its interval to a few 10^-9 of the scale at 800 Hz.
    [(100.0, 1e-6), pytest.param(800.0, 2e-9, marks=pytest.mark.slow)],
)
def test_calibration_of_the_linear_noiseless_instrument_recovers_the_truth(rate_hz, gyro_tolerance):
    scenario = replace(scenario_by_name("linear-noiseless"), clock=Clock(rate_hz))
    recording, truth = simulate(scenario)
    segments = segments_from_truth(recording, truth)
    # Errors of the means are zero; equal weights instead.
    equal = np.full_like(segments.accelerometer_mean, 1e-3)
    segments = replace(segments, accelerometer_sigma_mean=equal, gyroscope_sigma_mean=equal)
    accel, _ = calibrate_norm(segments.accelerometer_mean, equal, truth.gravity_m_s2)
    assert relative(accel.S, truth.accelerometer_S) < 1e-9
    assert np.abs(accel.b - truth.accelerometer_b).max() < 1e-9
    gyro, _ = calibrate_moves(recording, segments, accel, truth.gravity_m_s2)
    assert relative(gyro.S, truth.gyroscope_S) < gyro_tolerance
    assert np.abs(gyro.b - truth.gyroscope_b).max() < gyro_tolerance
