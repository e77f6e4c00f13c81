"""Column names of common loggers mean what they mean there."""

import pytest

from trihedron.read.names import parse_name

SENSORS = [
    # name, sensor, axis, unit
    ("ax", "accelerometer", "x", ""),
    ("ax_adc", "accelerometer", "x", "counts"),
    ("wz_adc", "gyroscope", "z", "counts"),
    ("gx_dps", "gyroscope", "x", "deg/s"),
    ("ax_g", "accelerometer", "x", "g"),
    ("wx", "gyroscope", "x", ""),
    ("acc_x", "accelerometer", "x", ""),
    ("gyr_z", "gyroscope", "z", ""),
    ("Acc_X", "accelerometer", "x", ""),
    ("Gyr_Y", "gyroscope", "y", ""),
    ("gyro_x", "gyroscope", "x", ""),
    ("accel_z", "accelerometer", "z", ""),
    ("AccX", "accelerometer", "x", ""),
    ("GyroX [deg/s]", "gyroscope", "x", "deg/s"),
    ("gx_output", "gyroscope", "x", ""),
    ("linear_acceleration.x", "accelerometer", "x", ""),
    ("field.angular_velocity.z", "gyroscope", "z", ""),
    ("accelerometer_m_s2[0]", "accelerometer", "0", "m/s^2"),
    ("gyro_rad[2]", "gyroscope", "2", "rad/s"),
    ("w_RS_S_x [rad s^-1]", "gyroscope", "x", "rad/s"),
    ("a_RS_S_z [m s^-2]", "accelerometer", "z", "m/s^2"),
    ("accelerometerAccelerationX(G)", "accelerometer", "x", "g"),
    ("gyroRotationX(rad/s)", "gyroscope", "x", "rad/s"),
    ("Acceleration x (m/s^2)", "accelerometer", "x", "m/s^2"),
    ("Gyroscope y (rad/s)", "gyroscope", "y", "rad/s"),
    ("ax [m/s²]", "accelerometer", "x", "m/s^2"),
    ("gx [°/s]", "gyroscope", "x", "deg/s"),
    ("acc_x (mg)", "accelerometer", "x", "mg"),
    ("omega x [rad s^-1]", "gyroscope", "x", "rad/s"),
    ("AngularVelocityX", "gyroscope", "x", ""),
    ("ACCEL_XOUT", "accelerometer", "x", ""),
    ("GYRO_ZOUT", "gyroscope", "z", ""),
    ("gyro_z (mrad/s)", "gyroscope", "z", "mrad/s"),
    ("fy", "accelerometer", "y", ""),
    ("AcX", "accelerometer", "x", ""),
    ("GyX", "gyroscope", "x", ""),
]


@pytest.mark.parametrize(("name", "sensor", "axis", "unit"), SENSORS, ids=[s[0] for s in SENSORS])
def test_a_sensor_column_is_recognised_with_axis_and_unit(name, sensor, axis, unit):
    parsed = parse_name(name)
    assert (parsed.role, parsed.axis, parsed.unit) == (sensor, axis, unit)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("t", ""),
        ("t_s", "s"),
        ("t_unix_s", "s"),
        ("time", ""),
        ("%time", ""),
        ("time_ms", "ms"),
        ("timestamp [ns]", "ns"),
        ("Timestamp[nanosec]", "ns"),
        ("millis", "ms"),
        ("Time (s)", "s"),
        ("seconds_elapsed", "s"),
        ("SampleTimeFine", "100us"),
    ],
)
def test_a_time_column_is_recognised_with_its_unit(name, unit):
    parsed = parse_name(name)
    assert (parsed.role, parsed.time_unit) == ("time", unit)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("temp_C", "temperature"),
        ("Temperature", "temperature"),
        ("imu_temperature", "temperature"),
        ("vdd", "supply"),
        ("Supply Voltage", "supply"),
        ("PacketCounter", "counter"),
        ("n_samples", "counter"),
        ("seq", "counter"),
        ("x", "bare"),
        ("Z (m/s^2)", "bare"),
    ],
)
def test_other_known_columns_have_their_role(name, role):
    assert parse_name(name).role == role


@pytest.mark.parametrize(
    "name",
    [
        "mx",
        "qx",
        "Roll",
        "depth_m",
        "angular_velocity_covariance_0",
        "orientation.x",
        "gravity_x",
        "gyro_integral_dt",
        "accel_bias_x",
        "UTC_Nano",
        "magnetometer_x",
        "angular_acceleration_x",
        "gps_velocity_x",
        "",
        "___",
    ],
)
def test_what_is_neither_sensor_nor_time_is_not_taken_for_one(name):
    assert parse_name(name).role == ""


def test_raw_readings_rank_above_corrected_ones():
    assert parse_name("gx_measured").rank > parse_name("gx").rank > parse_name("gx_output").rank
    assert parse_name("motionUserAccelerationX(G)").rank < parse_name("accelerometerAccelerationX(G)").rank


@pytest.mark.parametrize(
    ("name", "role", "axis", "unit"),
    [
        ("время", "time", "", ""),
        ("время, мс", "time", "", "ms"),
        ("уск_x", "accelerometer", "x", ""),
        ("Уск_Х", "accelerometer", "x", ""),  # a Cyrillic letter that looks like x
        ("гироскоп_Y (град/с)", "gyroscope", "y", "deg/s"),
        ("угл_скорость_z", "gyroscope", "z", ""),
        ("угловое_ускорение_x", "", "x", ""),
        ("маг_x", "", "", ""),
        ("Beschl. X [g]", "accelerometer", "x", "g"),
        ("Drehrate Z [°/s]", "gyroscope", "z", "deg/s"),
        ("Winkelbeschleunigung x", "", "x", ""),
        ("Tempo (ms)", "time", "", "ms"),
        ("temps", "time", "", ""),
        ("Acel X (m/s²)", "accelerometer", "x", "m/s^2"),
        ("Giro Z (rad/s)", "gyroscope", "z", "rad/s"),
        ("girox", "gyroscope", "x", ""),
        ("accélération_x", "accelerometer", "x", ""),
        ("vitesse_angulaire_y", "gyroscope", "y", ""),
        ("prędkość kątowa Y", "gyroscope", "y", ""),
        ("加速度X(g)", "accelerometer", "x", "g"),
        ("X轴加速度（g）", "accelerometer", "x", "g"),
        ("角速度Z(°/s)", "gyroscope", "z", "deg/s"),
        ("角度X(°)", "", "x", ""),
        ("温度(℃)", "temperature", "", ""),
        ("时间", "time", "", ""),
        ("ωx", "gyroscope", "x", ""),
        ("t [µs]", "time", "", "us"),  # the micro sign
        ("t [\u03bcs]", "time", "", "us"),  # the Greek letter
        ("скачок_x", "", "x", ""),  # unknown: no bare x
        ("\ufffd\ufffd\ufffd_x", "", "x", ""),  # letters lost in another encoding: no bare x
    ],
)
def test_names_in_other_languages_mean_the_same_and_unknown_words_are_kept(name, role, axis, unit):
    parsed = parse_name(name)
    assert (parsed.role, parsed.axis, parsed.unit or parsed.time_unit) == (role, axis, unit)
