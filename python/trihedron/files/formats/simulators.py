"""IMU models of simulators: truth to readings, and comments on what a model cannot represent."""

import json
import math

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.files.formats.contract import ExportOptions, Format, heading, number, of_si_readings, row
from trihedron.files.formats.losses import has_bias, has_matrix, lost_to_a_diagonal, size_of_bias
from trihedron.files.formats.noise_keys import Figures, required
from trihedron.records import Calibration
from trihedron.sensor_model import other_form
from trihedron.units import degrees_from_radians, mg_from_m_s2


def distortion(
    calibration: Calibration, options: ExportOptions, target: str
) -> tuple[Calibration, dict[str, tuple[FloatArray, FloatArray]], Figures]:
    """``reading = A truth + b`` by sensor, (3, 3) and (3,) in SI, and the noise; an ideal gyro where there is none.

    Raises ``InputError`` when noise or rate are not given.
    """
    known = of_si_readings(calibration, target, options)
    pairs = {name: other_form(sensor.S, sensor.b) for name, sensor in known.sensors}
    pairs.setdefault("gyroscope", (np.eye(3), np.zeros(3)))
    return known, pairs, required(known, options, target)


def said_of(
    calibration: Calibration,
    options: ExportOptions,
    equation: str,
    *,
    holds_matrix: bool = False,
    lost_bias: tuple[str, ...] = (),
    lost: tuple[str, ...] = (),
) -> list[str]:
    """Heading of a simulator's file, with what its model cannot represent and the size of that for this unit."""
    lines = heading(calibration, equation)
    for name, sensor in calibration.sensors:
        A, b = other_form(sensor.S, sensor.b)
        if not holds_matrix and has_matrix(sensor):
            share = 100.0 * float(np.linalg.norm(A - np.eye(3), 2))
            lines.append(f"Scale and misalignment of the {name} cannot be held: {share:.2g} % of its signal is lost.")
        if name in lost_bias and has_bias(sensor):
            lines.append(f"The bias of the {name} cannot be held: {size_of_bias(name, b)} is lost.")
    lines += lost
    for name, noise in (("accelerometer", options.accelerometer_noise), ("gyroscope", options.gyroscope_noise)):
        if noise is not None and noise.K.is_limit:
            lines.append(f"The {name}'s walk is an upper limit: it was not seen in the static log.")
    return lines


MESSAGE_FIELDS = {"gyroscope": "angular_velocity", "accelerometer": "linear_acceleration"}
CORRELATION_S = 1e6
"""Eleven days, longer than any run, so that the bias is a random walk."""


def to_gazebo(calibration: Calibration, options: ExportOptions) -> str:
    """A ``<sensor>`` for a link of an SDF model.

    Gazebo: an SDF ``<imu>`` with Gaussian noise and bias drift, axis by axis.
    Every sample adds ``N(mean, stddev)`` and a bias that follows ``b <- exp(-dt/tau) b + N(0, s)`` with
    ``s² = σ² tau/2 (1 - exp(-2 dt/tau))``: for tau much longer than a run, a random walk with σ = K. The bias of a unit
    is written as ``mean``, because the sign of ``bias_mean`` is drawn. By GaussianNoiseModel of gz-sensors and the
    noise element of SDFormat (https://github.com/gazebosim/gz-sensors).
    """
    known, pairs, figures = distortion(calibration, options, "Gazebo")
    equation = "reading = truth + N(mean, stddev) + slow bias, axis by axis, SI."
    root = math.sqrt(figures.rate_hz)
    lines = ["<!--", *(line.replace("--", "- -") for line in said_of(known, options, equation)), "-->"]
    lines += ['<sensor name="imu" type="imu">', f"  <update_rate>{number(figures.rate_hz)}</update_rate>"]
    lines += [f"  <topic>{options.topic.strip('/')}</topic>", "  <imu>"]
    for name, element in MESSAGE_FIELDS.items():
        N, K = figures.of(name)
        lines.append(f"    <{element}>")
        for axis, bias in zip(AXES, pairs[name][1], strict=True):
            lines += [
                f'      <{axis}><noise type="gaussian">',
                f"        <mean>{number(float(bias))}</mean>",
                f"        <stddev>{number(N.value * root)}</stddev>",
                f"        <dynamic_bias_stddev>{number(K.value)}</dynamic_bias_stddev>",
                f"        <dynamic_bias_correlation_time>{number(CORRELATION_S)}</dynamic_bias_correlation_time>",
                f"      </noise></{axis}>",
            ]
        lines.append(f"    </{element}>")
    return "\n".join([*lines, "  </imu>", "</sensor>", ""])


TAU_S = 500.0
"""Arbitrary, because AirSim uses only ``stability/√tau``."""


def to_airsim(calibration: Calibration, options: ExportOptions) -> str:
    """The ``Sensors`` entry of a vehicle.

    AirSim: noise of an IMU in ``settings.json``, in deg/√h, deg/h, mg and µg by its keys; no bias and no scale.
    Its bias is a random walk of ``stability/√tau`` per √s, so ``stability = K √tau``. By ImuSimple and ImuSimpleParams
    of https://github.com/microsoft/AirSim.
    """
    known, _, figures = distortion(calibration, options, "AirSim")
    both = ("accelerometer", "gyroscope")
    said = said_of(known, options, "reading = truth + bias random walk + noise, SI.", lost_bias=both)
    root = math.sqrt(TAU_S)
    imu = {
        "SensorType": 2,
        "Enabled": True,
        "AngularRandomWalk": degrees_from_radians(figures.gyro_N.value) * 60.0,
        "GyroBiasStabilityTau": TAU_S,
        "GyroBiasStability": degrees_from_radians(figures.gyro_K.value * root) * 3600.0,
        "VelocityRandomWalk": mg_from_m_s2(figures.accel_N.value),
        "AccelBiasStabilityTau": TAU_S,
        "AccelBiasStability": 1e3 * mg_from_m_s2(figures.accel_K.value * root),
    }
    return json.dumps({"Sensors": {"Imu": imu}, "written_by_trihedron": said}, indent=2) + "\n"


def to_mvsim(calibration: Calibration, options: ExportOptions) -> str:
    """A ``<sensor>`` for a vehicle.

    mvsim: an IMU of a vehicle, ``reading = truth + b + N(0, white)``, ``b <- b + N(0, walk² dt)``; b starts at 0, no S.
    By the documentation of its sensors and its class IMU, https://github.com/MRPT/mvsim.
    """
    known, _, figures = distortion(calibration, options, "mvsim")
    both = ("accelerometer", "gyroscope")
    lost = ("Of the rate only its part about the vertical is simulated: the program's vehicles move in a plane.",)
    said = said_of(known, options, "reading = truth + bias random walk + noise, SI.", lost_bias=both, lost=lost)
    root = math.sqrt(figures.rate_hz)
    lines = ["<!--", *(line.replace("--", "- -") for line in said), "-->", '<sensor class="imu" name="imu1">']
    lines.append(f"  <sensor_period>{number(1.0 / figures.rate_hz)}</sensor_period>")
    for name, word in MESSAGE_FIELDS.items():
        N, K = figures.of(name)
        lines.append(f"  <{word}_white_noise_std_noise>{number(N.value * root)}</{word}_white_noise_std_noise>")
        lines.append(f"  <{word}_random_walk_std_noise>{number(K.value)}</{word}_random_walk_std_noise>")
    return "\n".join([*lines, "</sensor>", ""])


def to_gnss_ins_sim(calibration: Calibration, options: ExportOptions) -> str:
    """A Python module with ``imu_err`` for ``imu_model.IMU(accuracy=imu_err)``.

    gnss-ins-sim: the dictionary of an IMU, in deg/h, deg/√h, m/s² and m/s/√h.
    Its bias follows ``b <- (1 - dt/tau) b + dt drift N(0, 1)`` per sample, so a random walk K needs ``drift = K
    √rate``: the value is valid only at the rate of this file. By pathgen and imu_model of
    https://github.com/Aceinna/gnss-ins-sim.
    """
    known, pairs, figures = distortion(calibration, options, "gnss-ins-sim")
    lost = (f"The walk of the bias is valid at {figures.rate_hz:g} Hz: the program scales it by the step.",)
    lines = [f"# {line}" for line in said_of(known, options, "reading = truth + b + slow bias + noise.", lost=lost)]
    lines += ["import numpy as np", "", f"FS = {number(figures.rate_hz)}", "imu_err = {"]
    root, hour = math.sqrt(figures.rate_hz), 3600.0
    per_hour = degrees_from_radians(1.0) * hour
    ones = np.ones(3)
    values = {
        "gyro_b": pairs["gyroscope"][1] * per_hour,
        "gyro_arw": ones * (degrees_from_radians(figures.gyro_N.value) * math.sqrt(hour)),
        "gyro_b_stability": ones * (figures.gyro_K.value * root * per_hour),
        "gyro_b_corr": ones * CORRELATION_S,
        "accel_b": pairs["accelerometer"][1],
        "accel_vrw": ones * (figures.accel_N.value * math.sqrt(hour)),
        "accel_b_stability": ones * (figures.accel_K.value * root),
        "accel_b_corr": ones * CORRELATION_S,
    }
    lines += [f"    {key!r}: np.array([{row(value)}])," for key, value in values.items()]
    return "\n".join([*lines, "}", ""])


def to_imusensor(calibration: Calibration, options: ExportOptions) -> str:
    """A MATLAB script that creates the object ``imu``.

    MATLAB's ``imuSensor``: ``reading = AxesMisalignment/100 · truth + ConstantBias``, white noise, random walk.
    White noise is ``NoiseDensity √rate`` per sample and the walk ``RandomWalk/√rate`` per step, for the double-sided
    noise type. By the algorithms on MathWorks' page of imuSensor.
    """
    known, pairs, figures = distortion(calibration, options, "imuSensor")
    equation = "reading = AxesMisalignment/100 * truth + ConstantBias + noise, SI."
    lines = [f"% {line}" for line in said_of(known, options, equation, holds_matrix=True)]
    lines += [f"imu = imuSensor('accel-gyro', 'SampleRate', {number(figures.rate_hz)});"]
    for name, make in (("accelerometer", "accelparams"), ("gyroscope", "gyroparams")):
        A, b = pairs[name]
        N, K = figures.of(name)
        rows = "; ".join(row(100.0 * r).replace(",", "") for r in A)
        lines += [
            f"imu.{name.capitalize()} = {make}( ...",
            f"    'AxesMisalignment', [{rows}], ...",
            f"    'ConstantBias', [{row(b).replace(',', '')}], ...",
            "    'NoiseType', 'double-sided', ...",
            f"    'NoiseDensity', {number(N.value)}, ...",
            f"    'RandomWalk', {number(K.value)});",
        ]
    return "\n".join([*lines, ""])


def to_isaac(calibration: Calibration, options: ExportOptions) -> str:
    """A Python module with ``scale`` and ``noise`` of the terms ``imu_ang_vel`` and ``imu_lin_acc``.

    Isaac Lab: observation terms of an IMU, ``reading = scale o (truth + N(mean, std))`` axis by axis.
    An observation's noise is added before its ``scale`` is applied (``clip`` is between them); ``mean`` and ``std`` of
    Gaussian noise may be tensors. By noise_model and ObservationManager of https://github.com/isaac-sim/IsaacLab.
    """
    known, pairs, figures = distortion(calibration, options, "Isaac Lab")
    equation = "reading = scale * (truth + N(mean, std)) axis by axis, SI; truth is specific force and angular rate."
    lost = (*lost_to_a_diagonal(known), *_lost_walks(figures))
    lines = [f"# {line}" for line in said_of(known, options, equation, holds_matrix=True, lost=lost)]
    lines += ["import torch", "from isaaclab.utils.noise import GaussianNoiseCfg", ""]
    lines.append(f"STEP_S = {number(1.0 / figures.rate_hz)}  # of the environment: std is valid at this step")
    for name, term in (("gyroscope", "IMU_ANG_VEL"), ("accelerometer", "IMU_LIN_ACC")):
        A, b = pairs[name]
        scale = np.diag(A)
        std = figures.of(name)[0].value * math.sqrt(figures.rate_hz) / np.abs(scale)
        lines += [
            f"{term} = {{",
            f'    "scale": ({row(scale)}),',
            f'    "noise": GaussianNoiseCfg(mean=torch.tensor([{row(b / scale)}]), std=torch.tensor([{row(std)}])),',
            "}",
        ]
    return "\n".join([*lines, ""])


def _lost_walks(figures: Figures) -> tuple[str, ...]:
    return tuple(
        f"The walk of the {name}'s bias cannot be held: {size_of_bias(name, K.value * math.sqrt(60.0), 2)} in a minute "
        "is lost."
        for name in ("accelerometer", "gyroscope")
        if (K := figures.of(name)[1]).value > 0.0 and not K.is_limit
    )


FORMATS = (
    Format("gazebo", to_gazebo, in_si=True),
    Format("airsim", to_airsim, in_si=True),
    Format("mvsim", to_mvsim, in_si=True),
    Format("gnss-ins-sim", to_gnss_ins_sim, in_si=True),
    Format("imusensor", to_imusensor, in_si=True),
    Format("isaac", to_isaac, in_si=True),
)
