"""VINS-Fusion, LIO-SAM, ORB-SLAM3, FAST-LIO: noise, topic and gravity; their configurations have no fields for S and b.

LIO-SAM squares its continuous densities for GTSAM's preintegration. FAST-LIO's values are covariances of one sample,
``N² rate`` and ``K² rate``, because its filter squares the time step: its prediction adds ``(dt F) Q (dt F)ᵀ``, where
white noise of density N adds N² dt to the variance of the angle, and a random walk K adds K² dt to that of the bias.
"""

from trihedron.files.formats.contract import ExportOptions, Format, heading, number, of_si_readings
from trihedron.files.formats.losses import lost_without_intrinsics
from trihedron.files.formats.noise_keys import COVARIANCES, KEYS, Figures, limits, required, si_rows
from trihedron.records import Calibration


def _known(
    calibration: Calibration, options: ExportOptions, target: str, poses: str = ""
) -> tuple[Calibration, Figures, list[str]]:
    """The calibration of readings in SI, the noise figures that the target requires, and comments for its file."""
    known = of_si_readings(calibration, target, options)
    figures = required(known, options, target)
    said = heading(known, f"{target} has no intrinsics of the IMU{poses}.")
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
    _, figures, lines = _known(calibration, options, "FAST-LIO", ": variances of one sample")
    lines += [f"# {limit}" for limit in limits(options)]
    lines += ["common:", f'  imu_topic: "{options.topic}"', "mapping:"]
    values = dict(zip(COVARIANCES, figures.four, strict=True))
    # The order of FAST-LIO's own files.
    for key in sorted(values, key=lambda key: key.startswith("b_")):
        lines.append(f"  {key}: {number(values[key].value ** 2 * figures.rate_hz)}")
    return "\n".join([*lines, ""])


FORMATS = (
    Format("vins-fusion", to_vins_fusion, in_si=True),
    Format("lio-sam", to_lio_sam, in_si=True),
    Format("orb-slam3", to_orb_slam3, in_si=True),
    Format("fast-lio", to_fast_lio, in_si=True),
)
