"""AirSim: noise of an IMU in ``settings.json``, in deg/√h, deg/h, mg and µg by its keys; no bias and no scale.

Its bias is a random walk of ``stability/√tau`` per √s, so ``stability = K √tau``. By ImuSimple and ImuSimpleParams of
https://github.com/microsoft/AirSim.
"""

from __future__ import annotations

import json
import math

from trihedron.files.formats.contract import ExportOptions, Format
from trihedron.files.formats.simulated import distortion, said_of
from trihedron.records import Calibration
from trihedron.units import degrees_from_radians, mg_from_m_s2

TAU_S = 500.0
"""Arbitrary, because AirSim uses only ``stability/√tau``."""


def to_airsim(calibration: Calibration, options: ExportOptions) -> str:
    """The ``Sensors`` entry of a vehicle."""
    known, _, figures = distortion(calibration, options, "AirSim")
    both = ("accelerometer", "gyroscope")
    said = said_of(known, options, "reading = truth + walking bias + noise, SI.", lost_bias=both)
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


FORMATS = (Format("airsim", to_airsim, in_si=True),)
