"""A calibration written for another program."""

from __future__ import annotations

import os
from dataclasses import replace

from trihedron.files.export import ExportOptions, export_files
from trihedron.files.noise import read_noise
from trihedron.pipeline.applying import AnyCalibration, calibration_of


def export(
    calibration: AnyCalibration,
    target: str,
    *,
    noise: str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    topic: str = "/imu0",
    accel_lsb: str = "",
    gyro_lsb: str = "",
) -> dict[str, str]:
    """A calibration as text in the convention of another program (docs/export.md): by the ending of each file's name.

    Parameters
    ----------
    calibration : calibration or path
    target : str
        One of ``trihedron.files.export.TARGETS``: c, rust, python, kalibr, openvins, vins-fusion, basalt, ros, px4,
        ardupilot, imu_tk, xio, pyins.
    noise : path, optional
        JSON of ``trihedron allan``: white density and walk go into targets that hold them.
    rate_hz : float, optional
        Rate of the samples; that of the rest log when not given.
    topic : str
        Where the samples are published.
    accel_lsb, gyro_lsb : str
        The size of a count that the target's driver assumes, as ``0.061 mg``, where the calibration maps counts.

    Raises
    ------
    ValueError
        When the target is unknown or its convention cannot hold the calibration.
    """
    if rate_hz is not None and not rate_hz > 0.0:
        raise ValueError(f"rate_hz is the number of samples per second, not {rate_hz}")
    options = ExportOptions(rate_hz=rate_hz, topic=topic, accel_lsb=accel_lsb, gyro_lsb=gyro_lsb)
    if noise is not None:
        figures, rest_rate = read_noise(noise)
        options = replace(
            options,
            accelerometer_noise=figures.get("accelerometer"),
            gyroscope_noise=figures.get("gyroscope"),
            rate_hz=rate_hz or rest_rate,
        )
    return export_files(calibration_of(calibration), target, options)
