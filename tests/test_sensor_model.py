"""Directions, forms and frames of the linear model, with their uncertainty."""

import numpy as np
import pytest

from trihedron.gravity import normal_gravity
from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import in_frame, other_form, other_form_jacobian, reframing
from trihedron.units import (
    AccelerationUnit,
    RateUnit,
    acceleration_lsb_to_si,
    acceleration_to_si,
    degrees_from_radians,
    m_s2_from_micro_g,
    mg_from_m_s2,
    radians_from_degrees,
    rate_lsb_to_si,
    rate_to_si,
)


def triad(seed: int, *, left_handed: bool = False) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    S = np.diag(1 + 0.1 * rng.uniform(-1, 1, 3)) + 0.05 * rng.uniform(-1, 1, (3, 3))
    if left_handed:
        S = S * [1, -1, 1]
    return S, rng.uniform(-1, 1, 3)


def parameters(S, b):
    return np.concatenate([np.ravel(S), b])


def numeric_jacobian(function, x, step=1e-6):
    """Central differences: rounding 1e-16/1e-6."""
    return np.column_stack([(function(x + e) - function(x - e)) / (2 * step) for e in step * np.eye(len(x))])


def test_the_two_forms_are_inverse_to_each_other_with_the_stated_derivative_and_none_has_parallel_axes():
    S, b = triad(2)
    S_a, b_a = other_form(S, b)
    f = np.array([[1.0, -2.0, 9.0]])
    np.testing.assert_allclose(f @ S_a.T + b_a, np.linalg.solve(S, (f - b).T).T, atol=1e-13)
    back = other_form(S_a, b_a)
    np.testing.assert_allclose(back[0], S, atol=1e-14)
    np.testing.assert_allclose(back[1], b, atol=1e-14)
    numeric = numeric_jacobian(lambda x: parameters(*other_form(x[:9].reshape(3, 3), x[9:])), parameters(S, b))
    np.testing.assert_allclose(other_form_jacobian(S, b), numeric, atol=1e-8)
    with pytest.raises(ValueError, match="parallel"):
        other_form(np.ones((3, 3)), np.zeros(3))


@pytest.mark.parametrize("left_handed", [False, True])
@pytest.mark.parametrize("frame", ["lower", "symmetric"])
def test_a_frame_is_reached_by_a_proper_rotation_of_the_stated_derivative(frame, left_handed):
    for seed in range(20):
        S, b = triad(seed, left_handed=left_handed)
        change = reframing(S, b, frame)
        R = change.rotation
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) == pytest.approx(1.0)
        new = R @ S
        if frame == "lower":
            assert np.abs(np.triu(new, 1)).max() < 1e-14
        else:
            signs = np.sign(np.diag(new))
            np.testing.assert_allclose(new * signs, (new * signs).T, atol=1e-14)
        # The sign of the determinant, handedness, is kept and not turned into a half turn.
        assert np.sign(np.linalg.det(new)) == np.sign(np.linalg.det(S))
        assert np.trace(R) > 2.9

        def moved(x, frame=frame):
            S, b = x[:9].reshape(3, 3), x[9:]
            R = reframing(S, b, frame).rotation
            return parameters(R @ S, R @ b)

        np.testing.assert_allclose(change.jacobian, numeric_jacobian(moved, parameters(S, b)), atol=1e-8)


def both_sensors(seed: int) -> Calibration:
    S, b = triad(seed)
    S_w, b_w = triad(seed + 100)
    rng = np.random.default_rng(seed)
    root = 1e-3 * rng.standard_normal((24, 24))
    covariance = root @ root.T
    accelerometer = SensorCalibration(S, b, covariance[:12, :12], "m/s^2", "m/s^2", "test")
    gyroscope = SensorCalibration(S_w, b_w, covariance[12:, 12:], "rad/s", "rad/s", "test")
    return Calibration(accelerometer, gyroscope, covariance, "case", 9.81, "test")


@pytest.mark.parametrize("frame", ["lower", "symmetric"])
def test_the_gyro_turns_with_the_accelerometer_and_shares_its_uncertainty(frame):
    calibration = both_sensors(7)
    new = in_frame(calibration, frame)
    R = new.accelerometer.S @ np.linalg.inv(calibration.accelerometer.S)
    np.testing.assert_allclose(new.gyroscope.S, R @ calibration.gyroscope.S, atol=1e-14)

    def moved(x):
        a, w = x[:12], x[12:]
        R = reframing(a[:9].reshape(3, 3), a[9:], frame).rotation
        return np.concatenate([(R @ s[:9].reshape(3, 3)).ravel() for s in (a, w)] + [R @ a[9:], R @ w[9:]])

    x = np.concatenate([parameters(s.S, s.b) for s in (calibration.accelerometer, calibration.gyroscope)])
    order = [*range(9), *range(18, 21), *range(9, 18), *range(21, 24)]
    jacobian = numeric_jacobian(moved, x)[order]
    expected = jacobian @ calibration.covariance @ jacobian.T
    # Entries of 1e-5; differences are good to eight digits.
    np.testing.assert_allclose(new.covariance, expected, atol=1e-11)
    np.testing.assert_array_equal(new.covariance[12:, 12:], new.gyroscope.covariance)


def test_normal_gravity_has_its_published_values_and_impossible_places_are_refused():
    # Equator and pole by definition of WGS 84; 45° from NIMA TR8350.2.
    assert normal_gravity(0.0) == pytest.approx(9.7803253359, abs=1e-10)
    assert normal_gravity(90.0) == pytest.approx(9.8321849378, abs=1e-9)
    assert normal_gravity(45.0) == pytest.approx(9.806197769, abs=1e-8)
    assert normal_gravity(-45.0) == normal_gravity(45.0)
    # Free-air gradient, 3.086e-6 s⁻² at mid latitudes, to its third digit.
    assert (normal_gravity(45.0) - normal_gravity(45.0, 1000.0)) / 1000.0 == pytest.approx(3.086e-6, abs=3e-9)
    for latitude, height in ((91.0, 0.0), (float("nan"), 0.0), (0.0, 1e6)):
        with pytest.raises(ValueError, match="must be between"):
            normal_gravity(latitude, height)


def test_units_have_the_sizes_of_the_international_system():
    # The unit g is defined as 9.80665 m/s²; a degree is pi/180.
    assert acceleration_to_si(AccelerationUnit.G) == 9.80665
    assert acceleration_to_si(AccelerationUnit.MG) == pytest.approx(9.80665e-3, rel=1e-15)
    assert rate_to_si(RateUnit.DEG_S) == pytest.approx(0.017453292519943295, rel=1e-15)
    assert (rate_to_si(RateUnit.MDEG_S), rate_to_si(RateUnit.MRAD_S)) == pytest.approx((1.7453292519943e-5, 1e-3))
    assert (rate_to_si(RateUnit.DEG_H), rate_to_si(RateUnit.RPM)) == pytest.approx((4.848136811095e-6, 0.10471975512))
    assert acceleration_lsb_to_si("0.061 mg") == pytest.approx(0.061e-3 * 9.80665)
    assert rate_lsb_to_si("0.05 deg/s") == pytest.approx(8.726646259971648e-4)
    assert mg_from_m_s2(9.80665) == pytest.approx(1000.0)
    assert m_s2_from_micro_g(1e6) == pytest.approx(9.80665)
    assert (degrees_from_radians(np.pi), radians_from_degrees(180.0)) == pytest.approx((180.0, np.pi))
