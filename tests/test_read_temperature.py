"""Units of a temperature column, and readings that no sensor has."""

import numpy as np
import pytest

import trihedron
from hand_made_sessions import motion

T_DEGC = np.round(np.linspace(22.0, 28.0, 1650), 2)


def read_with(name, values):
    t, force, rate = motion(50.0, n_poses=8)
    columns = {"time_s": t, "acc": force, "gyr": rate, name: np.resize(values, len(t))}
    recording = trihedron.read(columns)
    return recording.temperature_degc, {f.code: f for f in recording.findings}


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("temperature [degC]", T_DEGC),
        ("temp_C", T_DEGC),
        ("temperature [K]", T_DEGC + 273.15),
        ("temp_K", T_DEGC + 273.15),
        ("temperature (°F)", T_DEGC * 1.8 + 32.0),
        ("temp_F", T_DEGC * 1.8 + 32.0),
    ],
)
def test_a_temperature_is_converted_from_the_unit_of_its_name(name, values):
    found, findings = read_with(name, values)
    np.testing.assert_allclose(found, np.resize(T_DEGC, len(found)), atol=1e-9)
    assert "temperature-implausible" not in findings


@pytest.mark.parametrize("values", [T_DEGC + 273.15, 10.0 * T_DEGC, (T_DEGC - 36.53) * 340.0])
def test_a_column_that_is_not_in_degrees_celsius_is_not_used(values):
    found, findings = read_with("temp", values)
    assert found is None
    assert "not used" in findings["temperature-implausible"].action


def test_readings_of_a_thermometer_that_does_not_answer_are_left_out():
    values = T_DEGC.copy()
    values[::37] = -127.0
    found, findings = read_with("temp_C", values)
    assert np.isnan(found[::37][:40]).all()
    assert np.nanmin(found) == 22.0
    assert "temperature-implausible" in findings
