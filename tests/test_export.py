"""Every export, evaluated by the target's own equation, gives what the calibration gives."""

import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from trihedron.files.export import TARGETS, export_calibration, upper_frame
from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import in_frame

READINGS = np.random.default_rng(5).normal(size=(40, 3)) * 8.0

# Residue of writing numbers with all digits and evaluating in another order.
ROUNDING = {"rtol": 1e-10, "atol": 1e-10}


def calibration(unit="si", handed=1.0):
    """Both sensors, lower frame, with a gyro that is neither triangular nor aligned."""
    scale = 1.0 if unit == "si" else 1e-3
    S_f = scale * np.array([[1.01 * handed, 0, 0], [0.004, 0.99, 0], [-0.006, 0.003, 1.02]])
    S_w = scale * np.array([[1.02 * handed, 0.01, -0.02], [-0.015, 0.98, 0.005], [0.01, -0.02, 1.01]])
    units = ("m/s^2", "rad/s") if unit == "si" else ("counts", "counts")
    covariance = np.zeros((24, 24))
    sensors = [
        SensorCalibration(S, b, np.zeros((12, 12)), raw, si, "given")
        for S, b, raw, si in (
            (S_f, np.array([0.3, -0.2, 0.1]), units[0], "m/s^2"),
            (S_w, np.array([0.01, -0.02, 0.03]), units[1], "rad/s"),
        )
    ]
    return Calibration(*sensors, covariance, "lower", 9.81, "given", "log.csv", "")


def corrected(sensor):
    return READINGS @ sensor.S.T + sensor.b


def numbers(text):
    return [float(word) for word in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", text)]


def assignments(text):
    """`name = {...};` of the xio export."""
    return {m[1]: np.array(numbers(m[2])) for m in re.finditer(r"(\w+) = \{([^}]*)\};", text)}


@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_python_snippet_runs_and_agrees(handed):
    known = calibration("counts", handed)
    scope = {}
    exec(export_calibration(known, "python"), scope)
    np.testing.assert_allclose(
        scope["correct"](READINGS, scope["S_ACCELEROMETER"], scope["B_ACCELEROMETER"]), corrected(known.accelerometer)
    )
    np.testing.assert_allclose(
        scope["correct"](READINGS, scope["S_GYROSCOPE"], scope["B_GYROSCOPE"]), corrected(known.gyroscope)
    )


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler on this machine")
def test_c_snippet_compiles_without_warnings_and_agrees(tmp_path):
    known = calibration("counts")
    main = """
    #include <stdio.h>
    int main(void) {
        double r[3], f[3], w[3];
        while (scanf("%lf %lf %lf", r, r + 1, r + 2) == 3) {
            trihedron_correct(&trihedron_accelerometer, r, f);
            trihedron_correct(&trihedron_gyroscope, r, w);
            printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", f[0], f[1], f[2], w[0], w[1], w[2]);
        }
        return 0;
    }
    """
    source = tmp_path / "main.c"
    source.write_text(export_calibration(known, "c") + main)
    build = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", str(source), "-o", str(tmp_path / "main")]
    subprocess.run(build, check=True, capture_output=True)
    rows = "\n".join(" ".join(repr(float(v)) for v in row) for row in READINGS)
    done = subprocess.run([tmp_path / "main"], input=rows, capture_output=True, text=True, check=True)
    out = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    np.testing.assert_allclose(out[:, :3], corrected(known.accelerometer), **ROUNDING)
    np.testing.assert_allclose(out[:, 3:], corrected(known.gyroscope), **ROUNDING)


@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_kalibr_distorts_truth_into_the_readings(handed):
    """a_m = M a + b; w_m = M C_gyro_i w + A a + b, M lower triangular, C a rotation."""
    known = calibration("counts", handed)
    text = export_calibration(known, "kalibr")
    rows = [numbers(line) for line in text.splitlines() if line.strip().startswith("- [")]
    biases = [numbers(line.split("#")[0]) for line in text.splitlines() if line.strip().startswith("b:")]
    M_a, M_w, A, C = (np.array(rows[3 * k : 3 * k + 3]) for k in range(4))
    assert np.allclose(M_a, np.tril(M_a))
    assert np.allclose(M_w, np.tril(M_w))
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(C) > 0
    assert not A.any()
    force, rate = corrected(known.accelerometer), corrected(known.gyroscope)
    np.testing.assert_allclose(force @ M_a.T + biases[0], READINGS, **ROUNDING)
    np.testing.assert_allclose(rate @ (M_w @ C).T + biases[1], READINGS, **ROUNDING)


@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_imu_tk_subtracts_the_zero_then_scales_then_aligns(handed):
    """x = T K (raw - B) in its own frame, which is ours turned by the rotation that the file states."""
    known = calibration("counts", handed)
    text = export_calibration(known, "imu_tk")
    rotation, _ = upper_frame(known)
    assert np.linalg.det(rotation) > 0
    body = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    values = [[float(v) for v in line.split()] for line in body]
    for k, sensor in enumerate((known.accelerometer, known.gyroscope)):
        part = values[9 * k : 9 * k + 9]
        T, K, B = np.array(part[:3]), np.array(part[3:6]), np.array(part[6:9]).ravel()
        np.testing.assert_array_equal(np.diag(T), 1.0)
        if k == 0:
            np.testing.assert_array_equal(T, np.triu(T))
        np.testing.assert_allclose((READINGS - B) @ (T @ K).T, corrected(sensor) @ rotation.T, **ROUNDING)


def test_basalt_subtracts_the_zero_after_the_matrix():
    """(I + M) raw - b with M by columns, its lower triangle for the accelerometer."""
    known = calibration()
    document = json.loads(export_calibration(known, "basalt"))
    a, w = np.array(document["calib_accel_bias"]), np.array(document["calib_gyro_bias"])
    M = np.array([[a[3], 0, 0], [a[4], a[6], 0], [a[5], a[7], a[8]]])
    np.testing.assert_allclose(READINGS @ (np.eye(3) + M).T - a[:3], corrected(known.accelerometer), **ROUNDING)
    M = w[3:].reshape(3, 3).T
    np.testing.assert_allclose(READINGS @ (np.eye(3) + M).T - w[:3], corrected(known.gyroscope), **ROUNDING)


def test_basalt_refuses_readings_that_are_not_si():
    with pytest.raises(ValueError, match="Basalt expects raw readings in m/s"):
        export_calibration(calibration("counts"), "basalt")


def test_xio_scales_the_difference_then_aligns():
    known = calibration("counts")
    parts = assignments(export_calibration(known, "xio"))
    for name, sensor in (("accelerometer", known.accelerometer), ("gyroscope", known.gyroscope)):
        M = parts[f"{name}Misalignment"].reshape(3, 3)
        s, b = parts[f"{name}Sensitivity"], parts[f"{name}Offset"]
        np.testing.assert_allclose((s * (READINGS - b)) @ M.T, corrected(sensor), **ROUNDING)


def test_pyins_distorts_truth_into_the_readings():
    known = calibration("counts")
    scope = {}
    exec(export_calibration(known, "pyins"), scope)
    force = corrected(known.accelerometer)
    np.testing.assert_allclose(force @ scope["accel_transform"].T + scope["accel_bias"], READINGS, **ROUNDING)


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_every_export_says_when_the_calibration_is_not_to_be_trusted_or_has_no_gyro(target):
    known = calibration()
    alone = replace(known, gyroscope=None, covariance=np.zeros((12, 12)))
    assert export_calibration(alone, target)


def test_a_symmetric_frame_is_turned_before_a_triangular_convention_is_written():
    known = in_frame(calibration("counts"), "symmetric")
    text = export_calibration(known, "kalibr")
    rows = [numbers(line) for line in text.splitlines() if line.strip().startswith("- [")]
    lower = in_frame(known, "lower")
    M = np.array(rows[:3])
    np.testing.assert_allclose(M, np.linalg.inv(lower.accelerometer.S), **ROUNDING)


def test_an_unknown_target_is_answered_with_the_list():
    with pytest.raises(ValueError, match="kalibr"):
        export_calibration(calibration(), "floppy")
