"""Noise parameters alone, in the keys and units of each filter; values of the static log are comments."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from trihedron.errors import InputError
from trihedron.files.formats.contract import NoiseFigure, number
from trihedron.files.formats.noise_keys import COVARIANCES, KEYS, Figures, si_rows
from trihedron.records.filter_noise import Bounded, FilterNoise, SensorFilterNoise
from trihedron.records.finding import Severity


@dataclass(frozen=True)
class _Written:
    """The four noise figures, and the densities of X, Y and Z of both sensors."""

    figures: Figures
    accel_axes: tuple[float, ...]
    gyro_axes: tuple[float, ...]

    def by_axis(self) -> tuple[tuple[float, ...], ...]:
        """As :attr:`Figures.four`, for X, Y and Z; K is the same on all axes."""
        f = self.figures
        return self.accel_axes, (f.accel_K.value,) * 3, self.gyro_axes, (f.gyro_K.value,) * 3


def _short(value: float) -> str:
    """A number with four digits, which is finer than its interval."""
    return number(float(f"{value:.4g}"))


def _rows(names: tuple[str, ...], rate: str = "") -> Callable[[_Written], list[str]]:
    """Rows of densities and random walks in SI, and of the rate if ``rate`` is its key."""
    return lambda f: [*si_rows(f.figures, names), *([f"{rate}: {number(f.figures.rate_hz)}"] if rate else [])]


def _openvins(f: _Written) -> list[str]:
    return [
        "imu0:",
        *(f"  {line}" for line in [*si_rows(f.figures, KEYS["kalibr"]), f"update_rate: {number(f.figures.rate_hz)}"]),
    ]


def _basalt(f: _Written) -> list[str]:
    keys = zip(("accel_noise_std", "accel_bias_std", "gyro_noise_std", "gyro_bias_std"), f.by_axis(), strict=True)
    rows = [f'    "{key}": [{", ".join(_short(one) for one in axes)}]' for key, axes in keys]
    return ['  "value0": {', f'    "imu_update_rate": {number(f.figures.rate_hz)},', ",\n".join(rows), "  }"]


def _fast_lio(f: _Written) -> list[str]:
    keys = zip(COVARIANCES, f.figures.four, strict=True)
    rows = [f"  {key}: {_short(one.value**2 * f.figures.rate_hz)}" for key, one in keys]
    return ["# variances of one sample: N^2 rate and K^2 rate", "mapping:", *rows]


def _gtsam(f: _Written) -> list[str]:
    setters = ("setAccelerometerCovariance", "setBiasAccCovariance", "setGyroscopeCovariance", "setBiasOmegaCovariance")
    return [
        "# import numpy as np; params = gtsam.PreintegrationCombinedParams.MakeSharedU(9.81)",
        *(
            f"params.{setter}(np.diag([{', '.join(_short(one**2) for one in axes)}]))"
            for setter, axes in zip(setters, f.by_axis(), strict=True)
        ),
    ]


def _robot_localization(f: _Written) -> list[str]:
    """Covariances of sensor_msgs/Imu, which its filters read from every message; they have no bias states."""
    rows = []
    for key, axes in (("angular_velocity", f.gyro_axes), ("linear_acceleration", f.accel_axes)):
        x, y, z = (_short(one**2 * f.figures.rate_hz) for one in axes)
        rows.append(f"{key}_covariance: [{x}, 0, 0, 0, {y}, 0, 0, 0, {z}]")
    return [
        "# robot_localization takes the covariances of the messages (N^2 rate, row by row); it has no bias states.",
        *rows,
    ]


@dataclass(frozen=True)
class _Target:
    """Function for the rows of a target's file, its comment character, and a first line if its reader requires one."""

    rows: Callable[[_Written], list[str]]
    comment: str = "#"
    first: str = ""


YAML = "%YAML:1.0"
TARGETS: dict[str, _Target] = {
    "kalibr": _Target(_rows(KEYS["kalibr"], "update_rate")),
    "openvins": _Target(_openvins, first=YAML),
    "vins-fusion": _Target(_rows(KEYS["vins-fusion"]), first=YAML),
    "basalt": _Target(_basalt, comment=""),
    "orb-slam3": _Target(_rows(KEYS["orb-slam3"], "IMU.Frequency"), first=YAML),
    "fast-lio": _Target(_fast_lio),
    "gtsam": _Target(_gtsam),
    "robot_localization": _Target(_robot_localization),
}
"""Targets of noise alone; keys and units are those of the same target in :mod:`trihedron.files.formats`."""


def filter_noise_text(found: FilterNoise, target: str) -> str:
    """The noise of both sensors in the format of ``target``.

    Raises ``InputError`` when the target is unknown, or a sensor was not estimated: the target reads a missing key
    as 0.
    """
    one = TARGETS.get(target)
    if one is None:
        raise InputError(f"noise is not written for {target!r}; there are {', '.join(TARGETS)}.")
    figures = {sensor.sensor: sensor for sensor in found.sensors}
    for name in ("accelerometer", "gyroscope"):
        if name not in figures:
            raise InputError(
                f"{target} needs both sensors, and the {name} was not estimated: give a reference with positions, or "
                "leave --reference out."
            )
    accel, gyro = figures["accelerometer"], figures["gyroscope"]
    four = (_figure(accel.N), _figure(accel.K), _figure(gyro.N), _figure(gyro.K))
    rows = one.rows(_Written(Figures(*four, found.rate_hz), _of_axes(accel), _of_axes(gyro)))
    if not one.comment:
        # JSON has no comments; the target's reader ignores other keys.
        said = ",\n".join(f'    "{line}"' for line in _beside(found))
        return "\n".join(["{", *rows[:-1], f'{rows[-1]},\n  "about": [', said, "  ]", "}", ""])
    lines = [one.first] if one.first else []
    return "\n".join([*lines, *(f"{one.comment} {line}" for line in _beside(found)), *rows, ""])


def _figure(one: Bounded) -> NoiseFigure:
    return NoiseFigure(float(f"{one.filter_value:.4g}"), one.is_limit)


def _of_axes(sensor: SensorFilterNoise) -> tuple[float, ...]:
    return tuple(one.filter_value for one in sensor.axes_N or (sensor.N,) * 3)


def _beside(found: FilterNoise) -> Sequence[str]:
    """Comments: each sensor's values with their intervals, those of the static log, and warnings about them."""
    out = []
    for one in found.sensors:
        units = (f"{one.unit}/sqrt(Hz)", f"{one.unit}/sqrt(s)")
        pairs = (
            [("", one.N, one.K)]
            if one.static is None
            else [("", one.N, one.K), ("static ", one.static.N, one.static.K)]
        )
        for word, N, K in pairs:
            out.append(f"{word}{one.sensor}: N {_said(N)} {units[0]}, K {_said(K)} {units[1]}")
        if one.axes_N:
            out.append(f"{one.sensor} N of X, Y, Z: {', '.join(_said(axis) for axis in one.axes_N)}")
    warned = (f for f in found.findings if f.severity is Severity.WARNING and f.code.value.startswith("filter-noise"))
    out += [f"warning: {f.seen} {f.action}".replace("\N{MINUS SIGN}", "-") for f in warned]
    return out


def _said(one: Bounded) -> str:
    if one.is_limit:
        return f"below {_short(one.upper)}"
    return f"{_short(one.value)} ({_short(one.lower)} to {_short(one.upper)})"
