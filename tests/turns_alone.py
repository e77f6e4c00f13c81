"""Known turns of a gyro without an accelerometer: rows on a prior of the bias at rest and of scales to 30 %."""

import numpy as np

from trihedron.estimate.gyroscope.stated_turns import TableTurns, measure_turns
from trihedron.records import Calibration, Move, SensorCalibration

VAGUE = 0.3


def turned(recording, spans, static, angles, axes, scale, square=1e-2):
    """S, b and their standard errors by turns in samples ``spans`` by ``angles`` [rad] about the body's ``axes``.

    What turns about an axis do not show, the others' share in its scale, is known to ``square``.
    """
    moves = [Move(k, k, k + 1, a, b) for k, (a, b) in enumerate(spans)]
    measured = measure_turns(recording, moves, static)
    turns = TableTurns(
        **vars(measured), moves=moves, numbers=1 + np.arange(len(moves)), begin_s=np.zeros(len(moves)),
        angles=np.array(angles), up=np.eye(3)[axes], is_stated=True,
    )  # fmt: skip
    rest_s = sum(recording.time_s[b - 1] - recording.time_s[a] for a, b in static)
    of_bias = measured.var_rate / rest_s + measured.bias_spread / len(static) + np.sum(measured.hidden**2, axis=(0, 2))
    covariance = np.zeros((24, 24))
    covariance[12:21, 12:21] = scale**2 * np.diag(np.where(np.eye(3), VAGUE, square).ravel() ** 2)
    # b = -S z: known as z is, whatever the scale.
    by_scale = -np.kron(np.eye(3), measured.bias)
    covariance[21:, 12:21] = by_scale @ covariance[12:21, 12:21]
    covariance[12:21, 21:] = covariance[21:, 12:21].T
    covariance[21:, 21:] = by_scale @ covariance[12:21, 21:] + scale**2 * np.diag(of_bias)
    sensors = [
        SensorCalibration(s * np.eye(3), b, covariance[at : at + 12, at : at + 12], "counts", unit, "prior")
        for s, b, at, unit in ((1.0, np.zeros(3), 0, "m/s^2"), (scale, -scale * measured.bias, 12, "rad/s"))
    ]
    known = Calibration(*sensors, covariance, "case", 9.81, "assumed")
    found = turns.rates().scattered_on(known)
    sigma = np.sqrt(np.diag(found.covariance))
    return found.values[12:21].reshape(3, 3), found.values[21:], sigma[12:21].reshape(3, 3), sigma[21:]
