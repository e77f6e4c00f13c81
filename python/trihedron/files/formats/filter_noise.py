"""Noise alone, for the filters that ask for it, in their own keys and units; static values beside as comments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from trihedron.errors import RefusedError
from trihedron.files.formats.contract import NoiseFigure, SensorNoise, number
from trihedron.files.formats.kalibr import KEYS
from trihedron.files.formats.noise_keys import Figures, si_rows
from trihedron.records.filter_noise import Bounded, FilterNoise, SensorFilterNoise


def _rows(names: tuple[str, str, str, str], rate: str = "") -> Callable[[Figures], list[str]]:
    """Densities and walks in SI, and the rate under its key where there is one."""
    return lambda f: [*si_rows(f, names), *([f"{rate}: {number(f.rate_hz)}"] if rate else [])]


def _openvins(f: Figures) -> list[str]:
    return ["imu0:", *(f"  {line}" for line in [*si_rows(f, KEYS), f"update_rate: {number(f.rate_hz)}"])]


def _basalt(f: Figures) -> list[str]:
    keys = zip(("accel_noise_std", "accel_bias_std", "gyro_noise_std", "gyro_bias_std"), _four(f), strict=True)
    values = [f'    "{key}": [{", ".join([number(one.value)] * 3)}]' for key, one in keys]
    rows = [f'    "imu_update_rate": {number(f.rate_hz)}', *values]
    return ["{", '  "value0": {', *(f"{row}," for row in rows[:-1]), rows[-1], "  }", "}"]


def _fast_lio(f: Figures) -> list[str]:
    keys = zip(("acc_cov", "b_acc_cov", "gyr_cov", "b_gyr_cov"), _four(f), strict=True)
    rows = [f"  {key}: {number(one.value**2 * f.rate_hz)}" for key, one in keys]
    return ["# variances of one sample: N^2 rate and K^2 rate", "mapping:", *rows]


def _gtsam(f: Figures) -> list[str]:
    setters = ("setAccelerometerCovariance", "setBiasAccCovariance", "setGyroscopeCovariance", "setBiasOmegaCovariance")
    return [
        "# import numpy as np; params = gtsam.PreintegrationCombinedParams.MakeSharedU(9.81)",
        *(
            f"params.{setter}({number(one.value**2)} * np.eye(3))"
            for setter, one in zip(setters, _four(f), strict=True)
        ),
    ]


def _robot_localization(f: Figures) -> list[str]:
    """Diagonals of sensor_msgs/Imu, which its filters read from every message; biases are no states of theirs."""
    accel, gyro = (number(one.value**2 * f.rate_hz) for one in (f.accel_N, f.gyro_N))
    return [
        "# robot_localization takes the covariances of the messages (N^2 rate, row by row); it has no bias states.",
        f"angular_velocity_covariance: [{gyro}, 0, 0, 0, {gyro}, 0, 0, 0, {gyro}]",
        f"linear_acceleration_covariance: [{accel}, 0, 0, 0, {accel}, 0, 0, 0, {accel}]",
    ]


def _four(f: Figures) -> tuple[NoiseFigure, NoiseFigure, NoiseFigure, NoiseFigure]:
    return f.accel_N, f.accel_K, f.gyro_N, f.gyro_K


@dataclass(frozen=True)
class _Target:
    """Rows of a consumer's file, what comments begin with, and its first line where its reader demands one."""

    rows: Callable[[Figures], list[str]]
    comment: str = "#"
    first: str = ""


YAML = "%YAML:1.0"
TARGETS: dict[str, _Target] = {
    "kalibr": _Target(_rows(KEYS, "update_rate")),
    "openvins": _Target(_openvins, first=YAML),
    "vins-fusion": _Target(_rows(("acc_n", "acc_w", "gyr_n", "gyr_w")), first=YAML),
    "basalt": _Target(_basalt, comment=""),
    "orb-slam3": _Target(
        _rows(("IMU.NoiseAcc", "IMU.AccWalk", "IMU.NoiseGyro", "IMU.GyroWalk"), "IMU.Frequency"), first=YAML
    ),
    "fast-lio": _Target(_fast_lio),
    "gtsam": _Target(_gtsam),
    "robot_localization": _Target(_robot_localization),
}
"""Consumers of noise alone. Keys and units are those of :mod:`trihedron.files.formats` with a calibration."""


def filter_noise_text(found: FilterNoise, target: str) -> str:
    """The noise of both sensors as ``target`` reads it.

    Raises
    ------
    ValueError
        When there is no such target, or a sensor is not known: a missing key would be read as zero.
    """
    one = TARGETS.get(target)
    if one is None:
        raise RefusedError(f"noise is not written for {target!r}; there are {', '.join(TARGETS)}.")
    figures: dict[str, SensorNoise] = {sensor.sensor: _figures(sensor) for sensor in found.sensors}
    for name in ("accelerometer", "gyroscope"):
        if name not in figures:
            raise RefusedError(
                f"{target} needs both sensors, and the {name} was not estimated: give a reference with positions, or "
                "leave --reference out."
            )
    lines = [one.first] if one.first else []
    if one.comment:
        lines += [f"{one.comment} {line}" for line in _beside(found)]
    rows = one.rows(_both(figures, found.rate_hz))
    return "\n".join([*lines, *rows, ""])


def _both(of: dict[str, SensorNoise], rate_hz: float) -> Figures:
    accel, gyro = of["accelerometer"], of["gyroscope"]
    return Figures(accel.N, accel.K, gyro.N, gyro.K, rate_hz)


def _figures(sensor: SensorFilterNoise) -> SensorNoise:
    return SensorNoise(_figure(sensor.N), _figure(sensor.K))


def _figure(one: Bounded) -> NoiseFigure:
    return NoiseFigure(one.filter_value, one.is_limit)


def _beside(found: FilterNoise) -> Sequence[str]:
    return [
        f"static {one.sensor}: N {number(one.static.N.filter_value)} {one.unit}/sqrt(Hz), "
        f"K {'below ' if one.static.K.is_limit else ''}{number(one.static.K.filter_value)} {one.unit}/sqrt(s)"
        for one in found.sensors
        if one.static
    ]
