"""What a flight controller must hold: its own equation, on readings before its correction, gives what `apply` gives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron
from small_session import rejected
from test_export import export_calibration, given
from trihedron.api.calibrating import of_board
from trihedron.cli import main
from trihedron.files.calibration import calibration_document, calibration_from_document, write_calibration
from trihedron.files.formats import ExportOptions
from trihedron.files.formats.autopilot import orientation, parameters_in
from trihedron.records import Onboard

AXES = "XYZ"
TCAL = {"INS_TCAL1_ENABLE": 1.0, "INS_TCAL1_TMIN": 10.0, "INS_TCAL1_TMAX": 60.0, "INS_ACC1_CALTEMP": 40.0,
        "INS_GYR1_CALTEMP": 40.0, "INS_TCAL1_ACC1_X": 900.0, "INS_TCAL1_ACC2_Y": -30.0, "INS_TCAL1_ACC3_Z": 0.7,
        "INS_TCAL1_GYR1_Z": 55.0}  # fmt: skip
ARDUPILOT = {f"INS_ACCOFFS_{a}": v for a, v in zip(AXES, (0.3, -0.2, 0.1), strict=True)}
ARDUPILOT |= {f"INS_ACCSCAL_{a}": v for a, v in zip(AXES, (1.01, 0.99, 1.02), strict=True)}
ARDUPILOT |= {f"INS_GYROFFS_{a}": v for a, v in zip(AXES, (0.01, 0.02, -0.03), strict=True)}
ARDUPILOT |= {"AHRS_ORIENTATION": 10.0, "INS_ACC_ID": 2753036.0}
PX4 = {"CAL_ACC0_ID": 1310988.0, "CAL_GYRO0_ID": 2490378.0, "SENS_BOARD_ROT": 2.0}
PX4 |= {f"CAL_ACC0_{a}OFF": 0.1 for a in AXES} | {f"CAL_ACC0_{a}SCALE": 1.02 for a in AXES}
PX4 |= {f"CAL_GYRO0_{a}OFF": -0.01 for a in AXES}
TC = {"TC_A_ENABLE": 1.0, "TC_A1_ID": 1310988.0, "TC_A1_TREF": 31.0, "TC_A1_TMIN": 12.0, "TC_A1_TMAX": 58.0,
      "TC_A1_X0_0": 0.05, "TC_A1_X1_1": 3e-3, "TC_A1_X2_2": 1e-4, "TC_A1_X3_0": 2e-6}  # fmt: skip


def turn(roll, pitch, yaw):
    """Sensor to board: yaw, pitch, roll, in the manner of both autopilots."""
    return Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True).as_matrix()


def ardupilot(p, raw_accel, raw_gyro, T, imu, R):
    """As AP_InertialSensor corrects: temperature, offset, scale, then the board's orientation."""
    suffix = "" if imu == 0 else str(imu + 1)

    def triple(name, default=0.0):
        return np.array([p.get(name.format(a), default) for a in AXES])

    def polynomial(letters, t):
        c = [1e-6 * triple(f"INS_TCAL{imu + 1}_{letters}{k}_{{}}") for k in (1, 2, 3)]
        return (c[0] + (c[1] + c[2] * t) * t) * t

    out = []
    for letters, raw in (("ACC", raw_accel), ("GYR", raw_gyro)):
        v = raw.copy()
        if p.get(f"INS_TCAL{imu + 1}_ENABLE", 0) == 1:
            low, high = p[f"INS_TCAL{imu + 1}_TMIN"], p[f"INS_TCAL{imu + 1}_TMAX"]
            cal = np.clip(p[f"INS_{letters}{imu + 1}_CALTEMP"], low, high)
            t = np.clip(T, low, high)[:, None]
            v = v - polynomial(letters, t - 35.0) + polynomial(letters, cal - 35.0)
        v = v - triple(f"INS_{letters}{suffix}OFFS_{{}}")
        if letters == "ACC":
            v = v * triple(f"INS_ACC{suffix}SCAL_{{}}", 1.0)
        out.append(v @ R.T)
    return out


def px4(p, raw_accel, raw_gyro, T, accel, gyro, R):
    """As PX4's sensor library corrects: thermal offset, offset, scale, then the rotation of the board."""
    out = []
    for word, letter, k, raw in (("ACC", "A", accel, raw_accel), ("GYRO", "G", gyro, raw_gyro)):
        v = raw.copy()
        if p.get(f"TC_{letter}_ENABLE", 0) == 1:
            group = next(i for i in range(4) if p.get(f"TC_{letter}{i}_ID") == p[f"CAL_{word}{k}_ID"])
            low, high = p[f"TC_{letter}{group}_TMIN"], p[f"TC_{letter}{group}_TMAX"]
            t = (np.clip(T, low, high) - p[f"TC_{letter}{group}_TREF"])[:, None]
            for n in range(4):
                v = v - t**n * [p.get(f"TC_{letter}{group}_X{n}_{axis}", 0.0) for axis in range(3)]
        v = v - [p[f"CAL_{word}{k}_{a}OFF"] for a in AXES]
        v = v * [p.get(f"CAL_{word}{k}_{a}SCALE", 1.0) for a in AXES]
        out.append(v @ R.T)
    return out


def diagonal_in(R, recording, gyro_scale=(1.0, 1.0, 1.0)):
    """A calibration of a log that scales and shifts the axes of the sensor: what an autopilot can hold of one."""
    pairs = (
        (np.array([1.012, 0.991, 1.004]), np.array([0.21, -0.13, 0.34])),
        (np.array(gyro_scale), np.array([0.011, -0.007, 0.02])),
    )
    return of_board(given(*((R @ np.diag(s) @ R.T, R @ b) for s, b in pairs)), recording)


def assert_alike(made, applied, atol=1e-9):
    """Numbers are written with all digits; the difference is the order of operations on values below 100."""
    np.testing.assert_allclose(made[0], applied.accelerometer, rtol=0.0, atol=atol)
    np.testing.assert_allclose(made[1], applied.gyroscope, rtol=0.0, atol=1e-9)


def corrected(autopilot, p, raw, T, R):
    """Of the first sensors, as the autopilot does with these parameters."""
    return ardupilot(p, *raw, T, 0, R) if autopilot == "ardupilot" else px4(p, *raw, T, 0, 0, R)


@pytest.mark.parametrize("imu", [0, 1, 2])
def test_ardupilot_parameters_on_the_raw_readings_of_a_flight_are_what_apply_gives(real_data, imu):
    pytest.importorskip("pymavlink")
    recording = trihedron.read(real_data / "formats" / "ardupilot_log171.bin", instance=imu)
    assert (recording.onboard.stage, recording.onboard.accel) == ("body", imu)
    # The log's readings as the sensor gave them, by the equation of the board solved for them.
    p, suffix, R = recording.onboard.parameters, "" if imu == 0 else str(imu + 1), turn(0, 180, 0)
    raw_accel = (recording.accelerometer @ R) / [p[f"INS_ACC{suffix}SCAL_{a}"] for a in AXES]
    raw_accel = raw_accel + [p[f"INS_ACC{suffix}OFFS_{a}"] for a in AXES]
    raw_gyro = recording.gyroscope @ R + [p[f"INS_GYR{suffix}OFFS_{a}"] for a in AXES]
    # Through its file, as a person's calibration goes.
    known = calibration_from_document(calibration_document(diagonal_in(R, recording)))
    parameters = parameters_in(export_calibration(known, "ardupilot"))
    made = ardupilot(parameters, raw_accel, raw_gyro, recording.temperature_degc, imu, R)
    assert_alike(made, trihedron.apply(known, recording))


def test_px4_parameters_on_the_raw_readings_of_a_flight_are_what_apply_gives(real_data):
    pytest.importorskip("pyulog")
    recording = trihedron.read(real_data / "formats" / "sample.ulg")
    p = recording.onboard.parameters
    # This board is levelled by 1.5 and 1.2 degrees behind the correction.
    R = turn(*(p[f"SENS_BOARD_{a}_OFF"] for a in AXES))
    raw_accel = (recording.accelerometer @ R) / [p[f"CAL_ACC0_{a}SCALE"] for a in AXES]
    raw_accel = raw_accel + [p[f"CAL_ACC0_{a}OFF"] for a in AXES]
    raw_gyro = recording.gyroscope @ R + [p[f"CAL_GYRO0_{a}OFF"] for a in AXES]
    # Firmware of that age holds gyro scales, and the log says so.
    known = diagonal_in(R, recording, gyro_scale=(0.99, 1.02, 1.005))
    parameters = parameters_in(export_calibration(known, "px4"))
    assert parameters["CAL_ACC0_ID"] == 1245450
    assert parameters["CAL_GYRO0_ID"] == 2162688
    assert_alike(px4(parameters, raw_accel, raw_gyro, None, 0, 0, R), trihedron.apply(known, recording))


def log_of(autopilot, parameters, stage="body"):
    """A log with temperature that a board with these parameters might have written."""
    rng = np.random.default_rng(11)
    n = 400
    t = np.arange(n) / 100.0
    recording = trihedron.read({"t": t, "acc": rng.normal(0, 5, (n, 3)), "gyr": rng.normal(0, 1, (n, 3))},
                               accelerometer_unit="m/s^2", gyroscope_unit="rad/s")  # fmt: skip
    onboard = Onboard(autopilot, 0, 0, stage, parameters)
    return replace(recording, temperature_degc=np.linspace(15.0, 55.0, n), onboard=onboard)


@pytest.mark.parametrize(
    ("autopilot", "p", "R"),
    [
        ("ardupilot", ARDUPILOT, turn(180, 0, 90)),
        ("ardupilot", ARDUPILOT | TCAL, turn(180, 0, 90)),
        ("px4", PX4, turn(0, 0, 90)),
        ("px4", PX4 | TC, turn(0, 0, 90)),
    ],
)
def test_temperature_terms_are_added_to_those_that_the_board_holds_already(autopilot, p, R):
    rng = np.random.default_rng(3)
    recording = log_of(autopilot, p)
    T = recording.temperature_degc
    raw = rng.normal(0, 6, (len(T), 3)), rng.normal(0, 1, (len(T), 3))
    logged = corrected(autopilot, p, raw, T, R)
    recording = replace(recording, accelerometer=logged[0], gyroscope=logged[1])
    # Biases quadratic in temperature, as a diagnosis finds them: v an axis, in SI, counted from a reference.
    effects = []
    for sensor, size in (("accel", 4e-3), ("gyro", 2e-4)):
        values = [size * v for v in (1.0, -0.6, 0.3, 0.01, 0.02, -0.015)]
        names = [f"{symbol}_{a}" for symbol in ("bias_per_kelvin", "bias_per_kelvin2") for a in "xyz"]
        effects.append({
            "id": f"{sensor}-thermal-bias",
            "parameters": [{"name": name, "value": value} for name, value in zip(names, values, strict=True)],
            "model": {"variant": "quadratic", "values": values},
        })  # fmt: skip
    at = {"references": {"temperature_degc": 28.0}, "valid_range": {"temperature_degc": [15.0, 55.0]}}
    known = diagonal_in(R, recording)
    known = replace(known, extensions={**known.extensions, "effects": effects, **at})
    parameters = parameters_in(export_calibration(known, autopilot))
    assert autopilot == "px4" or parameters["INS_ACC_ID"] == 2753036
    assert_alike(corrected(autopilot, p | parameters, raw, T, R), trihedron.apply(known, recording))


def by_temperature(known):
    """A calibration of several recordings `--by temperature`: bias and scale of the accelerometer's axes follow it."""
    terms = [
        {"id": "accel-bias", "coefficients": [[0.0, 0.0, 0.0], [2e-3, -1e-3, 5e-4], [1e-5, 2e-5, -1e-5]]},
        {"id": "gyro-bias", "coefficients": [[0.0, 0.0, 0.0], [1e-4, -2e-4, 5e-5]]},
    ]
    thermal = {"reference_degc": 25.0, "axis_signs": [1.0, 1.0, 1.0], "triad": np.eye(3).tolist(), "terms": terms}
    extensions = {**known.extensions, "thermal": thermal, "valid_range": {"temperature_degc": [5.0, 45.0]}}
    return replace(known, extensions=extensions, frame="lower")


@pytest.mark.parametrize("target", ["ardupilot", "px4"])
def test_polynomials_of_several_recordings_go_where_the_autopilot_has_places(target):
    recording = replace(log_of(target, {}, "raw"), temperature_degc=np.linspace(5.0, 45.0, 400))
    known = by_temperature(diagonal_in(np.eye(3), recording))
    p = parameters_in(export_calibration(known, target, ExportOptions(current_parameters="none")))
    if target == "px4":
        p |= {"CAL_ACC0_ID": 1, "CAL_GYRO0_ID": 2, "TC_A0_ID": 1, "TC_G0_ID": 2}
    raw = recording.accelerometer, recording.gyroscope
    made = corrected(target, p, raw, recording.temperature_degc, np.eye(3))
    # `apply` follows the polynomials linearly between 257 temperatures.
    assert_alike(made, trihedron.apply(known, recording), atol=3e-6)


def test_a_log_that_does_not_say_makes_the_export_ask_for_the_parameters(tmp_path, capsys):
    file = tmp_path / "unit.json"
    write_calibration(given(*[(1.01 * np.eye(3), np.full(3, 0.1))] * 2), file)
    assert "--current-parameters" in rejected(capsys, "export", file, "--to", "ardupilot")
    lines = [f"INS_ACCOFFS_{a} {0.5}" for a in AXES] + [f"INS_ACCSCAL_{a} {1.02}" for a in AXES]
    (tmp_path / "board.param").write_text("\n".join([*lines, "AHRS_ORIENTATION,0", ""]))
    ask = ["export", str(file), "--to", "ardupilot", "--current-parameters"]
    assert main([*ask, str(tmp_path / "board.param")]) == 0
    composed = parameters_in(capsys.readouterr().out)
    # truth = 1.01 * 1.02 (r - 0.5) + 0.1
    assert composed["INS_ACCSCAL_X"] == pytest.approx(1.01 * 1.02, abs=1e-12)
    assert composed["INS_ACCOFFS_Y"] == pytest.approx(0.5 - 0.1 / (1.01 * 1.02), abs=1e-12)
    assert main([*ask, "none"]) == 0
    assert parameters_in(capsys.readouterr().out)["INS_ACCOFFS_Y"] == pytest.approx(-0.1 / 1.01, abs=1e-12)
    assert main([*ask, str(tmp_path / "absent.param")]) == 1


def test_parameters_that_changed_in_flight_or_of_another_autopilot_and_a_mirrored_axis_are_refused():
    recording = log_of("ardupilot", {"INS_ACCOFFS_X": 0.1})
    with pytest.raises(ValueError, match="another autopilot"):
        export_calibration(diagonal_in(np.eye(3), recording), "px4")
    moved = replace(recording, onboard=replace(recording.onboard, changed=("INS_GYROFFS_X",)))
    with pytest.raises(ValueError, match="INS_GYROFFS_X changed"):
        export_calibration(diagonal_in(np.eye(3), moved), "ardupilot")
    known = diagonal_in(np.eye(3), log_of("px4", {}, "raw"))
    mirrored = replace(known, accelerometer=replace(known.accelerometer, S=np.diag([1.0, -1.0, 1.0])))
    with pytest.raises(ValueError, match="mirrored"):
        export_calibration(mirrored, "px4")


def test_orientations_are_those_of_mavlink():
    dialect = pytest.importorskip("pymavlink.dialects.v20.common")
    for number, entry in dialect.enums["MAV_SENSOR_ORIENTATION"].items():
        words = entry.name.removeprefix("MAV_SENSOR_ROTATION_").split("_")
        if number > 40:
            continue
        angles = dict(zip(words[::2], words[1::2], strict=False)) if "NONE" not in words else {}
        wanted = turn(*(float(angles.get(k, 0)) for k in ("ROLL", "PITCH", "YAW")))
        np.testing.assert_allclose(orientation(number), wanted, atol=1e-12)
    with pytest.raises(ValueError, match="orientation"):
        orientation(100)


@pytest.mark.parametrize("exact", [True, False])
def test_settings_of_inav_on_raw_counts_are_what_apply_gives(exact):
    counts = 9.80665 / 2048, np.radians(1 / 16.4)
    zero, gain = np.array([33.0, 68.0, -9.0]), np.array([4349.0, 4204.0, 4083.0]) / 4096
    if not exact:
        zero, gain = zero + 0.3, gain + 1e-4
    S_a, S_g = np.diag(gain) * counts[0], np.eye(3) * counts[1]
    known = given((S_a, -S_a @ zero), (S_g, -S_g @ [9.0, -11.0, -4.0]), 9.80665, "counts")
    sizes = ExportOptions(accel_lsb=f"{1000 / 2048!r} mg", gyro_lsb=f"{1 / 16.4!r} deg/s")
    text = export_calibration(known, "inav", sizes)
    assert "Readings in: counts. Corrected in: counts." in text
    raw = np.random.default_rng(2).integers(-3000, 3000, (50, 3)).astype(float)
    # As INAV's acceleration.c and gyro.c correct, but for their rounding of the result.
    p = {w[1]: float(w[3]) for w in (line.split() for line in text.splitlines()) if w[:1] == ["set"] and w[3] != "OFF"}
    zeros, gains, rates = ([p[f"{word}_{a}"] for a in "xyz"] for word in ("acczero", "accgain", "gyro_zero"))
    made = (raw - zeros) * gains / 4096 * counts[0], (raw - rates) * counts[1]
    # Half a count of zero and half a 4096th of gain, where the settings cannot say it whole.
    bound = 1e-9 if exact else counts[0] * (0.51 * 1.07 + 3100 / 8192)
    np.testing.assert_allclose(made[0], raw @ S_a.T + known.accelerometer.b, rtol=0, atol=bound)
    np.testing.assert_allclose(made[1], raw @ S_g.T + known.gyroscope.b, rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="--accel-lsb"):
        export_calibration(known, "inav")
    si = replace(known, accelerometer=replace(known.accelerometer, S=np.eye(3), raw_unit="m/s^2"))
    with pytest.raises(ValueError, match="debug_mode = ACC"):
        export_calibration(si, "inav")
