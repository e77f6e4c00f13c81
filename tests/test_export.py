"""Every export, evaluated by the target's own equation, gives what the calibration gives."""

import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
import yaml

from small_session import rejected
from trihedron.cli import main
from trihedron.files.calibration import write_calibration
from trihedron.files.formats import ExportOptions, NoiseFigure, SensorNoise, export_files, targets
from trihedron.files.formats.imu_tk import upper_frame
from trihedron.records import Calibration, Finding, SensorCalibration, Severity
from trihedron.sensor_model import in_frame

READINGS = np.random.default_rng(5).normal(size=(40, 3)) * 8.0
# Residue of writing numbers with all digits and evaluating in another order.
ROUNDING = {"rtol": 1e-10, "atol": 1e-10}
NOISE = ExportOptions(
    SensorNoise(NoiseFigure(2e-3), NoiseFigure(4e-5, is_limit=True)),
    SensorNoise(NoiseFigure(1e-4), NoiseFigure(2e-6)),
    rate_hz=200.0,
    topic="/imu",
    current_parameters="none",
)
IN_LSB = replace(NOISE, accel_lsb="0.488 mg", gyro_lsb="0.061 deg/s")
FOUR = [f"{sensor}_{kind}" for sensor in ("accelerometer", "gyroscope") for kind in ("noise_density", "random_walk")]


def export_calibration(known, target, options=None):
    return "\n".join(export_files(known, target, options).values())


def given(accelerometer, gyroscope, gravity=9.81, raw_unit=None, frame="case"):
    """A calibration of two pairs (S, b), of readings in SI unless a unit is said."""
    sensors = [
        SensorCalibration(S, b, np.zeros((12, 12)), raw_unit or unit, unit, "given")
        for (S, b), unit in ((accelerometer, "m/s^2"), (gyroscope, "rad/s"))
    ]
    return Calibration(*sensors, np.zeros((24, 24)), frame, gravity, "given", "log.csv", "")


def calibration(unit="si", handed=1.0):
    """Both sensors, lower frame, with a gyro that is neither triangular nor aligned."""
    scale = 1.0 if unit == "si" else 1e-3
    S_f = scale * np.array([[1.01 * handed, 0, 0], [0.004, 0.99, 0], [-0.006, 0.003, 1.02]])
    S_w = scale * np.array([[1.02 * handed, 0.01, -0.02], [-0.015, 0.98, 0.005], [0.01, -0.02, 1.01]])
    pairs = (S_f, np.array([0.3, -0.2, 0.1])), (S_w, np.array([0.01, -0.02, 0.03]))
    return given(*pairs, raw_unit=None if unit == "si" else "counts", frame="lower")


def corrected(sensor):
    return READINGS @ sensor.S.T + sensor.b


def numbers(text):
    return [float(word) for word in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", text)]


def printed(program, readings):
    """Numbers (n, m) that a program prints of readings (n, 3) on its input."""
    rows = "\n".join(" ".join(repr(float(v)) for v in row) for row in readings)
    done = subprocess.run([program], input=rows, capture_output=True, text=True, check=True)
    return np.array([numbers(line) for line in done.stdout.splitlines()])


@pytest.mark.parametrize(("handed", "frame"), [(1.0, "lower"), (-1.0, "lower"), (1.0, "symmetric")])
def test_python_snippet_runs_and_agrees(handed, frame):
    known = in_frame(calibration("counts", handed), frame)
    scope = {}
    exec(export_calibration(known, "python"), scope)
    for name, sensor in (("ACCELEROMETER", known.accelerometer), ("GYROSCOPE", known.gyroscope)):
        made = scope["correct"](READINGS, scope[f"S_{name}"], scope[f"B_{name}"])
        np.testing.assert_allclose(made, corrected(sensor))


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler on this machine")
@pytest.mark.parametrize(
    ("suffix", "real", "tolerance"), [("", "double", ROUNDING), ("_f", "float", {"rtol": 0, "atol": 1e-5})]
)
def test_c_header_compiles_without_warnings_and_agrees(tmp_path, suffix, real, tolerance):
    known = calibration("counts")
    main_c = f"""
    #include <stdio.h>
    #include "calibration.h"
    #include "calibration.h"
    int main(void) {{
        double in[3]; {real} r[3], f[3], w[3]; int i;
        while (scanf("%lf %lf %lf", in, in + 1, in + 2) == 3) {{
            for (i = 0; i < 3; ++i) r[i] = ({real})in[i];
            trihedron_correct{suffix}(&trihedron_accelerometer{suffix}, r, f);
            trihedron_correct{suffix}(&trihedron_gyroscope{suffix}, r, w);
            printf("%.17g %.17g %.17g %.17g %.17g %.17g\\n", f[0], f[1], f[2], w[0], w[1], w[2]);
        }}
        return 0;
    }}
    """
    (tmp_path / "calibration.h").write_text(export_calibration(known, "c"))
    source = tmp_path / "main.c"
    source.write_text(main_c)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run(["cc", *flags, str(source), "-o", str(tmp_path / "main")], check=True, capture_output=True)
    out = printed(tmp_path / "main", READINGS)
    # Single precision: 6e-8 of numbers below 30, a few of them summed.
    np.testing.assert_allclose(out[:, :3], corrected(known.accelerometer), **tolerance)
    np.testing.assert_allclose(out[:, 3:], corrected(known.gyroscope), **tolerance)


@pytest.mark.skipif(shutil.which("rustc") is None, reason="no Rust compiler on this machine")
def test_rust_module_compiles_without_warnings_and_agrees(tmp_path):
    known = calibration("counts")
    (tmp_path / "calibration.rs").write_text(export_calibration(known, "rust"))
    (tmp_path / "bare.rs").write_text("#![no_std]\n#![deny(warnings)]\npub mod calibration;\n")
    (tmp_path / "main.rs").write_text(
        """#![deny(warnings)]
        mod calibration;
        fn main() {
            for line in std::io::stdin().lines() {
                let v: Vec<f64> = line.unwrap().split_whitespace().map(|w| w.parse().unwrap()).collect();
                let raw = [v[0], v[1], v[2]];
                println!("{:?} {:?}", calibration::ACCELEROMETER.correct(raw), calibration::GYROSCOPE.correct(raw));
            }
        }"""
    )
    build = ["rustc", "--edition", "2021", "--out-dir", str(tmp_path)]
    subprocess.run([*build, "--crate-type", "lib", str(tmp_path / "bare.rs")], check=True, capture_output=True)
    subprocess.run([*build, str(tmp_path / "main.rs")], check=True, capture_output=True)
    out = printed(tmp_path / "main", READINGS[:5])
    np.testing.assert_allclose(out[:, :3], corrected(known.accelerometer)[:5], **ROUNDING)
    np.testing.assert_allclose(out[:, 3:], corrected(known.gyroscope)[:5], **ROUNDING)


def with_g_sensitivity(known):
    G = 1e-3 * np.array([[1.0, -2.0, 0.5], [0.3, 0.7, -1.1], [2.0, 0.0, -0.4]])
    parameters = [{"name": f"G_{i}{j}", "value": G[a, b]} for a, i in enumerate("xyz") for b, j in enumerate("xyz")]
    effects = [{"id": "gyro-g-sensitivity", "parameters": parameters}]
    return replace(known, extensions={"effects": effects}), G


@pytest.mark.parametrize("mirrored", ["none", "both", "gyro", "swapped"])
def test_kalibr_distorts_truth_into_the_readings(mirrored):
    """a_m = M a + b; w_m = M C_gyro_i w + A C_gyro_i a + b, M lower triangular, C a proper rotation always."""
    known = calibration("si", -1.0 if mirrored == "both" else 1.0)
    if mirrored in ("gyro", "swapped"):
        turn = np.diag([1.0, -1.0, 1.0]) if mirrored == "gyro" else np.eye(3)[[1, 0, 2]]
        known = replace(known, gyroscope=replace(known.gyroscope, S=known.gyroscope.S @ turn))
    known, G = with_g_sensitivity(known)
    document = yaml.safe_load(export_calibration(known, "kalibr", NOISE))
    assert {*FOUR, "update_rate", "rostopic"} <= set(document)
    M_a, b_a = np.array(document["accelerometers"]["M"]), np.array(document["accelerometers"]["b"])
    gyro = {key: np.array(value) for key, value in document["gyroscopes"].items()}
    np.testing.assert_array_equal(M_a, np.tril(M_a))
    np.testing.assert_array_equal(gyro["M"], np.tril(gyro["M"]))
    np.testing.assert_allclose(gyro["C_gyro_i"] @ gyro["C_gyro_i"].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(gyro["C_gyro_i"]) > 0.999
    force, rate = corrected(known.accelerometer), corrected(known.gyroscope)
    np.testing.assert_allclose(force @ M_a.T + b_a, READINGS, **ROUNDING)
    C = gyro["C_gyro_i"]
    measured = rate @ (gyro["M"] @ C).T + force @ (gyro["A"] @ C).T + gyro["b"]
    # The gyro that follows specific force reads S⁻¹ (ω + G f - b).
    np.testing.assert_allclose(measured, READINGS + force @ (np.linalg.inv(known.gyroscope.S) @ G).T, **ROUNDING)


def test_a_symmetric_frame_is_turned_before_a_triangular_convention_is_written():
    known = calibration("si")
    turned = in_frame(known, "symmetric")
    np.testing.assert_allclose(turned.accelerometer.S, turned.accelerometer.S.T, **ROUNDING)
    M = yaml.safe_load(export_calibration(turned, "kalibr", NOISE))["accelerometers"]["M"]
    np.testing.assert_allclose(M, np.linalg.inv(known.accelerometer.S), **ROUNDING)


def test_openvins_corrects_the_readings():
    """a = R_ACCtoIMU Da (a_m - b), ω = R_GYROtoIMU Dw (w_m - b - Tg a), with Da = Ta⁻¹, Dw = Tw⁻¹."""
    known, G = with_g_sensitivity(calibration("si"))
    text = export_calibration(known, "openvins", NOISE)
    # OpenCV takes a comment behind a value for a sequence.
    assert not [line for line in text.splitlines() if "#" in line and not line.strip().startswith("#")]
    imu = yaml.safe_load(text.replace("%YAML:1.0", ""))["imu0"]
    assert {*FOUR, "update_rate", "rostopic"} <= set(imu)
    Tw, R, Ta, Tg = (np.array(imu[key]) for key in ("Tw", "R_IMUtoGYRO", "Ta", "Tg"))
    b_a, b_w = (numbers(re.search(rf"#   {name} \[(.*)\]", text)[1]) for name in ("accelerometer", "gyroscope"))
    force = corrected(known.accelerometer)
    np.testing.assert_allclose((READINGS - b_a) @ np.linalg.inv(Ta).T, force, **ROUNDING)
    readings = READINGS + force @ (np.linalg.inv(known.gyroscope.S) @ G).T
    rate = (readings - b_w - force @ Tg.T) @ (R.T @ np.linalg.inv(Tw)).T
    np.testing.assert_allclose(rate, corrected(known.gyroscope), **ROUNDING)


@pytest.mark.parametrize(("target", "keys"), [("kalibr", FOUR), ("vins-fusion", ("acc_n", "acc_w", "gyr_n", "gyr_w"))])
def test_noise_goes_into_the_file_and_an_absent_walk_as_a_limit_that_is_labelled(target, keys):
    text = export_calibration(calibration("si"), target, NOISE)
    document = yaml.safe_load(text.replace("%YAML:1.0", ""))
    assert [document[key] for key in keys] == ([2e-3, 4e-5, 1e-4, 2e-6])
    before = text.splitlines()[next(i for i, line in enumerate(text.splitlines()) if line.startswith(keys[1])) - 1]
    assert "upper limit" in before
    assert text.count("upper limit") == 1


def test_ros_covariances_are_those_of_one_message():
    document = yaml.safe_load(export_calibration(calibration("si"), "ros", NOISE))
    np.testing.assert_allclose(np.reshape(document["linear_acceleration_covariance"], (3, 3)), np.eye(3) * 4e-6 * 200)
    np.testing.assert_allclose(np.reshape(document["angular_velocity_covariance"], (3, 3)), np.eye(3) * 1e-8 * 200)
    assert document["orientation_covariance"][0] == -1.0


@pytest.mark.parametrize("target", ["px4", "ardupilot"])
def test_what_an_autopilot_cannot_hold_is_written_into_the_file_with_its_size(target):
    text = export_calibration(calibration("si"), target, ExportOptions(current_parameters="none"))
    # Half of 0.006, the angle between X and Z, at 9.81 m/s²: the other half is a turn of the triad as a whole.
    assert re.search(r"% of the accelerometer's is lost, 2\d(\.\d)? mm/s\^2 at 1 g", text)
    assert "gyro scale" in text


@pytest.mark.parametrize("target", sorted(set(targets()) - {"c", "rust", "python"}))
def test_of_an_instrument_that_is_right_within_its_uncertainty_no_target_loses_anything(target):
    """0.3 % and 0.03 m/s² with standard errors of 1 % and 0.1 m/s²: nothing is known to be lost."""
    known = calibration("si")
    covariance = np.diag(np.r_[np.full(9, 1e-2**2), np.full(3, 0.1**2)])
    sensors = [
        replace(s, S=np.eye(3) + 0.003, b=np.full(3, 0.03), covariance=covariance)
        for s in (known.accelerometer, known.gyroscope)
    ]
    known = replace(known, accelerometer=sensors[0], gyroscope=sensors[1])
    text = " ".join(export_files(known, target, IN_LSB).values())
    said = [line for line in text.splitlines() if re.search(r"\d.* (is|are) lost|lost: |are lost, ", line)]
    assert not [line for line in said if "walk" not in line]


@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_imu_tk_reads_its_numbers_from_the_first_character_on(handed):
    """x = T K (raw - B), in our frame turned by the rotation that the file states; one file a sensor."""
    known = calibration("counts", handed)
    rotation, _ = upper_frame(known)
    assert np.linalg.det(rotation) > 0
    files = export_files(known, "imu_tk")
    assert set(files) == {"_acc.calib", "_gyro.calib"}
    for ending, sensor in (("_acc.calib", known.accelerometer), ("_gyro.calib", known.gyroscope)):
        # As its reader does: 3 x 3, 3 x 3 and 3 x 1 numbers, white space between, nothing else before the last.
        words = files[ending].split()[:21]
        values = np.array([float(word) for word in words])
        T, K, B = values[:9].reshape(3, 3), values[9:18].reshape(3, 3), values[18:]
        np.testing.assert_array_equal(np.diag(T), 1.0)
        if ending == "_acc.calib":
            np.testing.assert_array_equal(T, np.triu(T))
        np.testing.assert_allclose((READINGS - B) @ (T @ K).T, corrected(sensor) @ rotation.T, **ROUNDING)


def test_basalt_subtracts_the_zero_after_the_matrix_and_has_noise_and_rate():
    """(I + M) raw - b with M by columns, its lower triangle for the accelerometer."""
    known = calibration()
    document = json.loads(export_calibration(known, "basalt", NOISE))["value0"]
    a, w = np.array(document["calib_accel_bias"]), np.array(document["calib_gyro_bias"])
    M = np.array([[a[3], 0, 0], [a[4], a[6], 0], [a[5], a[7], a[8]]])
    np.testing.assert_allclose(READINGS @ (np.eye(3) + M).T - a[:3], corrected(known.accelerometer), **ROUNDING)
    M = w[3:].reshape(3, 3).T
    np.testing.assert_allclose(READINGS @ (np.eye(3) + M).T - w[:3], corrected(known.gyroscope), **ROUNDING)
    stated = [document[key] for key in ("imu_update_rate", "accel_noise_std", "gyro_bias_std")]
    assert stated == [200.0, [2e-3] * 3, [2e-6] * 3]


@pytest.mark.parametrize("target", ["basalt", "kalibr", "openvins", "px4", "ardupilot"])
def test_counts_are_refused_or_converted_by_the_size_of_a_count(target):
    known = calibration("counts")
    with pytest.raises(ValueError, match="--accel-lsb"):
        export_calibration(known, target, NOISE)
    options = replace(NOISE, accel_lsb="0.001 m/s^2", gyro_lsb="0.001 rad/s", current_parameters="none")
    # Counts of 1e-3 SI and S of 1e-3 SI per count are the calibration of SI readings.
    left, right = (numbers(export_calibration(k, target, o)) for k, o in ((known, options), (calibration(), options)))
    np.testing.assert_allclose(left, right, rtol=1e-6, atol=1e-12)


def test_xio_scales_the_difference_then_aligns_to_g_and_degrees():
    known = calibration("counts")
    text = export_calibration(known, "xio")
    assert "Readings in: counts, counts. Corrected in: g, deg/s." in text
    said = re.finditer(r"(\w+) = \{([^}]*)\};", text)
    parts = {m[1]: np.array(numbers(m[2])) for m in said}
    wanted = (("accelerometer", known.accelerometer, 1 / 9.80665), ("gyroscope", known.gyroscope, 180 / np.pi))
    for name, sensor, unit in wanted:
        M = parts[f"{name}Misalignment"].reshape(3, 3)
        s, b = parts[f"{name}Sensitivity"], parts[f"{name}Offset"]
        np.testing.assert_allclose((s * (READINGS - b)) @ M.T, unit * corrected(sensor), **ROUNDING)


def test_pyins_distorts_truth_into_the_readings():
    known = calibration("counts")
    scope = {}
    exec(export_calibration(known, "pyins"), scope)
    force = corrected(known.accelerometer)
    np.testing.assert_allclose(force @ scope["accel_transform"].T + scope["accel_bias"], READINGS, **ROUNDING)


@pytest.mark.parametrize("target", targets())
def test_every_export_says_when_the_calibration_is_not_to_be_trusted_or_has_no_gyro(target):
    known = calibration()
    assert export_calibration(replace(known, gyroscope=None, covariance=np.zeros((12, 12))), target, IN_LSB)
    serious = Finding("not-converged", Severity.SERIOUS, "it did not settle.")
    assert "NOT TO BE TRUSTED" in export_calibration(replace(known, findings=(serious,)), target, IN_LSB)


def test_the_command_writes_one_file_a_sensor_where_the_target_wants_it(tmp_path, capsys):
    file = tmp_path / "c.json"
    write_calibration(calibration("counts"), file)
    assert main(["export", str(file), "--to", "imu_tk", "-o", str(tmp_path / "unit.calib")]) == 0
    assert {p.name for p in tmp_path.glob("*.calib")} == {"unit_acc.calib", "unit_gyro.calib"}
    assert "unit_acc.calib" in rejected(capsys, "export", file, "--to", "imu_tk", "-o", tmp_path / "unit.calib")
    # Several that are called alike take the names of their folders.
    (tmp_path / "b").mkdir()
    other = tmp_path / "b" / "c.json"
    write_calibration(calibration("si"), other)
    assert main(["export", str(file), str(other), "--to", "c", "-o", str(tmp_path / "out")]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["b_c.c", f"{tmp_path.name}_c.c"]
    assert "names that differ" in rejected(capsys, "export", file, file, "--to", "c", "-o", tmp_path / "same")
    counted = ["export", str(file), "--to", "px4", "--accel-lsb", "0.1 mg", "--gyro-lsb"]
    assert main([*counted, "0.0573 deg/s"]) == 0
    assert "is lost" in capsys.readouterr().err
    assert main([*counted, "0.0305 deg/s"]) == 1, "a size of another range would scale what the file corrects"
    assert "0.531 times" in capsys.readouterr().err
