"""Devices side by side in one row, identified by the names of their columns: ``A_ax ... B_gz``, ``ax_1 ... gz_2``."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from trihedron.read.devices import MAX_DEVICES, chosen
from trihedron.read.errors import ReadError
from trihedron.read.names import parse_name
from trihedron.read.table import Table
from trihedron.records.words import words as phrase

_SENSORS = ("accelerometer", "gyroscope")
_BEFORE = re.compile(r"\s*(?P<device>[^\W_]+)[_.:/ -]+(?P<rest>[^\W\d_].*)")
_BEHIND = re.compile(r"(?P<rest>.*?[^\W\d_])(?:[_.: -]+(?P<device>[^\W_]+)|(?P<number>\d))(?P<unit>\s*[\[(].*)?\s*")

Devices = dict[str, dict[int, str]]
"""Device → its columns → their names without it."""


def one_beside(table: Table, instance: str | None) -> Table:
    """The columns of the device ``instance`` under their names without it, those of the others left out.

    The same table where no names tell devices apart, or one is not asked for and sensors are known without.

    Raises
    ------
    ReadError
        When no column is known without its device, and none was chosen.
    """
    devices = _devices(table.names or ())
    if instance in devices:
        own = devices.pop(instance)
        others = {i for columns in devices.values() for i in columns}
        listed = phrase("devices", devices=[(name, table.n_rows) for name in sorted([instance, *devices])])
        return replace(
            table,
            names=tuple(own.get(i, name) for i, name in enumerate(table.names or ())),
            columns=tuple(np.empty(0) if i in others else column for i, column in enumerate(table.columns)),
            findings=(*table.findings, chosen(phrase("names"), instance, listed, 0)),
            is_chosen=True,
        )
    if instance is None and devices and not any(parse_name(name).role in _SENSORS for name in table.names or ()):
        raise ReadError(
            f"{table.path}: the names of the columns identify {len(devices)} devices: {', '.join(devices)}; read one "
            f"of them with --instance {next(iter(devices))}."
        )
    return table


def _devices(names: tuple[str, ...]) -> Devices:
    """Two devices or more that have the same columns, those of a whole sensor among them."""
    for form in (_BEFORE, _BEHIND):
        found: Devices = {}
        for i, name in enumerate(names):
            if (parts := form.fullmatch(name)) is not None:
                told = parts.groupdict()
                device = told["device"] or told.get("number", "")
                found.setdefault(device, {})[i] = told["rest"] + (told.get("unit") or "")
        sensors = {device: _of_sensors(columns) for device, columns in found.items()}
        alike = [device for device, columns in sensors.items() if len(columns) >= len("xyz")]
        if 2 <= len(alike) <= MAX_DEVICES and len({frozenset(sensors[device]) for device in alike}) == 1:
            return {device: found[device] for device in alike}
    return {}


def _of_sensors(columns: dict[int, str]) -> set[str]:
    parsed = {name: parse_name(name) for name in columns.values()}
    return {name for name, meaning in parsed.items() if meaning.role in _SENSORS and meaning.axis}
