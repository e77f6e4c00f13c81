"""Noise under the keys of other programs: rows of figures, and the error where a target requires missing ones."""

from dataclasses import dataclass

from trihedron.errors import InputError
from trihedron.files.formats.contract import ExportOptions, NoiseFigure, SensorNoise, number
from trihedron.records import Calibration


@dataclass(frozen=True)
class Figures:
    """White densities N [SI/√Hz] and random walks K [SI/√s] of both sensors, and the rate [Hz] of the samples."""

    accel_N: NoiseFigure
    accel_K: NoiseFigure
    gyro_N: NoiseFigure
    gyro_K: NoiseFigure
    rate_hz: float

    @property
    def four(self) -> tuple[NoiseFigure, NoiseFigure, NoiseFigure, NoiseFigure]:
        """N and K of the accelerometer, N and K of the gyro."""
        return self.accel_N, self.accel_K, self.gyro_N, self.gyro_K


def required(calibration: Calibration, options: ExportOptions, target: str) -> Figures:
    """The noise and rate that the target's reader requires.

    Raises ``InputError`` when noise or rate are not given.
    """
    accel, gyro = options.accelerometer_noise, options.gyroscope_noise
    if accel is None or (gyro is None and calibration.gyroscope is not None) or options.rate_hz is None:
        raise InputError(
            f"{target} needs the noise and the rate of the samples: add --noise ALLAN.json (of `trihedron allan LOG "
            "--json ALLAN.json`) and --rate HZ."
        )
    gyro = gyro or SensorNoise(NoiseFigure(0.0), NoiseFigure(0.0))
    return Figures(accel.N, accel.K, gyro.N, gyro.K, options.rate_hz)


def noise_row(name: str, figure: NoiseFigure, unit: str) -> list[str]:
    """A comment with the unit (and whether the figure is an upper limit), then ``name: value``."""
    said = f"# {unit}"
    if figure.is_limit:
        said = f"# {name} [{unit}] is an upper limit"
    return [said, f"{name}: {number(figure.value)}"]


def si_rows(figures: Figures, names: tuple[str, ...]) -> list[str]:
    """Rows of densities and random walks in SI; ``names`` in the order accelerometer N, K, gyro N, K."""
    units = ("m/s^2/sqrt(Hz)", "m/s^2/sqrt(s)", "rad/s/sqrt(Hz)", "rad/s/sqrt(s)")
    return [
        line
        for name, figure, unit in zip(names, figures.four, units, strict=True)
        for line in noise_row(name, figure, unit)
    ]


def limits(options: ExportOptions) -> list[str]:
    """A sentence for each figure that is an upper limit."""
    return [
        f"{name} {term} is an upper limit from the static log."
        for name, noise in (("accelerometer", options.accelerometer_noise), ("gyroscope", options.gyroscope_noise))
        if noise is not None
        for term, figure in (("N", noise.N), ("K", noise.K))
        if figure.is_limit
    ]
