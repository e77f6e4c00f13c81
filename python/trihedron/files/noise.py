"""Noise figures read from the JSON that ``trihedron allan`` writes."""

import os
from pathlib import Path
from types import MappingProxyType
from typing import Any

from trihedron.documents import read_json
from trihedron.errors import InputError
from trihedron.files.formats.contract import NoiseFigure, SensorNoise
from trihedron.records.finding import Finding
from trihedron.records.noise import NOT_OF_THE_SENSOR, GaussMarkov, NoiseAxis, NoiseTerm, TermName, of_axes
from trihedron.records.plain import from_plain

MEANT = "name a file written by `trihedron allan --json`"
_OF_A_TERM = ("sigma", "lower", "upper", "evidence", "estimate", "fitted")
_SENSORS = {"m/s^2": "accelerometer", "rad/s": "gyroscope"}


class NoiseFileError(InputError):
    """Noise that cannot be read. One sentence: which file, what is wrong, what to do."""


def read_noise(path: str | os.PathLike[str]) -> tuple[dict[str, SensorNoise], float]:
    """White density and random walk of each sensor (root mean square of its axes), and the rate [Hz] of the static log.

    For a term that was not detected, and for K with temperature or a turn in it, the value is an upper limit.

    Raises ``InputError`` when the file is missing or is not what ``trihedron allan --json`` writes, or its readings
    are not in SI.
    """
    return noise_figures(read_json(path, "file of noise terms", MEANT, NoiseFileError), str(Path(path)))


def noise_figures(document: dict[str, Any], source: str = "noise") -> tuple[dict[str, SensorNoise], float]:
    """As :func:`read_noise`, from the JSON document itself; ``source`` is its name in error messages.

    Raises ``InputError`` when it contains no noise terms, or its readings are not in SI.
    """
    try:
        axes = document["axes"]
        is_limit = any(one["code"] in NOT_OF_THE_SENSOR for one in document.get("findings", ()))
        out = {
            sensor: SensorNoise(_figure(axes, unit, "N"), _figure(axes, unit, "K", is_limit=is_limit))
            for unit, sensor in _SENSORS.items()
            if any(axis["unit"] == unit for axis in axes)
        }
        rate = float(document["rate_hz"])
    except (KeyError, TypeError, ValueError, IndexError, ArithmeticError):
        raise NoiseFileError(
            f"{source}: this JSON contains no noise terms; name a file written by `trihedron allan --json`."
        ) from None
    if not out:
        raise NoiseFileError(
            f"{source}: its noise is in counts; make it again with --accel-lsb and --gyro-lsb, or with "
            "--calibration FILE."
        )
    return out, rate


def read_noise_findings(path: str | os.PathLike[str]) -> tuple[Finding, ...]:
    """Findings on the static log behind a file that ``trihedron allan --json`` writes, those of its axes included.

    Raises ``InputError`` when the file is missing or no JSON, or its findings lack their words.
    """
    document = read_json(path, "file of noise terms", MEANT, NoiseFileError)
    try:
        said = [one for part in (document, *document["axes"]) for one in part.get("findings", ())]
        return tuple(from_plain(one, Finding) for one in said)
    except (AttributeError, KeyError, TypeError, ValueError):
        raise NoiseFileError(f"{Path(path)}: its findings are not those of a static log; {MEANT}.") from None


def read_noise_axes(path: str | os.PathLike[str]) -> tuple[NoiseAxis, ...]:
    """The axes of a file that ``trihedron allan --json`` writes, in their unit; none where it is another JSON object.

    Raises ``InputError`` when the file is missing or no JSON, or its axes lack values.
    """
    document = read_json(path, "file of noise terms", MEANT, NoiseFileError)
    if not isinstance(document, dict) or "axes" not in document:
        return ()
    try:
        return tuple(_axis(one, float(document["rate_hz"]), int(document["n_samples"])) for one in document["axes"])
    except (KeyError, TypeError, ValueError, ArithmeticError):
        raise NoiseFileError(f"{Path(path)}: its axes lack noise terms; {MEANT}.") from None


def _axis(said: dict[str, Any], rate_hz: float, n_samples: int) -> NoiseAxis:
    process = said["gauss_markov"]
    return NoiseAxis(
        name=str(said["name"]),
        unit=str(said["unit"]),
        rate_hz=rate_hz,
        n_samples=n_samples,
        duration_s=n_samples / rate_hz,
        mean=float(said["mean"]),
        sample_sigma=float(said["sample_sigma"]),
        resolution=float(said["resolution"]),
        terms=MappingProxyType({symbol: _term(symbol, said["terms"][symbol.value]) for symbol in TermName}),
        gauss_markov=None if process is None else GaussMarkov(**{name: float(v) for name, v in process.items()}),
    )


def _term(symbol: TermName, said: dict[str, Any]) -> NoiseTerm:
    figures: dict[str, Any] = {name: float(said[name]) for name in _OF_A_TERM}
    return NoiseTerm(symbol=symbol, is_present=bool(said["present"]), **figures)


def _figure(axes: list[dict[str, Any]], unit: str, term: str, *, is_limit: bool = False) -> NoiseFigure:
    name = TermName(term)
    value, is_absent = of_axes([_term(name, axis["terms"][term]) for axis in axes if axis["unit"] == unit])
    return NoiseFigure(value, is_limit or is_absent)
