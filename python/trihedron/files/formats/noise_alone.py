"""VINS-Fusion, LIO-SAM, ORB-SLAM3, FAST-LIO, GTSAM, ROS messages: noise, topic and gravity, without fields for S and b.

LIO-SAM squares its continuous densities for GTSAM's preintegration. FAST-LIO's values are covariances of one sample,
``N² rate`` and ``K² rate``, because its filter squares the time step: its prediction adds ``(dt F) Q (dt F)ᵀ``, where
white noise of density N adds N² dt to the variance of the angle, and a random walk K adds K² dt to that of the bias.
"""

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, heading, number, of_si_readings, row
from trihedron.files.formats.losses import lost_without_intrinsics
from trihedron.files.formats.noise_keys import COVARIANCES, KEYS, Figures, limits, required, si_rows
from trihedron.records import Calibration


def _known(
    calibration: Calibration, options: ExportOptions, target: str, equation: str = ""
) -> tuple[Calibration, Figures, list[str]]:
    """The calibration of readings in SI, the noise figures that the target requires, and comments for its file."""
    known = of_si_readings(calibration, target, options)
    figures = required(known, options, target)
    said = heading(known, equation or f"{target} has no intrinsics of the IMU.")
    return known, figures, [f"# {line}" for line in [*said, *lost_without_intrinsics(known)]]


def to_vins_fusion(calibration: Calibration, options: ExportOptions) -> str:
    """The keys of the IMU."""
    known, figures, lines = _known(calibration, options, "VINS-Fusion")
    lines += ["imu: 1", f'imu_topic: "{options.topic}"', *si_rows(figures, KEYS["vins-fusion"])]
    return "\n".join(["%YAML:1.0", *lines, f"g_norm: {number(known.gravity_m_s2)}", ""])


def to_lio_sam(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for ``params.yaml``."""
    known, figures, lines = _known(calibration, options, "LIO-SAM")
    lines += [f"imuTopic: {options.topic}", *si_rows(figures, KEYS["lio-sam"])]
    return "\n".join([*lines, f"imuGravity: {number(known.gravity_m_s2)}", ""])


def to_orb_slam3(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for its settings file."""
    _, figures, lines = _known(calibration, options, "ORB-SLAM3")
    lines += si_rows(figures, KEYS["orb-slam3"])
    return "\n".join(["%YAML:1.0", *lines, f"IMU.Frequency: {number(figures.rate_hz)}", ""])


def to_fast_lio(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for its configuration's ``mapping``."""
    _, figures, lines = _known(
        calibration, options, "FAST-LIO", "FAST-LIO has no intrinsics of the IMU: variances of one sample."
    )
    lines += [f"# {limit}" for limit in limits(options)]
    lines += ["common:", f'  imu_topic: "{options.topic}"', "mapping:"]
    values = dict(zip(COVARIANCES, figures.four, strict=True))
    # The order of FAST-LIO's own files.
    for key in sorted(values, key=lambda key: key.startswith("b_")):
        lines.append(f"  {key}: {number(values[key].value ** 2 * figures.rate_hz)}")
    return "\n".join([*lines, ""])


def to_gtsam(calibration: Calibration, options: ExportOptions) -> str:
    """A Python module: S and b to apply, and the parameters of ``PreintegrationCombinedParams``."""
    known = of_si_readings(calibration, "GTSAM", options)
    figures = required(known, options, "GTSAM")
    lines = [f"# {line}" for line in heading(known, "true = S @ raw + b; preintegrate what is true.")]
    lines += [f"# {limit}" for limit in limits(options)]
    lines += ["import numpy as np", ""]
    for name, sensor in known.sensors:
        lines += [f"S_{name.upper()} = np.array([{', '.join(f'[{row(r)}]' for r in sensor.S)}])"]
        lines += [f"B_{name.upper()} = np.array([{row(sensor.b)}])"]
    lines += ["", "", "def preintegration_params():"]
    lines += ["    import gtsam", ""]
    lines += [f"    params = gtsam.PreintegrationCombinedParams.MakeSharedU({number(known.gravity_m_s2)})"]
    for setter, one in (
        ("setAccelerometerCovariance", figures.accel_N),
        ("setGyroscopeCovariance", figures.gyro_N),
        ("setBiasAccCovariance", figures.accel_K),
        ("setBiasOmegaCovariance", figures.gyro_K),
    ):
        lines.append(f"    params.{setter}({number(float(np.square(one.value)))} * np.eye(3))")
    return "\n".join([*lines, "    return params", ""])


def to_ros(calibration: Calibration, options: ExportOptions) -> str:
    """The three covariances of a message.

    Raises ``InputError`` when noise or rate, from which the covariance is computed, are not given.
    """
    equation = "sensor_msgs/Imu: variance of one message = N^2 * rate, in SI; apply S and b before publishing."
    known, figures, lines = _known(calibration, options, "ROS", equation)
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


FORMATS = (
    Format("vins-fusion", to_vins_fusion, in_si=True),
    Format("lio-sam", to_lio_sam, in_si=True),
    Format("orb-slam3", to_orb_slam3, in_si=True),
    Format("fast-lio", to_fast_lio, in_si=True),
    Format("gtsam", to_gtsam, in_si=True),
    Format("ros", to_ros, in_si=True),
)
