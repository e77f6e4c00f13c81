"""Covariances of ROS' ``sensor_msgs/Imu``: the variance of one message, N² times the rate, on the diagonal."""

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, heading, of_si_readings, row
from trihedron.files.formats.losses import lost_without_intrinsics
from trihedron.files.formats.noise_keys import required
from trihedron.records import Calibration


def to_ros(calibration: Calibration, options: ExportOptions) -> str:
    """The three covariances of a message.

    Raises ``InputError`` when noise or rate, from which the covariance is computed, are not given.
    """
    known = of_si_readings(calibration, "ROS", options)
    figures = required(known, options, "ROS")
    equation = "sensor_msgs/Imu: variance of one message = N^2 * rate, in SI; apply S and b before publishing."
    lines = [f"# {line}" for line in (*heading(known, equation), *lost_without_intrinsics(known))]
    pairs = [("linear_acceleration", figures.accel_N)]
    if known.gyroscope is not None:
        pairs.append(("angular_velocity", figures.gyro_N))
    for name, N in pairs:
        variance = N.value**2 * figures.rate_hz
        lines += [f"{name}_covariance: [{row(variance * np.eye(3).ravel())}]"]
    unknown = np.zeros(9)
    unknown[0] = -1.0
    lines.append("# The first number is -1 by the message's definition where there is no orientation.")
    return "\n".join([*lines, f"orientation_covariance: [{row(unknown)}]", ""])


FORMATS = (Format("ros", to_ros, in_si=True),)
