"""The truth of a simulated log in a separate file: .npz with a JSON header, or the header alone as .json."""

import io
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.files.output import OutputError, write_whole
from trihedron.records.truth import Truth

_ARRAYS = (
    "accelerometer_time_s",
    "gyroscope_time_s",
    "specific_force_m_s2",
    "angular_rate_rad_s",
    "attitude",
    "temperature_degc",
    "supply_v",
    "kept",
)
_MATRICES = ("accelerometer_S", "accelerometer_b", "gyroscope_S", "gyroscope_b")


def truth_document(truth: Truth) -> dict[str, Any]:
    """The truth without the arrays per sample, as plain JSON types (SI)."""
    return {
        "scenario": truth.scenario,
        "seed": truth.seed,
        "gravity_m_s2": truth.gravity_m_s2,
        **{name: getattr(truth, name).tolist() for name in _MATRICES},
        "effects": {name: dict(values) for name, values in truth.effects.items()},
        "noise": {name: dict(values) for name, values in truth.noise.items()},
        "segments": [asdict(segment) for segment in truth.segments],
    }


def check_truth_suffix(path: Path) -> None:
    """Reject a file name whose ending is not that of a format, before any work."""
    if path.suffix.lower() not in (".npz", ".json"):
        raise OutputError(f"{path}: truth is written as .npz (everything) or .json (no samples).")


def write_truth(truth: Truth, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the truth; ``.npz`` contains everything, ``.json`` all but the arrays per sample.

    Raises ``InputError`` when the ending is another one, or the file exists and may not be replaced.
    """
    target = Path(path)
    check_truth_suffix(target)
    text = json.dumps(truth_document(truth), indent=1)
    if target.suffix.lower() == ".json":
        write_whole(target, text + "\n", overwrite=overwrite)
    else:
        arrays = {name: getattr(truth, name) for name in _ARRAYS if getattr(truth, name) is not None}
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, header=np.array(text), **arrays)
        write_whole(target, buffer.getvalue(), overwrite=overwrite)
