"""Method 1: six faces, in closed form and by least squares, with the errors that a table adds."""

import numpy as np
import pytest

from trihedron.estimate.accelerometer import calibrate_faces
from trihedron.records import FindingCode
from trihedron.sensor_model import other_form, other_form_jacobian

G = 9.81
S_A = np.array([[0.997, -0.015, -0.007], [0.009, 1.002, 0.002], [0.014, 0.002, 1.023]])
B_A = np.array([0.54, -0.62, 0.40])
SIX = np.array([1, -1, 2, -2, 3, -3])


def direction(faces) -> np.ndarray:
    faces = np.asarray(faces)
    return np.sign(faces)[:, None] * np.eye(3)[np.abs(faces) - 1]


def face_readings(faces, sigma: float, seed: int, tilt_deg: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    up = direction(faces) + np.radians(tilt_deg) * rng.standard_normal((len(faces), 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return G * up @ S_A.T + B_A + sigma * rng.standard_normal(up.shape)


def codes(findings):
    return {finding.code for finding in findings}


@pytest.mark.parametrize("method", ["least-squares", "closed-form"])
def test_exact_faces_give_the_exact_model_in_any_order(method):
    faces = np.array([3, -1, 2, 1, -3, -2])
    sensor, findings = calibrate_faces(
        face_readings(faces, 0.0, 0), np.full(3, 1e-3), G, raw_unit="m/s^2", method=method
    )
    S_a, b_a = other_form(sensor.S, sensor.b)
    # Linear algebra on numbers of order ten.
    np.testing.assert_allclose(S_a, S_A, atol=1e-13)
    np.testing.assert_allclose(b_a, B_A, atol=1e-12)
    assert not findings


@pytest.mark.parametrize(("method", "zero_variance"), [("least-squares", 1 / 6), ("closed-form", 1 / 6)])
def test_reported_variances_are_those_of_the_formula(method, zero_variance):
    sigma = 2e-3
    sensor, _ = calibrate_faces(face_readings(SIX, 0.0, 0), np.full(3, sigma), G, raw_unit="m/s^2", method=method)
    # Back to the inverse form, in which the formula is stated: var S_a = σ²/2g², var b_a = σ²/6.
    jacobian = other_form_jacobian(sensor.S, sensor.b)
    variance = np.diag(jacobian @ sensor.covariance @ jacobian.T)
    np.testing.assert_allclose(variance[:9], sigma**2 / (2 * G**2), rtol=1e-9)
    np.testing.assert_allclose(variance[9:], sigma**2 * zero_variance, rtol=1e-9)
