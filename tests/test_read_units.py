"""Column names, units and order by what names mean and readings can only be; a temperature."""

import math

import numpy as np
import pytest

import trihedron
from hand_made_sessions import motion
from test_read import HEADER, codes, finding, write
from trihedron.channel_facts.turning import turning_of
from trihedron.read import ReadError, read_recording
from trihedron.read.names import parse_name
from trihedron.records import Severity
from trihedron.units import RateUnit

RATE_HZ = 100.0
OTHERS = (
    "mx | qx | Roll | depth_m | angular_velocity_covariance_0 | orientation.x | gravity_x | gyro_integral_dt | ___ | "
    "yaw_rate_setpoint | yaw | time_offset | "
    "accel_bias_x | UTC_Nano | magnetometer_x | angular_acceleration_x | gps_velocity_x | маг_x"
)


def saved(path, time_s, force, rate, header=HEADER):
    return write(path, np.round(np.column_stack([time_s, force, rate]), 9), header)


@pytest.mark.parametrize(
    ("scale", "unit"), [(1.0, RateUnit.RAD_S), (180 / math.pi, RateUnit.DEG_S), (1000.0, RateUnit.MRAD_S)]
)
@pytest.mark.parametrize("turn_s", [0.7, 6.0])
def test_the_gyro_unit_is_told_by_turning_gravity(tmp_path, scale, unit, turn_s):
    time_s, force, rate = motion(RATE_HZ, 3, 6, turn_s)
    recording = read_recording(saved(tmp_path / "log.csv", time_s, force, rate * scale))
    assert recording.gyroscope_unit is unit
    assert "unit-assumed" not in codes(recording)


def test_the_gyro_unit_depends_on_no_order_of_axes_and_one_that_contradicts_gravity_is_serious(tmp_path):
    time_s, force, rate = motion(RATE_HZ, 3, 6, 1.0)
    turned = np.column_stack([-rate[:, 2], rate[:, 0], -rate[:, 1]])
    assert read_recording(saved(tmp_path / "log.csv", time_s, force, turned)).gyroscope_unit is RateUnit.RAD_S
    path = saved(tmp_path / "log.csv", time_s, force, rate, "t,ax,ay,az,gx_dps,gy_dps,gz_dps\n")
    recording = read_recording(path)
    # As the header says; but the contradiction is reported.
    assert recording.gyroscope_unit is RateUnit.DEG_S
    assert finding(recording, "unit-contradicted").severity is Severity.SERIOUS


@pytest.mark.parametrize("names", ["t,gx,gy,gz,ax,ay,az", "t [s],gx [rad/s],gy [rad/s],gz [rad/s],ax [m/s^2],ay,az"])
def test_a_header_that_exchanges_the_sensors_is_named_with_the_columns_to_give(tmp_path, names):
    time_s, force, rate = motion(RATE_HZ, 3, 6, 1.0)
    path = saved(tmp_path / "log.csv", time_s, force, rate, f"{names}\n")
    (found,) = [f for f in read_recording(path).findings if f.code == "sensors-exchanged"]
    assert found.severity is Severity.SERIOUS
    recording = read_recording(path, columns=found.action.split("--columns ")[1].rstrip("."))
    np.testing.assert_allclose(recording.accelerometer, force, atol=1e-5)
    assert "sensors-exchanged" not in {f.code for f in recording.findings}


def test_a_still_log_leaves_the_gyro_unit_a_guess_and_one_without_gravity_is_serious(tmp_path):
    time_s, force, rate = (part[:200] for part in motion(RATE_HZ, 3, 1, 1.0))
    recording = read_recording(saved(tmp_path / "log.csv", time_s, force, rate))
    assert finding(recording, "unit-assumed").severity is Severity.WARNING
    noise = 0.02 * np.random.default_rng(5).standard_normal((len(time_s), 3))
    recording = read_recording(saved(tmp_path / "log.csv", time_s, noise, rate))
    assert finding(recording, "gravity-missing").severity is Severity.SERIOUS
    user = HEADER.replace("ax", "user_acc_x (g)").replace("ay", "user_acc_y (g)").replace("az", "user_acc_z (g)")
    time_s, _, rate = motion(RATE_HZ, 3, 6)
    noise = 0.02 * np.random.default_rng(5).standard_normal((len(time_s), 3))
    recording = read_recording(saved(tmp_path / "user.csv", time_s, noise, rate, user))
    assert finding(recording, "gravity-missing").severity is Severity.SERIOUS
    assert not {"stuck-values", "unit-contradicted"} & {*codes(recording)}


@pytest.mark.parametrize(
    ("per_rad_s", "unit"),
    [
        (1.0, RateUnit.RAD_S),
        (180 / math.pi, RateUnit.DEG_S),
        (1e3, RateUnit.MRAD_S),
        (180e3 / math.pi, RateUnit.MDEG_S),
    ],
)
def test_a_guessed_gyro_unit_leaves_its_bias_and_its_fastest_turn_those_of_a_gyro(tmp_path, per_rad_s, unit):
    time_s, force, rate = (part[:200].copy() for part in motion(RATE_HZ, 3, 1, 1.0))
    # A bias of 0.7 °/s and turns of 1000 °/s; a knock gives no rotation of gravity that would tell the unit.
    rate += np.radians(0.7)
    rate[150:] += np.radians(1000.0)
    recording = read_recording(saved(tmp_path / "log.csv", time_s, force, rate * per_rad_s))
    assert recording.gyroscope_unit is unit
    assert finding(recording, "unit-assumed").severity is Severity.WARNING


@pytest.mark.parametrize("gyro_first", [False, True])
@pytest.mark.parametrize("n_poses", [1, 6])
def test_six_columns_without_names_are_put_in_order_by_gravity(tmp_path, gyro_first, n_poses):
    _, force, rate = motion(RATE_HZ, 3, n_poses, 1.0)
    pair = [rate, force] if gyro_first else [force, rate]
    recording = read_recording(write(tmp_path / "log.txt", np.column_stack(pair), "", separator=" "), rate_hz=RATE_HZ)
    np.testing.assert_array_equal(recording.accelerometer, force)
    np.testing.assert_array_equal(recording.gyroscope, rate)
    severity = Severity.WARNING if gyro_first else Severity.NOTE
    assert finding(recording, "columns-assumed").severity is severity


def test_columns_without_names_are_told_by_gravity_and_its_turning_and_the_mapping_stated_reads_the_same(tmp_path):
    time_s, force, rate = motion(RATE_HZ, 3, 6)
    other = np.random.default_rng(6).standard_normal((len(time_s), 4))
    ns = np.rint(1e9 * time_s).astype(np.int64)
    seconds = np.column_stack([1709294400 + ns // 10**9, ns % 10**9])
    table = np.column_stack([seconds, np.full(len(time_s), 3), other[:, :2], rate, other[:, 2:], force])
    path = write(tmp_path / "log.txt", table, "", separator=" ")
    guessed = read_recording(path)
    said = finding(guessed, "columns-assumed")
    assert said.severity is Severity.WARNING
    mapping = "time=1,ax=11,ay=12,az=13,gx=6,gy=7,gz=8"
    assert mapping in str(said)
    for recording in (guessed, read_recording(path, columns=mapping)):
        np.testing.assert_array_equal(recording.accelerometer, force)
        np.testing.assert_array_equal(recording.gyroscope, rate)
        # The last digit of a time since 1970 in double precision.
        np.testing.assert_allclose(recording.time_s, time_s, rtol=0.0, atol=1e-6)
    with pytest.raises(ReadError, match="13 columns without names could mean anything"):
        read_recording(write(tmp_path / "static.txt", table[:200], "", separator=" "))


@pytest.mark.parametrize("name", ["LSM6DSO {}", "BMI160 {} Non-wakeup", "K6DS3TR {} Sensor", "android.sensor.{}"])
def test_rows_in_turn_are_told_by_the_names_that_android_gives_to_parts(tmp_path, name):
    time_s, force, rate = motion(50.0, 3, 3)
    lines = ["timestamp,sensor,x,y,z"]
    for t, a, w in zip(np.rint(1e3 * time_s), force.tolist(), rate.tolist(), strict=True):
        for kind, values in (("Accelerometer", a), ("Gyroscope", w), ("Magnetometer", w)):
            lines.append(",".join([f"{t:.0f}", name.format(kind), *map(repr, values)]))
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    recording = read_recording(tmp_path / "log.csv")
    np.testing.assert_array_equal(recording.accelerometer, force)
    np.testing.assert_array_equal(recording.gyroscope, rate)


def test_instruments_side_by_side_are_chosen_by_the_path_before_a_colon(tmp_path):
    time_s, force, rate = motion(RATE_HZ, 3, 2)
    names = [f"IMU_ATTI({k}):{name}{x}" for k in (0, 1) for name in ("accel", "gyro") for x in "XYZ"]
    table = np.column_stack([time_s, force, rate, force + 0.1, rate + 0.1])
    path = write(tmp_path / "flight.csv", table, ",".join(["Clock:offsetTime", *names]) + "\n")
    np.testing.assert_array_equal(read_recording(path, instance="IMU_ATTI(1)").accelerometer, force + 0.1)
    assert "columns-assumed" in codes(read_recording(path))


def test_an_undecidable_order_is_said_to_be_a_guess(tmp_path):
    noise = np.random.default_rng(6).standard_normal((500, 6))
    recording = read_recording(write(tmp_path / "log.txt", noise, "", separator=" "), rate_hz=RATE_HZ)
    assert finding(recording, "columns-assumed").severity is Severity.SERIOUS


# Role, axis and unit → names; in other languages below, with letters that look like Latin ones, lost letters, and two
# code points for a micro.
MEANINGS = {
    ("accelerometer", "x", ""): "ax | acc_x | Acc_X | AccX | linear_acceleration.x | ACCEL_XOUT | AcX | уск_x | Уск_Х",
    ("accelerometer", "y", ""): "fy | accélération_y",
    ("accelerometer", "z", ""): "accel_z",
    ("accelerometer", "x", "counts"): "ax_adc",
    ("accelerometer", "x", "g"): "ax_g | accelerometerAccelerationX(G) | Beschl. X [g] | 加速度X(g) | X轴加速度（g）",
    ("accelerometer", "x", "mg"): "acc_x (mg)",
    ("accelerometer", "0", "m/s^2"): "accelerometer_m_s2[0]",
    ("accelerometer", "x", "m/s^2"): "Acceleration x (m/s^2) | Acel X (m/s²) | a x [meters per second squared]",
    ("accelerometer", "z", "m/s^2"): "a_RS_S_z [m s^-2]",
    ("gyroscope", "x", ""): "wx | gyro_x | gx_output | AngularVelocityX | GyX | girox | ωx",
    ("gyroscope", "y", ""): "Gyr_Y | vitesse_angulaire_y | prędkość kątowa Y",
    ("gyroscope", "z", ""): "gyr_z | IMU_YAW_VEL | gyro_yaw | field.angular_velocity.z | GYRO_ZOUT | угл_скорость_z",
    ("gyroscope", "z", "counts"): "wz_adc",
    ("gyroscope", "x", "deg/s"): "gx_dps | GyroX [deg/s] | gx [°/s] | AsX(°/s) | roll rate (deg/s)",
    ("gyroscope", "y", "deg/s"): "гироскоп_Y (град/с)",
    ("gyroscope", "z", "deg/s"): "Drehrate Z [°/s] | 角速度Z(°/s)",
    ("gyroscope", "2", "rad/s"): "gyro_rad[2]",
    ("gyroscope", "x", "rad/s"): "w_RS_S_x [rad s^-1] | gyroRotationX(rad/s) | omega x [rad s^-1]",
    ("gyroscope", "y", "rad/s"): "Gyroscope y (rad/s) | rotation_rate_y(radians/s) | wy radians per second",
    ("gyroscope", "z", "rad/s"): "Giro Z (rad/s)",
    ("gyroscope", "z", "mrad/s"): "gyro_z (mrad/s)",
    ("time", "", ""): "t | time | Clock:offsetTime | %time | время | temps | 时间",
    ("time", "", "s"): "X[s] | t_s | t_unix_s | Time (s) | seconds_elapsed",
    ("time", "", "ms"): "time_ms | millis | время, мс | Tempo (ms)",
    ("time", "", "us"): "utime | t [µs] | t [\u03bcs]",
    ("time", "", "ns"): "timestamp [ns] | Timestamp[nanosec]",
    ("time", "", "100us"): "SampleTimeFine",
    ("temperature", "", ""): "Temperature | imu_temperature | 温度(℃)",
    ("supply", "", ""): "vdd | Supply Voltage",
    ("counter", "", ""): "PacketCounter | n_samples | seq",
    ("bare", "x", ""): "x",
    ("bare", "z", ""): "Z (m/s^2)",
    ("", "x", ""): "угловое_ускорение_x | Winkelbeschleunigung x | 角度X(°) | скачок_x | \ufffd\ufffd\ufffd_x",
}
NAMES = [(name, meaning) for meaning, names in MEANINGS.items() for name in names.split(" | ")]


@pytest.mark.parametrize(("name", "meaning"), NAMES, ids=[name for name, _ in NAMES])
def test_a_column_is_recognised_with_its_role_axis_and_unit(name, meaning):
    parsed = parse_name(name)
    assert (parsed.role, parsed.axis, parsed.unit or parsed.time_unit) == meaning


@pytest.mark.parametrize("name", ["", *OTHERS.split(" | ")])
def test_what_is_neither_sensor_nor_time_is_not_taken_for_one(name):
    assert parse_name(name).role == ""


def test_raw_readings_rank_above_corrected_ones():
    assert parse_name("gx_measured").rank > parse_name("gx").rank > parse_name("gx_output").rank
    assert parse_name("motionUserAccelerationX(G)").rank < parse_name("accelerometerAccelerationX(G)").rank
    assert parse_name("Rotation_X").rank < parse_name("Gyroscope_X").rank
    assert parse_name("Tick#").rank < parse_name("Clock:offsetTime").rank


def log_of(tmp_path, header, change=lambda row: row):
    """A log of a static sensor under ``header``; ``change`` of the cells of a row."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal((300, 6))
    read = noise + np.array([0.1, 0.2, 9.8, 0.01, 0.02, -0.01])
    rows = [change([f"{0.01 * k:.2f}", *(f"{value:.5f}" for value in row)]) for k, row in enumerate(read)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([header, *(",".join(row) for row in rows)]))
    return log


def test_a_unit_in_the_name_of_one_axis_is_that_of_all_three(tmp_path):
    read = trihedron.read(log_of(tmp_path, "t [s],ax [m/s^2],ay,az,gx [deg/s],gy,gz"))
    assert (read.accelerometer_unit.value, read.gyroscope_unit.value) == ("m/s^2", "deg/s")
    read = trihedron.read(log_of(tmp_path, "t [s],ax,ay,az [m/s^2],gx,gy [deg/s],gz"))
    assert (read.accelerometer_unit.value, read.gyroscope_unit.value) == ("m/s^2", "deg/s")


def test_of_two_accelerometers_one_is_taken_and_the_columns_of_the_other_are_given(tmp_path):
    header = "t,accel_a_x,accel_a_y,accel_a_z,accel_b_x,accel_b_y,accel_b_z,gx,gy,gz"
    read = trihedron.read(log_of(tmp_path, header, lambda row: [*row[:4], *row[1:]]))
    (found,) = [f for f in read.findings if "More than one triad" in f.seen]
    assert "'accel_b_x' 'accel_b_y' 'accel_b_z' not used" in found.seen
    assert "time=1,ax=5,ay=6,az=7,gx=8,gy=9,gz=10" in found.action


def test_an_axis_without_numbers_is_named(tmp_path):
    named = "t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]"
    read = trihedron.read(log_of(tmp_path, named, lambda row: [*row[:2], "north", *row[3:]]))
    assert read.accelerometer is None
    words = next(one for one in read.findings if one.code == "column-left-out")
    assert "'ay [m/s^2]' contains no numbers (such as north), so the accelerometer" in words.seen
    assert words.severity is Severity.WARNING
    with pytest.raises(trihedron.InputError, match=r"column 'ay' of the accelerometer contains no numbers"):
        trihedron.read(log_of(tmp_path, "t,ax,ay,az", lambda row: [*row[:2], "north", row[3]]))


@pytest.mark.parametrize(("scale", "unit"), [(1.0 / 9.80665, "g"), (1000.0 / 9.80665, "mg"), (0.3, "counts")])
def test_a_contradicted_accelerometer_unit_is_answered_with_the_one_that_fits(tmp_path, scale, unit):
    time_s, force, rate = motion()
    table = np.column_stack([time_s, scale * force, rate])
    log = write(
        tmp_path / "log.csv", table, "t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]\n"
    )
    found = finding(read_recording(log), "unit-contradicted")
    assert f"--accel-unit {unit}" in found.action


def test_the_gyros_scale_by_rotating_gravity_is_exact_for_quick_turns_and_its_uncertainty_that_of_whole_moves():
    """Blocks of 0.1 s at 3 rad/s turn by 0.3 rad: means of directions and rates are weighted alike."""
    t = np.arange(2000) / 100.0
    rate = 3.0 * np.sin(2.0 * np.pi * t / 4.0)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) / 100.0
    a = np.column_stack([np.sin(angle), np.zeros_like(t), np.cos(angle)]) * 9.81
    w = np.column_stack([np.zeros_like(t), -rate, np.zeros_like(t)])
    assert turning_of(a, w, 100.0).scale == pytest.approx(1.0, abs=2e-3)
    z = []
    for seed in range(2):
        log, _ = trihedron.simulate("hand-session", seed)
        own = trihedron.calibrate(log, gravity_m_s2=9.80665).calibration.gyroscope.S
        found = turning_of(log.accelerometer, log.gyroscope, log.rate_hz)
        z.append((found.scale / np.cbrt(np.linalg.det(own)) - 1.0) / (found.sigma / found.scale))
    # Errors of the uncalibrated accelerometer are one per unit, not one per block.
    assert np.sqrt(np.mean(np.square(z))) < 2.0


def test_the_one_move_of_a_static_log_decides_no_unit():
    """Where a body is picked up the accelerometer shows its acceleration, too: no other move confirms the scale."""
    rng, n = np.random.default_rng(2), 30_000
    rate = np.zeros((n, 3))
    rate[-150:, 1] = np.sin(np.linspace(0.0, np.pi, 150))
    angle = np.cumsum(rate[:, 1]) / RATE_HZ
    a = 9.81 * np.column_stack([np.sin(2.8 * angle), np.zeros(n), np.cos(2.8 * angle)]) + 0.01 * rng.normal(size=(n, 3))
    w = -rate + 1e-3 * rng.normal(size=(n, 3))
    found = turning_of(a, w, RATE_HZ)
    assert found.correlation > 0.5
    assert not found.is_clear


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
