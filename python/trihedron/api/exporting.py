"""A calibration written for another program."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from trihedron.api.applying import AnyCalibration, calibration_of
from trihedron.documents import read_text
from trihedron.files.formats import ExportOptions, any_calibration, export_files
from trihedron.files.noise import noise_figures, read_noise
from trihedron.files.output import check_free, write_whole
from trihedron.records import Noise
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
    current_parameters: str | os.PathLike[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
) -> dict[str, str]:
    """A calibration as text in the convention of another program (docs/export.md): by the ending of each file's name.

    Parameters
    ----------
    calibration : calibration or path
    target : str
        One of ``trihedron.files.formats.targets()`` (docs/export.md): kalibr, px4, gazebo, c, ...
    noise : Noise or path, optional
        The result of ``trihedron.allan``, or the JSON of ``trihedron allan``: white density and random walk, for
        targets with such entries.
    rate_hz : float, optional
        Rate of the samples; that of the static log when not given.
    topic : str
        ROS topic of the samples.
    accelerometer_lsb, gyroscope_lsb : str
        The LSB that the target's driver assumes, as ``0.061 mg``, for a calibration of counts.
    current_parameters : path or "none", optional
        For px4 and ardupilot, where the log does not state them: the board's parameters while it logged
        (.param, .parm, QGroundControl's .params); "none" where the readings were raw.
    output : path, optional
        Where to write; each of several files gets its own ending.
    overwrite : bool, whether a file that exists is replaced

    Returns
    -------
    dict of str to str
        The text of every file of the target, by its ending.

    Raises
    ------
    ValueError
        When the target is unknown or its convention cannot represent the calibration.

    Examples
    --------
    >>> (header,) = trihedron.export(result, "c").values()
    >>> "double S[3][3]" in header
    True
    """
    current = str(current_parameters or "")
    # "none": the readings were logged raw.
    if current not in ("", "none"):
        current = read_text(current, "file of parameters")
    options = ExportOptions(
        rate_hz=rate_hz, topic=topic, accel_lsb=accelerometer_lsb, gyro_lsb=gyroscope_lsb, current_parameters=current
    )
    if noise is not None:
        figures, rest_rate = noise_figures(noise_record(noise)) if isinstance(noise, Noise) else read_noise(noise)
        options = replace(
            options,
            accelerometer_noise=figures.get("accelerometer"),
            gyroscope_noise=figures.get("gyroscope"),
            rate_hz=rate_hz or rest_rate,
        )
    known = any_calibration(calibration) if isinstance(calibration, str | os.PathLike) else calibration_of(calibration)
    made = export_files(known, target, options)
    if output is not None:
        placed(made, Path(output), write=True, overwrite=overwrite)
    return made


def placed(made: dict[str, str], path: Path, *, write: bool = False, overwrite: bool = False) -> list[Path]:
    """Paths of the files of an export, each of several with its own ending; written when ``write``."""
    targets = {path.with_name(path.stem + ending) if ending else path: text for ending, text in made.items()}
    if write:
        check_free(list(targets), overwrite=overwrite)
        for name, text in targets.items():
            write_whole(name, text, overwrite=overwrite)
    return list(targets)
