"""Noise figures read from the JSON that ``trihedron allan`` writes."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from trihedron.documents import read_json
from trihedron.errors import RefusedError
from trihedron.files.formats.contract import NoiseFigure, SensorNoise

_SENSORS = {"m/s^2": "accelerometer", "rad/s": "gyroscope"}


class NoiseFileError(RefusedError):
    """Noise that cannot be read. One sentence: which file, what is wrong, what to do."""


def read_noise(path: str | os.PathLike[str]) -> tuple[dict[str, SensorNoise], float]:
    """White density and random walk of each sensor (root mean square of its axes), and the rate [Hz] of the static log.

    For a term that was not detected the value is the upper limit from the log.

    Refused when the file is missing or is not what ``trihedron allan --json`` writes, or its readings are not in SI.
    """
    meant = "name a file written by `trihedron allan --json`"
    return noise_figures(read_json(path, "file of noise terms", meant, NoiseFileError), str(Path(path)))


def noise_figures(document: dict[str, Any], source: str = "noise") -> tuple[dict[str, SensorNoise], float]:
    """As :func:`read_noise`, from the JSON document itself; ``source`` is its name in error messages.

    Refused when it contains no noise terms, or its readings are not in SI.
    """
    try:
        axes = document["axes"]
        out = {
            sensor: SensorNoise(_figure(axes, unit, "N"), _figure(axes, unit, "K"))
            for unit, sensor in _SENSORS.items()
            if any(axis["unit"] == unit for axis in axes)
        }
        rate = float(document["rate_hz"])
    except (KeyError, TypeError, ValueError, IndexError, ArithmeticError):
        raise NoiseFileError(
            f"{source}: this JSON holds no noise terms; name a file written by `trihedron allan --json`."
        ) from None
    if not out:
        raise NoiseFileError(
            f"{source}: its noise is in counts; run `trihedron allan LOG` again with --accel-lsb and "
            "--gyro-lsb, or with --calibration FILE."
        )
    return out, rate


def _figure(axes: list[dict[str, Any]], unit: str, term: str) -> NoiseFigure:
    terms = [axis["terms"][term] for axis in axes if axis["unit"] == unit]
    if all(t["present"] for t in terms):
        return NoiseFigure(_rms([float(t["value"]) for t in terms]))
    return NoiseFigure(_rms([max(float(t["limit"]), float(t["value"])) for t in terms]), is_limit=True)


def _rms(values: list[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values))
