"""Isaac Lab: observation terms of an IMU, ``reading = scale o (truth + N(mean, std))`` axis by axis.

An observation's noise is added before its ``scale`` is applied (``clip`` is between them); ``mean`` and ``std`` of
Gaussian noise may be tensors. By noise_model and ObservationManager of https://github.com/isaac-sim/IsaacLab.
"""

from __future__ import annotations

import math

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, number, row
from trihedron.files.formats.losses import lost_to_a_diagonal
from trihedron.files.formats.noise_keys import Figures
from trihedron.files.formats.simulated import distortion, said_of
from trihedron.records import Calibration
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2


def to_isaac(calibration: Calibration, options: ExportOptions) -> str:
    """A Python module with ``scale`` and ``noise`` of the terms ``imu_ang_vel`` and ``imu_lin_acc``."""
    known, pairs, figures = distortion(calibration, options, "Isaac Lab")
    equation = "reading = scale * (truth + N(mean, std)) axis by axis, SI; truth is specific force and angular rate."
    lost = (*lost_to_a_diagonal(known), *_lost_walks(figures))
    lines = [f"# {line}" for line in said_of(known, options, equation, holds_matrix=True, lost=lost)]
    lines += ["import torch", "from isaaclab.utils.noise import GaussianNoiseCfg", ""]
    lines.append(f"STEP_S = {number(1.0 / figures.rate_hz)}  # of the environment: std holds at this step")
    for term, name, N in (
        ("IMU_ANG_VEL", "gyroscope", figures.gyro_N),
        ("IMU_LIN_ACC", "accelerometer", figures.accel_N),
    ):
        A, b = pairs[name]
        scale = np.diag(A)
        std = N.value * math.sqrt(figures.rate_hz) / np.abs(scale)
        lines += [
            f"{term} = {{",
            f'    "scale": ({row(scale)}),',
            f'    "noise": GaussianNoiseCfg(mean=torch.tensor([{row(b / scale)}]), std=torch.tensor([{row(std)}])),',
            "}",
        ]
    return "\n".join([*lines, ""])


def _lost_walks(figures: Figures) -> tuple[str, ...]:
    minute = math.sqrt(60.0)
    accel, gyro = figures.accel_K, figures.gyro_K
    sizes = (
        ("accelerometer", accel, f"{mm_s2_from_m_s2(accel.value * minute):.2g} mm/s^2"),
        ("gyroscope", gyro, f"{degrees_from_radians(gyro.value * minute):.2g} deg/s"),
    )
    return tuple(
        f"The walk of the {name}'s bias cannot be held: {size} in a minute is lost."
        for name, K, size in sizes
        if K.value > 0.0 and not K.is_limit
    )


FORMATS = (Format("isaac", to_isaac, in_si=True),)
