"""A calibration written for another program."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from trihedron.files.export import ExportOptions, export_files
from trihedron.files.noise import noise_figures, read_noise
from trihedron.files.output import check_free, write_whole
from trihedron.pipeline.applying import AnyCalibration, calibration_of
from trihedron.records import Noise
from trihedron.refused import RefusedError
from trihedron.report.noise_files import noise_record


def export(
    calibration: AnyCalibration,
    target: str,
    *,
    noise: Noise | str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    topic: str = "/imu0",
    accelerometer_lsb: str = "",
    gyroscope_lsb: str = "",
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
) -> dict[str, str]:
    """A calibration as text in the convention of another program (docs/export.md): by the ending of each file's name.

    Parameters
    ----------
    calibration : calibration or path
    target : str
        One of ``trihedron.files.export.TARGETS``: c, rust, python, kalibr, openvins, vins-fusion, basalt, ros, px4,
        ardupilot, imu_tk, xio, pyins.
    noise : Noise or path, optional
        What ``trihedron.noise`` found, or the JSON of ``trihedron allan``: white density and walk, for targets that
        hold them.
    rate_hz : float, optional
        Rate of the samples; that of the rest log when not given.
    topic : str
        Where the samples are published.
    accelerometer_lsb, gyroscope_lsb : str
        The size of a count that the target's driver assumes, as ``0.061 mg``, where the calibration maps counts.
    output : path, optional
        Where to write; of several files each takes its own ending.

    Returns
    -------
    dict of str to str
        The text of every file of the target, by its ending.

    Raises
    ------
    ValueError
        When the target is unknown or its convention cannot hold the calibration.

    Examples
    --------
    >>> (header,) = trihedron.export(result, "c").values()
    >>> "double S[3][3]" in header
    True
    """
    if rate_hz is not None and not rate_hz > 0.0:
        raise RefusedError(f"rate_hz is the number of samples per second, not {rate_hz}")
    options = ExportOptions(rate_hz=rate_hz, topic=topic, accel_lsb=accelerometer_lsb, gyro_lsb=gyroscope_lsb)
    if noise is not None:
        figures, rest_rate = noise_figures(noise_record(noise)) if isinstance(noise, Noise) else read_noise(noise)
        options = replace(
            options,
            accelerometer_noise=figures.get("accelerometer"),
            gyroscope_noise=figures.get("gyroscope"),
            rate_hz=rate_hz or rest_rate,
        )
    made = export_files(calibration_of(calibration), target, options)
    if output is not None:
        path = Path(output)
        targets = {path.with_name(path.stem + ending) if ending else path: text for ending, text in made.items()}
        check_free(list(targets), overwrite=overwrite)
        for name, text in targets.items():
            write_whole(name, text, overwrite=overwrite)
    return made
