"""INAV: ``corrected = (reading - acczero) accgain/4096`` per axis in counts, ``reading - gyro_zero`` of the gyro.

Integers, in the sensor's axes, before the alignments. By applyAccelerationZero and gyroUpdateAndCalibrate of
https://github.com/iNavFlight/inav.
"""

import numpy as np

from trihedron.arrays import XYZ, FloatArray
from trihedron.errors import InputError
from trihedron.files.formats.autopilot import AxisCorrection, Composed, composed
from trihedron.files.formats.contract import ExportOptions, Format, heading, number
from trihedron.files.formats.losses import lost_gyro_scale, lost_to_a_diagonal, size_of_bias
from trihedron.probability import NORMAL_95
from trihedron.records import Calibration
from trihedron.units import acceleration_lsb_to_si, rate_lsb_to_si

UNIT_GAIN = 4096
LARGEST_GAIN, LARGEST_OFFSET = 8192, 32767
"""Limits of the settings."""


def to_inav(calibration: Calibration, options: ExportOptions) -> str:
    """Commands for INAV's command line, from a calibration of uncorrected readings.

    Raises ``InputError`` when the readings were not raw, the LSB is not given, or a value exceeds the range of a
    setting.
    """
    if calibration.accelerometer.raw_unit != "counts" and options.current_parameters.strip().lower() != "none":
        raise InputError(
            "INAV logs readings that its own biases and gains have corrected and its alignments have turned: calibrate "
            "raw counts (debug_mode = ACC), or say --current-parameters none where the readings were raw."
        )
    own, sensors = composed(calibration, options, "INAV", lambda _: AxisCorrection(np.zeros(3), np.ones(3), np.eye(3)))
    equation = "corrected = (reading - acczero) * accgain / 4096; a gyro has gyro_zero only."
    lines = [f"# {line}" for line in heading(own, equation, read_in="counts", corrected_in="counts")]
    lines += [f"# {line}" for line in lost_to_a_diagonal(own)]
    for name, sensor in own.sensors:
        count = _size_of_a_count(name, options)
        half = np.full(3, 0.5 * count)
        if half[0] > NORMAL_95 * float(sensor.sigma_b.max()):
            lines.append(f"# Biases are whole counts: up to {size_of_bias(name, half)} of bias of the {name} is lost.")
        lines += _lines(name, sensors[name], count)
        if name == "gyroscope":
            lines += [f"# {line}" for line in lost_gyro_scale(sensor, "INAV")]
            lines += ["# Without this the gyro's bias is measured anew at every start:", "set init_gyro_cal = OFF"]
    return "\n".join([*lines, "save", ""])


def _size_of_a_count(name: str, options: ExportOptions) -> float:
    is_accel = name == "accelerometer"
    said, option, example = (
        (options.accel_lsb, "--accel-lsb", "0.488 mg") if is_accel else (options.gyro_lsb, "--gyro-lsb", "0.061 deg/s")
    )
    if not said:
        raise InputError(f"INAV stores whole counts: say the size of one of the {name} with {option} '{example}'.")
    return acceleration_lsb_to_si(said) if is_accel else rate_lsb_to_si(said)


def _lines(name: str, one: Composed, count: float) -> list[str]:
    is_accel = name == "accelerometer"
    lines = _settings("acczero" if is_accel else "gyro_zero", one.offset / count, -LARGEST_OFFSET, LARGEST_OFFSET)
    return lines + (_settings("accgain", UNIT_GAIN * one.scale, 1, LARGEST_GAIN) if is_accel else [])


def _settings(word: str, values: FloatArray, low: int, high: int) -> list[str]:
    whole = np.rint(values)
    if np.any((whole < low) | (whole > high)):
        raise InputError(
            f"{word} of INAV is from {low} to {high} and would be {number(float(whole[np.abs(whole).argmax()]))}: is "
            "the size of a count that of INAV's driver?"
        )
    return [f"set {word}_{axis.lower()} = {value:.0f}" for axis, value in zip(XYZ, whole, strict=True)]


FORMATS = (Format("inav", to_inav, in_si=True),)
