"""The temperature column in °C: its unit by its name, and readings that no sensor has."""

import re

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.sensors import Sensors
from trihedron.records import Finding

LOWEST_DEGC, HIGHEST_DEGC = -60.0, 150.0
"""Temperatures beyond the operating range of parts, -55 to 125 °C at most, by the error of a thermometer on the die."""
_KELVIN = re.compile(r"(?:[^a-z]|deg)k(?:elvin)?(?![a-z])")
_FAHRENHEIT = re.compile(r"(?:[^a-z]|deg)f(?:ahrenheit)?(?![a-z])")


def temperature_of(sensors: Sensors) -> tuple[FloatArray | None, list[Finding]]:
    """Temperature (n,) [°C], NaN where the reading is none; ``None`` without a column of it, or with another unit."""
    column = sensors.columns.temperature
    if column is None:
        return None, []
    label = sensors.table.label(column)
    name = (sensors.table.names or [""] * (column + 1))[column].lower()
    logged = sensors.column(column)
    degc = logged
    if _KELVIN.search(name):
        degc = logged - 273.15
    elif _FAHRENHEIT.search(name):
        degc = (logged - 32.0) / 1.8
    wrong = (degc < LOWEST_DEGC) | (degc > HIGHEST_DEGC)
    if not wrong.any():
        return degc, []
    is_column = bool(2 * np.count_nonzero(wrong) > len(wrong))
    found = Finding.of(
        "temperature-implausible",
        column=label,
        count=np.count_nonzero(wrong),
        is_column=is_column,
        low=logged[wrong].min(),
        high=logged[wrong].max(),
        where=sensors.place(int(np.argmax(wrong))),
        sample=int(np.argmax(wrong)),
    )
    return None if is_column else np.where(wrong, np.nan, degc), [found]
