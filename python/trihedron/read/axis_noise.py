"""Noise coefficients given by the user as JSON: per term one number, or one per axis."""

import os
from dataclasses import fields
from pathlib import Path

from trihedron.documents import read_json
from trihedron.read.errors import ReadError
from trihedron.records import AxisNoise

TERMS = tuple(field.name for field in fields(AxisNoise))


def read_axis_noise(path: str | os.PathLike[str]) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
    """Read ``{"white": 0.002, "walk": [1e-5, 1e-5, 2e-5], ...}``, Allan coefficients in the raw unit of the log.

    Raises
    ------
    ReadError
        (a ``ValueError``) when the file is not such JSON, or a term is unknown or negative.
    """
    file = Path(path)
    said = read_json(file, "file of noise terms", "write one object with the noise terms", ReadError)
    if not isinstance(said, dict) or not said:
        raise ReadError(f'{file}: write the noise terms as one object, such as {{"white": 0.002, "walk": 1e-5}}.')
    unknown = sorted(set(said) - set(TERMS))
    if unknown:
        raise ReadError(
            f"{file}: there is no noise term {unknown[0]!r}; give the static log itself (--noise static.csv) or an "
            f"object with some of {', '.join(TERMS)} in the raw unit of the log."
        )
    axes: list[dict[str, float]] = [{}, {}, {}]
    for name, value in said.items():
        values = value if isinstance(value, list) else [value] * 3
        if len(values) != 3 or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
            raise ReadError(f"{file}: {name} must be one number, or three, one per axis.")
        for axis, number in zip(axes, values, strict=True):
            axis[name] = float(number)
    try:
        return AxisNoise(**axes[0]), AxisNoise(**axes[1]), AxisNoise(**axes[2])
    except ValueError as error:
        raise ReadError(f"{file}: {error}.") from None
