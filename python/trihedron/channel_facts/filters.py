"""The low-pass of each channel, from the static intervals of a log."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.at_rest import AxisAtRest
from trihedron.channel_facts.low_pass import low_passes
from trihedron.channel_facts.quiet import Windows, look
from trihedron.errors import RefusedError
from trihedron.ranges import Range, ranges_of
from trihedron.records.channel_facts import LowPass

IN_A_ROW = 16
"""Consecutive windows that are taken together from a long log: intervals of eight seconds."""


def find_low_passes(sensors: dict[str, FloatArray], rate_hz: float) -> dict[str, tuple[LowPass, ...]]:
    """Low-passes of the three channels of each sensor (n, 3) by name; none where no quiet interval is long enough.

    The method is that for poses (:func:`trihedron.channel_facts.low_pass.low_passes`), applied to the quietest
    intervals of the log: a filter shows in the white noise of a static sensor.
    """
    windows = look(sensors, rate_hz, in_a_row=IN_A_ROW)
    if windows is None:
        return {}
    stretches = _stretches(windows)
    found = {}
    for name, readings in sensors.items():
        try:
            axes = [AxisAtRest.of(readings[:, c], rate_hz, stretches, name) for c in range(3)]
        except RefusedError:
            continue  # fewer than 32 readings in a row
        found[name] = tuple(low_passes([axis.spectrum for axis in axes], rate_hz))
    return found


def _stretches(windows: Windows) -> list[Range]:
    """Ranges of consecutive quiet windows."""
    follows = np.diff(windows.start) == windows.length
    number = np.concatenate([[0], np.cumsum(np.where(follows, 1, 2))])
    is_quiet = np.zeros(int(number[-1]) + 1, dtype=np.bool_)
    is_quiet[number[windows.quiet]] = True
    first_row = dict(zip(number.tolist(), windows.start.tolist(), strict=True))
    return [(first_row[a], first_row[b - 1] + windows.length) for a, b in ranges_of(is_quiet)]
