"""Noise parameters alone, in the keys and units of each filter; values of the static log are comments."""

from collections.abc import Sequence

from trihedron.errors import InputError
from trihedron.files.formats.contract import NoiseFigure, short
from trihedron.files.formats.from_templates import filled
from trihedron.files.formats.noise_keys import Figures
from trihedron.records.filter_noise import Bounded, FilterNoise, SensorFilterNoise
from trihedron.records.finding import Severity

TARGETS = ("kalibr", "openvins", "vins-fusion", "basalt", "orb-slam3", "fast-lio", "gtsam", "robot_localization")
"""Targets of noise alone; keys and units are those of the same target in :mod:`trihedron.files.formats`."""


class Sensor:
    """A sensor as templates name it: N and K, and the densities and variances of X, Y and Z."""

    def __init__(self, found: SensorFilterNoise) -> None:
        self.N, self.K = _figure(found.N), _figure(found.K)
        self.axes = [one.filter_value for one in found.axes_N or (found.N,) * 3]
        self.variances = [one**2 for one in self.axes]


def filter_noise_text(found: FilterNoise, target: str) -> str:
    """The noise of both sensors in the format of ``target``.

    Raises ``InputError`` when the target is unknown, or a sensor was not estimated: the target reads a missing key
    as 0.
    """
    if target not in TARGETS:
        raise InputError(f"noise is not written for {target!r}; there are {', '.join(TARGETS)}.")
    figures = {sensor.sensor: sensor for sensor in found.sensors}
    for name in ("accelerometer", "gyroscope"):
        if name not in figures:
            raise InputError(
                f"{target} needs both sensors, and the {name} was not estimated: give a reference with positions, or "
                "leave --reference out."
            )
    accel, gyro = Sensor(figures["accelerometer"]), Sensor(figures["gyroscope"])
    four = Figures(accel.N, accel.K, gyro.N, gyro.K, found.rate_hz)
    return filled(f"noise/{target}", four, said=_beside(found), accel=accel, gyro=gyro)


def _figure(one: Bounded) -> NoiseFigure:
    return NoiseFigure(float(f"{one.filter_value:.4g}"), one.is_limit)


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
    warned = (f for f in found.findings if f.severity is Severity.WARNING and f.code.startswith("filter-noise"))
    out += [f"warning: {f.seen} {f.action}".replace("\N{MINUS SIGN}", "-") for f in warned]
    return out


def _said(one: Bounded) -> str:
    if one.is_limit:
        return f"below {short(one.upper)}"
    return f"{short(one.value)} ({short(one.lower)} to {short(one.upper)})"
