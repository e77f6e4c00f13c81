"""PX4's batches of raw samples (sensor_accel_fifo, sensor_gyro_fifo), one row per sample.

A message holds up to 32 samples of each axis as counts, the size of a count, the step between samples and the timestamp
of its last one: sample s of n was taken at t - (n - 1 - s) dt.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.arrays import AXES

SUFFIX = "_fifo"


def expanded(data: dict[str, Any]) -> dict[str, npt.NDArray[np.float64]] | None:
    """Samples of every message in order: ``timestamp_sample`` [µs] and x, y, z in SI; None where fields are missing."""
    present = {"timestamp_sample", "dt", "scale", "samples"} <= set(data)
    width = sum(f"x[{k}]" in data for k in range(256))
    if not present or not width or any(f"{axis}[{width - 1}]" not in data for axis in AXES):
        return None
    counts = np.clip(np.asarray(data["samples"], dtype=np.int64), 0, width)
    message = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(message)) - np.repeat(np.cumsum(counts) - counts, counts)
    timestamp = np.asarray(data["timestamp_sample"], dtype=np.float64)
    step = np.asarray(data["dt"], dtype=np.float64)
    scale = np.asarray(data["scale"], dtype=np.float64)
    out = {"timestamp_sample": timestamp[message] - (counts[message] - 1 - place) * step[message]}
    for axis in AXES:
        block = np.column_stack([data[f"{axis}[{k}]"] for k in range(width)]).astype(np.float64)
        out[axis] = block[message, place] * scale[message]
    return out
