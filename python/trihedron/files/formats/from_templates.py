"""Targets that are written and not read: their files are the templates of this folder, their losses stand here.

Source code, estimators without fields for S and b, and IMU models of simulators, which make readings of the truth.
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from trihedron.files.formats.contract import (
    ExportOptions,
    Format,
    NoiseFigure,
    heading,
    matrix_rows,
    number,
    of_si_readings,
    row,
    short,
)
from trihedron.files.formats.losses import (
    has_bias,
    has_matrix,
    lost_to_a_diagonal,
    lost_without_intrinsics,
    size_of_bias,
)
from trihedron.files.formats.noise_keys import Figures, limits, required, si_rows
from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import other_form
from trihedron.units import degrees_from_radians, mg_from_m_s2

CORRELATION_S = 1e6
"""Eleven days, longer than any run, so that the bias is a random walk."""
FIELDS = {"gyroscope": "angular_velocity", "accelerometer": "linear_acceleration"}
Losses = Callable[[Calibration, ExportOptions], list[str]]


class Sensor:
    """A sensor as templates name it: S and b, ``forward`` and ``offset`` of the other direction, N and K."""

    def __init__(self, name: str, sensor: SensorCalibration | None, noise: tuple[NoiseFigure, NoiseFigure]) -> None:
        self.name, self.field = name, FIELDS[name]
        self.N, self.K = noise
        # An ideal sensor where there is none.
        self.forward, self.offset = np.eye(3), np.zeros(3)
        if sensor is not None:
            self.S, self.b, self.raw_unit, self.si_unit = sensor.S, sensor.b, sensor.raw_unit, sensor.si_unit
            self.forward, self.offset = other_form(sensor.S, sensor.b)


@dataclass(frozen=True)
class Target:
    """Title in errors, equation, losses; ``has_noise``: noise and rate are required, readings are in SI."""

    title: str
    equation: str
    losses: Losses = lambda _known, _options: []
    has_noise: bool = True

    def write(self, name: str, calibration: Calibration, options: ExportOptions) -> str:
        """The file of a calibration.

        Raises ``InputError`` when the target requires what is not given, or cannot hold the calibration.
        """
        known = of_si_readings(calibration, self.title, options) if self.has_noise else calibration
        figures = required(known, options, self.title) if self.has_noise else NONE
        said = [*heading(known, self.equation), *self.losses(known, options)]
        accel = Sensor("accelerometer", known.accelerometer, figures.four[:2])
        gyro = Sensor("gyroscope", known.gyroscope, figures.four[2:])
        sensors = [accel] if known.gyroscope is None else [accel, gyro]
        names = {"said": said, "accel": accel, "gyro": gyro, "sensors": sensors, "gravity": known.gravity_m_s2}
        return filled(name, figures, topic=options.topic, **names)


def filled(name: str, figures: Figures, **names: Any) -> str:
    """The text of a template; ``rate``, its ``root`` and ``in_keys`` are of the noise figures."""
    text: str = (
        templates()
        .get_template(f"{name}.j2")
        .render(
            rate=figures.rate_hz,
            root=math.sqrt(figures.rate_hz),
            in_keys=lambda *keys: "\n".join(si_rows(figures, keys)),
            per_degree=degrees_from_radians(1.0),
            correlation_s=CORRELATION_S,
            **names,
        )
    )
    return text


@cache
def templates() -> Any:
    """The templates, with filters for numbers."""
    # Imported here to spare other commands the import time.
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("trihedron.files.formats", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    made.filters |= {
        "number": lambda value: number(float(value)),
        "short": short,
        "json": partial(json.dumps, indent=2),
        "mg": mg_from_m_s2,
        "deg": degrees_from_radians,
        "row": row,
        "yaml": lambda values, indent: "\n".join(matrix_rows(values, indent)),
        "brackets": lambda values: f"[{row(values)}]",
        "blanks": lambda values: row(values).replace(",", ""),
        "braces": lambda values, end: f"{{{', '.join(f'{float(v) + 0.0!r}{end}' for v in values)}}}",
        "diagonal": lambda value: row(value * np.eye(3).ravel()),
    }
    return made


def lost_in_simulation(
    known: Calibration,
    options: ExportOptions,
    *,
    holds_matrix: bool = False,
    holds_bias: bool = True,
    more: Losses = lambda _known, _options: [],
) -> list[str]:
    """What a simulator's model cannot represent, and the size of that for this unit."""
    lines = []
    for name, sensor in known.sensors:
        A, b = other_form(sensor.S, sensor.b)
        if not holds_matrix and has_matrix(sensor):
            share = 100.0 * float(np.linalg.norm(A - np.eye(3), 2))
            lines.append(f"Scale and misalignment of the {name} cannot be held: {share:.2g} % of its signal is lost.")
        if not holds_bias and has_bias(sensor):
            lines.append(f"The bias of the {name} cannot be held: {size_of_bias(name, b)} is lost.")
    lines += more(known, options)
    for name, noise in (("accelerometer", options.accelerometer_noise), ("gyroscope", options.gyroscope_noise)):
        if noise is not None and noise.K.is_limit:
            lines.append(f"The {name}'s walk is an upper limit: it was not seen in the static log.")
    return lines


def _lost_in_isaac(known: Calibration, options: ExportOptions) -> list[str]:
    lines = lost_to_a_diagonal(known)
    for name, noise in (("accelerometer", options.accelerometer_noise), ("gyroscope", options.gyroscope_noise)):
        if noise is not None and noise.K.value > 0.0 and not noise.K.is_limit:
            size = size_of_bias(name, noise.K.value * math.sqrt(60.0), 2)
            lines.append(f"The walk of the {name}'s bias cannot be held: {size} in a minute is lost.")
    return lines


def _lost_in_gnss_ins_sim(_known: Calibration, options: ExportOptions) -> list[str]:
    return [f"The walk of the bias is valid at {options.rate_hz:g} Hz: the program scales it by the step."]


def _lost_in_mvsim(_known: Calibration, _options: ExportOptions) -> list[str]:
    return ["Of the rate only its part about the vertical is simulated: the program's vehicles move in a plane."]


def _lost_in_estimator(known: Calibration, options: ExportOptions, *, has_limits: bool = False) -> list[str]:
    return lost_without_intrinsics(known) + (limits(options) if has_limits else [])


NONE = Figures(*(NoiseFigure(0.0),) * 4, math.nan)
IN_ROWS = "true = S * raw + b, raw to true, row by row."
WALKING = "reading = truth + bias random walk + noise, SI."
TARGETS = {
    "c": Target("C", IN_ROWS, has_noise=False),
    "python": Target("Python", "true = S @ raw + b, raw to true.", has_noise=False),
    "rust": Target("Rust", IN_ROWS, has_noise=False),
    "vins-fusion": Target("VINS-Fusion", "VINS-Fusion has no intrinsics of the IMU.", _lost_in_estimator),
    # It squares its continuous densities for GTSAM's preintegration.
    "lio-sam": Target("LIO-SAM", "LIO-SAM has no intrinsics of the IMU.", _lost_in_estimator),
    "orb-slam3": Target("ORB-SLAM3", "ORB-SLAM3 has no intrinsics of the IMU.", _lost_in_estimator),
    "fast-lio": Target(
        "FAST-LIO",
        "FAST-LIO has no intrinsics of the IMU: variances of one sample.",
        partial(_lost_in_estimator, has_limits=True),
    ),
    "gtsam": Target("GTSAM", "true = S @ raw + b; preintegrate what is true.", lambda _known, options: limits(options)),
    "ros": Target(
        "ROS",
        "sensor_msgs/Imu: variance of one message = N^2 * rate, in SI; apply S and b before publishing.",
        _lost_in_estimator,
    ),
    "gazebo": Target("Gazebo", "reading = truth + N(mean, stddev) + slow bias, axis by axis, SI.", lost_in_simulation),
    "airsim": Target("AirSim", WALKING, partial(lost_in_simulation, holds_bias=False)),
    "mvsim": Target("mvsim", WALKING, partial(lost_in_simulation, holds_bias=False, more=_lost_in_mvsim)),
    "gnss-ins-sim": Target(
        "gnss-ins-sim",
        "reading = truth + b + slow bias + noise.",
        partial(lost_in_simulation, more=_lost_in_gnss_ins_sim),
    ),
    "imusensor": Target(
        "imuSensor",
        "reading = AxesMisalignment/100 * truth + ConstantBias + noise, SI.",
        partial(lost_in_simulation, holds_matrix=True),
    ),
    "isaac": Target(
        "Isaac Lab",
        "reading = scale * (truth + N(mean, std)) axis by axis, SI; truth is specific force and angular rate.",
        partial(lost_in_simulation, holds_matrix=True, more=_lost_in_isaac),
    ),
}
FORMATS = tuple(Format(name, partial(one.write, name), in_si=one.has_noise) for name, one in TARGETS.items())
