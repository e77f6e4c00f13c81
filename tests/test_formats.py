"""Calibrations of other makers are read as the inverse of how they are written, and real files of theirs are read."""

import json

import numpy as np
import pytest
import yaml

import trihedron
from test_export import NOISE, READINGS, ROUNDING, calibration, corrected, with_g_sensitivity
from trihedron.files.formats import any_calibration, export_files, is_calibration
from trihedron.files.formats.parsing import yaml_of
from trihedron.records import Calibration
from trihedron.sensor_model import in_frame


def read_back(known, target, folder):
    files = export_files(known, target, NOISE)
    for ending, text in files.items():
        (folder / f"unit{ending or '.txt'}").write_text(text)
    first = folder / f"unit{next(iter(files)) or '.txt'}"
    assert is_calibration(first)
    return any_calibration(first)


@pytest.mark.parametrize("target", ["kalibr", "openvins", "imucal"])
def test_g_sensitivity_is_read_back_and_applied(target, tmp_path):
    known, G = with_g_sensitivity(in_frame(calibration("si"), "lower"))
    back = read_back(known, target, tmp_path)
    values = back.extensions["effects"][0]["model"]["values"]
    np.testing.assert_allclose(np.reshape(values, (3, 3)), G, **ROUNDING)
    log = trihedron.read({"t": np.arange(40) / 100, "acc": READINGS, "gyr": READINGS},
                         accelerometer_unit="m/s^2", gyroscope_unit="rad/s")  # fmt: skip
    made = trihedron.apply(back, log)
    force = corrected(known.accelerometer)
    np.testing.assert_allclose(made.gyroscope, corrected(known.gyroscope) - force @ G.T, **ROUNDING)


def test_realsense_stores_the_transpose():
    """The maker's script fits raw · X - bias to the truth and stores X row by row."""
    known = calibration("si")
    imu = json.loads(export_files(known, "realsense", NOISE)[""])["imus"][0]
    X, bias = np.reshape(imu["accelerometer"]["scale_and_alignment"], (3, 3)), imu["accelerometer"]["bias"]
    np.testing.assert_allclose(READINGS @ X - bias, corrected(known.accelerometer), **ROUNDING)


def test_imucal_calibrates_as_its_own_functions_do():
    """acc = (K R)⁻¹ (raw - b); gyr in deg/s = (K R)⁻¹ (raw - b - K_ga acc)."""
    known, G = with_g_sensitivity(calibration("counts"))
    p = {k: np.array(v) for k, v in json.loads(export_files(known, "imucal")[""]).items() if not isinstance(v, str)}
    acc = (READINGS - p["b_a"]) @ np.linalg.inv(p["K_a"] @ p["R_a"]).T
    np.testing.assert_allclose(acc, corrected(known.accelerometer), **ROUNDING)
    gyr = (READINGS - p["b_g"] - acc @ p["K_ga"].T) @ np.linalg.inv(p["K_g"] @ p["R_g"]).T
    np.testing.assert_allclose(np.radians(gyr), corrected(known.gyroscope) - acc @ G.T, **ROUNDING)


@pytest.mark.parametrize(
    "target", ["kalibr", "openvins", "vins-fusion", "ros", "orb-slam3", "lio-sam", "fast-lio", "gtsam", "gazebo"]
)
def test_a_target_that_cannot_do_without_noise_asks_for_it(target):
    with pytest.raises(ValueError, match="--noise"):
        export_files(calibration("si"), target)


def test_the_result_of_imu_tk_on_its_own_recording_is_read(real_data, tmp_path):
    published = json.loads((real_data / "xsens_mti" / "published_imu_tk.json").read_text())
    for sensor, ending in (("acc", "acc"), ("gyro", "gyro")):
        one = published[sensor]
        rows = [*one["misalignment"], *np.diag(one["scale"]).tolist(), *[[v] for v in one["bias"]]]
        (tmp_path / f"test_imu_{ending}.calib").write_text("\n".join(" ".join(map(str, r)) for r in rows))
    back = any_calibration(tmp_path / "test_imu_acc.calib")
    assert back.accelerometer.raw_unit == "counts"
    # x = T K (raw - B): at B the sensor reads nothing.
    np.testing.assert_allclose(back.accelerometer.S @ published["acc"]["bias"] + back.accelerometer.b, 0, atol=1e-9)
    np.testing.assert_allclose(back.gyroscope.S @ published["gyro"]["bias"] + back.gyroscope.b, 0, atol=1e-9)


def test_the_result_of_imucal_on_a_recording_is_read(real_data):
    file = real_data / "imucal_ferraris" / "ferraris_result_imucal260.json"
    back = any_calibration(file)
    assert (back.accelerometer.raw_unit, back.gyroscope.raw_unit) == ("m/s^2", "deg/s")
    p = {k: np.array(v) for k, v in json.loads(file.read_text()).items() if isinstance(v, list)}
    acc = (READINGS - p["b_a"]) @ (np.linalg.inv(p["R_a"]) @ np.linalg.inv(p["K_a"])).T
    np.testing.assert_allclose(READINGS @ back.accelerometer.S.T + back.accelerometer.b, acc, **ROUNDING)


def test_small_yaml_is_read_as_the_library_reads_it():
    text = """imu0:
  T_i_b:
  - [1.0, 0.0]
  - - 0.5
    - -1.0e-3
  model: scale-misalignment  # a comment
  rostopic: "/imu0"
  update_rate: 200.0
"""
    whole = yaml.safe_load(text)["imu0"]
    small = yaml_of(text)["imu0"]
    assert small["T_i_b"] == [v for r in whole["T_i_b"] for v in r]
    assert {k: small[k] for k in ("model", "rostopic", "update_rate")} == {
        k: whole[k] for k in ("model", "rostopic", "update_rate")
    }


def test_a_foreign_calibration_is_exported_to_another_program(tmp_path):
    known: Calibration = calibration("si")
    (tmp_path / "camera.json").write_text(export_files(known, "realsense")[""])
    made = trihedron.export(tmp_path / "camera.json", "python")[""]
    scope: dict = {}
    exec(made, scope)
    np.testing.assert_allclose(
        READINGS @ scope["S_ACCELEROMETER"].T + scope["B_ACCELEROMETER"], corrected(known.accelerometer), **ROUNDING
    )
