"""What is written for another program is read back as the same calibration, and files laid out by their makers too."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

import trihedron
from test_export import NOISE, READINGS, ROUNDING, calibration, corrected, with_g_sensitivity
from trihedron.cli import main
from trihedron.files.formats import any_calibration, export_files, formats, is_calibration

READ = [name for name, one in formats().items() if one.read is not None]
BOARDS = ("ardupilot", "px4")
GYRO_LOST = ("imu_calib",)


def angles(sensor):
    """What no choice of frame changes: SᵀS, and the reading that means zero."""
    return sensor.S.T @ sensor.S, np.linalg.solve(sensor.S, sensor.b)


@pytest.mark.parametrize("unit", ["si", "counts"])
@pytest.mark.parametrize("target", READ)
def test_a_calibration_is_read_back_from_the_file_of_another_program(target, unit, tmp_path):
    known = calibration(unit)
    if target in BOARDS:
        # Their equation has scales of the accelerometer and offsets.
        a, w = known.accelerometer, known.gyroscope
        known = replace(known, accelerometer=replace(a, S=np.diag(np.diag(a.S))), gyroscope=replace(w, S=np.eye(3)))
    if unit == "counts" and formats()[target].in_si:
        pytest.skip("takes readings in SI")
    if target in ("kalibr", "openvins", "imucal"):
        known, G = with_g_sensitivity(known)
    made = export_files(known, target, replace(NOISE, current_parameters="none"))
    for ending, text in made.items():
        (tmp_path / f"unit{ending}").write_text(text)
    path = tmp_path / f"unit{next(iter(made))}"
    assert is_calibration(path)
    back = any_calibration(path)
    assert back.extensions["maker"] == target
    pairs = [(known.accelerometer, back.accelerometer), (known.gyroscope, back.gyroscope)]
    for mine, read in pairs[: 1 if target in GYRO_LOST else 2]:
        assert read.raw_unit == mine.raw_unit
        # Residue of writing all digits and inverting matrices of condition 1.1, relative to the size of S.
        tolerance = {"rtol": 1e-9, "atol": 1e-12 * np.linalg.norm(mine.S)}
        for wanted, got in zip(angles(mine), angles(read), strict=True):
            np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())
        if target != "imu_tk":
            np.testing.assert_allclose(read.S, mine.S, **tolerance)
    # Both sensors are turned alike where the format has a frame of its own.
    if target not in (*GYRO_LOST, *BOARDS):
        relative = [np.linalg.solve(w.S, a.S) for a, w in ((s[0][0], s[1][0]) for s in [pairs])]
        read = np.linalg.solve(back.gyroscope.S, back.accelerometer.S)
        np.testing.assert_allclose(read, relative[0], rtol=1e-9, atol=1e-11)
    if "effects" in known.extensions:
        values = back.extensions["effects"][0]["model"]["values"]
        np.testing.assert_allclose(np.reshape(values, (3, 3)), G, atol=1e-14)
        log = trihedron.read({"t": np.arange(40) / 100, "acc": READINGS, "gyr": READINGS},
                             accelerometer_unit="m/s^2", gyroscope_unit="rad/s")  # fmt: skip
        if unit == "si":
            force = corrected(back.accelerometer)
            made = trihedron.apply(back, log).gyroscope
            wanted = corrected(back.gyroscope) - force @ np.reshape(values, (3, 3)).T
            np.testing.assert_allclose(made, wanted, **ROUNDING)


def test_results_of_kalibr_as_its_writer_dumps_them_with_a_second_imu_and_no_bias(tmp_path):
    """``kalibr_calibrate_imu_camera`` dumps a mapping of IMUs by PyYAML: block lists in block lists, words sorted."""
    known, G = with_g_sensitivity(calibration("si"))
    flat = yaml.safe_load(export_files(known, "kalibr", NOISE)[""])
    for sensor in ("accelerometers", "gyroscopes"):
        del flat[sensor]["b"]
    result = {"imu0": {"T_i_b": np.eye(4).tolist(), "time_offset": 0.0, **flat}}
    result["imu1"] = {**result["imu0"], "accelerometers": {"M": (2 * np.eye(3)).tolist()}}
    for style in (None, False):
        path = tmp_path / f"log-imu-{style}.yaml"
        path.write_text(yaml.dump(json.loads(json.dumps(result)), default_flow_style=style))
        back = any_calibration(path)
        np.testing.assert_allclose(back.accelerometer.S, known.accelerometer.S, atol=1e-12)
        np.testing.assert_allclose(back.gyroscope.S, known.gyroscope.S, atol=1e-12)
        values = back.extensions["effects"][0]["model"]["values"]
        np.testing.assert_allclose(np.reshape(values, (3, 3)), G, atol=1e-14)
        assert back.extensions["without_bias"] == ("accelerometer", "gyroscope")


def test_a_file_of_where_the_imu_sits_is_refused_with_what_it_lacks_and_a_yaml_in_braces_is_none(tmp_path):
    """Kalibr's camera chain holds pose and delay of the IMU, nothing of its readings."""
    chain = {"T_cam_imu": np.eye(4).tolist(), "camera_model": "pinhole", "timeshift_cam_imu": 0.0021}
    (tmp_path / "camchain-imucam.yaml").write_text(yaml.dump({"cam0": chain}))
    with pytest.raises(ValueError, match=r"(?s)Kalibr.*no scale, misalignment or bias"):
        any_calibration(tmp_path / "camchain-imucam.yaml")
    assert is_calibration(tmp_path / "camchain-imucam.yaml")
    known = yaml.safe_load(export_files(calibration("si"), "kalibr", NOISE)[""])
    (tmp_path / "imu.yaml").write_text(yaml.dump({"imu0": known}, default_flow_style=True))
    assert not is_calibration(tmp_path / "imu.yaml")


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


def test_the_result_of_imucal_on_a_recording_is_read(real_data):
    file = real_data / "imucal_ferraris" / "ferraris_result_imucal260.json"
    back = any_calibration(file)
    assert (back.accelerometer.raw_unit, back.gyroscope.raw_unit) == ("m/s^2", "deg/s")
    p = {k: np.array(v) for k, v in json.loads(file.read_text()).items() if isinstance(v, list)}
    acc = (READINGS - p["b_a"]) @ (np.linalg.inv(p["R_a"]) @ np.linalg.inv(p["K_a"])).T
    np.testing.assert_allclose(READINGS @ back.accelerometer.S.T + back.accelerometer.b, acc, **ROUNDING)


def test_the_list_of_targets_says_what_each_needs_and_files_out_of_order_are_refused(tmp_path, capsys):
    assert main(["export", "--to", "list"]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:])
    assert listed["kalibr*"] == "--noise --rate"
    assert listed["px4*"] == "--current-parameters"
    assert listed["c"] == "–"
    assert main(["export", "--to", "c"]) == 1
    assert "name a calibration file" in capsys.readouterr().err
    (tmp_path / "log.csv").write_text("t,ax,ay,az\n0,0,0,9.8\n")
    assert main(["apply", str(tmp_path / "log.csv"), "cal.json"]) == 1
    assert "it comes before the log" in capsys.readouterr().err
